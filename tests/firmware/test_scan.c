/* The scan: order of rows, break before make, settling, repeated slots, reciprocal scans, periods,
 * two buffers, stalls. */
#include "steps.h"

static const eits_packet_raw *raw_head(uint32_t k)
{
    const host_packet *packet = host_packet_of(&b.host, EITS_PACKET_RAW, k);
    return packet == NULL ? NULL : (const eits_packet_raw *)(const void *)packet->payload;
}

/* Rows are measured in the model's order, each with its own four electrodes, and always break
 * before make. */
static void test_order(const skin_spec *spec, uint32_t rows)
{
    bench_start(&b, spec);
    CHECK_EQUAL(b.open.n_rows, rows);
    host_run(&b.host, 60);
    CHECK(b.board.bursts > rows);
    uint32_t wrong = 0;
    /* at its interrupt, a burst's own electrodes are still selected */
    for (uint32_t k = 0; k < b.board.bursts; ++k)
        wrong += memcmp(b.board.selected[k],
                        b.open.protocol + 4 * (size_t)b.open.scan_order[k % rows], 4) != 0;
    CHECK_EQUAL(b.open.scan_order[13], spec->order == 7 ? 7 * 13 : 13);
    CHECK_EQUAL(wrong, 0);
    CHECK(b.board.monitor.violation == NULL);
    CHECK_EQUAL(b.host.instrument.acquire.scan.slots_repeated, 0);
    CHECK_EQUAL(b.board.setup.slot_us, 100);
}

/* The last frame has voltages within half a step of the converter on every row. */
static void check_voltages(const char *name)
{
    CASE(name);
    host_run(&b.host, 60); /* the frame under way began before the skin changed */
    hear(60);
    const host_packet *packet = host_last(&b.host, EITS_PACKET_RAW);
    CHECK(packet != NULL);
    if (packet == NULL)
        return;
    CHECK_EQUAL(packet->size, sizeof(eits_packet_raw) + 5 * b.open.n_rows);
    CHECK(raw_steps_off(packet, 1) <= 0.5);
    for (uint32_t i = 0; i < b.open.n_rows; ++i)
        CHECK_EQUAL(raw_quality(packet, i), 0);
}

static void test_voltages(const skin_spec *spec)
{
    bench_start(&b, spec);
    STREAM(EITS_STREAM_RAW, 1, 0);
    check_voltages("untouched");
    TARE(4);
    sheet_touch(&b.sheet, -3, 2, 2, 6);
    sheet_solve(&b.sheet);
    check_voltages("touched");
    CASE("");
}

/* If the settling time covers the multiplexers' time constant, the row before leaves no trace. */
TEST(test_settling)
{
    const struct {
        const char *name;
        uint16_t settle_us;
        double least_off, most_off; /* in steps of the converter */
    } cases[] = {{"a few time constants", 1, 2, 1e9}, {"twelve time constants", 36, -1, 0.5}};
    bench_start(&b, &SKIN_ADJACENT);
    b.board.tau_ns = 3000;
    STREAM(EITS_STREAM_RAW, 1, 0);
    for (size_t k = 0; IN_TABLE(k, cases); ++k) {
        eits_command_scan scan = host_default_scan();
        CASE(cases[k].name);
        scan.settle_us = cases[k].settle_us;
        scan.samples = 20;
        TAKEN(scan_with(scan));
        host_run(&b.host, 60);
        const double off = raw_steps_off(host_last(&b.host, EITS_PACKET_RAW), 1);
        CHECK(off > cases[k].least_off);
        CHECK(off < cases[k].most_off);
    }
}

/* A switch that comes too late costs a slot, and the row is measured again. */
TEST(test_late_switch)
{
    bench_start(&b, &SKIN_ADJACENT);
    STREAM(EITS_STREAM_RAW, 1, 0);
    host_run(&b.host, 30);
    /* of 20 us from burst to burst, 16 are for settling */
    const struct {
        const char *name;
        uint32_t late_ns, lost, repeated;
    } cases[] = {
        {"15 us are left", 5000, 0, 1},
        {"15.7 us are left, though the clock shows 16", 3440, 0, 1},
        {"16.2 us are left", 2900, 0, 0},
        {"two bursts are lost", 0, 2, 2},
    };
    uint32_t repeated = b.host.instrument.acquire.scan.slots_repeated;
    for (size_t k = 0; IN_TABLE(k, cases); ++k) {
        CASE(cases[k].name);
        b.board.late_once_ns = cases[k].late_ns;
        b.board.lose = cases[k].lost;
        host_run(&b.host, 2);
        repeated += cases[k].repeated;
        CHECK_EQUAL(b.host.instrument.acquire.scan.slots_repeated, repeated);
    }
    host_run(&b.host, 60);
    const host_packet *packet = NULL;
    for (uint32_t k = 0; (packet = host_packet_of(&b.host, EITS_PACKET_RAW, k)) != NULL; ++k)
        CHECK(raw_steps_off(packet, 1) < 0.5);
    CHECK_EQUAL(host_stats(&b.host, 0).slots_repeated, repeated);
}

/* Rows that cannot be measured are marked, and are NaN. */
TEST(test_never_settles)
{
    bench_start(&b, &SKIN_ADJACENT);
    STREAM(EITS_STREAM_RAW, 1, 0);
    b.board.latency_ns = 10000; /* every switch is 6 us late */
    host_run(&b.host, 400);
    const host_packet *packet = host_last(&b.host, EITS_PACKET_RAW);
    CHECK(packet != NULL);
    /* a row that is measured again has been selected for a whole slot, so it has settled */
    CHECK(packet != NULL && !isnan(raw_volts(packet, 0)));
    b.board.latency_ns = 600;
    b.board.lose = 1000000;
    hear(400);
    packet = host_last(&b.host, EITS_PACKET_RAW);
    CHECK(packet != NULL);
    for (uint32_t i = 0; packet != NULL && i < b.open.n_rows; ++i) {
        CHECK(isnan(raw_volts(packet, i)));
        CHECK_EQUAL(raw_quality(packet, i), EITS_QUALITY_UNSETTLED);
    }
}

static void set_check_every(uint16_t every)
{
    check_each(every);
    host_run(&b.host, 30);
    host_forget(&b.host);
}

typedef struct reciprocal_case {
    const char *name;
    uint16_t every;        /* which frame is full */
    bool some_full;        /* in a tenth of a second */
    bool masks_second;     /* which row of a fold is masked */
    uint8_t first, second; /* quality of the fold's rows then */
} reciprocal_case;

/* The flags, the time and the rows of a reciprocal frame, or of a full one. */
static void check_reciprocal_frame(uint32_t k, bool full)
{
    const host_packet *packet = host_packet_of(&b.host, EITS_PACKET_RAW, k);
    const uint32_t rows = full ? b.open.n_rows : b.open.n_folded;
    CHECK_EQUAL(raw_head(k)->flags, full ? EITS_RAW_CHECK : EITS_RAW_RECIPROCAL);
    CHECK_EQUAL(raw_head(k)->scan_us, (rows - 1) * 100 + 80);
    CHECK(raw_steps_off(packet, 1) <= 0.5);
    for (uint32_t f = 0; f < b.open.n_folded; ++f) {
        const eits_fold fold = b.open.fold[f];
        CHECK(raw_volts(packet, fold.second) == (float)fold.sign * raw_volts(packet, fold.first));
        CHECK_EQUAL(raw_quality(packet, fold.first), 0);
        CHECK_EQUAL(raw_quality(packet, fold.second), EITS_QUALITY_COPIED);
    }
}

/* A masked row has no value and does not change its reciprocal row. */
static void check_masked_fold(const reciprocal_case *c)
{
    const eits_fold fold = b.open.fold[3];
    const uint16_t row = c->masks_second ? fold.second : fold.first;
    TAKEN(mask_row(row, 1));
    host_run(&b.host, 60);
    const host_packet *packet = host_last(&b.host, EITS_PACKET_RAW);
    CHECK_EQUAL(isnan(raw_volts(packet, fold.first)) != 0, !c->masks_second);
    CHECK_EQUAL(isnan(raw_volts(packet, fold.second)) != 0, c->masks_second);
    CHECK_EQUAL(raw_quality(packet, fold.first), c->first);
    CHECK_EQUAL(raw_quality(packet, fold.second), c->second);
    TAKEN(mask_row(row, 0));
}

/* Reciprocal scans measure half the rows; the others are copies with their sign. */
static void test_reciprocal(const skin_spec *spec)
{
    static const reciprocal_case cases[] = {
        {"no frame is full", 0, false, true, 0, EITS_QUALITY_COPIED | EITS_QUALITY_MASKED},
        {"every third is full", 3, true, false, EITS_QUALITY_MASKED, EITS_QUALITY_COPIED},
    };
    bench_start(&b, spec);
    STREAM(EITS_STREAM_RAW, 1, 0);
    for (size_t n = 0; IN_TABLE(n, cases); ++n) {
        const reciprocal_case *c = &cases[n];
        CASE(c->name);
        set_check_every(c->every);
        host_run(&b.host, 110);
        const uint32_t frames = host_count(&b.host, EITS_PACKET_RAW);
        CHECK(frames >= 5);
        uint32_t full_ones = 0;
        for (uint32_t k = 0; k < frames; ++k) {
            const bool full = c->every != 0 && raw_head(k)->frame % c->every == 0;
            check_reciprocal_frame(k, full);
            full_ones += full;
        }
        CHECK_EQUAL(full_ones > 0, c->some_full);
        check_masked_fold(c);
    }
    CASE("");
}

TEST(test_frame_period)
{
    bench_start(&b, &SKIN_ADJACENT);
    STREAM(EITS_STREAM_RAW, 1, 0);
    eits_command_scan scan = host_default_scan();
    scan.frame_period_us = 20799;
    eits_packet_reply reply = scan_with(scan);
    CHECK_EQUAL(reply.status, EITS_REPLY_TOO_FAST);
    CHECK_EQUAL(reply.detail[0], 20800);
    scan.frame_period_us = 33333;
    reply = scan_with(scan);
    TAKEN(reply);
    host_run(&b.host, 50);
    hear(1100); /* over the wrap of the clock */
    const uint32_t frames = host_count(&b.host, EITS_PACKET_RAW);
    CHECK(frames >= 32);
    for (uint32_t k = 1; k < frames; ++k) {
        CHECK_EQUAL(raw_head(k)->frame, raw_head(k - 1)->frame + 1);
        CHECK_NEAR(raw_head(k)->time_us - raw_head(k - 1)->time_us, 33333, 100);
    }
    /* no drift in the long run, although a period is not a whole number of slots */
    CHECK_NEAR((double)(raw_head(frames - 1)->time_us - raw_head(0)->time_us),
               33333.0 * (frames - 1), 100);
    CHECK_EQUAL(host_stats(&b.host, 0).deadlines_missed, 0);
    /* a period of a whole number of slots is kept to the microsecond, from the first frame on */
    scan.frame_period_us = 30000;
    TAKEN(scan_with(scan));
    hear(200);
    for (uint32_t k = 1; k < host_count(&b.host, EITS_PACKET_RAW); ++k)
        CHECK_EQUAL(raw_head(k)->time_us - raw_head(k - 1)->time_us, 30000);
    CHECK(host_count(&b.host, EITS_PACKET_RAW) >= 5);
    b.board.clock_cost_ns = 15000000; /* in place of a slow solver */
    TARE(1);
    host_run(&b.host, 1000);
    CHECK(host_stats(&b.host, 0).deadlines_missed > 0);
    CHECK(host_fault(&b.host, EITS_FAULT_DEADLINE, true, 0) != NULL);
    b.board.clock_cost_ns = 0;
    host_run(&b.host, 1000);
    CHECK(host_fault(&b.host, EITS_FAULT_DEADLINE, false, 0) != NULL);
}

/* While the main loop is busy, one frame is filled, and then the scan waits. No frame mixes two
 * scans. */
TEST(test_two_buffers)
{
    bench_start(&b, &SKIN_ADJACENT);
    STREAM(EITS_STREAM_RAW, 1, 0);
    b.board.write_cost_ns = 90000000; /* as long as four frames */
    host_run(&b.host, 2000);
    const uint32_t frames = host_count(&b.host, EITS_PACKET_RAW);
    CHECK(frames >= 15 && frames <= 30);
    for (uint32_t k = 0; k < frames; ++k) {
        const host_packet *packet = host_packet_of(&b.host, EITS_PACKET_RAW, k);
        /* no scanned frame is missing */
        CHECK(k == 0 || raw_head(k)->frame == raw_head(k - 1)->frame + 1);
        CHECK_EQUAL(raw_head(k)->scan_us, 20780);
        CHECK_NEAR(raw_volts(packet, 207), bench_volts(&b, 207), 0.5 * fake_lsb_v(&b.board));
    }
}

TEST(test_stall)
{
    bench_start(&b, &SKIN_ADJACENT);
    STREAM(EITS_STREAM_RAW, 1, 0);
    TARE(8);
    host_run(&b.host, 50);
    b.board.stalled = true;
    host_run(&b.host, 60);
    CHECK(host_fault(&b.host, EITS_FAULT_SCAN_STALLED, true, 0) != NULL);
    CHECK(host_fault(&b.host, EITS_FAULT_SCAN_STALLED, true, 1) == NULL); /* reported once */
    eits_command_tare tare = {.frames = 4};
    CHECK_EQUAL(host_command(&b.host, EITS_PACKET_TARE, &tare, sizeof tare).status,
                EITS_REPLY_CORE);
    CHECK_EQUAL(host_info(&b.host).tared, 1); /* by the tare before */
    b.board.stalled = false;
    hear(600);
    CHECK(host_fault(&b.host, EITS_FAULT_SCAN_STALLED, false, 0) != NULL);
    CHECK(host_count(&b.host, EITS_PACKET_RAW) > 10);
    /* the generator kept running, so the phase of the tare is still right */
    CHECK(raw_steps_off(host_last(&b.host, EITS_PACKET_RAW), 1) <= 0.5);
    b.board.configure_status = FW_E_TIMEOUT; /* now the converter does not even start */
    b.board.stalled = true;
    hear(2000);
    CHECK(host_fault(&b.host, EITS_FAULT_SCAN_STALLED, true, 0) != NULL);
    b.board.configure_status = FW_OK;
    b.board.stalled = false;
    host_run(&b.host, 2000);
    CHECK(host_fault(&b.host, EITS_FAULT_SCAN_STALLED, false, 0) != NULL);
    CHECK_EQUAL(host_info(&b.host).faults, 0);
}

TEST(test_slots)
{
    const struct {
        const char *name;
        uint32_t excitation_millihz, samples, settle_us, slot_us;
    } cases[] = {
        {"as after a start", 50000000, 80, 16, 100},
        {"103 us, to the next whole period", 50000000, 80, 20, 120},
        {"a shorter burst", 50000000, 20, 16, 40},
        {"periods of 1 ms, too long to wait for", 1000000, 20, 16, 39},
    };
    for (size_t k = 0; IN_TABLE(k, cases); ++k) {
        fw_scan_settings s = FW_SCAN_DEFAULT;
        CASE(cases[k].name);
        s.excitation_millihz = cases[k].excitation_millihz;
        s.samples = cases[k].samples;
        s.settle_us = cases[k].settle_us;
        CHECK_EQUAL(fw_slot_us(&s), cases[k].slot_us);
    }
}

int main(void)
{
    run_tests();
    const struct {
        const skin_spec *spec;
        uint32_t rows;
    } skins[] = {{&SKIN_ADJACENT, 208}, {&SKIN_OPPOSITE, 192}, {&SKIN_BY_SEVEN, 208}};
    for (size_t k = 0; k < COUNT_OF(skins); ++k) {
        test_order(skins[k].spec, skins[k].rows);
        test_voltages(skins[k].spec);
        test_reciprocal(skins[k].spec);
    }
    bench_stop(&b);
    return checks_report("scan");
}
