/* Mutations of .eitm models that keep what the reader checks right, most of the time: checksum,
 * protocol hash, sizes of sections. Otherwise nearly every input would end at the checksum. */
#include "fuzz.h"

enum {
    HEADER = 64,
    ENTRY = 16,
    SECTIONS = 12 /* that every model is laid out with */,
    MAX = 1 << 14
};
enum { DIMS, PROT, FOLD, VREF, REDU, SENS, COLW, GRID, DEFS, GOLD, SCAL, META, LOAD };
static const char TAGS[] = "DIMSPROTFOLDVREFREDUSENSCOLWGRIDDEFSGOLDSCALMETALOAD";

static uint32_t get(const uint8_t *at)
{
    uint32_t value;
    memcpy(&value, at, sizeof value);
    return value;
}

static void put(uint8_t *at, uint32_t value)
{
    memcpy(at, &value, sizeof value);
}

/* The section's bytes, or NULL where the table leads nowhere. */
static uint8_t *find(uint8_t *data, size_t size, int which, uint32_t *bytes)
{
    const uint32_t count = get(data + 16);
    for (uint32_t k = 0; k < count && HEADER + (size_t)ENTRY * (k + 1) <= size; ++k) {
        const uint8_t *entry = data + HEADER + (size_t)ENTRY * k;
        if (memcmp(entry, TAGS + 4 * which, 4) != 0)
            continue;
        const uint32_t offset = get(entry + 4);
        *bytes = get(entry + 8);
        return offset <= size && *bytes <= size - offset ? data + offset : NULL;
    }
    return NULL;
}

static void seal(uint8_t *data, size_t size)
{
    uint32_t dims_bytes = 0, bytes = 0;
    const uint8_t *dims = find(data, size, DIMS, &dims_bytes),
                  *table = find(data, size, PROT, &bytes);
    if (dims != NULL && dims_bytes == 64 && table != NULL && bytes / 4 >= get(dims + 4)) {
        const uint64_t hash = eits_protocol_hash(get(dims), get(dims + 4), table);
        memcpy(data + 24, &hash, sizeof hash);
    }
    const uint32_t total = get(data + 8);
    if (total >= 16 && total <= size)
        put(data + 12, eits_crc32(0, data + 16, total - 16u));
}

/* ---- other dimensions: every section again, filled with what the old one held, over and over ----
 */

static size_t sizes_for(const uint32_t d[10], uint32_t bytes[SECTIONS])
{
    static const uint32_t item[4] = {4, 2, 2, 1};
    const uint32_t m = d[1], k = d[2], stride = d[4], n = d[5], storage = d[8] % 4;
    const uint32_t made[SECTIONS] = {
        64,    4 * m, 8 * k, 4 * k,           4 * k * stride,           item[storage] * n * stride,
        4 * n, 4 * n, 64,    4 * (2 * m + n), storage >= 2 ? 4 * n : 0, 2};
    size_t total = HEADER + ENTRY * SECTIONS;
    for (int which = 0; which < SECTIONS; ++which) {
        bytes[which] = made[which];
        total += (made[which] + 15u) & ~15u;
    }
    return total;
}

static void fill(uint8_t *to, uint32_t size, const uint8_t *from, uint32_t have)
{
    for (uint32_t i = 0; i < size; ++i)
        to[i] = have > 0 ? from[i % have] : 0;
}

/* Tables whose offsets point to existing data. */
static void point_right(uint8_t *at[SECTIONS], const uint32_t d[10])
{
    const uint32_t electrodes = d[0], m = d[1], k = d[2], n = d[5], nx = d[6];
    for (uint32_t i = 0; i < 4 * m; i += 2) {
        uint8_t *pair = at[PROT] + i;
        pair[0] = (uint8_t)(pair[0] % electrodes);
        pair[1] = (uint8_t)(pair[1] % electrodes);
        if (pair[0] == pair[1])
            pair[1] = (uint8_t)((pair[1] + 1u) % electrodes);
    }
    for (uint32_t i = 0; i < k; ++i) {
        uint8_t *fold = at[FOLD] + 8 * i;
        uint16_t row[2];
        memcpy(row, fold, sizeof row);
        row[0] = (uint16_t)(row[0] % m);
        if (row[1] != EITS_FOLD_NONE)
            row[1] = (uint16_t)(row[1] % m);
        memcpy(fold, row, sizeof row);
    }
    for (uint32_t j = 0; j < n; ++j) {
        const uint16_t cell[2] = {(uint16_t)(j % nx), (uint16_t)(j / nx)};
        memcpy(at[GRID] + 4 * j, cell, sizeof cell);
    }
}

static size_t lay_out_anew(uint8_t *data, size_t size, size_t room, uint32_t seed)
{
    static uint8_t made[MAX];
    uint32_t bytes[SECTIONS], have = 0, d[10];
    const uint8_t *dims = find(data, size, DIMS, &have);
    if (dims == NULL || have != 64)
        return size;
    memcpy(d, dims, sizeof d);
    d[0] = 4 + seed % 13;
    d[1] = 1 + seed / 16 % 24;
    d[2] = 1 + seed / 512 % d[1];
    d[3] = 1 + seed / 8192 % 12;
    d[4] = (d[3] + 7u) & ~7u;
    d[6] = 1 + seed / 65536 % 5;
    d[7] = 1 + seed / 524288 % 5;
    d[5] = d[6] * d[7] - (seed >> 30 ? (seed >> 28) % (d[6] * d[7]) : 0);
    d[8] = (seed >> 22) % 4;
    d[9] = (seed >> 24) % 3;
    const size_t total = sizes_for(d, bytes);
    if (total > MAX || total > room)
        return size;
    memset(made, 0, total);
    memcpy(made, data, HEADER);
    put(made + 8, (uint32_t)total);
    put(made + 16, SECTIONS);
    uint8_t *at[SECTIONS];
    uint32_t offset = HEADER + ENTRY * SECTIONS;
    for (int which = 0; which < SECTIONS; ++which) {
        uint8_t *entry = made + HEADER + ENTRY * which;
        memcpy(entry, which == SCAL && d[8] < 2 ? "XTRA" : TAGS + 4 * which, 4);
        put(entry + 4, offset);
        put(entry + 8, bytes[which]);
        put(entry + 12, which != META && bytes[which] > 0);
        at[which] = made + offset;
        const uint8_t *old = find(data, size, which, &have);
        fill(at[which], bytes[which], old, old == NULL ? 0 : have);
        offset += (bytes[which] + 15u) & ~15u;
    }
    memcpy(at[DIMS], d, sizeof d);
    point_right(at, d);
    memcpy(data, made, total);
    return total;
}

/* ---- numbers within one section ---- */

static void set_number(uint8_t *data, size_t size, uint32_t seed)
{
    static const uint32_t odd[] = {0x00000001u, 0x80000001u, 0x007FFFFFu, 0x00800000u,
                                   0x7F7FFFFFu, 0xFF7FFFFFu, 0x7F800000u, 0x7FC00000u,
                                   0x80000000u, 0x7E967699u, 0x01000000u, 0x3F800000u,
                                   0xBF800000u, 0x5F000000u, 0x20000000u, 0u};
    static const int numbers[] = {VREF, REDU, SENS, COLW, DEFS, GOLD, SCAL, DIMS, LOAD};
    uint32_t bytes = 0;
    uint8_t *section = find(data, size, numbers[seed % 9], &bytes);
    if (section == NULL || bytes < 4)
        return;
    const uint32_t place = (seed >> 8) % (bytes / 4) * 4, power = (seed >> 3) & 31u;
    if (power < 16)
        put(section + place, odd[power]);
    else /* another unit for all of them: the exponents move */
        for (uint32_t i = 0; i + 4 <= bytes && numbers[seed % 9] != DIMS &&
                             numbers[seed % 9] != DEFS && numbers[seed % 9] != LOAD;
             i += 4) {
            const uint32_t bits = get(section + i),
                           exponent = (bits >> 23 & 255u) + (power - 24u) * 9u;
            if ((bits & 0x7F800000u) != 0 && exponent >= 1 && exponent <= 254)
                put(section + i, (bits & 0x807FFFFFu) | exponent << 23);
        }
}

static size_t mutate_section(uint8_t *data, size_t size, uint32_t seed)
{
    uint32_t bytes = 0;
    uint8_t *section = find(data, size, (int)(seed % (SECTIONS + 1u)), &bytes);
    if (section != NULL && bytes > 0) {
        const size_t kept = LLVMFuzzerMutate(section, bytes, bytes);
        memset(section + kept, 0, bytes - kept);
    }
    return size;
}

size_t LLVMFuzzerCustomMutator(uint8_t *data, size_t size, size_t room, unsigned int seed);
size_t LLVMFuzzerCustomMutator(uint8_t *data, size_t size, size_t room, unsigned int seed)
{
    const uint32_t what = seed % 16, rest = (seed / 16u) * 2654435761u;
    if (size < HEADER || what == 0)
        return LLVMFuzzerMutate(data, size, room);
    if (what < 4)
        size = LLVMFuzzerMutate(data, size, room);
    else if (what < 7)
        size = lay_out_anew(data, size, room, rest);
    else if (what < 11)
        set_number(data, size, rest);
    else
        size = mutate_section(data, size, rest);
    if (size >= HEADER && what != 1)
        seal(data, size);
    return size;
}
