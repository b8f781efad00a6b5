/* Packets to the host: encoded into one scratch buffer and written whole, or dropped and counted.
 * It never waits. */
#ifndef FW_TX_QUEUE_H
#define FW_TX_QUEUE_H

#include "eitskin/link.h"
#include "hal/hal.h"

typedef struct fw_tx_queue {
    fw_link link;
    uint32_t sequence; /* of the next packet; a dropped one takes its number too */
    uint32_t sent, dropped;
    /* a packet is under way: what runs between the main loop's instructions must not send one, and
     * is called when it may */
    volatile bool busy;
    void (*free)(void *user);
    void *user;
    uint8_t scratch[EITS_LINK_ENCODED(EITS_LINK_MAX_PAYLOAD)];
} fw_tx_queue;

void fw_tx_queue_init(fw_tx_queue *tx_queue, fw_link link);

/* Send a payload in two parts (body may be NULL with size 0). Returns whether it went out. */
bool fw_tx_queue_send(fw_tx_queue *tx_queue, eits_packet_type type, const void *head,
                      size_t head_size, const void *body, size_t body_size);

#endif
