/* Packets to the host. Each is encoded into one buffer and written whole, or dropped and counted;
 * nothing waits. */
#ifndef FW_TX_QUEUE_H
#define FW_TX_QUEUE_H

#include "eitskin/link.h"
#include "hal/hal.h"

typedef struct fw_tx_queue {
    fw_link link;
    uint32_t sequence; /* of the next packet; dropped packets are numbered, too */
    uint32_t sent, dropped;
    /* a packet is being sent: work that interrupts the main loop must not send another. `free` is
     * called when it may */
    volatile bool busy;
    void (*free)(void *user);
    void *user;
    uint8_t scratch[EITS_LINK_ENCODED(EITS_LINK_MAX_PAYLOAD)];
} fw_tx_queue;

void fw_tx_queue_init(fw_tx_queue *tx_queue, fw_link link);

/* Send a payload in two parts (body may be NULL with size 0). Returns whether it was written. */
bool fw_tx_queue_send(fw_tx_queue *tx_queue, eits_packet_type type, const void *head,
                      size_t head_size, const void *body, size_t body_size);

#endif
