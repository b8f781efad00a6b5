/* Packets on a wire: head, payload and checksum, stuffed between zeros.
 * docs/reference/link-protocol.md specifies the bytes. */
#include "eitskin/link.h"

#include "eitskin/model.h"
#include "link/layouts.h"

#include <string.h>

enum { CHECKSUM = 4, MIN = (int)EITS_LINK_HEAD + CHECKSUM, LONGEST_BLOCK = 0xFF };

/* ---- encoding ---- */

typedef struct stuffer {
    uint8_t *out;
    size_t at;      /* next byte */
    size_t code_at; /* where the open block's code goes */
    uint8_t code;   /* of the open block: its bytes so far, and one */
} stuffer;

static void open_block(stuffer *s)
{
    s->code_at = s->at++;
    s->code = 1;
}

/* Consistent overhead byte stuffing (Cheshire and Baker, IEEE/ACM Trans. Networking 7, 1999): each
 * zero becomes the distance to the next, so that zeros alone part packets and whoever comes late
 * finds the next one. At most one byte in 254 is added. */
static void stuff(stuffer *s, const uint8_t *bytes, size_t size)
{
    for (size_t i = 0; i < size; ++i) {
        if (s->code == LONGEST_BLOCK) { /* a full block stands for no zero */
            s->out[s->code_at] = s->code;
            open_block(s);
        }
        if (bytes[i] == 0) {
            s->out[s->code_at] = s->code;
            open_block(s);
        } else {
            s->out[s->at++] = bytes[i];
            ++s->code;
        }
    }
}

/* Bytes by shifts, low ones first: the same on every processor, aligned or not. */
static void put_u16(uint8_t *out, uint32_t value)
{
    out[0] = (uint8_t)value;
    out[1] = (uint8_t)(value >> 8);
}

static void put_u32(uint8_t *out, uint32_t value)
{
    put_u16(out, value);
    put_u16(out + 2, value >> 16);
}

/* Head and body apart, so that an image goes out of the context's own memory, without a copy that a
 * board would need room for. Sizes are compared one after the other: their sum could wrap. */
size_t eits_link_encode(uint8_t *out, size_t room, uint8_t type, uint32_t sequence,
                        const void *head, size_t head_size, const void *body, size_t body_size)
{
    if (!out || head_size > EITS_LINK_MAX_PAYLOAD ||
        body_size > EITS_LINK_MAX_PAYLOAD - head_size ||
        room < EITS_LINK_ENCODED(head_size + body_size) || (head_size && !head) ||
        (body_size && !body))
        return 0;
    uint8_t start[EITS_LINK_HEAD], checksum[CHECKSUM];
    start[0] = EITS_LINK_VERSION;
    start[1] = type;
    put_u16(start + 2, (uint32_t)(head_size + body_size));
    put_u32(start + 4, sequence);
    uint32_t crc = eits_crc32(0, start, sizeof start);
    crc = eits_crc32(crc, head, head_size);
    crc = eits_crc32(crc, body, body_size);
    put_u32(checksum, crc);

    stuffer s = {.out = out, .at = 1};
    /* A zero before as well as after: what was on the line before ends there, and cannot take this
     * packet with it. */
    out[0] = 0;
    open_block(&s);
    stuff(&s, start, sizeof start);
    stuff(&s, head, head_size);
    stuff(&s, body, body_size);
    stuff(&s, checksum, sizeof checksum);
    out[s.code_at] = s.code;
    out[s.at++] = 0;
    return s.at;
}

/* ---- decoding ---- */

static uint32_t get_u16(const uint8_t *bytes)
{
    return (uint32_t)bytes[0] | (uint32_t)bytes[1] << 8;
}

static uint32_t get_u32(const uint8_t *bytes)
{
    return get_u16(bytes) | get_u16(bytes + 2) << 16;
}

/* The buffer begins at 8 bytes, and so does the payload behind a head of 8: receivers may read its
 * numbers in place. */
eits_status eits_link_decoder_init(eits_link_decoder *decoder, uint8_t *buffer, size_t room)
{
    if (!decoder || !buffer || (uintptr_t)buffer % 8u != 0 || room < (size_t)MIN)
        return EITS_E_ARGUMENT;
    memset(decoder, 0, sizeof *decoder);
    decoder->buffer = buffer;
    decoder->room = room;
    return EITS_OK;
}

/* A packet that is longer than the buffer is counted once and passed over to its end. */
static void keep(eits_link_decoder *d, uint8_t byte)
{
    if (d->used < d->room) {
        d->buffer[d->used++] = byte;
    } else if (!d->broken) {
        d->broken = 1;
        ++d->overruns;
    }
}

/* A byte that is not zero. A block's code stands for the zero before it, but for the first of a
 * packet and after a full block. */
static void unstuff(eits_link_decoder *d, uint8_t byte)
{
    if (d->left > 0) {
        keep(d, byte);
        --d->left;
        return;
    }
    if (d->in_packet && d->code != LONGEST_BLOCK)
        keep(d, 0);
    d->in_packet = 1;
    d->code = byte;
    d->left = (uint8_t)(byte - 1u);
}

/* What lies between two zeros is over: a packet, or counted as what it is. */
static void finish(eits_link_decoder *d, eits_link_packet *packet)
{
    if (d->broken)
        return;
    /* a block that promised more bytes was cut, or two packets have run together */
    if (d->left > 0 || d->used < (size_t)MIN) {
        ++d->framing_errors;
        return;
    }
    const size_t size = d->used - (size_t)MIN;
    /* The checksum before the version: a damaged first byte is no other version. */
    if (eits_crc32(0, d->buffer, d->used - CHECKSUM) != get_u32(d->buffer + d->used - CHECKSUM)) {
        ++d->crc_errors;
    } else if (d->buffer[0] != EITS_LINK_VERSION) {
        ++d->version_errors;
        d->other_version = d->buffer[0];
    } else if (get_u16(d->buffer + 2) != size) {
        ++d->framing_errors;
    } else {
        ++d->packets;
        packet->type = d->buffer[1];
        packet->sequence = get_u32(d->buffer + 4);
        packet->payload = d->buffer + EITS_LINK_HEAD;
        packet->size = size;
    }
}

/* Ends behind each packet, so that its payload may be used in place before the buffer is filled
 * again; the caller feeds the rest. */
size_t eits_link_feed(eits_link_decoder *d, const uint8_t *bytes, size_t size,
                      eits_link_packet *packet)
{
    *packet = (eits_link_packet){.payload = NULL};
    for (size_t i = 0; i < size; ++i) {
        if (bytes[i] != 0) {
            unstuff(d, bytes[i]);
            continue;
        }
        /* zeros may follow one another; between them is no packet */
        if (d->in_packet)
            finish(d, packet);
        d->used = 0;
        d->left = d->code = d->in_packet = d->broken = 0;
        if (packet->payload)
            return i + 1;
    }
    return size;
}
