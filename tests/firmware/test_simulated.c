/* The simulated board by itself: it measures the frames that it is shown, in order, on a clock that
 * runs only while frames are wanted. */
#include "app/link/scanning.h"
#include "bench.h"
#include "check.h"
#include "simulated.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { BANK = 128 * 1024, WORKSPACE = 192 * 1024, UNTOUCHED = 4, FRAMES = 3, ROWS = 208 };

typedef struct rig {
    _Alignas(16) uint8_t bank[FW_BANKS][BANK];
    _Alignas(16) uint8_t workspace[WORKSPACE];
    sim_board sim;
    eits_link_decoder decoder;
    _Alignas(8) uint8_t decoding[EITS_LINK_MAX_PACKET + 4];
    eits_packet_raw head; /* of the last RAW */
    float raw[ROWS];
    uint32_t raws, replies, refused, sequence;
} rig;

static rig a, b;
static bench source; /* of the model and of voltages */
static float volts[(UNTOUCHED + FRAMES) * ROWS];

static void collect(rig *r)
{
    uint8_t bytes[1000];
    for (size_t size; (size = sim_read(&r->sim, bytes, sizeof bytes)) > 0;) {
        for (size_t at = 0; at < size;) {
            eits_link_packet packet;
            at += eits_link_feed(&r->decoder, bytes + at, size - at, &packet);
            if (packet.payload != NULL && packet.type == EITS_PACKET_RAW) {
                memcpy(&r->head, packet.payload, sizeof r->head);
                memcpy(r->raw, packet.payload + sizeof r->head, sizeof r->raw);
                ++r->raws;
            } else if (packet.payload != NULL && packet.type == EITS_PACKET_REPLY) {
                eits_packet_reply reply;
                memcpy(&reply, packet.payload, sizeof reply);
                ++r->replies;
                r->refused += reply.status != EITS_REPLY_OK;
            }
        }
    }
}

static void send(rig *r, eits_packet_type type, const void *payload, size_t size)
{
    uint8_t bytes[100];
    const size_t sent =
        eits_link_encode(bytes, sizeof bytes, (uint8_t)type, r->sequence++, payload, size, NULL, 0);
    sim_write(&r->sim, bytes, sent);
    collect(r);
}

static void stream(rig *r, uint16_t what, uint32_t frames)
{
    const eits_command_stream c = {
        .request = r->sequence + 1, .what = what, .every = 1, .frames = frames};
    send(r, EITS_PACKET_STREAM, &c, sizeof c);
}

static void start_given(rig *r, uint32_t period_us, bool frames_given)
{
    memset(r, 0, sizeof *r);
    memset(r->bank, 0xFF, sizeof r->bank);
    fake_put_model(&source.board, 0, 1, source.model.blob, source.model.size);
    memcpy(r->bank[0], source.board.bank[0], BANK);
    CHECK_EQUAL(eits_link_decoder_init(&r->decoder, r->decoding, sizeof r->decoding), EITS_OK);
    const sim_setup setup = {.name = "simulated",
                             .serial = "5",
                             .frames_given = frames_given,
                             .frame_period_us = period_us,
                             .banks = {r->bank[0], r->bank[1]},
                             .bank_bytes = BANK,
                             .workspace = r->workspace,
                             .workspace_bytes = WORKSPACE};
    sim_init(&r->sim, &setup);
    collect(r);
}

static void start(rig *r, uint32_t period_us)
{
    start_given(r, period_us, false);
}

static void show(rig *r, double rate_hz)
{
    uint32_t bytes, crc;
    CHECK(sim_model(&r->sim, &bytes, &crc) == r->bank[0]);
    CHECK_EQUAL(bytes, source.model.size);
    CHECK_EQUAL(crc, source.model.crc);
    float largest_v = 0;
    for (uint32_t k = 0; k < (UNTOUCHED + FRAMES) * ROWS; ++k)
        largest_v = fmaxf(largest_v, fabsf(volts[k]));
    sim_show(&r->sim, largest_v, UNTOUCHED, FRAMES, rate_hz);
    sim_put(&r->sim, volts, 0, UNTOUCHED + FRAMES);
}

/* The number of the frame that was measured, by its scale; -1: none of them. */
static int shown(const rig *r)
{
    const float step = 1e-6f * (float)r->sim.board.capture.reference_uv / 65536;
    for (int k = 0; k < UNTOUCHED + FRAMES; ++k) {
        float worst = 0;
        for (uint32_t i = 0; i < ROWS; ++i)
            worst = fmaxf(worst, fabsf(fabsf(r->raw[i]) - fabsf(volts[k * ROWS + (int)i])));
        if (worst < step)
            return k;
    }
    return -1;
}

static int scan(rig *r)
{
    const uint32_t before = r->raws;
    CHECK(sim_scan_frame(&r->sim));
    collect(r);
    CHECK_EQUAL(r->raws, before + 1);
    return shown(r);
}

TEST(test_frames_in_order)
{
    start(&a, 50000);
    CHECK(!sim_wants_frame(&a.sim));
    stream(&a, EITS_STREAM_RAW, 0);
    CHECK(sim_wants_frame(&a.sim));
    show(&a, 20.0);
    for (int k = 0; k < 6; ++k)
        CHECK_EQUAL(scan(&a), k % UNTOUCHED);
    const eits_command_tare tare = {.request = 77, .frames = 4};
    send(&a, EITS_PACKET_TARE, &tare, sizeof tare);
    CHECK(sim_tares(&a.sim));
    for (int k = 0; k < 4; ++k)
        CHECK_EQUAL(scan(&a), k); /* from the first again */
    CHECK(!sim_tares(&a.sim));
    const uint32_t last_us = a.head.time_us;
    sim_begin_scene(&a.sim);
    for (int k = 0; k < FRAMES; ++k) {
        CHECK(!sim_scene_over(&a.sim));
        CHECK_EQUAL(scan(&a), UNTOUCHED + k);
        CHECK_EQUAL(a.head.time_us, last_us + 50000u * (uint32_t)(k + 1));
        CHECK_EQUAL(a.head.scan_us, 207 * 100 + 80);
    }
    CHECK(sim_scene_over(&a.sim));
    CHECK_EQUAL(scan(&a), UNTOUCHED + FRAMES - 1); /* the last frame is repeated */
    CHECK_EQUAL(a.refused, 0);
    CHECK_EQUAL(a.replies, 2);
}

/* Time stands still while no frames are wanted. After a restart it continues, and the model is
 * still there. */
TEST(test_time_and_restart)
{
    stream(&a, 0, 0);
    const uint64_t us = a.sim.now_us;
    CHECK(sim_scan_frame(&a.sim));
    CHECK(!sim_wants_frame(&a.sim));
    CHECK_EQUAL(a.sim.now_us, us);
    const eits_command_plain reset = {.request = 500};
    send(&a, EITS_PACKET_RESET, &reset, sizeof reset);
    CHECK_EQUAL(a.sim.now_us, us);
    CHECK(!a.sim.instrument.solve.engine.tared && a.sim.instrument.solve.engine.open);
    stream(&a, EITS_STREAM_RAW, 1);
    CHECK_EQUAL(scan(&a), UNTOUCHED + FRAMES - 1);
    CHECK(!sim_wants_frame(&a.sim));
}

/* If the scan is faster than the scene, its frames repeat. A second board has its own scene. */
TEST(test_two_boards)
{
    start(&a, 0);
    start(&b, 0);
    stream(&a, EITS_STREAM_RAW, 0);
    stream(&b, EITS_STREAM_RAW, 0);
    show(&a, 20.0);
    show(&b, 20.0);
    sim_begin_scene(&a.sim);
    for (int k = 0; k < 6; ++k) {
        const int number = (int)(k * 0.0208 * 20 + 0.5);
        CHECK_EQUAL(scan(&a), UNTOUCHED + (number < FRAMES ? number : FRAMES - 1));
        CHECK_EQUAL(scan(&b), k % UNTOUCHED);
        CHECK_EQUAL(a.head.time_us, b.head.time_us);
    }
}

/* Frames that are given one at a time lead to the same packets as all at once. Time stands still if
 * one is missing. */
TEST(test_frames_by_and_by)
{
    start(&a, 50000);
    start(&b, 50000);
    stream(&a, EITS_STREAM_RAW, 0);
    stream(&b, EITS_STREAM_RAW, 0);
    show(&a, 20.0);
    show(&b, 20.0);
    sim_put(&b.sim, volts, 0, 0);
    for (uint32_t k = 0; k < UNTOUCHED + FRAMES; ++k) {
        if (k == UNTOUCHED) {
            sim_begin_scene(&a.sim);
            sim_begin_scene(&b.sim);
        }
        CHECK_EQUAL(scan(&a), k);
        const uint64_t us = b.sim.now_us;
        CHECK(!sim_scan_frame(&b.sim));
        CHECK_EQUAL(sim_frame_wanted(&b.sim), k);
        CHECK(b.sim.now_us == us || k == 0);
        sim_put(&b.sim, volts + (size_t)k * ROWS, k, 1);
        CHECK_EQUAL(scan(&b), k);
        CHECK_EQUAL(a.head.time_us, b.head.time_us);
        CHECK(memcmp(a.raw, b.raw, sizeof a.raw) == 0);
    }
}

/* A frame that is given once is shown only in the scan for which it was made. The host can ask when
 * that scan begins, and when each row is measured. */
TEST(test_frames_of_one_scan)
{
    uint32_t delays_us[ROWS];
    start(&a, 50000);
    stream(&a, EITS_STREAM_RAW, 0);
    show(&a, 20.0);
    sim_begin_scene(&a.sim);
    sim_put(&a.sim, volts, 0, UNTOUCHED);
    CHECK(!sim_scan_frame(&a.sim));
    CHECK_EQUAL(sim_frame_wanted(&a.sim), UNTOUCHED);
    CHECK(sim_wanted_s(&a.sim) == 0);
    sim_row_delays(&a.sim, delays_us);
    for (uint32_t i = 0; i < ROWS; ++i)
        CHECK_EQUAL(delays_us[i], 100 * i);
    sim_put_once(&a.sim, volts + UNTOUCHED * ROWS, UNTOUCHED);
    CHECK_EQUAL(scan(&a), UNTOUCHED);
    CHECK(!sim_scan_frame(&a.sim));
    CHECK(sim_wanted_s(&a.sim) == 0.05);
    sim_put_once(&a.sim, volts + UNTOUCHED * ROWS, UNTOUCHED); /* not the wanted frame */
    CHECK(!sim_scan_frame(&a.sim));
    CHECK_EQUAL(sim_frame_wanted(&a.sim), UNTOUCHED + 1);
    eits_command_scan half = host_default_scan();
    half.request = 901;
    half.check_every = 0;
    send(&a, EITS_PACKET_SCAN, &half, sizeof half);
    CHECK(!sim_scan_frame(&a.sim));
    sim_row_delays(&a.sim, delays_us);
    uint32_t measured = 1; /* the first row, at 0 as those that are left out */
    for (uint32_t i = 0; i < ROWS; ++i)
        measured += delays_us[i] != 0;
    CHECK_EQUAL(measured, ROWS / 2);
}

/* Another instrument's numbers reach the host with the same bits; values that are not finite become
 * NaN. INFO has no settings of a scan, and none can be set. A fault is raised while no frames come.
 */
TEST(test_frames_given)
{
    float given[2 * ROWS] = {0};
    start_given(&a, 20000, true);
    CHECK_EQUAL(a.sim.instrument.solve.engine.open, true);
    /* no converter is known, so there is no lower bound of the noise */
    CHECK(eits_get_options(a.sim.instrument.solve.engine.ctx)->noise_floor_v == 0);
    stream(&a, EITS_STREAM_RAW, 0);
    for (uint32_t i = 0; i < ROWS; ++i)
        given[2 * i] = 1e3f * volts[i] + 1e-7f;
    sim_give_frame(&a.sim, given, 21000, 22000);
    given[2 * 3] = INFINITY;
    sim_give_frame(&a.sim, given, 23000, 22000);
    collect(&a);
    CHECK_EQUAL(a.raws, 2);
    CHECK_EQUAL(a.head.time_us, 44000);
    CHECK_EQUAL(a.sim.instrument.acquire.settings.frame_period_us, 22000);
    for (uint32_t i = 0; i < ROWS; ++i)
        CHECK(i == 3 ? isnan(a.raw[i]) : fabsf(a.raw[i]) == fabsf(given[2 * i]));
    const uint32_t stalled = 1u << EITS_FAULT_SCAN_STALLED;
    sim_let_pass(&a.sim, 1000000);
    CHECK((a.sim.instrument.safety.faults.raised & stalled) != 0);
    sim_give_frame(&a.sim, given, 20000, 22000);
    CHECK((a.sim.instrument.safety.faults.raised & stalled) == 0);
    const eits_command_scan scan = {.request = 900,
                                    .excitation_millihz = 50000000,
                                    .sample_rate_hz = 1000000,
                                    .samples = 80,
                                    .settle_us = 16,
                                    .check_every = 1};
    send(&a, EITS_PACKET_SCAN, &scan, sizeof scan);
    CHECK_EQUAL(a.sim.instrument.link.replies.reply.status, EITS_REPLY_RANGE);
    collect(&a);
    const uint32_t raws = a.raws;
    sim_give_frame(&a.sim, given, 20000, 22000);
    collect(&a);
    CHECK_EQUAL(a.raws, raws + 1);
    fw_engine_close(&a.sim.instrument.solve.engine); /* without a model no frame is taken */
    fw_acquire_stop(&a.sim.instrument.acquire);
    sim_give_frame(&a.sim, given, 20000, 22000);
    collect(&a);
    CHECK_EQUAL(a.raws, raws + 1);
}

int main(void)
{
    bench_start(&source, &SKIN_ADJACENT);
    for (uint32_t k = 0; k < UNTOUCHED + FRAMES; ++k) {
        for (uint32_t i = 0; i < ROWS; ++i)
            volts[k * ROWS + i] = (1.0f + 0.01f * (float)k) * (float)bench_volts(&source, i);
    }
    run_tests();
    bench_stop(&source);
    return checks_report("simulated");
}
