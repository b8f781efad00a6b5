/* Decides whether current may flow. After power-up it may not flow until a host asks for frames.
 * The permission ends when the host has sent no packet for a second or has said that it leaves, or
 * when the measured current exceeds its limit. Without the permission all multiplexers are open and
 * the generator is in reset. */
#ifndef FW_CURRENT_ENABLE_H
#define FW_CURRENT_ENABLE_H

#include "eitskin/link.h"

#include <stdbool.h>
#include <stdint.h>

typedef struct fw_safety fw_safety;

/* The promised limit is one second; the difference is a reserve for a slow turn of the main loop.
 */
#define FW_SILENT_US 900000u
#define FW_SENSE_US  50000u /* between two measurements of the current */

/* Call this when a host asks for frames. Returns false after a trip, that is, if the current
 * exceeded its limit and the faults have not been cleared since. */
bool fw_current_on(fw_safety *safety);

/* Withdraw the permission; the current has stopped when this returns. */
void fw_current_off(fw_safety *safety, eits_drive why);

/* Call this when a packet has come from the host. */
void fw_current_heard(fw_safety *safety);

/* Call once per turn of the main loop. Withdraws the permission if the host is silent, or, while
 * the scan runs, if the measured current exceeds its limit. */
void fw_current_check(fw_safety *safety, bool scanning);

/* Call this when the faults were cleared: after a trip, current may be requested again. */
void fw_current_clear_trip(fw_safety *safety);

bool fw_current_allowed(const fw_safety *safety);
eits_drive fw_current_state(const fw_safety *safety);

/* Returns the last measured current, rms; 0 if it was not measured. */
uint32_t fw_current_ua(const fw_safety *safety);

/* Returns the owner's limit, or else 1.25 times the current of the board's source, rms; 0: no
 * limit. */
uint32_t fw_current_limit_ua(const fw_safety *safety);

/* Returns the lowest excitation at which the current of the board's source is safe. */
uint32_t fw_current_min_millihz(const fw_safety *safety);

/* Returns whether frames are still dropped because the current was switched on recently. */
bool fw_current_settling(const fw_safety *safety);

/* Counts one frame, and returns whether it must be dropped for that reason. */
bool fw_current_drops_frame(fw_safety *safety);

#endif
