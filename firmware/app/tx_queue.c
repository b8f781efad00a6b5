#include "app/tx_queue.h"

void fw_outbox_init(fw_outbox *outbox, fw_link link)
{
    outbox->link = link;
    outbox->sequence = outbox->sent = outbox->dropped = 0;
}

bool fw_outbox_send(fw_outbox *outbox, eits_packet_type type, const void *head, size_t head_size,
                    const void *body, size_t body_size)
{
    const size_t size = eits_link_encode(outbox->scratch, sizeof outbox->scratch, (uint8_t)type,
                                         outbox->sequence++, head, head_size, body, body_size);
    const bool sent = size > 0 && outbox->link.ops->write(outbox->link.ctx, outbox->scratch, size);
    if (sent)
        ++outbox->sent;
    else
        ++outbox->dropped;
    return sent;
}
