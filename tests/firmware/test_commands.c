/* Commands: every status of a reply, ranges and lengths; a command that is sent again is answered
 * again and not run again. */
#include "steps.h"

#include "small_model.h"

static void check_reply(eits_packet_reply reply, eits_reply_status status, int32_t a, int32_t c,
                        int line)
{
    check_equal(reply.status, status, __FILE__, line, "status");
    check_equal(reply.detail[0], a, __FILE__, line, "detail[0]");
    check_equal(reply.detail[1], c, __FILE__, line, "detail[1]");
}
#define REPLY(reply, status, a, c) check_reply(reply, status, a, c, __LINE__)

TEST(test_lengths)
{
    const struct {
        eits_packet_type type;
        uint32_t size;
    } expected[] = {
        {EITS_PACKET_GET_INFO, 4},     {EITS_PACKET_STREAM, 12},   {EITS_PACKET_TARE, 8},
        {EITS_PACKET_SCAN, 24},        {EITS_PACKET_SOLVER, 40},   {EITS_PACKET_MODEL_BEGIN, 12},
        {EITS_PACKET_MODEL_COMMIT, 4}, {EITS_PACKET_GET_STATS, 8}, {EITS_PACKET_MASK_ROW, 8},
        {EITS_PACKET_RESET, 4},        {EITS_PACKET_SELF_TEST, 4}, {EITS_PACKET_CLEAR_FAULTS, 4}};
    for (size_t k = 0; IN_TABLE(k, expected); ++k) {
        uint8_t payload[64] = {0};
        for (uint32_t size = 4; size <= 44; ++size) {
            if (size != expected[k].size)
                REPLY(host_command(&b.host, expected[k].type, payload, size), EITS_REPLY_LENGTH,
                      (int32_t)expected[k].size, 0);
        }
    }
    uint8_t payload[16] = {0};
    REPLY(host_command(&b.host, EITS_PACKET_MODEL_DATA, payload, 8), EITS_REPLY_LENGTH, 12, 0);
    /* without a request number the answer has number 0 */
    host_forget(&b.host);
    host_send(&b.host, EITS_PACKET_STREAM, payload, 3);
    const eits_packet_reply short_one = host_reply(&b.host, 0);
    CHECK_EQUAL(short_one.status, EITS_REPLY_LENGTH);
    CHECK_EQUAL(short_one.command, EITS_PACKET_STREAM);
    CHECK_EQUAL(b.board.resets, 0);
}

TEST(test_unknown)
{
    eits_command_plain c = {0};
    REPLY(host_command(&b.host, (eits_packet_type)0x91, &c, sizeof c), EITS_REPLY_UNKNOWN_COMMAND,
          0, 0);
    REPLY(host_command(&b.host, (eits_packet_type)0xFF, &c, sizeof c), EITS_REPLY_UNKNOWN_COMMAND,
          0, 0);
    host_forget(&b.host);
    host_send(&b.host, EITS_PACKET_REPLY, &c, sizeof c); /* a board's own packet, echoed */
    host_send(&b.host, EITS_PACKET_INFO, &c, sizeof c);
    host_run(&b.host, 5);
    CHECK_EQUAL(b.host.packets, 0);
}

/* Names in INFO are cut to the field's size and padded with zeros; the board's name always ends
 * with a zero.
 */
TEST(test_names)
{
    static const char LONG[] = "abcdefghijklmnopqrstuvwxyzabcdefghijklmnopqrstuvwxyz";
    static const char SHORT[64] = "two\0hidden";
    const fw_board board = b.board.board;
    b.board.board.name = b.board.board.serial = LONG;
    eits_packet_info info = host_info(&b.host);
    CHECK(memcmp(info.board, LONG, sizeof info.board - 1) == 0 &&
          info.board[sizeof info.board - 1] == 0);
    CHECK(memcmp(info.serial, LONG, sizeof info.serial) == 0);
    b.board.board.name = b.board.board.serial = SHORT;
    info = host_info(&b.host);
    for (size_t k = 0; k < sizeof info.board; ++k)
        CHECK_EQUAL(info.board[k], k < 3 ? SHORT[k] : 0);
    for (size_t k = 0; k < sizeof info.serial; ++k)
        CHECK_EQUAL(info.serial[k], k < 3 ? SHORT[k] : 0);
    b.board.board.name = b.board.board.serial = NULL;
    info = host_info(&b.host);
    CHECK(info.board[0] == 0 && info.serial[0] == 0);
    b.board.board = board;
}

TEST(test_stream_ranges)
{
    REPLY(host_stream(&b.host, 32, 1, 0), EITS_REPLY_RANGE, 4, 31);
    REPLY(host_stream(&b.host, 1, 0, 0), EITS_REPLY_RANGE, 6, 1);
    REPLY(host_stream(&b.host, EITS_STREAM_TOUCHES, 1, 0), EITS_REPLY_NOT_TARED, 0, 0);
    CHECK_EQUAL(host_info(&b.host).streaming, 0);
}

TEST(test_tare_ranges)
{
    REPLY(host_tare(&b.host, 0), EITS_REPLY_NOT_TARED, 0, 0); /* nothing to undo */
    REPLY(host_tare(&b.host, 2), EITS_REPLY_RANGE, 4, 4);
    REPLY(host_tare(&b.host, 3), EITS_REPLY_RANGE, 4, 4);
    REPLY(host_tare(&b.host, 1025), EITS_REPLY_RANGE, 4, 1024);
    CHECK_EQUAL(host_info(&b.host).tared, 0);
}

/* The reply to the default settings with `change`, given as `s.field = value`. */
#define SCAN(change, status, a, c)                      \
    do {                                                \
        eits_command_scan s = host_default_scan();      \
        change;                                         \
        REPLY(scan_with(s), EITS_REPLY_##status, a, c); \
    } while (0)

/* A fixed row: its burst comes after that of the row before, and frames go on afterwards.
 * Electrodes that cannot be joined, and numbers out of range, are refused. */
TEST(test_probe)
{
    STREAM(EITS_STREAM_RAW, 1, 0);
    eits_command_probe c = {.before = EITS_PROBE_OPEN,
                            .joined = 0x03020001u,
                            .settle_us = 20,
                            .samples = 100,
                            .generator = 1};
    host_forget(&b.host);
    c.request = 700;
    host_send(&b.host, EITS_PACKET_PROBE, &c, sizeof c);
    host_run(&b.host, 50);
    CHECK_EQUAL(host_count(&b.host, EITS_PACKET_PROBED), 1);
    const host_packet *packet = host_last(&b.host, EITS_PACKET_PROBED);
    eits_packet_probed head;
    memcpy(&head, packet->payload, sizeof head);
    CHECK_EQUAL(head.request, 700);
    CHECK_EQUAL(head.samples, 100);
    CHECK_EQUAL(packet->size, sizeof head + 200);
    CHECK_EQUAL(head.lost, 0);
    CHECK(head.start_us - head.switched_us >= 20 && head.start_us - head.switched_us <= 24);
    uint16_t low = UINT16_MAX, high = 0;
    for (uint32_t k = 0; k < 100; ++k) {
        uint16_t code;
        memcpy(&code, packet->payload + sizeof head + 2 * (size_t)k, sizeof code);
        low = code < low ? code : low;
        high = code > high ? code : high;
    }
    CHECK(high - low > 100 && low < 2048 && high > 2048); /* a sine about the middle */
    hear(100);
    CHECK(host_count(&b.host, EITS_PACKET_RAW) > 1);
    CHECK(b.board.monitor.violation == NULL);
    const struct {
        uint32_t before, joined, settle_us, samples, generator;
        int32_t offset;
    } refused[] = {
        {0x03020000u, 0x03020001u, 20, 100, 1, 4},     {0x03020001u, 0x03020010u, 20, 100, 1, 8},
        {0x03020001u, 0x03020001u, 50001, 100, 1, 12}, {0x03020001u, 0x03020001u, 20, 3, 1, 14},
        {0x03020001u, 0x03020001u, 20, 1025, 1, 14},   {0x03020001u, 0x03020001u, 20, 100, 2, 16}};
    for (size_t k = 0; IN_TABLE(k, refused); ++k) {
        eits_command_probe bad = {0,
                                  refused[k].before,
                                  refused[k].joined,
                                  (uint16_t)refused[k].settle_us,
                                  (uint16_t)refused[k].samples,
                                  (uint16_t)refused[k].generator,
                                  0};
        const eits_packet_reply reply = host_command(&b.host, EITS_PACKET_PROBE, &bad, sizeof bad);
        CHECK_EQUAL(reply.status, EITS_REPLY_RANGE);
        CHECK_EQUAL(reply.detail[0], refused[k].offset);
    }
}

TEST(test_scan_ranges)
{
    SCAN(s.excitation_millihz = 3499999, RANGE, 4, 3500000); /* at 350 uA rms */
    b.board.board.source_ua_rms = 100;
    SCAN(s.excitation_millihz = 999, RANGE, 4, 1000);
    b.board.board.source_ua_rms = 101;
    SCAN(s.excitation_millihz = 1009999, RANGE, 4, 1010000);
    b.board.board.source_ua_rms = 350;
    SCAN(s.excitation_millihz = 250000001, RANGE, 4, 250000000);
    SCAN(s.sample_rate_hz = 999, RANGE, 8, 1000);
    SCAN(s.sample_rate_hz = 5000001, RANGE, 8, 5000000);
    /* in range, but too fast for this board's converter; two samples per period are too few */
    SCAN((s.sample_rate_hz = 5000000, s.samples = 400), RANGE, 8, 0);
    SCAN(s.sample_rate_hz = 100000, RANGE, 4, 49999999);
    SCAN(s.samples = 3, RANGE, 12, 4);
    SCAN(s.samples = 1025, RANGE, 12, 1024);
    SCAN(s.samples = 90, PERIODS, 100, 0);
    SCAN(s.samples = 89, PERIODS, 80, 0);
    SCAN(s.settle_us = 50001, RANGE, 14, 50000);
    SCAN(s.reserved = 1, RANGE, 18, 0);
    SCAN(s.frame_period_us = 600000001, RANGE, 20, 600000000);
    SCAN(s.frame_period_us = 1, TOO_FAST, 20800, 0);
    /* half the rows only */
    SCAN((s.frame_period_us = 1, s.check_every = 0), TOO_FAST, 10400, 0);
    SCAN((s.frame_period_us = 10400, s.check_every = 0), OK, 0, 0);
    const eits_packet_info info = host_info(&b.host);
    CHECK_EQUAL(info.check_every, 0);
    CHECK_EQUAL(info.frame_period_us, 10400);
    REPLY(scan_with(host_default_scan()), EITS_REPLY_OK, 0, 0);
}

/* Refused settings change nothing: reference, settings and frames stay. Accepted settings forget
 * the reference.
 */
TEST(test_scan_and_tare)
{
    REPLY(host_tare(&b.host, 4), EITS_REPLY_OK, 0, 0);
    REPLY(host_stream(&b.host, 7, 1, 0), EITS_REPLY_OK, 0, 0);
    SCAN((s.sample_rate_hz = 5000000, s.samples = 400), RANGE, 8, 0);
    CHECK_EQUAL(host_info(&b.host).tared, 1);
    CHECK_EQUAL(host_info(&b.host).sample_rate_hz, 1000000);
    hear(100);
    CHECK(host_count(&b.host, EITS_PACKET_IMAGE) >= 3);
    SCAN(s.excitation_millihz = 25000000, OK, 0, 0);
    CHECK_NEAR(fake_generator_hz(&b.board), 25000, 0.02);
    CHECK_EQUAL(host_info(&b.host).tared, 0);
    CHECK_EQUAL(host_info(&b.host).streaming, EITS_STREAM_RAW);
    CHECK_EQUAL(host_info(&b.host).excitation_millihz, 25000006);
    REPLY(scan_with(host_default_scan()), EITS_REPLY_OK, 0, 0);
    REPLY(host_stream(&b.host, 0, 1, 0), EITS_REPLY_OK, 0, 0);
}

static eits_packet_reply solver_with(eits_command_solver c)
{
    return host_command(&b.host, EITS_PACKET_SOLVER, &c, sizeof c);
}

TEST(test_solver)
{
    const eits_command_solver good = {.iterations = 7,
                                      .max_touches = 3,
                                      .warm_start = 1,
                                      .sign = 2,
                                      .lambda_rel = 0.05f,
                                      .gap_rel = 0.01f,
                                      .solver = EITS_SOLVER_ACTIVE_SET,
                                      .mac_limit = 123456,
                                      .diagnostics = EITS_DIAGNOSTIC_OUTLIER};
#define SOLVER(change, a, last)                           \
    do {                                                  \
        eits_command_solver c = good;                     \
        change;                                           \
        REPLY(solver_with(c), EITS_REPLY_RANGE, a, last); \
    } while (0)
    SOLVER(c.iterations = 0, 4, 1);
    SOLVER(c.iterations = 1001, 4, 1000);
    SOLVER(c.max_touches = 17, 8, 16);
    SOLVER(c.warm_start = 2, 12, 1);
    SOLVER(c.sign = 3, 16, 2);
    SOLVER(c.lambda_rel = 1.5f, 20, 1);
    SOLVER(c.lambda_rel = (float)NAN, 20, 0);
    SOLVER(c.gap_rel = -0.1f, 24, 0);
    SOLVER(c.solver = 2, 28, 3); /* reserved */
    SOLVER(c.solver = 4, 28, 3);
    SOLVER(c.diagnostics = EITS_DIAGNOSTICS_ALL + 1, 36, EITS_DIAGNOSTICS_ALL);
    const eits_options *options = eits_get_options(b.host.instrument.solve.engine.ctx);
    CHECK_NEAR(options->detection_factor, 0.75 * 1.2f, 1e-7);
    CHECK_EQUAL(options->warm_start, 0);
    CHECK_EQUAL(options->mac_limit, 0);
    CHECK_EQUAL(options->iterations, 30);
    /* the lowest value of each field */
    eits_command_solver c = {.iterations = 1, .max_touches = 1};
    REPLY(solver_with(c), EITS_REPLY_OK, 0, 0);
    CHECK_EQUAL(options->diagnostics, 0);
    REPLY(solver_with(good), EITS_REPLY_OK, 0, 0);
    CHECK_EQUAL(options->iterations, 7);
    CHECK_EQUAL(options->max_touches, 3);
    CHECK_EQUAL(options->warm_start, 1);
    CHECK_EQUAL(options->sign, EITS_SIGN_BOTH);
    CHECK_NEAR(options->lambda_rel, 0.05f, 0);
    CHECK_NEAR(options->gap_rel, 0.01f, 0);
    CHECK_EQUAL(options->solver, EITS_SOLVER_ACTIVE_SET);
    CHECK_EQUAL(options->diagnostics, EITS_DIAGNOSTIC_OUTLIER);
    CHECK_EQUAL(options->mac_limit, 123456);
    CHECK_NEAR(options->detection_factor, 0.75 * 1.2f, 1e-7); /* stays that of streams */
}

TEST(test_mask_row)
{
    REPLY(mask_row(208, 1), EITS_REPLY_RANGE, 4, 207);
    REPLY(mask_row(207, 2), EITS_REPLY_RANGE, 6, 1);
    const struct {
        const char *name;
        uint16_t masked;
        uint8_t quality;
    } cases[] = {{"masked", 1, EITS_QUALITY_MASKED}, {"not masked", 0, 0}};
    for (size_t k = 0; IN_TABLE(k, cases); ++k) {
        CASE(cases[k].name);
        REPLY(mask_row(207, cases[k].masked), EITS_REPLY_OK, 0, 0);
        REPLY(host_stream(&b.host, EITS_STREAM_RAW, 1, 2), EITS_REPLY_OK, 0, 0);
        host_run(&b.host, 70);
        const host_packet *packet = host_last(&b.host, EITS_PACKET_RAW);
        CHECK_EQUAL(raw_quality(packet, 207), cases[k].quality);
        CHECK_EQUAL(isnan(raw_volts(packet, 207)) != 0, cases[k].masked);
    }
}

/* A request that is sent again gets the same answer and has no other effect; with another number it
 * is run again. */
TEST(test_sent_again)
{
    eits_command_stream c = {.request = 5000, .what = EITS_STREAM_RAW, .every = 1, .frames = 3};
    host_forget(&b.host);
    host_send(&b.host, EITS_PACKET_STREAM, &c, sizeof c);
    host_run(&b.host, 120);
    CHECK_EQUAL(host_count(&b.host, EITS_PACKET_RAW), 3);
    host_send(&b.host, EITS_PACKET_STREAM, &c, sizeof c);
    host_run(&b.host, 120);
    CHECK_EQUAL(host_count(&b.host, EITS_PACKET_RAW), 3);
    CHECK_EQUAL(host_count(&b.host, EITS_PACKET_REPLY), 2);
    const host_packet *first = host_packet_of(&b.host, EITS_PACKET_REPLY, 0),
                      *second = host_packet_of(&b.host, EITS_PACKET_REPLY, 1);
    CHECK(memcmp(first->payload, second->payload, sizeof(eits_packet_reply)) == 0);
    CHECK_EQUAL(second->sequence, first->sequence + 4); /* in a packet of its own */
    /* the same number with another command is another command */
    eits_command_plain other = {5000};
    host_send(&b.host, EITS_PACKET_CLEAR_FAULTS, &other, sizeof other);
    host_run(&b.host, 5);
    const eits_packet_reply *last = (const void *)host_last(&b.host, EITS_PACKET_REPLY)->payload;
    CHECK_EQUAL(last->command, EITS_PACKET_CLEAR_FAULTS);
    /* a tare under way is not restarted; its answer comes once, and again if it is asked for again
     */
    eits_command_tare tare = {.request = 6000, .frames = 10};
    host_forget(&b.host);
    host_send(&b.host, EITS_PACKET_TARE, &tare, sizeof tare);
    for (int k = 0; k < 9; ++k) {
        host_run(&b.host, 20);
        host_send(&b.host, EITS_PACKET_TARE, &tare, sizeof tare);
    }
    CHECK_EQUAL(host_count(&b.host, EITS_PACKET_REPLY), 0);
    CHECK(b.host.instrument.solve.tare.taken >= 7);
    REPLY(host_reply(&b.host, 6000), EITS_REPLY_OK, 0, 0);
    (void)host_info(&b.host);
    REPLY(host_stream(&b.host, 0, 1, 0), EITS_REPLY_OK, 0, 0);
    const uint32_t scanned = b.host.instrument.safety.faults.frame;
    host_forget(&b.host);
    host_send(&b.host, EITS_PACKET_TARE, &tare, sizeof tare);
    REPLY(host_reply(&b.host, 6000), EITS_REPLY_OK, 0, 0);
    CHECK(b.host.instrument.safety.faults.frame - scanned <= 1); /* at once */
}

TEST(test_stats_again)
{
    host_run(&b.host, 100);
    eits_command_get_stats c = {7000, 1};
    host_forget(&b.host);
    host_send(&b.host, EITS_PACKET_GET_STATS, &c, sizeof c);
    host_run(&b.host, 60);
    host_send(&b.host, EITS_PACKET_GET_STATS, &c, sizeof c);
    host_run(&b.host, 5);
    CHECK_EQUAL(host_count(&b.host, EITS_PACKET_STATS), 2);
    const host_packet *first = host_packet_of(&b.host, EITS_PACKET_STATS, 0),
                      *second = host_packet_of(&b.host, EITS_PACKET_STATS, 1);
    CHECK(memcmp(first->payload, second->payload, sizeof(eits_packet_stats)) == 0);
    const eits_packet_stats *stats = (const void *)first->payload;
    CHECK(stats->stage[EITS_STAGE_SCAN].count > 4);
    CHECK_EQUAL(stats->stage[EITS_STAGE_SCAN].worst_us, 20780);
    CHECK_EQUAL(stats->stage[EITS_STAGE_SCAN].p99_us, 20780);
    CHECK_EQUAL(stats->stack_bytes, 8192);
    CHECK_EQUAL(stats->stack_used, 1234);
    CHECK_EQUAL(stats->workspace_bytes, FAKE_WORKSPACE);
    CHECK(stats->workspace_used > 10000 && stats->workspace_used <= FAKE_WORKSPACE);
    const eits_packet_stats after = host_stats(&b.host, 0);
    /* forgotten at the first */
    CHECK(after.stage[EITS_STAGE_SCAN].count >= 1 && after.stage[EITS_STAGE_SCAN].count <= 5);
    CHECK(after.uptime_ms > stats->uptime_ms + 50);
    CHECK(after.frames_scanned > 20);
    eits_command_get_stats wrong = {.reset = 2};
    REPLY(host_command(&b.host, EITS_PACKET_GET_STATS, &wrong, sizeof wrong), EITS_REPLY_RANGE, 4,
          1);
}

/* Commands that are refused during a tare. */
TEST(test_busy)
{
    eits_command_tare tare = {.request = 8000, .frames = 50};
    host_send(&b.host, EITS_PACKET_TARE, &tare, sizeof tare);
    host_run(&b.host, 30);
    REPLY(host_tare(&b.host, 4), EITS_REPLY_BUSY, EITS_PACKET_TARE, 0);
    REPLY(scan_with(host_default_scan()), EITS_REPLY_BUSY, EITS_PACKET_TARE, 0);
    REPLY(host_plain(&b.host, EITS_PACKET_SELF_TEST), EITS_REPLY_BUSY, EITS_PACKET_TARE, 0);
    eits_command_model_begin begin = {.bytes = 1000};
    REPLY(host_command(&b.host, EITS_PACKET_MODEL_BEGIN, &begin, sizeof begin), EITS_REPLY_BUSY,
          EITS_PACKET_TARE, 0);
    REPLY(host_stream(&b.host, EITS_STREAM_RAW, 1, 0), EITS_REPLY_OK, 0, 0);
    REPLY(host_plain(&b.host, EITS_PACKET_CLEAR_FAULTS), EITS_REPLY_OK, 0, 0);
    CHECK(!b.host.instrument.link.reset_wanted);
    REPLY(host_plain(&b.host, EITS_PACKET_RESET), EITS_REPLY_OK, 0, 0);
    CHECK(b.host.instrument.link.reset_wanted);
    b.host.instrument.link.reset_wanted = false;
    REPLY(host_reply(&b.host, 8000), EITS_REPLY_OK, 0, 0);
    REPLY(host_stream(&b.host, 0, 1, 0), EITS_REPLY_OK, 0, 0);
}

/* Bytes outside packets are counted, and the packets after them are read. */
TEST(test_bad_bytes)
{
    const eits_packet_stats before = host_stats(&b.host, 0);
    eits_command_plain c = {9000};
    fake_board *f = &b.board;
    host_send(&b.host, EITS_PACKET_RESET, &c, sizeof c);
    f->to_board[f->to_board_size - 5] ^= 0x10; /* a bit of its checksum or end */
    host_run(&b.host, 3);
    host_send(&b.host, EITS_PACKET_RESET, &c, sizeof c);
    f->to_board_size -= 6; /* cut short by the next packet */
    REPLY(host_plain(&b.host, EITS_PACKET_CLEAR_FAULTS), EITS_REPLY_OK, 0, 0);
    static uint8_t long_one[EITS_LINK_MAX_PAYLOAD];
    /* longer than the board accepts */
    host_send(&b.host, EITS_PACKET_MODEL_DATA, long_one, sizeof long_one);
    for (uint32_t k = 0; k < 20000; ++k)
        f->to_board[f->to_board_size++] = (uint8_t)(k * 2654435761u >> 24);
    REPLY(host_plain(&b.host, EITS_PACKET_CLEAR_FAULTS), EITS_REPLY_OK, 0, 0);
    const eits_packet_stats after = host_stats(&b.host, 0);
    CHECK(after.link_crc_errors + after.link_framing_errors >
          before.link_crc_errors + before.link_framing_errors + 1);
    CHECK(after.link_overruns > before.link_overruns);
    CHECK(after.link_packets >= before.link_packets + 3);
    CHECK_EQUAL(f->resets, 0);
    CHECK(!b.host.instrument.link.reset_wanted);
}

int main(void)
{
    bench_start(&b, &SKIN_ADJACENT);
    run_tests();
    bench_stop(&b);
    return checks_report("commands");
}
