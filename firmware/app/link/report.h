/* Packets about the board itself, and replies to commands. */
#ifndef FW_REPORT_H
#define FW_REPORT_H

#include "app/link/answer.h"

#include <stdint.h>

typedef struct fw_host_link fw_host_link;

#define FW_VERSION_MAJOR 0u
#define FW_VERSION_MINOR 1u
#define FW_VERSION_PATCH 0u

/* Each of these functions sends one packet with this request number. */
void fw_send_info(fw_host_link *link, uint32_t request);

/* SHA-256 of model and program; takes a board about 0.1 s. */
void fw_send_hashes(fw_host_link *link, uint32_t request);

/* `reset`: the statistics begin again afterwards. */
void fw_send_stats(fw_host_link *link, uint32_t request, bool reset);

/* Send a reply, and keep it, to repeat it if its command is sent again. */
void fw_send_reply(fw_host_link *link, eits_packet_type command, uint32_t request,
                   fw_answer answer);
void fw_send_tare_reply(fw_host_link *link, fw_answer answer);

#endif
