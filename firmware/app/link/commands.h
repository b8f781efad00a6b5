/* Commands: lengths and ranges are checked before anything is changed, and one that is sent again
 * is answered again. */
#ifndef FW_COMMANDS_H
#define FW_COMMANDS_H

#include "app/instrument.h"

/* Carry out the command in a packet from the host and answer it; other packets are passed over. */
void fw_command(fw_instrument *instrument, const eits_link_packet *packet);

#endif
