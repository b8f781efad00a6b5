/* What the board says about itself, and answers to commands. */
#ifndef FW_REPORT_H
#define FW_REPORT_H

#include "app/instrument.h"
#include "app/link/answer.h"

/* Each sends one packet, which goes to `request`; `reset` begins the statistics from zero. A reply
 * is kept, to be given again when its command is sent again. */
void fw_send_info(fw_instrument *instrument, uint32_t request);
/* SHA-256 of model and program; takes some 0.1 s of a board. */
void fw_send_hashes(fw_instrument *instrument, uint32_t request);

void fw_send_stats(fw_instrument *instrument, uint32_t request, bool reset);
void fw_send_reply(fw_instrument *instrument, eits_packet_type command, uint32_t request,
                   fw_answer answer);
void fw_send_tare_reply(fw_instrument *instrument, fw_answer answer);

#endif
