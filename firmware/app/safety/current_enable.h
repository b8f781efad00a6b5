/* Whether current may flow: off from power-up until a host asks for frames, and off again where no
 * packet of it has come for a second, where the current is above its limit, or where it says that
 * it goes. Off means: all multiplexers open, generator in reset. */
#ifndef FW_DRIVE_H
#define FW_DRIVE_H

#include "app/instrument.h"

#define FW_SILENT_US 900000u /* without a packet; the main loop may take the rest of a second */
#define FW_SENSE_US  50000u  /* from one measurement of the current to the next */

/* A host asks for frames; false: the current was above its limit, and nobody has looked since. */
bool fw_drive_on(fw_instrument *instrument);

/* The current stops, and with it the stream and a tare under way; the reference stays. */
void fw_drive_off(fw_instrument *instrument, eits_drive why);

/* A packet has come from the host. */
void fw_drive_heard(fw_instrument *instrument);

/* Once a turn of the main loop: is the host heard, is the current within its limit? */
void fw_drive_check(fw_instrument *instrument);

#endif
