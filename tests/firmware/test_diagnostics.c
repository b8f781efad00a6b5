/* Diagnostics reach the host by name: in the frame's head, and as faults if they persist; on frames
 * of the sheet. */
#include "steps.h"

/* Start with a reference, and stream everything. */
static void start(void)
{
    bench_start(&b, &SKIN_ADJACENT);
    b.board.noise_codes = 4;
    TARE(8);
    STREAM(7, 1, 0);
}

static const eits_packet_solved *head_of(const host_packet *packet)
{
    return (const void *)packet->payload;
}

/* An open electrode is reported in the frame that shows it, whether or not that frame is streamed.
 */
static void test_open_while_nobody_looks(uint16_t what, uint16_t every)
{
    start();
    STREAM(what, every, 0);
    host_run(&b.host, 50);
    for (uint32_t e = 2; e < 16; e += 6) {
        host_forget(&b.host);
        detach(e, true);
        const uint32_t before = b.host.instrument.safety.faults.frame;
        host_run(&b.host, 60);
        const eits_packet_fault *fault = host_fault(&b.host, EITS_FAULT_ELECTRODE_OPEN, true, 0);
        CHECK(fault != NULL && fault->index == (int32_t)e && fault->frame <= before + 2);
        detach(e, false);
        host_run(&b.host, 300);
        CHECK(host_fault(&b.host, EITS_FAULT_ELECTRODE_OPEN, false, 0) != NULL);
    }
}

/* Two electrodes that are connected are both named, each with the other. */
static double bridged(void *user, const uint8_t e[4], uint64_t at_ns)
{
    (void)at_ns;
    /* the sheet with electrodes 6 and 7 as one, whose transfer impedances are the mean of both */
    double volts = 0;
    for (int k = 0; k < 16; ++k) {
        uint8_t row[4];
        for (int p = 0; p < 4; ++p)
            row[p] = e[p] == 6 || e[p] == 7 ? (uint8_t)(k >> p & 1 ? 6 : 7) : e[p];
        volts += sheet_volts(user, row) / 16;
    }
    return volts;
}

TEST(test_bridged)
{
    start();
    host_run(&b.host, 50);
    host_forget(&b.host);
    b.board.volts = bridged;
    host_run(&b.host, 60);
    for (int32_t k = 0; k < 2; ++k) {
        const eits_packet_fault *fault = host_fault(&b.host, EITS_FAULT_BRIDGED, true, (uint32_t)k);
        CHECK(fault != NULL && fault->index == 6 + k && fault->value == 7 - k &&
              fault->words[0] == 0xC0 && fault->words[1] == 0);
    }
    CHECK(host_fault(&b.host, EITS_FAULT_BRIDGED, true, 2) == NULL);
    const eits_packet_solved *head = head_of(host_last(&b.host, EITS_PACKET_TOUCHES));
    CHECK_EQUAL(head->bridged_electrodes, 0xC0);
    CHECK_EQUAL(head->diagnostics & EITS_DIAGNOSTIC_BRIDGED, EITS_DIAGNOSTIC_BRIDGED);
    CHECK_EQUAL(host_info(&b.host).faults >> EITS_FAULT_BRIDGED & 1u, 1);
    b.board.volts = bench_sheet;
    host_run(&b.host, 300);
    CHECK(host_fault(&b.host, EITS_FAULT_BRIDGED, false, 0) != NULL);
    CHECK(host_fault(&b.host, EITS_FAULT_BRIDGED, false, 1) != NULL);
    CHECK_EQUAL(host_info(&b.host).faults >> EITS_FAULT_BRIDGED & 1u, 0);
}

/* A single reading that is wrong for one frame is masked and counted, in the head and in STATS; it
 * is not a fault. */
static double one_row_off(void *user, const uint8_t e[4], uint64_t at_ns)
{
    (void)at_ns;
    return sheet_volts(user, e) + (e[0] == 2 && e[2] == 9 ? 0.02 : 0);
}

TEST(test_outlier)
{
    start();
    host_run(&b.host, 50);
    const uint32_t before = host_stats(&b.host, 0).outliers;
    host_forget(&b.host);
    b.board.volts = one_row_off;
    host_run(&b.host, 24);
    b.board.volts = bench_sheet;
    host_run(&b.host, 60);
    uint32_t rows = 0;
    for (uint32_t k = 0; k < host_count(&b.host, EITS_PACKET_TOUCHES); ++k) {
        const eits_packet_solved *head = head_of(host_packet_of(&b.host, EITS_PACKET_TOUCHES, k));
        /* a touch made of noise may be reported as crowded */
        const uint32_t crowded = EITS_DIAGNOSTIC_CROWDED;
        CHECK_EQUAL(head->diagnostics & ~crowded, head->outliers > 0 ? EITS_DIAGNOSTIC_OUTLIER : 0);
        CHECK(head->outliers <= 2 && head->masked == head->outliers);
        rows += head->outliers;
    }
    CHECK(rows >= 1);
    CHECK_EQUAL(host_stats(&b.host, 0).outliers - before, rows);
    CHECK_EQUAL(host_count(&b.host, EITS_PACKET_FAULT), 0);
}

/* A diagnostic that is switched off reports nothing. */
TEST(test_switched_off)
{
    start();
    const eits_options *o = eits_get_options(b.host.instrument.solve.engine.ctx);
    eits_command_solver solver = {.iterations = o->iterations,
                                  .max_touches = o->max_touches,
                                  .lambda_rel = o->lambda_rel,
                                  .gap_rel = o->gap_rel,
                                  .solver = o->solver,
                                  .diagnostics = EITS_DIAGNOSTICS_ALL &
                                                 ~(uint32_t)EITS_DIAGNOSTIC_ELECTRODE_OPEN};
    TAKEN(host_command(&b.host, EITS_PACKET_SOLVER, &solver, sizeof solver));
    detach(5, true);
    host_run(&b.host, 60);
    CHECK(host_fault(&b.host, EITS_FAULT_ELECTRODE_OPEN, true, 0) == NULL);
    CHECK_EQUAL(head_of(host_last(&b.host, EITS_PACKET_IMAGE))->open_electrodes, 0);
}

int main(void)
{
    CASE("nothing is streamed");
    test_open_while_nobody_looks(0, 1);
    CASE("touches of every fifth frame are streamed");
    test_open_while_nobody_looks(EITS_STREAM_TOUCHES, 5);
    run_tests();
    bench_stop(&b);
    return checks_report("diagnostics");
}
