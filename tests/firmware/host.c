#include "host.h"

#include "app/instrument.h"
#include "app/safety/current_enable.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static void keep(host *h, const eits_link_packet *packet)
{
    if (h->packets == HOST_PACKETS || h->used + packet->size + 8 > HOST_BYTES) {
        fprintf(stderr, "host: too many packets\n");
        abort();
    }
    if (h->known)
        h->gaps += packet->sequence - h->expected;
    h->known = true;
    h->expected = packet->sequence + 1;
    memcpy(h->bytes + h->used, packet->payload, packet->size);
    h->packet[h->packets++] =
        (host_packet){packet->type, packet->sequence, packet->size, h->bytes + h->used};
    h->used += (packet->size + 7u) & ~(size_t)7u;
}

static void collect(host *h)
{
    if (h->board->monitor.violation != NULL) {
        fprintf(stderr, "the board did what it must not: %s\n", h->board->monitor.violation);
        abort();
    }
    for (size_t at = 0; at < h->board->to_host_size;) {
        eits_link_packet packet;
        at += eits_link_feed(&h->decoder, h->board->to_host + at, h->board->to_host_size - at,
                             &packet);
        if (packet.payload != NULL)
            keep(h, &packet);
    }
    h->board->to_host_size = 0;
}

/* The same effect as a constant keepalive, which would change the counters. */
static void listen(host *h)
{
    if (h->quiet)
        return;
    drive_monitor_heard(&h->board->monitor, h->board->now_ns);
    fw_current_heard(&h->instrument.safety);
}

void host_start(host *h, fake_board *board)
{
    h->board = board;
    h->known = false;
    h->gaps = 0;
    h->request = 1000;
    host_forget(h);
    if (eits_link_decoder_init(&h->decoder, h->decoding, sizeof h->decoding) != EITS_OK)
        abort();
    board->monitor.needs_host = !h->kept_on;
    fw_instrument_init(&h->instrument, &board->board);
    listen(h);
    if (!h->quiet)
        (void)fw_current_on(&h->instrument.safety);
    collect(h);
}

void host_step(host *h)
{
    listen(h);
    if (!fw_instrument_step(&h->instrument))
        fake_wait(h->board);
    collect(h);
}

void host_run(host *h, uint32_t ms)
{
    const uint64_t until = h->board->now_ns + (uint64_t)ms * 1000000u;
    while (h->board->now_ns < until)
        host_step(h);
}

void host_forget(host *h)
{
    h->packets = 0;
    h->used = 0;
}

uint32_t host_count(const host *h, eits_packet_type type)
{
    uint32_t count = 0;
    for (uint32_t k = 0; k < h->packets; ++k)
        count += h->packet[k].type == type;
    return count;
}

const host_packet *host_packet_of(const host *h, eits_packet_type type, uint32_t wanted)
{
    for (uint32_t k = 0; k < h->packets; ++k) {
        if (h->packet[k].type == type && wanted-- == 0)
            return &h->packet[k];
    }
    return NULL;
}

const host_packet *host_last(const host *h, eits_packet_type type)
{
    const uint32_t count = host_count(h, type);
    return count > 0 ? host_packet_of(h, type, count - 1) : NULL;
}

const eits_packet_fault *host_fault(const host *h, eits_fault code, bool raised, uint32_t wanted)
{
    for (uint32_t k = 0; k < h->packets; ++k) {
        const eits_packet_fault *fault =
            (const eits_packet_fault *)(const void *)h->packet[k].payload;
        if (h->packet[k].type == EITS_PACKET_FAULT && fault->code == code &&
            (fault->raised != 0) == raised && wanted-- == 0)
            return fault;
    }
    return NULL;
}

void host_send(host *h, uint8_t type, const void *payload, size_t size)
{
    fake_board *b = h->board;
    const size_t sent =
        eits_link_encode(b->to_board + b->to_board_size, FAKE_WIRE - b->to_board_size, type,
                         h->sequence++, payload, size, NULL, 0);
    if (sent == 0)
        abort();
    b->to_board_size += sent;
}

eits_packet_reply host_reply(host *h, uint32_t request)
{
    const uint64_t until = h->board->now_ns + 60000000000u;
    uint32_t seen = 0;
    while (h->board->now_ns < until) {
        for (; seen < h->packets; ++seen) {
            eits_packet_reply reply;
            if (h->packet[seen].type != EITS_PACKET_REPLY)
                continue;
            memcpy(&reply, h->packet[seen].payload, sizeof reply);
            if (reply.request == request)
                return reply;
        }
        host_step(h);
    }
    return (eits_packet_reply){.status = 0xFFFF};
}

eits_packet_reply host_command(host *h, eits_packet_type type, void *payload, size_t size)
{
    const uint32_t request = ++h->request;
    memcpy(payload, &request, sizeof request);
    host_send(h, (uint8_t)type, payload, size);
    return host_reply(h, request);
}

eits_packet_reply host_stream(host *h, uint16_t what, uint16_t every, uint32_t frames)
{
    eits_command_stream c = {.what = what, .every = every, .frames = frames};
    return host_command(h, EITS_PACKET_STREAM, &c, sizeof c);
}

eits_packet_reply host_tare(host *h, uint32_t frames)
{
    eits_command_tare c = {.frames = frames};
    return host_command(h, EITS_PACKET_TARE, &c, sizeof c);
}

eits_packet_reply host_plain(host *h, eits_packet_type type)
{
    eits_command_plain c = {0};
    return host_command(h, type, &c, sizeof c);
}

eits_command_scan host_default_scan(void)
{
    return (eits_command_scan){.excitation_millihz = 50000000,
                               .sample_rate_hz = 1000000,
                               .samples = 80,
                               .settle_us = 16,
                               .check_every = 1};
}

/* The packet that answers GET_INFO or GET_STATS, into `out`. */
static void ask(host *h, eits_packet_type command, const void *payload, size_t size,
                eits_packet_type answer, void *out, size_t room)
{
    const uint32_t before = host_count(h, answer);
    host_send(h, (uint8_t)command, payload, size);
    for (int turn = 0; turn < 100000 && host_count(h, answer) == before; ++turn)
        host_step(h);
    const host_packet *packet = host_last(h, answer);
    memset(out, 0, room);
    if (packet != NULL && packet->size == room && host_count(h, answer) > before)
        memcpy(out, packet->payload, room);
}

eits_packet_info host_info(host *h)
{
    const eits_command_plain c = {++h->request};
    eits_packet_info info;
    ask(h, EITS_PACKET_GET_INFO, &c, sizeof c, EITS_PACKET_INFO, &info, sizeof info);
    return info;
}

eits_packet_stats host_stats(host *h, uint32_t reset)
{
    const eits_command_get_stats c = {++h->request, reset};
    eits_packet_stats stats;
    ask(h, EITS_PACKET_GET_STATS, &c, sizeof c, EITS_PACKET_STATS, &stats, sizeof stats);
    return stats;
}

eits_packet_reply host_model_data(host *h, uint32_t offset, const uint8_t *bytes, size_t size)
{
    static uint8_t payload[sizeof(eits_command_model_data) + EITS_LINK_MAX_PAYLOAD];
    memcpy(payload + 4, &offset, sizeof offset);
    memcpy(payload + 8, bytes, size);
    return host_command(h, EITS_PACKET_MODEL_DATA, payload, 8 + size);
}

eits_packet_reply host_upload(host *h, const uint8_t *blob, size_t size, uint32_t crc, size_t piece)
{
    eits_command_model_begin begin = {.bytes = (uint32_t)size, .crc = crc};
    eits_packet_reply reply = host_command(h, EITS_PACKET_MODEL_BEGIN, &begin, sizeof begin);
    for (size_t at = (size_t)reply.detail[0]; reply.status == EITS_REPLY_OK && at < size;
         at += piece)
        reply = host_model_data(h, (uint32_t)at, blob + at, size - at < piece ? size - at : piece);
    return reply.status == EITS_REPLY_OK ? host_plain(h, EITS_PACKET_MODEL_COMMIT) : reply;
}
