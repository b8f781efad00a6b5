/* Commands: lengths and ranges are checked before anything is changed. A command that is sent again
 * is answered again, and not run again. */
#ifndef FW_COMMANDS_H
#define FW_COMMANDS_H

#include "eitskin/link.h"

typedef struct fw_host_link fw_host_link;

/* Run the command in a packet from the host, and answer it; other packets are ignored. */
void fw_command(fw_host_link *link, const eits_link_packet *packet);

#endif
