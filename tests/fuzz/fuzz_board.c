/* The firmware on a fake board: a script of commands with odd fields, bytes that are no packets,
 * hostile but sealed models, faults of buses, flash, converter and link, and power that goes at any
 * write to the flash. Before each input the board is one of some that were started beforehand.
 *
 * It must hold of every script: lines are switched break before make, and between two electrodes;
 * no current flows where no host is heard; what is locked stays as it is, over a power cut too;
 * nothing is programmed over what was not erased, or into the bank in use; every number that is
 * sent is finite, every packet of its size and in order; where a model was open before the power
 * went, one is open after it; and once the faults are gone, the board scans, its model passes its
 * self-test, and it answers. */
#include "fuzz.h"

#include "app/instrument.h"
#include "app/link/tracks.h"
#include "app/solve/tracker.h"
#include "fake_board.h"
#include "skin_model.h"
#include "small_model.h"

#include <math.h>

enum { STARTS = 4, MODELS = 6, MODEL_BYTES = 12288, MAX_BURSTS = 500, MAX_OPS = 40 };

typedef struct machine {
    fw_instrument instrument;
    uint32_t request, sequence, expected;
    bool known; /* the board's sequence number */
    double volts, skew;
} machine;

static fake_board fake;
static machine m;
/* what is copied: everything but the wires, which are empty between two turns */
enum { BOARD_BYTES = offsetof(fake_board, to_board) };
static struct {
    _Alignas(64) uint8_t board[sizeof(fake_board)];
    machine m;
} start[STARTS];
static skin_model model[MODELS];
static uint32_t bursts_left;
static bool worn; /* a cell of the bank that is not in use has gone to 0 */
static eits_packet_reply last_reply;

/* ---- what the board sends ---- */

static void check_finite(const uint8_t *at, size_t count)
{
    for (size_t k = 0; k < count; ++k) {
        float value;
        memcpy(&value, at + 4 * k, sizeof value);
        MUST(isfinite(value));
    }
}

static void check_touches(const uint8_t *at, uint32_t count)
{
    for (; count > 0; --count, at += sizeof(eits_packet_touch))
        check_finite(at + 4, sizeof(eits_packet_touch) / 4 - 1);
}

static void check_solved(const eits_link_packet *packet)
{
    eits_packet_solved head;
    MUST(packet->size >= sizeof head);
    memcpy(&head, packet->payload, sizeof head);
    const uint8_t *rest = packet->payload + sizeof head;
    const bool image = packet->type == EITS_PACKET_IMAGE;
    MUST(packet->size == sizeof head + head.count * (image ? 4 : sizeof(eits_packet_touch)));
    MUST(image || head.count <= EITS_MAX_TOUCHES);
    MUST(isfinite(head.gap_rel) && isfinite(head.residual) && isfinite(head.data_norm));
    if (image)
        check_finite(rest, head.count);
    else
        check_touches(rest, head.count);
}

static void check_followed(const eits_link_packet *packet)
{
    eits_packet_drive_touches head;
    MUST(packet->size >= sizeof head);
    memcpy(&head, packet->payload, sizeof head);
    const size_t one = sizeof(eits_packet_drive_touch);
    MUST(head.count <= EITS_FAST_TOUCHES && packet->size == sizeof head + head.count * one);
    for (uint32_t k = 0; k < head.count; ++k)
        check_finite(packet->payload + sizeof head + k * one + 4, one / 4 - 1);
}

static const char *name_of(uint8_t type)
{
    static const struct {
        uint8_t type;
        const char *name;
    } known[] = {{EITS_PACKET_INFO, "info"},     {EITS_PACKET_STATS, "stats"},
                 {EITS_PACKET_HASHES, "hashes"}, {EITS_PACKET_RAW, "raw"},
                 {EITS_PACKET_IMAGE, "image"},   {EITS_PACKET_TOUCHES, "touches"},
                 {EITS_PACKET_EVENTS, "events"}, {EITS_PACKET_REPLY, "replies"},
                 {EITS_PACKET_FAULT, "faults"},  {EITS_PACKET_DRIVE_TOUCHES, "followed"}};
    for (size_t k = 0; k < sizeof known / sizeof known[0]; ++k) {
        if (known[k].type == type)
            return known[k].name;
    }
    return "other";
}

/* Rows without a number have NaN; the program's version is no business of a sum. */
static void note_packet(const eits_link_packet *packet)
{
    const char *name = name_of(packet->type);
    const uint8_t *payload = packet->payload;
    size_t from = 0;
    fuzz_note(name, &packet->sequence, sizeof packet->sequence);
    if (packet->type == EITS_PACKET_RAW) {
        eits_packet_raw head;
        memcpy(&head, payload, sizeof head);
        fuzz_note(name, payload, sizeof head);
        fuzz_note_floats(name, payload + sizeof head, head.n_rows);
        from = sizeof head + 4u * head.n_rows;
    } else if (packet->type == EITS_PACKET_INFO) {
        from = offsetof(eits_packet_info, board);
    }
    fuzz_note(name, payload + from, packet->size - from);
}

static void check_packet(const eits_link_packet *packet)
{
    const uint8_t *payload = packet->payload;
    const size_t size = packet->size;
    if (packet->type == EITS_PACKET_RAW) {
        eits_packet_raw head;
        MUST(size >= sizeof head);
        memcpy(&head, payload, sizeof head);
        MUST(size == sizeof head + 5u * head.n_rows);
        for (uint32_t i = 0; i < head.n_rows; ++i) { /* NaN if the quality gives a reason */
            float value;
            memcpy(&value, payload + sizeof head + 4 * i, 4);
            MUST(isfinite(value) ||
                 (isnan(value) && payload[sizeof head + 4 * head.n_rows + i] != 0));
        }
    } else if (packet->type == EITS_PACKET_IMAGE || packet->type == EITS_PACKET_TOUCHES) {
        check_solved(packet);
    } else if (packet->type == EITS_PACKET_DRIVE_TOUCHES) {
        check_followed(packet);
    } else if (packet->type == EITS_PACKET_EVENTS) {
        const size_t head = sizeof(eits_packet_events), one = sizeof(eits_packet_event);
        MUST(size >= head && (size - head) % one == 0);
        for (size_t at = head; at < size; at += one)
            check_finite(payload + at + offsetof(eits_packet_event, x_mm),
                         (one - offsetof(eits_packet_event, x_mm)) / 4);
    } else if (packet->type == EITS_PACKET_REPLY) {
        eits_packet_reply reply;
        MUST(size == sizeof reply);
        memcpy(&reply, payload, sizeof reply);
        if (reply.request == m.request) /* a tare's comes when it is done */
            last_reply = reply;
    } else if (packet->type == EITS_PACKET_FAULT) {
        eits_packet_fault fault;
        MUST(size == sizeof fault);
        memcpy(&fault, payload, sizeof fault);
        MUST(fault.code > 0 && fault.code < EITS_FAULTS && fault.raised <= 1);
    } else {
        MUST(packet->type == EITS_PACKET_INFO || packet->type == EITS_PACKET_STATS ||
             packet->type == EITS_PACKET_HASHES);
    }
}

/* A packet that was dropped because the queue was full has used up a sequence number. */
static void listen(void)
{
    static eits_link_decoder decoder;
    static _Alignas(8) uint8_t room[EITS_LINK_MAX_PACKET + 4];
    MUST(eits_link_decoder_init(&decoder, room, sizeof room) == EITS_OK);
    for (size_t at = 0; at < fake.to_host_size;) {
        eits_link_packet packet;
        at += eits_link_feed(&decoder, fake.to_host + at, fake.to_host_size - at, &packet);
        if (packet.payload == NULL)
            continue;
        MUST(!m.known || (int32_t)(packet.sequence - m.expected) >= 0);
        m.known = true;
        m.expected = packet.sequence + 1;
        check_packet(&packet);
        note_packet(&packet);
    }
    MUST(decoder.crc_errors + decoder.framing_errors + decoder.version_errors + decoder.overruns ==
         0);
    fake.to_host_size = 0;
}

/* ---- the board ---- */

static double volts(void *user, const uint8_t electrodes[4], uint64_t at_ns)
{
    (void)user, (void)at_ns;
    /* the enables are on: no line has both of its multiplexers at one electrode */
    MUST(electrodes[0] != electrodes[1] && electrodes[2] != electrodes[3]);
    const int code = electrodes[0] * 5 + electrodes[1] * 3 + electrodes[2] * 7 + electrodes[3] * 11;
    return m.volts * (0.2 + code % 17 * 0.03) + m.skew * (code % 5);
}

static void check_board(void)
{
    const fw_scan_settings *s = &m.instrument.acquire.settings;
    const uint32_t pins[] = {fake.spi_calls, fake.lines_calls, fake.bursts, fake.flash_steps,
                             fake.erases,    fake.feeds,       fake.resets, fake.leds};
    fuzz_note("pins", pins, sizeof pins);
    fuzz_note("pins", &fake.generator, sizeof fake.generator);
    fuzz_note("pins", fake.selected[0], 4);
    MUST(s->samples >= 4 && s->samples <= FW_MAX_SAMPLES && s->settle_us <= 50000);
    /* at 350 uA, 100 uA for each kilohertz */
    MUST(s->excitation_millihz >= 3500000 && s->excitation_millihz <= 250000000);
    MUST(fw_whole_periods(s->excitation_millihz, s->sample_rate_hz, s->samples));
    MUST(fake.monitor.violation == NULL);
    fake.monitor.needs_host = (m.instrument.safety.owner.settings & EITS_SETTING_KEEP_CURRENT) == 0;
    MUST(fake.rewrites == 0 || worn);
    MUST(!m.instrument.link.upload.begun || !m.instrument.solve.engine.open ||
         m.instrument.link.upload.bank != m.instrument.solve.models.bank);
}

static void power_up(void)
{
    fake_restart(&fake);
    m.known = false;
    fake.monitor.needs_host = false; /* until it is known what the owner wants */
    fw_instrument_init(&m.instrument, &fake.board);
    listen();
}

/* Nobody holds the button: the lock stays, no upload begins, no excitation gives more current. */
static void check_lock(const fw_instrument *before)
{
    const fw_instrument *now = &m.instrument;
    if ((before->safety.owner.settings & EITS_SETTING_LOCKED) == 0 || fake.button)
        return;
    MUST(now->safety.owner.settings == before->safety.owner.settings);
    MUST(now->safety.owner.current_limit_ua_rms == before->safety.owner.current_limit_ua_rms);
    MUST(now->safety.owner.source_ua == before->safety.owner.source_ua);
    MUST(now->safety.owner.gain_ppm == before->safety.owner.gain_ppm);
    MUST(memcmp(now->safety.owner.name, before->safety.owner.name, EITS_NAME_CHARACTERS) == 0);
    MUST(now->link.upload.begun <= before->link.upload.begun);
    MUST(now->acquire.settings.excitation_millihz >= before->acquire.settings.excitation_millihz);
}

static void turn(void)
{
    static fw_instrument before;
    before.safety.owner = m.instrument.safety.owner;
    before.link.upload = m.instrument.link.upload;
    before.acquire.settings = m.instrument.acquire.settings;
    if (!fw_instrument_step(&m.instrument))
        fake_wait(&fake);
    listen();
    check_board();
    check_lock(&before);
    if (m.instrument.link.reset_wanted)
        power_up();
}

static void run(uint32_t bursts)
{
    for (; bursts > 0 && bursts_left > 0; --bursts, --bursts_left)
        turn();
}

/* Lets the board read all that was sent: it takes 256 bytes per turn. */
static void hear_out(void)
{
    while (fake.to_board_size > 0)
        turn();
}

static void send(uint8_t type, const void *payload, size_t size)
{
    fake.to_board_size +=
        eits_link_encode(fake.to_board + fake.to_board_size, FAKE_WIRE - fake.to_board_size, type,
                         m.sequence++, payload, size, NULL, 0);
    hear_out();
}

/* ---- commands ---- */

#define USUAL(type, ...)               \
    do {                               \
        const type c = {__VA_ARGS__};  \
        memcpy(payload, &c, sizeof c); \
        return sizeof c;               \
    } while (0)

/* A command as hosts send it; the request follows. */
static size_t usual(uint8_t type, uint8_t *payload)
{
    switch (type) {
    case EITS_PACKET_STREAM:
        USUAL(eits_command_stream, .what = fw_tracker_possible(&m.instrument.solve) ? 31 : 15,
              .every = 1);
    case EITS_PACKET_TARE:
        USUAL(eits_command_tare, .frames = 4);
    case EITS_PACKET_SCAN:
        USUAL(eits_command_scan, .excitation_millihz = 250000000, .sample_rate_hz = 1000000,
              .samples = 4, .settle_us = 2, .check_every = 1);
    case EITS_PACKET_SOLVER:
        USUAL(eits_command_solver, .iterations = 6, .max_touches = 3, .lambda_rel = 0.1f,
              .diagnostics = EITS_DIAGNOSTICS_ALL);
    case EITS_PACKET_MODEL_BEGIN:
        USUAL(eits_command_model_begin, .bytes = (uint32_t)model[1].size, .crc = model[1].crc);
    case EITS_PACKET_MODEL_DATA:
        memcpy(payload + 8, model[1].blob, 64);
        return 8 + 64;
    case EITS_PACKET_GET_STATS:
        USUAL(eits_command_get_stats, .reset = 1);
    case EITS_PACKET_SETTINGS:
        USUAL(eits_command_settings, .settings = EITS_SETTING_LOCKED | EITS_SETTING_SENSE,
              .name = "left");
    case EITS_PACKET_MASK_ROW:
        USUAL(eits_command_mask_row, .row = 2, .masked = 1);
    default:
        USUAL(eits_command_plain, 0);
    }
}

static uint32_t odd_number(fuzz_bytes *in)
{
    static const uint32_t odd[] = {0,          1,          2,          3,          4,
                                   0x7F,       0x100,      0x7FFF,     0xFFFF,     0x10000,
                                   0x7FFFFFFF, 0x80000000, 0xFFFFFFFF, 0x7FC00000, 0x7F800000,
                                   0xFF800000, 0x3F800000, 0xBF800000, 0x00000001, 0x00800000,
                                   0x7F7FFFFF, 600000000,  250000000,  5000000};
    const uint8_t which = fuzz_u8(in);
    return which < sizeof odd / sizeof odd[0] ? odd[which] : which < 128 ? which : fuzz_u32(in);
}

static void command(fuzz_bytes *in)
{
    static uint8_t payload[512];
    memset(payload, 0, sizeof payload);
    const uint8_t type = (uint8_t)(EITS_PACKET_GET_INFO + fuzz_u8(in) % 20), how = fuzz_u8(in);
    size_t size = usual(type, payload);
    for (uint32_t patches = how & 3u; patches > 0; --patches) {
        const uint32_t at = fuzz_u8(in) % 80, bytes = fuzz_u8(in) % 2 ? 4 : 2;
        const uint32_t value = odd_number(in);
        memcpy(payload + at, &value, bytes);
    }
    if (how & 4)
        size = fuzz_u8(in);
    const uint32_t request = (how & 8) != 0 ? m.request : ++m.request;
    memcpy(payload, &request, sizeof request);
    const bool heard = fake.host_room == SIZE_MAX;
    last_reply.status = UINT16_MAX;
    send(type, payload, size);
    /* these are answered by packets of their own, later, or not at all */
    if (type == EITS_PACKET_GET_INFO || type == EITS_PACKET_GET_STATS || type == EITS_PACKET_TARE ||
        type == EITS_PACKET_GET_HASHES || type == EITS_PACKET_KEEPALIVE)
        return;
    MUST(!heard || size < 4 || (last_reply.status != UINT16_MAX && last_reply.request == request));
}

/* ---- models ---- */

/* Numbers of any bits in a model that is sealed, and whose golden image is what the core gives. */
static size_t hostile_model(fuzz_bytes *in, uint8_t *blob)
{
    static _Alignas(64) uint8_t room[FAKE_WORKSPACE];
    static const char *const sections[] = {"DEFS", "VREF", "REDU", "SENS",
                                           "COLW", "GOLD", "DIMS", "PROT"};
    const uint8_t how = fuzz_u8(in);
    const skin_model *from = &model[how % MODELS];
    const small_model made = {.blob = blob, .size = from->size};
    memcpy(blob, from->blob, from->size);
    for (uint32_t patches = how / MODELS % 8; patches > 0; --patches) {
        uint32_t bytes;
        uint8_t *section = small_model_section(&made, sections[fuzz_u8(in) % 8], &bytes);
        const uint32_t at = fuzz_u8(in) * 4u % bytes;
        small_put_u32(section + at, odd_number(in));
    }
    /* longer ones are a matter of patience */
    uint8_t *iterations = small_model_section(&made, "DEFS", NULL);
    small_put_u32(iterations, 1 + (small_get_u32(iterations) - 1) % 20);
    eits_model open;
    eits_context *ctx;
    eits_real difference;
    uint32_t rows = small_get_u32(small_model_section(&made, "DIMS", NULL) + 4);
    small_put_u32(blob + 12, eits_crc32(0, blob + 16, from->size - 16));
    if (how < 200 && eits_model_open(&open, blob, from->size) == EITS_OK &&
        eits_workspace_size(&open, 0) <= sizeof room &&
        eits_init(room, sizeof room, &open, &ctx) == EITS_OK &&
        eits_self_test(ctx, &difference) == EITS_OK)
        memcpy(small_model_section(&made, "GOLD", NULL) + 8 * (size_t)rows, eits_get_image(ctx),
               open.n_pixels * sizeof(float));
    small_put_u32(blob + 12, eits_crc32(0, blob + 16, from->size - 16));
    return from->size;
}

/* A whole upload; how it departs from one that succeeds is in the input. */
static void upload(fuzz_bytes *in)
{
    static _Alignas(16) uint8_t blob[MODEL_BYTES];
    static uint8_t payload[8 + FW_DATA_BYTES];
    const size_t size = hostile_model(in, blob);
    const uint8_t how = fuzz_u8(in);
    eits_command_model_begin begin = {++m.request, (uint32_t)size, eits_crc32(0, blob, size)};
    send(EITS_PACKET_MODEL_BEGIN, &begin, sizeof begin);
    const size_t piece = how & 1 ? FW_DATA_BYTES : 4u + fuzz_u8(in) * 16u;
    const size_t odd = how & 2 ? fuzz_u8(in) % 8u : SIZE_MAX;
    size_t count = 0;
    for (size_t at = 0; at < size; at += piece, ++count) {
        size_t bytes = size - at < piece ? size - at : piece;
        uint32_t offset = (uint32_t)at;
        ++m.request;
        if (count == odd) {
            const uint8_t what = fuzz_u8(in);
            offset = what & 1 ? odd_number(in) : offset; /* out of order */
            bytes -= what & 2 ? bytes % 4 + 1 : 0;       /* no whole words */
            if (what & 4)                                /* twice */
                at = at >= piece ? at - piece : at;
            blob[at] ^= what & 8; /* another than was announced */
            if (what & 16)
                run(fuzz_u8(in));
            if (what & 32)
                command(in);
        }
        memcpy(payload, &m.request, 4);
        memcpy(payload + 4, &offset, 4);
        memcpy(payload + 8, blob + at, bytes);
        send(EITS_PACKET_MODEL_DATA, payload, 8 + bytes);
    }
    const eits_command_plain commit = {++m.request};
    if ((how & 4) == 0)
        send(EITS_PACKET_MODEL_COMMIT, &commit, sizeof commit);
}

/* ---- faults ---- */

static void heal(void)
{
    fake.spi_fails = fake.lines_fails = fake.lose = 0;
    fake.host_room = SIZE_MAX;
    fake.stalled = false;
    fake.late_once_ns = 0;
    fake.erase_status = fake.program_status = fake.configure_status = FW_OK;
    fake.cut_at = 0;
}

static void break_something(fuzz_bytes *in)
{
    const uint8_t what = fuzz_u8(in), count = fuzz_u8(in);
    switch (what % 14) {
    case 0:
        fake.spi_fail_from = fake.spi_calls + (what >> 4), fake.spi_fails = count;
        break;
    case 1:
        fake.lines_fail_from = fake.lines_calls + (what >> 4), fake.lines_fails = count;
        break;
    case 2:
        fake.host_room = count * 8u;
        break;
    case 3:
        fake.erase_status = count & 1 ? FW_E_FLASH : FW_OK;
        break;
    case 4:
        fake.program_status = count & 1 ? FW_E_FLASH : FW_OK;
        break;
    case 5:
        fake.lose = count;
        break;
    case 6:
        fake.stalled = count & 1;
        break;
    case 7:
        fake.late_once_ns = count * 1000u;
        break;
    case 8:
        fake.configure_status = count & 1 ? FW_E_RANGE : FW_OK;
        break;
    case 9: /* flash wears out */
        fake.bank[m.instrument.solve.engine.open ? 1u - m.instrument.solve.models.bank : what >> 7]
                 [count * 64u % FAKE_BANK] &= (uint8_t)~(1u << (what >> 4 & 7));
        worn = true;
        break;
    case 10:
        fake.noise_codes = count * 4;
        break;
    case 11:
        fake.button = count & 1;
        break;
    case 12:
        fake.current_ua = count * 4u;
        break;
    default:
        fake.cut_at = fake.flash_steps + 1u + count * (what >> 4);
        break;
    }
}

static void script(fuzz_bytes *in)
{
    for (uint32_t ops = 0; in->at < in->end && ops < MAX_OPS; ++ops) {
        switch (fuzz_u8(in) % 10) {
        case 0:
        case 1:
        case 2:
            command(in);
            break;
        case 3:
        case 4:
            run(fuzz_u8(in));
            break;
        case 5:
            upload(in);
            break;
        case 6:
            break_something(in);
            break;
        case 7: /* the skin */
            m.volts = fuzz_u8(in) * 0.02;
            m.skew = ((int)fuzz_u8(in) - 128) * 0.002;
            break;
        case 8: { /* no packets */
            uint8_t count = fuzz_u8(in) % 24;
            while (count-- > 0)
                fake.to_board[fake.to_board_size++] = fuzz_u8(in);
            hear_out();
            break;
        }
        default:
            if (fuzz_u8(in) & 1)
                power_up();
            else
                heal();
            break;
        }
    }
}

/* ---- before and after ---- */

static void take_model(int k, void *memory, const uint8_t *blob, size_t size)
{
    MUST(size <= MODEL_BYTES);
    model[k] = (skin_model){memory, (uint8_t *)(uintptr_t)blob, size, eits_crc32(0, blob, size)};
}

static void tell(uint8_t type)
{
    uint8_t payload[128] = {0};
    const size_t size = usual(type, payload);
    ++m.request;
    memcpy(payload, &m.request, 4);
    send(type, payload, size);
}

static void prepare(void)
{
    const skin_spec
        few = {.electrodes = 5, .drive_step = 1, .measure_step = 1, .rank = 4, .side = 3},
        more = {.electrodes = 6,
                .drive_step = 1,
                .measure_step = 1,
                .rank = 6,
                .side = 4,
                .turned = 4},
        skip = {.electrodes = 8, .drive_step = 4, .measure_step = 1, .rank = 5, .side = 4};
    model[0] = skin_model_make(&few);
    model[1] = skin_model_make(&more);
    model[2] = skin_model_make(&skip);
    for (int k = 3; k < MODELS; ++k) {
        const small_spec spec = {.rank = 4,
                                 .side = 3,
                                 .storage = (eits_storage)(k - 2),
                                 .kind = (eits_data_kind)(k - 3),
                                 .shape = SMALL_WHITENED,
                                 .fields = k == 4};
        const small_model made = small_model_make(spec);
        take_model(k, made.memory, made.blob, made.size);
    }
    for (int k = 0; k < STARTS; ++k) {
        m = (machine){.volts = 1};
        fake_init(&fake, 4294900000u); /* the clock wraps within a second */
        fake.volts = volts;
        if (k > 0)
            fake_put_model(&fake, 0, 1, model[0].blob, model[0].size);
        if (k == 2)
            fake_put_model(&fake, 1, 2, model[1].blob, model[1].size);
        power_up();
        bursts_left = UINT32_MAX;
        tell(EITS_PACKET_SCAN);
        if (k > 1) {
            tell(EITS_PACKET_TARE);
            while (last_reply.request != m.request)
                turn();
            MUST(last_reply.status == EITS_REPLY_OK);
            tell(EITS_PACKET_STREAM);
        }
        if (k == 3) {
            m.volts = 1.1;
            run(30);
        }
        memcpy(start[k].board, &fake, sizeof fake);
        start[k].m = m;
    }
}

static void pass_ms(uint32_t ms)
{
    fake.now_ns += ms * 1000000ull;
    fake.slot_ns += ms * 1000000ull; /* no bursts meanwhile */
    turn();
}

/* All that was broken is mended: the board must work again. */
static void check_end(void)
{
    heal();
    m.volts = 1;
    const bool open = m.instrument.solve.engine.open;
    fake.current_ua = 0;
    /* the host falls silent; an upload that nobody ends */
    for (uint32_t k = 0; k < 14; ++k)
        pass_ms(k < 12 ? 90 : 11000);
    MUST(m.instrument.solve.engine.open == open);
    MUST(!m.instrument.link.upload.active);
    const bool kept = (m.instrument.safety.owner.settings & EITS_SETTING_KEEP_CURRENT) != 0;
    MUST(kept || !m.instrument.acquire.scan.running);
    tell(EITS_PACKET_CLEAR_FAULTS); /* a limit of the current that tripped */
    tell(EITS_PACKET_STREAM);
    tell(EITS_PACKET_TARE);
    pass_ms(1);
    MUST(m.instrument.acquire.scan.running == open);
    const bool tare = m.instrument.solve.tare.active; /* may end in the turn that answers */
    tell(EITS_PACKET_SELF_TEST);
    MUST(last_reply.request == m.request);
    const uint16_t status = last_reply.status;
    if (!open)
        MUST(status == EITS_REPLY_NO_MODEL);
    else
        MUST(status == EITS_REPLY_OK || (tare && status == EITS_REPLY_BUSY));
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static bool ready;
    if (!ready) {
        prepare();
        fuzz_end_input();
    }
    ready = true;
    static fuzz_bytes in; /* of before the power went, too */
    in = (fuzz_bytes){data, data + size};
    const uint8_t which = fuzz_u8(&in) % STARTS;
    memcpy(&fake, start[which].board, BOARD_BYTES);
    fake.to_board_size = fake.to_board_at = fake.to_host_size = 0;
    m = start[which].m;
    bursts_left = MAX_BURSTS;
    worn = false;
    /* after a loss of power the rest of the input continues */
    if (setjmp(fake.cut) != 0) {
        const bool was_open = m.instrument.solve.engine.open;
        const bool locked =
            (m.instrument.safety.owner.settings & EITS_SETTING_LOCKED) != 0 && !fake.button;
        power_up();
        MUST(!locked || (m.instrument.safety.owner.settings & EITS_SETTING_LOCKED) != 0);
        MUST(m.instrument.solve.engine.open || !was_open);
    }
    script(&in);
    check_end();
    return 0;
}
