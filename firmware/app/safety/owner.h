/* The owner's settings, and what only the owner may do. */
#ifndef FW_OWNER_H
#define FW_OWNER_H

#include "app/safety/owner_record.h"
#include "eitskin/link.h"
#include "hal/hal.h"

typedef struct fw_safety fw_safety;

/* The settings in use: bits of eits_setting. */
uint32_t fw_owner_settings(const fw_safety *safety);

/* Whether current may flow without a host. */
bool fw_owner_keeps_current(const fw_safety *safety);

/* The current source as fitted: its amplitude, and that rms; 0: not known. */
uint32_t fw_owner_source_ua(const fw_safety *safety);
uint32_t fw_owner_source_ua_rms(const fw_safety *safety);

/* Volts at the converter per volt between the electrodes as fitted, in millionths; 0: not known. */
uint32_t fw_owner_gain_ppm(const fw_safety *safety);

/* The board's converter, behind source and amplifier as fitted. */
fw_capture fw_owner_capture(const fw_safety *safety);

/* The board's name, EITS_NAME_CHARACTERS long and zero-filled; empty: it has none. */
const char *fw_owner_name(const fw_safety *safety);

/* Whether `name`, EITS_NAME_CHARACTERS long, is empty, or letters, digits, - and _ with a letter or
 * digit first, and zero-filled behind. So it can be a part of topics and addresses. */
bool fw_owner_name_valid(const char *name);

/* Whether the board is locked and the owner does not hold its button; raises LOCKED then. `command`
 * is what the host asked for. */
bool fw_owner_refuses(fw_safety *safety, eits_packet_type command);

/* Store new settings and use them; a number that is EITS_KEPT stays as it is. Errors: as
 * fw_owner_record_save. */
fw_status fw_owner_save(fw_safety *safety, const fw_owner_record *wanted);

#endif
