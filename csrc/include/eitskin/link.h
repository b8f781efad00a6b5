/* eitskin: how packets between a board and a host (packets.h) are framed.
 * docs/reference/link-protocol.md specifies the bytes.
 *
 * A packet is an 8-byte head (u8 version, u8 type, u16 bytes of payload, u32 sequence number), a
 * payload and a CRC-32 of both, stuffed by COBS (Cheshire and Baker, IEEE/ACM Trans. Networking 7
 * (1999) 159-172) between two zero bytes. Both sides use this codec: nothing else encodes or
 * decodes.
 */
#ifndef EITSKIN_LINK_H
#define EITSKIN_LINK_H

#include "eitskin/packets.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Bytes of a head; and of the longest packet before COBS stuffing, which a decoder's buffer must
 * hold. */
#define EITS_LINK_HEAD       8u
#define EITS_LINK_MAX_PACKET (EITS_LINK_HEAD + EITS_LINK_MAX_PAYLOAD + 4u)
/* The maximum number of bytes on the wire for a payload of `size` bytes: COBS adds at most one byte
 * per 254, and a zero stands at either end. */
#define EITS_LINK_ENCODED(size) \
    ((size_t)(size) + EITS_LINK_HEAD + 4u + ((size_t)(size) + EITS_LINK_HEAD + 4u) / 254u + 3u)

/* Encode one packet from a payload in two parts (either may be empty) into `out`. Returns its bytes
 * on the wire, or 0 if `room` is less than EITS_LINK_ENCODED(head_size + body_size) or the payload
 * is longer than EITS_LINK_MAX_PAYLOAD. */
size_t eits_link_encode(uint8_t *out, size_t room, uint8_t type, uint32_t sequence,
                        const void *head, size_t head_size, const void *body, size_t body_size);

/* A packet whose checksum, version and length are right; the content of its payload is not checked.
 */
typedef struct eits_link_packet {
    uint8_t type;      /* eits_packet_type, or a number that this version does not know */
    uint32_t sequence; /* counts the packets that the other side sent or dropped, modulo 2^32 */
    /* inside the decoder's buffer, 4-byte aligned, until the next eits_link_feed */
    const uint8_t *payload;
    size_t size; /* bytes of payload */
} eits_link_packet;

/* State of decoding a stream of bytes; the caller owns the buffer. */
typedef struct eits_link_decoder {
    uint8_t *buffer;   /* 8-byte aligned */
    size_t room, used; /* bytes of the buffer, and those of the packet so far */
    /* the COBS block's missing bytes and code; 1 if a packet has begun; 1 if it is too long */
    uint8_t left, code, in_packet, broken;
    uint32_t packets;        /* packets that were accepted */
    uint32_t crc_errors;     /* whole COBS frames with a wrong checksum */
    uint32_t framing_errors; /* those that end in a COBS block, or too short for head and CRC */
    uint32_t overruns;       /* those that are longer than the buffer */
    uint32_t version_errors; /* packets with the right checksum of another protocol version */
    uint8_t other_version;   /* the last version that did not match */
} eits_link_decoder;

/* Start with an empty decoder; call it again where the line was cut, which also clears the
 * counters. `buffer` stays the decoder's. EITS_LINK_MAX_PACKET bytes take every packet.
 * Errors: EITS_E_ARGUMENT (no buffer, not 8-byte aligned, or room below EITS_LINK_HEAD + 4). */
eits_status eits_link_decoder_init(eits_link_decoder *decoder, uint8_t *buffer, size_t room);

/* Take bytes until a packet is complete or they end. Returns how many were taken; `packet->payload`
 * is NULL if no packet is complete. Call it again with the rest until all are taken: bytes that
 * form no packet are counted and skipped. */
size_t eits_link_feed(eits_link_decoder *decoder, const uint8_t *bytes, size_t size,
                      eits_link_packet *packet);

#ifdef __cplusplus
}
#endif
#endif
