/* Any bytes, in any pieces, into the wire decoder. The first byte says how large its buffer is, the
 * second in which pieces the rest arrives. Pieces must not matter, what is decoded must be what its
 * encoding gives, and every stretch between zeros must be counted once. */
#include "fuzz.h"

enum { ROOM = 600, MAX_PACKETS = 64, MAX_WIRE = 4096 };

typedef struct heard {
    uint32_t packets;
    uint32_t digest[MAX_PACKETS]; /* of type, sequence number and payload */
    eits_link_decoder decoder;
} heard;

static uint32_t digest_of(const eits_link_packet *packet)
{
    uint32_t crc = eits_crc32(0, &packet->type, 1);
    crc = eits_crc32(crc, &packet->sequence, sizeof packet->sequence);
    return eits_crc32(crc, packet->payload, packet->size);
}

static void check_packet(const eits_link_decoder *decoder, const eits_link_packet *packet)
{
    static uint8_t again[EITS_LINK_ENCODED(ROOM)];
    static _Alignas(8) uint8_t buffer[ROOM];
    MUST(packet->payload >= decoder->buffer &&
         packet->payload + packet->size <= decoder->buffer + decoder->room);
    MUST(packet->size <= EITS_LINK_MAX_PAYLOAD);
    const size_t wire = eits_link_encode(again, sizeof again, packet->type, packet->sequence,
                                         packet->payload, packet->size, NULL, 0);
    MUST(wire > 0 && wire <= EITS_LINK_ENCODED(packet->size));
    fuzz_note("packets", packet->payload, packet->size);
    fuzz_note("packets", again, wire);
    const size_t cut = packet->size / 2;
    static uint8_t halves[EITS_LINK_ENCODED(ROOM)];
    MUST(eits_link_encode(halves, sizeof halves, packet->type, packet->sequence, packet->payload,
                          cut, packet->payload + cut, packet->size - cut) == wire);
    MUST(memcmp(again, halves, wire) == 0);
    eits_link_decoder second;
    eits_link_packet out;
    MUST(eits_link_decoder_init(&second, buffer, sizeof buffer) == EITS_OK);
    MUST(eits_link_feed(&second, again, wire, &out) == wire && out.payload != NULL);
    MUST(out.type == packet->type && out.sequence == packet->sequence && out.size == packet->size);
    MUST(memcmp(out.payload, packet->payload, out.size) == 0);
}

/* Give the decoder `size` bytes in pieces from a generator that starts at `pieces`; 0: all at once.
 */
static void hear(heard *h, uint8_t *buffer, size_t room, const uint8_t *bytes, size_t size,
                 uint32_t pieces)
{
    h->packets = 0;
    MUST(eits_link_decoder_init(&h->decoder, buffer, room) == EITS_OK);
    for (size_t at = 0; at < size;) {
        pieces = pieces * 1664525u + (pieces ? 1013904223u : 0);
        size_t piece = pieces ? (pieces >> 24) % 23u : size - at;
        piece = piece < size - at ? piece : size - at;
        for (size_t taken = 0; taken < piece;) {
            eits_link_packet packet;
            const size_t some =
                eits_link_feed(&h->decoder, bytes + at + taken, piece - taken, &packet);
            MUST(some > 0 && some <= piece - taken);
            MUST(h->decoder.used <= h->decoder.room);
            taken += some;
            if (packet.payload == NULL) {
                MUST(taken == piece);
                continue;
            }
            MUST(bytes[at + taken - 1] == 0);
            MUST(h->packets < MAX_PACKETS * (uint32_t)MAX_WIRE);
            if (h->packets < MAX_PACKETS) {
                check_packet(&h->decoder, &packet);
                h->digest[h->packets] = digest_of(&packet);
            }
            ++h->packets;
        }
        at += piece;
    }
}

/* Stretches of bytes that are not zero, each ended by a zero. */
static uint32_t ended_stretches(const uint8_t *bytes, size_t size)
{
    uint32_t count = 0;
    for (size_t i = 1; i < size; ++i)
        count += bytes[i] == 0 && bytes[i - 1] != 0;
    return count;
}

/* 1 if the bytes end inside a stretch: it may have overrun, but must be counted as nothing else.
 * */
static uint32_t open_end(const uint8_t *bytes, size_t size)
{
    return size > 0 && bytes[size - 1] != 0;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static _Alignas(8) uint8_t one[ROOM], other[ROOM];
    static heard whole, cut;
    fuzz_bytes in = {data, data + size};
    const size_t room = 12u + fuzz_u8(&in) * 2u;
    const uint32_t pieces = 1u + fuzz_u8(&in);
    const uint8_t *bytes = in.at;
    const size_t rest = (size_t)(in.end - in.at);
    hear(&whole, one, room, bytes, rest, 0);
    hear(&cut, other, room, bytes, rest, pieces);
    const eits_link_decoder *a = &whole.decoder, *b = &cut.decoder;
    MUST(whole.packets == cut.packets && whole.packets == a->packets);
    MUST(memcmp(whole.digest, cut.digest,
                sizeof whole.digest[0] *
                    (whole.packets < MAX_PACKETS ? whole.packets : MAX_PACKETS)) == 0);
    MUST(a->packets == b->packets && a->crc_errors == b->crc_errors &&
         a->framing_errors == b->framing_errors);
    MUST(a->overruns == b->overruns && a->version_errors == b->version_errors &&
         a->other_version == b->other_version);
    const uint32_t counts[] = {a->packets,  a->crc_errors,     a->framing_errors,
                               a->overruns, a->version_errors, a->other_version};
    fuzz_note("counts", counts, sizeof counts);
    const uint32_t counted =
        a->packets + a->crc_errors + a->framing_errors + a->overruns + a->version_errors;
    const uint32_t ended = ended_stretches(bytes, rest);
    MUST(counted == ended || (counted == ended + 1 && open_end(bytes, rest) && a->broken));
    return 0;
}

/* ---- mutation: what lies between zeros may be decoded, changed, and encoded again, so that
 * checksums are no wall ---- */

static size_t mutate_packet(uint8_t *data, size_t size, size_t room, uint32_t seed)
{
    static _Alignas(8) uint8_t buffer[MAX_WIRE];
    static uint8_t made[EITS_LINK_ENCODED(MAX_WIRE)];
    eits_link_decoder decoder;
    eits_link_packet packet = {.payload = NULL};
    if (size > MAX_WIRE || eits_link_decoder_init(&decoder, buffer, sizeof buffer) != EITS_OK)
        return size;
    size_t from = 2, to = 2;
    for (uint32_t skip = seed % 4; to < size; from = to) { /* one of the first packets */
        to += eits_link_feed(&decoder, data + to, size - to, &packet);
        if (packet.payload != NULL && skip-- == 0)
            break;
    }
    uint8_t type = (uint8_t)(seed >> 8), payload[MAX_WIRE];
    uint32_t sequence = seed >> 12;
    size_t bytes = 0;
    if (packet.payload != NULL) {
        type = packet.type, sequence = packet.sequence, bytes = packet.size;
        memcpy(payload, packet.payload, bytes);
    } else {
        from = to = size;
    }
    bytes = LLVMFuzzerMutate(payload, bytes, 560);
    const size_t wire =
                     eits_link_encode(made, sizeof made, type, sequence, payload, bytes, NULL, 0),
                 tail = size - to;
    if (wire == 0 || from + wire + tail > room)
        return size;
    memmove(data + from + wire, data + to, tail);
    memcpy(data + from, made, wire);
    return from + wire + tail;
}

size_t LLVMFuzzerCustomMutator(uint8_t *data, size_t size, size_t room, unsigned int seed);
size_t LLVMFuzzerCustomMutator(uint8_t *data, size_t size, size_t room, unsigned int seed)
{
    return size >= 2 && seed % 3 == 0 ? mutate_packet(data, size, room, seed / 3u)
                                      : LLVMFuzzerMutate(data, size, room);
}
