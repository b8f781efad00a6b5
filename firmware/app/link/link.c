#include "app/link/link.h"

#include "app/clock.h"
#include "app/link/commands.h"
#include "app/link/state.h"
#include "app/link/stream.h"
#include "app/link/tracks.h"
#include "app/safety/current_enable.h"

#include <string.h>

void fw_link_init(fw_host_link *link, const fw_board *board, fw_safety *safety, fw_acquire *acquire,
                  fw_solve *solve)
{
    memset(link, 0, sizeof *link);
    link->board = board;
    link->safety = safety;
    link->acquire = acquire;
    link->solve = solve;
    link->uptime_us = fw_now_us(board);
    fw_tx_queue_init(&link->tx_queue, board->link);
    fw_tracks_init(link);
    fw_stream_reset(link);
    (void)eits_link_decoder_init(&link->decoder, link->received, FW_RECEIVE_ROOM);
}

bool fw_link_read(fw_host_link *link)
{
    const fw_link *port = &link->board->link;
    const size_t size = port->ops->read(port->ctx, link->chunk, sizeof link->chunk);
    for (size_t at = 0; at < size;) {
        eits_link_packet packet;
        at += eits_link_feed(&link->decoder, link->chunk + at, size - at, &packet);
        if (packet.payload == NULL)
            continue;
        fw_tracks_hold(link);
        fw_command(link, &packet);
        fw_tracks_release(link);
        fw_current_heard(link->safety); /* during a long command the host waits, and is silent */
    }
    return size > 0;
}

void fw_link_keep_time(fw_host_link *link)
{
    const uint32_t ms = (fw_now_us(link->board) - link->uptime_us) / 1000u;
    link->uptime_ms += ms;
    link->uptime_us += ms * 1000u;
}

uint32_t fw_link_uptime_ms(const fw_host_link *link)
{
    return link->uptime_ms;
}

bool fw_link_reset_wanted(const fw_host_link *link)
{
    return link->reset_wanted;
}

void fw_link_fault_changed(void *link, const eits_packet_fault *fault)
{
    fw_host_link *self = link;
    (void)fw_tx_queue_send(&self->tx_queue, EITS_PACKET_FAULT, fault, sizeof *fault, NULL, 0);
}
