/* The owner's settings, and actions that only the owner may do. */
#ifndef FW_OWNER_H
#define FW_OWNER_H

#include "app/safety/owner_record.h"
#include "eitskin/link.h"
#include "hal/hal.h"

typedef struct fw_safety fw_safety;

/* Returns the settings in use: bits of eits_setting. */
uint32_t fw_owner_settings(const fw_safety *safety);

/* Returns whether current may flow without a host. */
bool fw_owner_keeps_current(const fw_safety *safety);

/* Return the current of the fitted source, as amplitude and as rms; 0: not known. */
uint32_t fw_owner_source_ua(const fw_safety *safety);
uint32_t fw_owner_source_ua_rms(const fw_safety *safety);

/* Returns the fitted amplification, in volts at the converter per volt between the electrodes, in
 * millionths; 0: not known. */
uint32_t fw_owner_gain_ppm(const fw_safety *safety);

/* Returns the board's converter, with the fitted source and amplifier taken into account. */
fw_capture fw_owner_capture(const fw_safety *safety);

/* Returns the board's name, EITS_NAME_CHARACTERS long and zero-filled; it is empty if the board has
 * no name. */
const char *fw_owner_name(const fw_safety *safety);

/* Returns whether `name`, EITS_NAME_CHARACTERS long, is empty, or consists of letters, digits, -
 * and _ with a letter or digit first, followed by zeros. Such a name can be part of topics and
 * addresses. */
bool fw_owner_name_valid(const char *name);

/* Returns whether the board is locked and the owner does not hold its button; then the fault LOCKED
 * is raised. `command` is the command of the host. */
bool fw_owner_refuses(fw_safety *safety, eits_packet_type command);

/* Store new settings and use them; a number that is EITS_KEPT stays as it is. Errors: as
 * fw_owner_record_save. */
fw_status fw_owner_save(fw_safety *safety, const fw_owner_record *wanted);

#endif
