/* The link's codec: encoded packets are decoded, and nothing else is taken for a packet. */
#include "check.h"
#include "small_model.h"

#include "eitskin/link.h"
#include "eitskin/model.h"

#include <stdlib.h>
#include <string.h>

enum { MAX = (int)EITS_LINK_MAX_PAYLOAD, ROOM = (int)EITS_LINK_ENCODED(EITS_LINK_MAX_PAYLOAD) };

static _Alignas(8) uint8_t buffer[EITS_LINK_MAX_PACKET];
static uint8_t payload[MAX], wire[ROOM], other[ROOM];

static uint32_t state = 1;

static uint32_t next_random(void) /* xorshift32 */
{
    state ^= state << 13;
    state ^= state >> 17;
    state ^= state << 5;
    return state;
}

static eits_link_decoder fresh(void)
{
    eits_link_decoder d;
    CHECK_OK(eits_link_decoder_init(&d, buffer, sizeof buffer));
    return d;
}

/* Feed all; the number of packets, the last of them in `last` (its payload is only valid until the
 * next byte). */
static int feed_all(eits_link_decoder *d, const uint8_t *bytes, size_t size, eits_link_packet *last)
{
    int found = 0;
    while (size > 0) {
        eits_link_packet packet;
        const size_t taken = eits_link_feed(d, bytes, size, &packet);
        CHECK(taken > 0 && taken <= size);
        bytes += taken;
        size -= taken;
        if (packet.payload) {
            ++found;
            *last = packet;
        }
    }
    return found;
}

static uint32_t errors(const eits_link_decoder *d)
{
    return d->crc_errors + d->framing_errors + d->overruns + d->version_errors;
}

/* The wire's bytes of a packet by a second, plain implementation: its checksum put behind it, then
 * stuffed block by block. */
static size_t stuff(uint8_t *out, uint8_t *packet, size_t size)
{
    small_put_u32(packet + size, eits_crc32(0, packet, size));
    const size_t total = size + 4;
    size_t at = 0, from = 0;
    out[at++] = 0;
    for (;;) {
        size_t run = 0;
        while (from + run < total && run < 254 && packet[from + run] != 0)
            ++run;
        out[at++] = (uint8_t)(run + 1);
        memcpy(out + at, packet + from, run);
        at += run;
        from += run;
        if (from == total)
            break;
        if (run < 254)
            ++from; /* the zero */
    }
    out[at++] = 0;
    return at;
}

static size_t plainly(uint8_t *out, uint8_t version, uint8_t type, uint32_t sequence,
                      const uint8_t *bytes, size_t size)
{
    static uint8_t packet[EITS_LINK_MAX_PACKET];
    packet[0] = version;
    packet[1] = type;
    small_put_u16(packet + 2, (uint32_t)size);
    small_put_u32(packet + 4, sequence);
    memcpy(packet + 8, bytes, size);
    return stuff(out, packet, size + 8);
}

/* Such a packet on the wire, of `payload`. */
static size_t encode(uint8_t type, uint32_t sequence, size_t size)
{
    return eits_link_encode(wire, sizeof wire, type, sequence, payload, size, NULL, 0);
}

static void fill(size_t size, int kind)
{
    for (size_t i = 0; i < size; ++i)
        payload[i] = kind == 0   ? 0
                     : kind == 1 ? (uint8_t)(1 + i % 255)
                     : kind == 2 ? 0xFF
                                 : (uint8_t)(next_random() >> 24);
}

static void one_round_trip(size_t size, size_t head_size)
{
    const uint8_t type = (uint8_t)next_random();
    const uint32_t sequence = next_random();
    const size_t made = eits_link_encode(wire, sizeof wire, type, sequence, payload, head_size,
                                         payload + head_size, size - head_size);
    CHECK(made > 0 && made <= EITS_LINK_ENCODED(size));
    CHECK_EQUAL(made, plainly(other, EITS_LINK_VERSION, type, sequence, payload, size));
    CHECK(memcmp(wire, other, made) == 0);
    CHECK(wire[0] == 0 && wire[made - 1] == 0 && memchr(wire + 1, 0, made - 2) == NULL);
    eits_link_decoder d = fresh();
    eits_link_packet packet = {.type = 0};
    CHECK_EQUAL(feed_all(&d, wire, made, &packet), 1);
    CHECK_EQUAL(packet.type, type);
    CHECK_EQUAL(packet.sequence, sequence);
    CHECK_EQUAL(packet.size, size);
    CHECK(packet.payload == buffer + EITS_LINK_HEAD && memcmp(packet.payload, payload, size) == 0);
    CHECK_EQUAL(d.packets, 1);
    CHECK_EQUAL(errors(&d), 0);
}

TEST(round_trips)
{
    for (size_t size = 0; size <= 2000; ++size) {
        for (int kind = 0; kind < 4; ++kind) {
            fill(size, kind);
            one_round_trip(size, size < 68 ? size / 2 : 68);
        }
    }
    for (int kind = 0; kind < 4; ++kind) {
        fill((size_t)MAX, kind);
        one_round_trip((size_t)MAX, 0);
        one_round_trip((size_t)MAX, (size_t)MAX);
        one_round_trip((size_t)MAX - 1, 16);
    }
}

TEST(limits_of_room)
{
    fill((size_t)MAX, 1);
    CHECK_EQUAL(eits_link_encode(wire, sizeof wire, 1, 1, payload, (size_t)MAX, payload, 1), 0);
    CHECK_EQUAL(eits_link_encode(wire, sizeof wire, 1, 1, payload, SIZE_MAX, payload, 2), 0);
    CHECK_EQUAL(eits_link_encode(wire, sizeof wire, 1, 1, payload, 2, payload, SIZE_MAX), 0);
    CHECK_EQUAL(eits_link_encode(NULL, sizeof wire, 1, 1, payload, 1, NULL, 0), 0);
    CHECK_EQUAL(eits_link_encode(wire, sizeof wire, 1, 1, NULL, 1, NULL, 0), 0);
    CHECK_EQUAL(eits_link_encode(wire, sizeof wire, 1, 1, NULL, 0, NULL, 1), 0);
    CHECK(eits_link_encode(wire, sizeof wire, 1, 1, NULL, 0, NULL, 0) > 0);
    for (size_t size = 0; size <= 600; ++size) {
        const size_t room = EITS_LINK_ENCODED(size);
        memset(wire, 0xAA, room + 1);
        CHECK_EQUAL(eits_link_encode(wire, room - 1, 1, 1, payload, size, NULL, 0), 0);
        CHECK(wire[0] == 0xAA); /* refused before it is begun */
        CHECK(eits_link_encode(wire, room, 1, 1, payload, size, NULL, 0) <= room);
        CHECK(wire[room] == 0xAA);
    }
}

TEST(bad_decoders)
{
    eits_link_decoder d;
    CHECK_REFUSED(eits_link_decoder_init(NULL, buffer, sizeof buffer));
    CHECK_REFUSED(eits_link_decoder_init(&d, NULL, sizeof buffer));
    CHECK_REFUSED(eits_link_decoder_init(&d, buffer + 4, sizeof buffer - 4));
    CHECK_REFUSED(eits_link_decoder_init(&d, buffer, EITS_LINK_HEAD + 3));
    CHECK_OK(eits_link_decoder_init(&d, buffer, EITS_LINK_HEAD + 4));
}

/* Whatever happens to one byte of a packet: no packet, one error counted, and the next packet is
 * there. */
static void one_damage(const uint8_t *damaged, size_t size, const uint8_t *good, size_t good_size)
{
    eits_link_decoder d = fresh();
    eits_link_packet packet = {.type = 0};
    CHECK_EQUAL(feed_all(&d, damaged, size, &packet), 0);
    CHECK_EQUAL(feed_all(&d, good, good_size, &packet), 1);
    CHECK_EQUAL(packet.type, 0x77);
    CHECK(errors(&d) >= 1);
    CHECK_EQUAL(d.packets, 1);
}

TEST(every_byte_damaged)
{
    static uint8_t damaged[ROOM], good[64];
    const size_t good_size = eits_link_encode(good, sizeof good, 0x77, 9, "next", 4, NULL, 0);
    static const size_t sizes[] = {0, 4, 36, 253, 300};
    for (size_t s = 0; IN_TABLE(s, sizes); ++s) {
        fill(sizes[s], 3);
        const size_t made = encode(EITS_PACKET_RAW, 5, sizes[s]);
        for (size_t at = 1; at + 1 < made; ++at) { /* the zeros at both ends: see delimiters() */
            for (unsigned value = 0; value < 256; ++value) {
                if (value == wire[at])
                    continue;
                memcpy(damaged, wire, made);
                damaged[at] = (uint8_t)value;
                one_damage(damaged, made, good, good_size);
            }
            memcpy(damaged, wire, at); /* byte lost */
            memcpy(damaged + at, wire + at + 1, made - at - 1);
            /* or one of a run of equals: then it is another's loss */
            if (memcmp(damaged, wire, made - 1) != 0)
                one_damage(damaged, made - 1, good, good_size);
            if (at + 2 < made) /* cut: the next packet's leading zero ends it */
                one_damage(wire, at + 1, good, good_size);
        }
    }
}

TEST(delimiters)
{
    uint8_t bytes[256];
    eits_link_packet packet = {.type = 0};
    eits_link_decoder d = fresh();
    const size_t made = eits_link_encode(wire, sizeof wire, 3, 4, "abc", 3, NULL, 0);
    memset(bytes, 0, sizeof bytes); /* any number of zeros between packets */
    memcpy(bytes + 7, wire, made);
    CHECK_EQUAL(feed_all(&d, bytes, 7 + made + 20, &packet), 1);
    /* one zero between two packets is enough */
    CHECK_EQUAL(feed_all(&d, wire + 1, made - 1, &packet), 1);
    CHECK_EQUAL(feed_all(&d, wire + 1, made - 2, &packet), 0);
    CHECK_EQUAL(feed_all(&d, wire, made, &packet), 2); /* its leading zero ends the one before */
    CHECK_EQUAL(d.packets, 4);
    CHECK_EQUAL(errors(&d), 0);
    /* the zero between two packets lost: both are, and counted once */
    memcpy(bytes, wire, made - 1);
    memcpy(bytes + made - 1, wire + 1, made - 1);
    CHECK_EQUAL(feed_all(&d, bytes, 2 * made - 2, &packet), 0);
    CHECK_EQUAL(errors(&d), 1);
}

TEST(finds_its_way_back)
{
    eits_link_decoder d = fresh();
    eits_link_packet packet = {.type = 0};
    uint32_t wanted = 0, seen = 0;
    for (uint32_t k = 0; k < 2000; ++k) {
        const size_t garbage = next_random() % 40;
        uint8_t bytes[40];
        for (size_t i = 0; i < garbage; ++i)
            bytes[i] = (uint8_t)(next_random() >> 24);
        seen += (uint32_t)feed_all(&d, bytes, garbage, &packet);
        const size_t made = eits_link_encode(wire, sizeof wire, 1, k, bytes, garbage / 2, NULL, 0);
        const int found = feed_all(&d, wire, made, &packet);
        wanted += 1;
        seen += (uint32_t)found;
        CHECK(found == 1 && packet.sequence == k && packet.size == garbage / 2);
    }
    CHECK_EQUAL(seen, wanted);
    CHECK_EQUAL(d.packets, wanted);
    CHECK(errors(&d) > 1000);
}

TEST(longer_than_the_buffer)
{
    static _Alignas(8) uint8_t small[8 + 4 + 32];
    eits_link_decoder d;
    eits_link_packet packet = {.type = 0};
    CHECK_OK(eits_link_decoder_init(&d, small, sizeof small));
    for (size_t size = 30; size <= 500; ++size) {
        fill(size, size % 2 ? 3 : 0);
        const uint32_t before = d.overruns, packets = d.packets;
        const size_t made = encode(1, 1, size);
        CHECK_EQUAL(feed_all(&d, wire, made, &packet), size <= 32);
        CHECK_EQUAL(d.overruns - before, size > 32);
        CHECK_EQUAL(d.packets - packets, size <= 32);
    }
    CHECK_EQUAL(d.crc_errors + d.framing_errors + d.version_errors, 0);
    memset(other, 1, sizeof other); /* a line that never falls silent */
    const uint32_t before = d.overruns;
    for (int k = 0; k < 10; ++k)
        CHECK_EQUAL(feed_all(&d, other, sizeof other, &packet), 0);
    CHECK_EQUAL(d.overruns - before, 1);
    const size_t made = encode(8, 1, 32);
    CHECK_EQUAL(feed_all(&d, wire, made, &packet), 1);
}

TEST(other_versions)
{
    eits_link_decoder d = fresh();
    eits_link_packet packet = {.type = 0};
    for (unsigned version = 0; version < 256; ++version) {
        const size_t made = plainly(wire, (uint8_t)version, 1, 1, (const uint8_t *)"text", 4);
        CHECK_EQUAL(feed_all(&d, wire, made, &packet), version == EITS_LINK_VERSION);
        CHECK(version == EITS_LINK_VERSION || d.other_version == version);
    }
    CHECK_EQUAL(d.version_errors, 255);
    CHECK_EQUAL(errors(&d), 255);
}

/* The length in the head is another check; the checksum alone would let these pass. */
TEST(wrong_length_in_the_head)
{
    uint8_t packet_bytes[16] = {EITS_LINK_VERSION, 1, 5, 0, 0, 0, 0, 0, 1, 2, 3, 4};
    const size_t at = stuff(wire, packet_bytes, 12);
    eits_link_decoder d = fresh();
    eits_link_packet packet = {.type = 0};
    CHECK_EQUAL(feed_all(&d, wire, at, &packet), 0);
    CHECK_EQUAL(d.framing_errors, 1);
    CHECK_EQUAL(errors(&d), 1);
}

TEST(shorter_than_a_packet)
{
    eits_link_decoder d = fresh();
    eits_link_packet packet = {.type = 0};
    for (size_t size = 1; size <= 11; ++size) {
        memset(wire, 7, sizeof wire);
        wire[0] = (uint8_t)(size + 1);
        wire[size + 1] = 0;
        CHECK_EQUAL(feed_all(&d, wire, size + 2, &packet), 0);
        CHECK_EQUAL(d.framing_errors, (int)size);
    }
    CHECK_EQUAL(errors(&d), 11);
}

/* However the bytes come, what comes out is the same. */
TEST(by_bytes_and_by_blocks)
{
    static uint8_t line[60000];
    size_t length = 0;
    while (length + 1200 < sizeof line) {
        const size_t size = next_random() % 900;
        fill(size, 3);
        length += eits_link_encode(line + length, sizeof line - length, (uint8_t)size,
                                   next_random(), payload, size, NULL, 0);
        if (next_random() % 4 == 0)
            line[length - 2 - next_random() % 10] ^= (uint8_t)(1 + next_random() % 255);
    }
    static _Alignas(8) uint8_t second[EITS_LINK_MAX_PACKET];
    eits_link_decoder bytes, blocks = fresh();
    CHECK_OK(eits_link_decoder_init(&bytes, second, sizeof second));
    size_t at = 0, by_bytes = 0;
    while (at < length) {
        eits_link_packet packet, single = {.payload = NULL};
        const size_t max = 1 + next_random() % 700;
        const size_t taken =
            eits_link_feed(&blocks, line + at, at + max < length ? max : length - at, &packet);
        for (size_t k = 0; k < taken; ++k) {
            CHECK_EQUAL(eits_link_feed(&bytes, line + at + k, 1, &single), 1);
            CHECK(k + 1 == taken || !single.payload);
        }
        at += taken;
        CHECK((packet.payload != NULL) == (single.payload != NULL));
        if (packet.payload && single.payload) {
            ++by_bytes;
            CHECK(packet.type == single.type && packet.sequence == single.sequence &&
                  packet.size == single.size);
            CHECK(memcmp(packet.payload, single.payload, packet.size) == 0);
        }
    }
    CHECK(by_bytes > 50 && bytes.packets == by_bytes && blocks.packets == by_bytes);
    CHECK(errors(&bytes) == errors(&blocks) && errors(&bytes) > 5);
    CHECK(bytes.crc_errors == blocks.crc_errors && bytes.framing_errors == blocks.framing_errors);
    eits_link_packet packet = {.type = 1};
    CHECK_EQUAL(eits_link_feed(&bytes, line, 0, &packet), 0);
    CHECK(packet.payload == NULL);
}

RUN_TESTS("link")
