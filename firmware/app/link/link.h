/* The link to the host: reads commands, and sends streams and reports. */
#ifndef FW_LINK_H
#define FW_LINK_H

#include "eitskin/link.h"
#include "hal/hal.h"

typedef struct fw_host_link fw_host_link;
typedef struct fw_safety fw_safety;
typedef struct fw_acquire fw_acquire;
typedef struct fw_solve fw_solve;

/* Initialise the link; packets can be sent afterwards. The other modules may be initialised later.
 */
void fw_link_init(fw_host_link *link, const fw_board *board, fw_safety *safety, fw_acquire *acquire,
                  fw_solve *solve);

/* Take the received bytes, and run the commands in them. Returns false if no bytes have come. */
bool fw_link_read(fw_host_link *link);

/* Call once per turn of the main loop. */
void fw_link_keep_time(fw_host_link *link);

uint32_t fw_link_uptime_ms(const fw_host_link *link);
bool fw_link_reset_wanted(const fw_host_link *link);

/* For fw_safety_hooks; `link` is a fw_host_link. */
void fw_link_fault_changed(void *link, const eits_packet_fault *fault);

#endif
