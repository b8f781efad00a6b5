/* Faults: reported once when raised and once when cleared; buses that fail and recover; the report
 * on the last reset. */
#include "steps.h"

#include "app/safety/faults.h"

static uint32_t reports(eits_fault code, bool raised)
{
    uint32_t count = 0;
    while (host_fault(&b.host, code, raised, count) != NULL)
        ++count;
    return count;
}

TEST(test_last_reset)
{
    bench_start(&b, &SKIN_ADJACENT);
    fake_restart(&b.board);
    b.board.board.last_reset = (fw_last_reset){
        .crash = 1, .watchdog = 1, .words = {0x08001234, 0x08005679, 0x400, 0x40000000, 0x20}};
    host_start(&b.host, &b.board);
    const eits_packet_fault *crash = host_fault(&b.host, EITS_FAULT_CRASH, true, 0);
    CHECK(crash != NULL);
    for (int k = 0; crash != NULL && k < 5; ++k)
        CHECK_EQUAL(crash->words[k], b.board.board.last_reset.words[k]);
    CHECK_EQUAL(reports(EITS_FAULT_WATCHDOG, true), 1);
    host_run(&b.host, 100);
    /* they stay until they are cleared */
    CHECK_EQUAL(host_info(&b.host).faults, 1u << EITS_FAULT_CRASH | 1u << EITS_FAULT_WATCHDOG);
    CHECK((b.board.leds & 4u) != 0);
    TAKEN(host_plain(&b.host, EITS_PACKET_CLEAR_FAULTS));
    CHECK_EQUAL(reports(EITS_FAULT_CRASH, false), 1);
    CHECK_EQUAL(reports(EITS_FAULT_WATCHDOG, false), 1);
    CHECK_EQUAL(host_info(&b.host).faults, 0);
    host_run(&b.host, 5);
    CHECK((b.board.leds & 4u) == 0);
}

/* A fault that is cleared by command and still there is raised again. */
TEST(test_cleared_but_there)
{
    bench_start(&b, NULL);
    CHECK_EQUAL(reports(EITS_FAULT_NO_MODEL, true), 1);
    TAKEN(host_plain(&b.host, EITS_PACKET_CLEAR_FAULTS));
    CHECK_EQUAL(reports(EITS_FAULT_NO_MODEL, false), 1);
    CHECK_EQUAL(reports(EITS_FAULT_NO_MODEL, true), 2);
    bench_start(&b, &SKIN_ADJACENT);
    detach(9, true);
    host_run(&b.host, 200);
    CHECK_EQUAL(reports(EITS_FAULT_ELECTRODE_OPEN, true), 1);
    TAKEN(host_plain(&b.host, EITS_PACKET_CLEAR_FAULTS));
    host_run(&b.host, 60);
    CHECK_EQUAL(reports(EITS_FAULT_ELECTRODE_OPEN, true), 2);
    CHECK_EQUAL(reports(EITS_FAULT_ELECTRODE_OPEN, false), 1);
}

/* If the generator cannot be written at start-up, this is reported and tried again, and the scan
 * begins once it works.
 */
TEST(test_generator_bus)
{
    for (uint32_t at = 0; at < 5; ++at) {
        bench_start(&b, &SKIN_ADJACENT);
        fake_restart(&b.board);
        b.board.spi_calls = 0;
        b.board.spi_fail_from = at;
        b.board.spi_fails = 1000;
        host_start(&b.host, &b.board);
        CHECK_EQUAL(reports(EITS_FAULT_BUS, true), 1);
        host_run(&b.host, 1200);
        CHECK_EQUAL(reports(EITS_FAULT_BUS, true), 1);
        CHECK_EQUAL(b.board.bursts, 0);
        CHECK_NEAR(fake_generator_hz(&b.board), 0, 0);
        CHECK_EQUAL(host_info(&b.host).faults, 1u << EITS_FAULT_BUS);
        b.board.spi_fails = 0;
        host_run(&b.host, 600);
        CHECK_EQUAL(reports(EITS_FAULT_BUS, false), 1);
        CHECK_NEAR(fake_generator_hz(&b.board), 50000, 0.02);
        TARE(4);
    }
}

/* If the multiplexers fail once, the row is measured again; if they fail always, BUS is reported
 * and rows are NaN. */
TEST(test_multiplexer_bus)
{
    bench_start(&b, &SKIN_ADJACENT);
    TARE(4);
    STREAM(7, 1, 0);
    host_run(&b.host, 30);
    for (uint32_t at = 0; at < 3; ++at) {
        const uint32_t repeated = b.host.instrument.acquire.scan.slots_repeated;
        host_forget(&b.host);
        b.board.lines_fail_from = b.board.lines_calls + at;
        b.board.lines_fails = 1;
        host_run(&b.host, 70);
        CHECK(b.host.instrument.acquire.scan.slots_repeated > repeated);
        CHECK_EQUAL(reports(EITS_FAULT_BUS, true), 1);
        CHECK_EQUAL(reports(EITS_FAULT_BUS, false), 1);
        for (uint32_t k = 0; k < host_count(&b.host, EITS_PACKET_RAW); ++k) {
            const host_packet *packet = host_packet_of(&b.host, EITS_PACKET_RAW, k);
            for (uint32_t i = 0; i < 208; ++i)
                CHECK_EQUAL(raw_quality(packet, i), 0);
        }
    }
    host_forget(&b.host);
    b.board.lines_fail_from = b.board.lines_calls;
    b.board.lines_fails = 1000000;
    host_run(&b.host, 500);
    CHECK_EQUAL(reports(EITS_FAULT_BUS, true), 1);
    CHECK_EQUAL(reports(EITS_FAULT_SOLVER, true), 1);
    CHECK(b.board.monitor.violation == NULL);
    b.board.lines_fails = 0;
    host_run(&b.host, 500);
    CHECK_EQUAL(reports(EITS_FAULT_BUS, false), 1);
    CHECK_EQUAL(reports(EITS_FAULT_SOLVER, false), 1);
    CHECK_EQUAL(host_info(&b.host).faults, 0);
}

/* A bus that fails while a scan starts is reported as BUS, and not as a stalled scan.
 */
TEST(test_bus_at_the_start_of_a_scan)
{
    eits_command_scan scan = host_default_scan();
    uint32_t buses = 0;
    bench_start(&b, &SKIN_ADJACENT);
    for (uint32_t at = 0; at < 6; ++at) {
        host_forget(&b.host);
        b.board.lines_fail_from = b.board.lines_calls + at;
        b.board.lines_fails = 1;
        (void)scan_with(scan);
        buses += reports(EITS_FAULT_BUS, true);
        host_run(&b.host, 700); /* it is tried again */
        CHECK_EQUAL(reports(EITS_FAULT_SCAN_STALLED, true), 0);
        CHECK_EQUAL(host_info(&b.host).faults, 0);
    }
    CHECK(buses >= 3);
}

static bool is_raised(eits_fault code)
{
    return (fw_faults_raised(&b.host.instrument.safety) >> code & 1u) != 0;
}

/* After how many frames a fault is raised and cleared, for each electrode by itself. A frame that
 * contradicts begins the count again. */
TEST(test_hysteresis)
{
    const struct {
        const char *name;
        eits_fault code;
        uint32_t shown;
    } kinds[] = {{"electrode open", EITS_FAULT_ELECTRODE_OPEN, 1},
                 {"saturated", EITS_FAULT_SATURATED, 1},
                 {"bridged", EITS_FAULT_BRIDGED, 1},
                 {"electrode noisy", EITS_FAULT_ELECTRODE_NOISY, 3},
                 {"model mismatch", EITS_FAULT_MODEL_MISMATCH, 3},
                 {"stale reference", EITS_FAULT_STALE_REFERENCE, 3},
                 {"unlike the model", EITS_FAULT_UNLIKE_MODEL, 3}};
    bench_start(&b, NULL);
    fw_safety *safety = &b.host.instrument.safety;
    for (size_t k = 0; IN_TABLE(k, kinds); ++k) {
        const eits_fault code = kinds[k].code;
        const fw_fault_detail detail = {.index = 9, .value = 5};
        CASE(kinds[k].name);
        for (uint32_t frame = 1; frame < kinds[k].shown; ++frame)
            fw_fault_observe(safety, code, true, detail);
        CHECK(!is_raised(code));
        if (kinds[k].shown > 1)
            fw_fault_observe(safety, code, false, detail);
        for (uint32_t frame = 1; frame <= kinds[k].shown; ++frame) {
            CHECK(!is_raised(code));
            fw_fault_observe(safety, code, true, detail);
        }
        CHECK(is_raised(code));
        for (uint32_t again = 0; again < 2; ++again) {
            for (uint32_t frame = 1; frame < EITS_FAULT_CLEAR_FRAMES; ++frame)
                fw_fault_observe(safety, code, false, detail);
            CHECK(is_raised(code));
            if (again == 0)
                fw_fault_observe(safety, code, true, detail);
        }
        fw_fault_observe(safety, code, false, detail);
        CHECK(!is_raised(code));
        host_run(&b.host, 5);
        CHECK_EQUAL(reports(code, true), 1);
        CHECK_EQUAL(reports(code, false), 1);
        CHECK_EQUAL(host_fault(&b.host, code, true, 0)->value, 5);
    }
    for (int32_t e = 0; e < 16; e += 15)
        fw_fault_observe(safety, EITS_FAULT_BRIDGED, true, (fw_fault_detail){.index = e});
    CHECK_EQUAL(safety->faults.there[EITS_FAULT_BRIDGED], 1u << 15 | 1u);
    fw_faults_clear(safety);
    CHECK_EQUAL(fw_faults_raised(safety), 0);
}

TEST(test_analog_supply)
{
    bench_start(&b, &SKIN_ADJACENT);
    CHECK_EQUAL(reports(EITS_FAULT_ANALOG_SUPPLY, true), 0);
    b.board.supply_missing = true;
    host_run(&b.host, 50);
    CHECK_EQUAL(reports(EITS_FAULT_ANALOG_SUPPLY, true), 1); /* once */
    CHECK((b.board.leds & 4u) != 0);
    b.board.supply_missing = false;
    host_run(&b.host, 50);
    CHECK_EQUAL(reports(EITS_FAULT_ANALOG_SUPPLY, false), 1);
    CHECK_EQUAL(host_info(&b.host).faults & 1u << EITS_FAULT_ANALOG_SUPPLY, 0);
}

TEST(test_watchdog_is_fed)
{
    bench_start(&b, &SKIN_ADJACENT);
    const uint32_t before = b.board.feeds;
    host_run(&b.host, 100);
    CHECK(b.board.feeds >= before + 100); /* each wait is a millisecond at most */
    uint32_t lit = 0;
    for (int k = 0; k < 20; ++k) {
        host_run(&b.host, 100);
        lit += b.board.leds & 1u;
    }
    CHECK(lit >= 8 && lit <= 12); /* alive: blinks */
}

RUN_TESTS("faults", bench_stop(&b))
