/* The other end of the fake board's link: sends commands, turns the main loop, keeps what the board
 * sent. */
#ifndef FW_TEST_HOST_H
#define FW_TEST_HOST_H

#include "fake_board.h"

enum { HOST_PACKETS = 8192, HOST_BYTES = 4 << 20 };

typedef struct host_packet {
    uint8_t type;
    uint32_t sequence;
    size_t size;
    const uint8_t *payload; /* 8-byte aligned */
} host_packet;

typedef struct host {
    fake_board *board;
    fw_instrument instrument;
    uint32_t request, sequence;
    bool kept_on;  /* the owner lets current flow without a host */
    uint32_t gaps; /* missing sequence numbers of the board's packets */
    uint32_t expected;
    bool known;
    bool quiet; /* does not ask for current, and is heard only by its packets */
    host_packet packet[HOST_PACKETS];
    uint32_t packets;
    size_t used;
    eits_link_decoder decoder;
    _Alignas(8) uint8_t decoding[EITS_LINK_MAX_PACKET + 4];
    _Alignas(8) uint8_t bytes[HOST_BYTES];
} host;

/* Start the application on the board. */
void host_start(host *h, fake_board *board);

/* One turn of the main loop, with a wait if there is nothing to do; or turns for so many
 * milliseconds of the board's time. */
void host_step(host *h);
void host_run(host *h, uint32_t ms);

/* Forget the packets so far. */
void host_forget(host *h);

/* Number of packets of a type; the k-th (from 0), NULL if there are fewer; the last. */
uint32_t host_count(const host *h, eits_packet_type type);
const host_packet *host_packet_of(const host *h, eits_packet_type type, uint32_t k);
const host_packet *host_last(const host *h, eits_packet_type type);

/* The k-th FAULT packet with this code and `raised`; NULL. */
const eits_packet_fault *host_fault(const host *h, eits_fault code, bool raised, uint32_t k);

/* Send a packet as it is. */
void host_send(host *h, uint8_t type, const void *payload, size_t size);

/* Send a command whose first 4 bytes are the request number (set here), and wait up to 60 s
 * for its reply; status 0xFFFF: none came. */
eits_packet_reply host_command(host *h, eits_packet_type type, void *payload, size_t size);

/* Wait for the reply to a request. */
eits_packet_reply host_reply(host *h, uint32_t request);

eits_packet_reply host_stream(host *h, uint16_t what, uint16_t every, uint32_t frames);
eits_packet_reply host_tare(host *h, uint32_t frames);
eits_packet_reply host_plain(host *h, eits_packet_type type);
eits_command_scan host_default_scan(void);
eits_packet_info host_info(host *h);
eits_packet_stats host_stats(host *h, uint32_t reset);

/* Upload a model in pieces of `piece` bytes; the first answer that is not OK, or the last one. */
eits_packet_reply host_upload(host *h, const uint8_t *blob, size_t size, uint32_t crc,
                              size_t piece);
eits_packet_reply host_model_data(host *h, uint32_t offset, const uint8_t *bytes, size_t size);

#endif
