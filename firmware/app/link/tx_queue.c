#include "app/link/tx_queue.h"

void fw_tx_queue_init(fw_tx_queue *tx_queue, fw_link link)
{
    tx_queue->link = link;
    tx_queue->sequence = tx_queue->sent = tx_queue->dropped = 0;
}

bool fw_tx_queue_send(fw_tx_queue *tx_queue, eits_packet_type type, const void *head,
                      size_t head_size, const void *body, size_t body_size)
{
    tx_queue->busy = true;
    const size_t size = eits_link_encode(tx_queue->scratch, sizeof tx_queue->scratch, (uint8_t)type,
                                         tx_queue->sequence++, head, head_size, body, body_size);
    const bool sent =
        size > 0 && tx_queue->link.ops->write(tx_queue->link.ctx, tx_queue->scratch, size);
    if (sent)
        ++tx_queue->sent;
    else
        ++tx_queue->dropped;
    tx_queue->busy = false;
    if (tx_queue->free != NULL)
        tx_queue->free(tx_queue->user);
    return sent;
}
