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
    size_t code_at; /* place of the open block's code */
    uint8_t code;   /* code of the open block: 1 + its bytes so far */
} stuffer;

static void open_block(stuffer *s)
{
    s->code_at = s->at++;
    s->code = 1;
}

/* Consistent overhead byte stuffing (Cheshire and Baker, IEEE/ACM Trans. Networking 7, 1999): each
 * zero is replaced by the distance to the next one, so that zeros occur only between packets, and a
 * receiver that starts in the middle of a stream finds the next packet. It adds at most one byte in
 * 254. */
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

/* Bytes are written by shifts, the low one first: this works the same on every processor and at any
 * alignment. */
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

/* Head and body are separate arguments, so that an image is sent from the context's own memory,
 * without a copy for which a board would need memory. Sizes are compared one after the other, since
 * their sum could wrap. */
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
    /* A zero is sent before the packet as well as after it: it ends any bytes that were on the line
     * before, so that they cannot damage this packet. */
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

/* The buffer is aligned to 8 bytes, and so is the payload behind a head of 8: receivers may read
 * its numbers in place. */
eits_status eits_link_decoder_init(eits_link_decoder *decoder, uint8_t *buffer, size_t room)
{
    if (!decoder || !buffer || (uintptr_t)buffer % 8u != 0 || room < (size_t)MIN)
        return EITS_E_ARGUMENT;
    memset(decoder, 0, sizeof *decoder);
    decoder->buffer = buffer;
    decoder->room = room;
    return EITS_OK;
}

/* A packet that is longer than the buffer is counted once, and its remaining bytes are skipped. */
static void keep(eits_link_decoder *d, uint8_t byte)
{
    if (d->used < d->room) {
        d->buffer[d->used++] = byte;
    } else if (!d->broken) {
        d->broken = 1;
        ++d->overruns;
    }
}

/* Take a byte that is not zero. The code of a block stands for the zero before the block, except
 * for the first block of a packet and after a full block. */
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

/* A zero has ended the bytes since the last one: report them as a packet, or count the error. */
static void finish(eits_link_decoder *d, eits_link_packet *packet)
{
    if (d->broken)
        return;
    /* a block announced more bytes, so it was cut, or two packets have run together */
    if (d->left > 0 || d->used < (size_t)MIN) {
        ++d->framing_errors;
        return;
    }
    const size_t size = d->used - (size_t)MIN;
    /* The checksum is checked before the version: a damaged first byte must not be reported as
     * another version. */
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

/* Returns after each packet, so that the caller may use its payload in place before the buffer is
 * filled again; the caller then feeds the rest. */
size_t eits_link_feed(eits_link_decoder *d, const uint8_t *bytes, size_t size,
                      eits_link_packet *packet)
{
    *packet = (eits_link_packet){.payload = NULL};
    for (size_t i = 0; i < size; ++i) {
        if (bytes[i] != 0) {
            unstuff(d, bytes[i]);
            continue;
        }
        /* zeros may follow one another, with no packet between them */
        if (d->in_packet)
            finish(d, packet);
        d->used = 0;
        d->left = d->code = d->in_packet = d->broken = 0;
        if (packet->payload)
            return i + 1;
    }
    return size;
}
