/* Quality: open electrodes are named within one frame, and touches are not taken for them;
 * saturation; reciprocity; on frames of the sheet. */
#include "steps.h"

static void start(uint16_t check_every)
{
    bench_start(&b, &SKIN_ADJACENT);
    b.board.noise_codes = 4;
    check_each(check_every);
    STREAM(EITS_STREAM_RAW, 1, 0);
}

static void tare(void)
{
    TARE(8);
    STREAM(7, 1, 0);
}

static bool uses(uint32_t row, uint32_t electrode)
{
    return memchr(b.open.protocol + 4 * (size_t)row, (int)electrode, 4) != NULL;
}

static const eits_packet_solved *head_of(const host_packet *packet)
{
    return (const void *)packet->payload;
}

/* The first frame in which electrode e is open, by the head, or without a reference by the quality
 * in RAW; 0: none. */
static uint32_t first_named(uint32_t e, bool tared)
{
    for (uint32_t k = 0; tared && k < host_count(&b.host, EITS_PACKET_IMAGE); ++k) {
        const eits_packet_solved *head = head_of(host_packet_of(&b.host, EITS_PACKET_IMAGE, k));
        if (head->open_electrodes == (uint64_t)1 << e &&
            (head->diagnostics & EITS_DIAGNOSTIC_ELECTRODE_OPEN) != 0)
            return head->frame;
    }
    for (uint32_t k = 0; !tared && k < host_count(&b.host, EITS_PACKET_RAW); ++k) {
        const host_packet *packet = host_packet_of(&b.host, EITS_PACKET_RAW, k);
        const eits_packet_raw *head = (const void *)packet->payload;
        for (uint32_t i = 0; i < 208; ++i) {
            if ((raw_quality(packet, i) & EITS_QUALITY_OPEN) != 0)
                return head->frame;
        }
    }
    return 0;
}

/* Rows of a frame that was measured wholly without electrode e. Without a reference they are marked
 * and NaN; with one the core gets them as they are. */
static void check_rows(const host_packet *packet, uint32_t e, bool tared)
{
    for (uint32_t i = 0; i < 208; ++i) {
        CHECK_EQUAL((raw_quality(packet, i) & EITS_QUALITY_OPEN) != 0, !tared && uses(i, e));
        CHECK_EQUAL(isnan(raw_volts(packet, i)) != 0, !tared && uses(i, e));
    }
}

/* An electrode comes off. It is named in the first frame that was measured wholly without it, by a
 * fault and in the frame. The fault is cleared eight frames after the electrode is back. */
static void test_open(bool tared, uint16_t check_every)
{
    start(check_every);
    if (tared)
        tare();
    for (uint32_t e = 0; e < 16; e += 5) {
        host_run(&b.host, 50);
        host_forget(&b.host);
        detach(e, true);
        const uint32_t off_us = (uint32_t)(b.board.now_ns / 1000);
        host_run(&b.host, 60);
        const eits_packet_fault *fault = host_fault(&b.host, EITS_FAULT_ELECTRODE_OPEN, true, 0);
        CHECK(fault != NULL && fault->index == (int32_t)e);
        /* only this electrode, and once */
        CHECK(host_fault(&b.host, EITS_FAULT_ELECTRODE_OPEN, true, 1) == NULL);
        CHECK(fault != NULL && fault->frame == first_named(e, tared));
        uint32_t whole = 0;
        for (uint32_t k = 0; fault != NULL && k < host_count(&b.host, EITS_PACKET_RAW); ++k) {
            const host_packet *packet = host_packet_of(&b.host, EITS_PACKET_RAW, k);
            const eits_packet_raw *head = (const void *)packet->payload;
            if ((int32_t)(head->time_us - off_us) < 0)
                continue;
            if (whole++ == 0)
                CHECK(fault->frame == head->frame || fault->frame + 1 == head->frame);
            check_rows(packet, e, tared);
        }
        CHECK(whole >= 1);
        if (tared) { /* images continue without those rows */
            const eits_packet_solved *image = head_of(host_last(&b.host, EITS_PACKET_IMAGE));
            CHECK_EQUAL(image->status, 0);
            uint32_t lost = 0;
            for (uint32_t i = 0; i < 208; ++i)
                lost += uses(i, e);
            CHECK_EQUAL(image->masked, lost);
            CHECK_EQUAL(image->diagnostics & EITS_DIAGNOSTIC_ELECTRODE_OPEN,
                        EITS_DIAGNOSTIC_ELECTRODE_OPEN);
        }
        detach(e, false);
        /* the frame under way may still have been measured without it */
        const uint32_t back = b.host.instrument.safety.faults.frame + 1;
        host_run(&b.host, 300);
        const eits_packet_fault *gone = host_fault(&b.host, EITS_FAULT_ELECTRODE_OPEN, false, 0);
        CHECK(gone != NULL && gone->index == (int32_t)e);
        CHECK(gone != NULL && gone->frame + 2 >= back + EITS_FAULT_CLEAR_FRAMES &&
              gone->frame <= back + EITS_FAULT_CLEAR_FRAMES);
        CHECK_EQUAL(host_info(&b.host).faults & 1u << EITS_FAULT_ELECTRODE_OPEN, 0);
    }
}

/* Two electrodes are open at once. */
TEST(test_two_open)
{
    start(1);
    tare();
    const struct {
        const char *name;
        uint32_t other;
    } cases[] = {{"neighbours", 4}, {"far apart", 8}};
    for (size_t k = 0; IN_TABLE(k, cases); ++k) {
        const uint32_t other = cases[k].other;
        CASE(cases[k].name);
        b.sheet.detached[3] = true;
        detach(other, true);
        host_run(&b.host, 60);
        CHECK_EQUAL(b.host.instrument.safety.faults.there[EITS_FAULT_ELECTRODE_OPEN],
                    1u << 3 | 1u << other);
        b.sheet.detached[3] = false;
        detach(other, false);
        host_run(&b.host, 300);
        CHECK_EQUAL(b.host.instrument.safety.faults.there[EITS_FAULT_ELECTRODE_OPEN], 0);
    }
}

/* An electrode is open also if its amplifier saturates. */
static double to_the_rail(void *user, const uint8_t electrodes[4], uint64_t at_ns)
{
    (void)at_ns;
    return memchr(electrodes, 6, 4) != NULL ? 9.0 : sheet_volts(user, electrodes);
}

TEST(test_open_at_the_rail)
{
    start(1);
    tare();
    b.board.volts = to_the_rail;
    host_run(&b.host, 60);
    CHECK_EQUAL(b.host.instrument.safety.faults.there[EITS_FAULT_ELECTRODE_OPEN], 1u << 6);
    const eits_packet_fault *fault = host_fault(&b.host, EITS_FAULT_SATURATED, true, 0);
    CHECK(fault != NULL);
}

/* A skin with far smaller voltages than the model's: the tare gives the scale. */
static double faint(void *user, const uint8_t electrodes[4], uint64_t at_ns)
{
    (void)at_ns;
    return 0.015 * sheet_volts(user, electrodes);
}

TEST(test_faint_skin)
{
    start(1);
    b.board.noise_codes = 0;
    b.board.volts = faint;
    host_run(&b.host, 50);
    tare();
    host_run(&b.host, 50);
    CHECK(host_fault(&b.host, EITS_FAULT_ELECTRODE_OPEN, true, 0) == NULL);
}

/* A row that reads a constant, and is masked for that, is not counted for its electrodes. */
static double stuck_row(void *user, const uint8_t e[4], uint64_t at_ns)
{
    (void)at_ns;
    return e[0] == 5 && e[2] == 8 ? 0.3 : sheet_volts(user, e);
}

TEST(test_masked_row_is_not_judged)
{
    start(1);
    b.board.volts = stuck_row;
    tare();
    for (uint16_t i = 0; i < 208; ++i) {
        const uint8_t *row = b.open.protocol + 4 * (size_t)i;
        if (row[0] == 5 && row[2] == 8)
            TAKEN(mask_row(i, 1));
    }
    detach(5, true);
    host_run(&b.host, 60);
    CHECK_EQUAL(b.host.instrument.safety.faults.there[EITS_FAULT_ELECTRODE_OPEN], 1u << 5);
}

/* Touches do not open electrodes, whether light or strong, near the rim, over electrodes, over half
 * the skin, or insulating. */
static void test_touches_are_not_open(bool tared)
{
    start(1);
    if (tared)
        tare();
    const struct {
        const char *name;
        double factor; /* of conductivity */
    } touches[] = {{"almost insulating", 0.02}, {"insulating", 0.3}, {"light", 3}, {"strong", 10}};
    const struct {
        double x, y, radius;
    } places[] = {{0, 0, 1}, {1.7, -0.4, 2}, {3.4, -0.8, 3}, {5.1, -1.2, 4}, {6.8, -1.6, 2.5}};
    for (size_t k = 0; IN_TABLE(k, touches); ++k) {
        CASE(touches[k].name);
        for (size_t p = 0; p < COUNT_OF(places); ++p) {
            sheet_init(&b.sheet);
            sheet_touch(&b.sheet, places[p].x, places[p].y, places[p].radius, touches[k].factor);
            sheet_solve(&b.sheet);
            host_run(&b.host, 45);
            CHECK_EQUAL(b.host.instrument.safety.faults.there[EITS_FAULT_ELECTRODE_OPEN], 0);
        }
    }
    CHECK(host_fault(&b.host, EITS_FAULT_ELECTRODE_OPEN, true, 0) == NULL);
}

static double one_row_saturates(void *user, const uint8_t e[4], uint64_t at_ns)
{
    (void)at_ns;
    const bool it = (e[0] == 2 && e[2] == 9) || (e[0] == 9 && e[2] == 2);
    return it ? 1.7 : sheet_volts(user, e);
}

TEST(test_saturation)
{
    start(1);
    tare();
    b.board.volts = one_row_saturates;
    host_run(&b.host, 60);
    const eits_packet_fault *fault = host_fault(&b.host, EITS_FAULT_SATURATED, true, 0);
    CHECK(fault != NULL);
    if (fault != NULL) {
        const uint8_t *row = b.open.protocol + 4 * (size_t)fault->index;
        CHECK(row[0] == 2 && row[2] == 9);
        CHECK(fault->value == 2 ||
              fault->value == 1); /* the frame of the change may have only one */
    }
    const host_packet *raw = host_last(&b.host, EITS_PACKET_RAW);
    uint32_t marked = 0;
    for (uint32_t i = 0; i < 208; ++i) {
        const uint8_t *row = b.open.protocol + 4 * (size_t)i;
        const bool it = (row[0] == 2 && row[2] == 9) || (row[0] == 9 && row[2] == 2);
        CHECK_EQUAL(raw_quality(raw, i), it ? EITS_QUALITY_SATURATED : 0);
        CHECK_EQUAL(isnan(raw_volts(raw, i)) != 0, it);
        marked += it;
    }
    CHECK_EQUAL(marked, 2);
    const eits_packet_solved *image = (const void *)host_last(&b.host, EITS_PACKET_IMAGE)->payload;
    CHECK_EQUAL(image->masked, 2);
    CHECK_EQUAL(image->saturated, 2);
    CHECK_EQUAL(image->diagnostics, EITS_DIAGNOSTIC_SATURATED);
}

static double broken_reciprocity(void *user, const uint8_t e[4], uint64_t at_ns)
{
    (void)at_ns;
    return sheet_volts(user, e) * (e[0] == 2 && e[2] == 5 ? 1.6 : 1);
}

/* Reciprocal rows that disagree are marked at once, and reported if it lasts. */
static void test_reciprocity(uint16_t check_every)
{
    start(check_every);
    tare();
    host_run(&b.host, 200);
    CHECK(host_fault(&b.host, EITS_FAULT_RECIPROCITY, true, 0) == NULL);
    b.board.volts = broken_reciprocity;
    host_run(&b.host, 30);
    CHECK(host_fault(&b.host, EITS_FAULT_RECIPROCITY, true, 0) ==
          NULL); /* not for a single frame */
    host_run(&b.host, 70u * check_every + 30);
    const eits_packet_fault *fault = host_fault(&b.host, EITS_FAULT_RECIPROCITY, true, 0);
    CHECK(fault != NULL);
    if (fault != NULL) {
        const uint8_t *row = b.open.protocol + 4 * (size_t)fault->index;
        CHECK(row[0] == 2 && row[2] == 5);
        CHECK(fault->value > 100 && fault->value < 2000);
    }
    uint32_t marked = 0;
    for (uint32_t k = 0; k < host_count(&b.host, EITS_PACKET_RAW); ++k) {
        const host_packet *packet = host_packet_of(&b.host, EITS_PACKET_RAW, k);
        const eits_packet_raw *head = (const void *)packet->payload;
        if ((head->flags & EITS_RAW_RECIPROCAL) != 0 || head->frame + 1 < fault->frame)
            continue;
        for (uint32_t i = 0; i < 208; ++i) {
            const uint8_t *row = b.open.protocol + 4 * (size_t)i;
            const bool it = (row[0] == 2 && row[2] == 5) || (row[0] == 5 && row[2] == 2);
            CHECK_EQUAL((raw_quality(packet, i) & EITS_QUALITY_RECIPROCITY) != 0, it);
            marked += it;
        }
    }
    CHECK(marked >= 2);
}

/* A dead front end: no voltage at all. */
static double nothing(void *user, const uint8_t e[4], uint64_t at_ns)
{
    (void)user;
    (void)e;
    (void)at_ns;
    return 0;
}

TEST(test_dead)
{
    start(1);
    tare();
    b.board.volts = nothing;
    host_run(&b.host, 60);
    /* this is what an unplugged cable looks like */
    CHECK(host_fault(&b.host, EITS_FAULT_SOLVER, true, 0) != NULL);
    const host_packet *image = host_last(&b.host, EITS_PACKET_IMAGE);
    const eits_packet_solved *head = (const void *)image->payload;
    CHECK_EQUAL((int16_t)head->status, -EITS_E_FRAME_ZERO);
    CHECK_EQUAL(head->open_electrodes, 0); /* the electrodes are not blamed */
    for (uint32_t j = 0; j < b.open.n_pixels; ++j) {
        float value;
        memcpy(&value, image->payload + sizeof *head + 4 * j, 4);
        CHECK(value == 0);
    }
    const eits_packet_solved *touches =
        (const void *)host_last(&b.host, EITS_PACKET_TOUCHES)->payload;
    CHECK_EQUAL(touches->count, 0);
}

int main(void)
{
    const struct {
        const char *name;
        bool tared;
        uint16_t check_every;
    } open[] = {{"no reference", false, 1},
                {"reference, full scans", true, 1},
                {"reference, every fourth scan is full", true, 4}};
    for (size_t k = 0; k < COUNT_OF(open); ++k) {
        CASE(open[k].name);
        test_open(open[k].tared, open[k].check_every);
    }
    run_tests();
    test_touches_are_not_open(true);
    test_touches_are_not_open(false);
    CASE("every scan is full");
    test_reciprocity(1);
    CASE("every third scan is full");
    test_reciprocity(3);
    bench_stop(&b);
    return checks_report("quality");
}
