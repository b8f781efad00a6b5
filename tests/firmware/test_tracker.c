/* Touches after each drive: drives are tracked while the main loop is busy, none is skipped or
 * reported twice, whole frames are aligned, and the tracker begins again when it must. */
#include "steps.h"

#include "app/link/tracks.h"
#include "app/solve/tracker.h"

enum { DRIVES = 16, DRIVE_US = 1300, SCAN_MS = 21, ALL = 31 & ~EITS_STREAM_IMAGE };

static void set_up(const skin_spec *spec)
{
    bench_start(&b, spec);
    b.board.noise_codes = 0.5;
    TARE(8);
}

static eits_packet_drive_touches followed(uint32_t k)
{
    eits_packet_drive_touches head = {0};
    const host_packet *packet = host_packet_of(&b.host, EITS_PACKET_DRIVE_TOUCHES, k);
    CHECK(packet != NULL);
    if (packet != NULL) {
        memcpy(&head, packet->payload, sizeof head);
        CHECK_EQUAL(packet->size, sizeof head + head.count * sizeof(eits_packet_drive_touch));
    }
    return head;
}

/* Frames that were streamed with all of these flags. */
static uint32_t with_flags(uint32_t flags)
{
    uint32_t count = 0;
    for (uint32_t k = 0; k < host_count(&b.host, EITS_PACKET_RAW); ++k) {
        eits_packet_raw head;
        memcpy(&head, host_packet_of(&b.host, EITS_PACKET_RAW, k)->payload, sizeof head);
        count += (head.flags & flags) == flags;
    }
    return count;
}

TEST(test_what_is_refused)
{
    set_up(&SKIN_ADJACENT); /* without fields */
    CHECK_EQUAL(host_stream(&b.host, EITS_STREAM_DRIVE_TOUCHES, 1, 0).status, EITS_REPLY_DRIVES);
    set_up(&SKIN_WITH_FIELDS);
    CHECK_EQUAL(host_stream(&b.host, EITS_STREAM_DRIVE_TOUCHES, 2, 0).status, EITS_REPLY_DRIVES);
    check_each(4);
    TARE(8);
    CHECK_EQUAL(host_stream(&b.host, EITS_STREAM_DRIVE_TOUCHES, 1, 0).status, EITS_REPLY_DRIVES);
}

/* An untouched skin: one packet reports the beginning; all frames are aligned, unchanged to the
 * bit, and solved. */
TEST(test_a_still_skin)
{
    set_up(&SKIN_WITH_FIELDS);
    host_forget(&b.host);
    STREAM(ALL, 1, 0);
    host_run(&b.host, 20 * SCAN_MS);
    const uint32_t frames = host_count(&b.host, EITS_PACKET_RAW);
    CHECK(frames >= 18);
    CHECK_EQUAL(host_count(&b.host, EITS_PACKET_DRIVE_TOUCHES), 1);
    CHECK_EQUAL(followed(0).count, 0);
    CHECK_EQUAL(followed(0).begun, followed(0).frame);
    CHECK(with_flags(EITS_RAW_ALIGNED | EITS_RAW_TRUSTED) >= frames - 1); /* one was under way */
    CHECK(host_count(&b.host, EITS_PACKET_TOUCHES) >= frames - 1);
    const fw_engine *engine = &b.host.instrument.solve.engine;
    CHECK(memcmp(engine->aligned,
                 engine->frames[(b.host.instrument.acquire.scan.taken - 1) % 2u].volts,
                 engine->model.n_rows * sizeof(float)) == 0);
    CHECK_EQUAL(b.host.gaps, 0);
}

/* A touch: packets come in the order in which drives are measured, each for its own instant. */
static void test_a_touch(uint64_t clock_cost_ns, uint64_t write_cost_ns)
{
    set_up(&SKIN_WITH_FIELDS);
    STREAM(ALL, 1, 0);
    host_run(&b.host, 5 * SCAN_MS);
    b.board.clock_cost_ns = clock_cost_ns;
    b.board.write_cost_ns = write_cost_ns;
    const uint32_t begun = b.host.instrument.solve.tracker.begun;
    host_forget(&b.host);
    touch(-2, 1, 4);
    const uint32_t scanned = b.host.instrument.acquire.scan.frames_scanned;
    const uint64_t from_ns = b.board.now_ns;
    host_run(&b.host, 30 * SCAN_MS);
    const uint32_t count = host_count(&b.host, EITS_PACKET_DRIVE_TOUCHES);
    CHECK(count > DRIVES);
    for (uint32_t k = 1; k < count; ++k) {
        const eits_packet_drive_touches before = followed(k - 1), now = followed(k);
        CHECK_EQUAL(now.begun, begun);
        CHECK(now.count <= EITS_FAST_TOUCHES);
        if (before.count == 0)
            continue;
        CHECK_EQUAL(now.drive, (before.drive + 7u) % DRIVES);
        CHECK_EQUAL(now.time_us - before.time_us, DRIVE_US);
        CHECK_EQUAL(now.frame - before.frame, now.drive == 0);
    }
    /* the scan continued whatever the main loop did */
    const uint64_t scans = (b.board.now_ns - from_ns) / (DRIVES * DRIVE_US * 1000u);
    CHECK(b.host.instrument.acquire.scan.frames_scanned - scanned + 1 >= scans);
    CHECK_EQUAL(b.host.instrument.acquire.scan.slots_repeated, 0);
    CHECK_EQUAL(b.host.gaps, 0);
    CHECK_EQUAL(b.board.nested_writes, 0);
    CHECK(b.host.instrument.solve.tracker.running);
}

/* If the main loop is slower than the scan, frames are skipped, but drives are not, and each frame
 * that is taken is the latest one. */
TEST(test_a_slow_main_loop)
{
    set_up(&SKIN_WITH_FIELDS);
    STREAM(ALL, 1, 0);
    host_run(&b.host, 5 * SCAN_MS);
    const uint32_t begun = b.host.instrument.solve.tracker.begun;
    const uint32_t scanned = b.host.instrument.acquire.scan.frames_scanned;
    host_forget(&b.host);
    b.board.write_cost_ns = 30000000u;
    host_run(&b.host, 40 * SCAN_MS);
    const uint32_t raws = host_count(&b.host, EITS_PACKET_RAW), aligned = with_flags(8);
    CHECK(b.host.instrument.acquire.scan.frames_scanned - scanned >= 38);
    CHECK(raws >= 4 && raws < 20); /* each costs three writes of 30 ms */
    CHECK_EQUAL(aligned, raws);
    CHECK(host_count(&b.host, EITS_PACKET_TOUCHES) <= aligned + 1);
    CHECK(b.host.instrument.solve.tracker.running);
    CHECK_EQUAL(b.host.instrument.solve.tracker.begun, begun);
}

/* The tracker begins again after commands that change what it reads, but not after questions. It
 * also begins again if drives had to be skipped because they waited too long. */
TEST(test_beginning_again)
{
    set_up(&SKIN_WITH_FIELDS);
    STREAM(ALL, 1, 0);
    host_run(&b.host, 3 * SCAN_MS);
    const fw_tracker *tracker = &b.host.instrument.solve.tracker;
    uint32_t begun = tracker->begun;
    (void)host_info(&b.host);
    (void)host_stats(&b.host, 0);
    host_run(&b.host, 2 * SCAN_MS);
    CHECK_EQUAL(tracker->begun, begun);
    TAKEN(mask_row(3, 1));
    host_run(&b.host, 2 * SCAN_MS);
    CHECK(tracker->begun > begun && tracker->running);
    begun = tracker->begun;
    fw_tracks_hold(&b.host.instrument.link);
    const uint32_t tracked = b.host.instrument.acquire.scan.drives_taken;
    fake_advance(&b.board, 3 * SCAN_MS * 1000000u);
    CHECK_EQUAL(b.host.instrument.acquire.scan.drives_taken, tracked);
    fw_tracks_release(&b.host.instrument.link);
    host_run(&b.host, 3 * SCAN_MS);
    CHECK(tracker->begun > begun && tracker->running);
    begun = tracker->begun;
    TARE(8);
    host_run(&b.host, 2 * SCAN_MS);
    CHECK(tracker->begun > begun && tracker->running);
    STREAM(EITS_STREAM_RAW | EITS_STREAM_IMAGE, 1, 0);
    host_run(&b.host, 2 * SCAN_MS);
    CHECK(!tracker->running && b.host.instrument.acquire.scan.drive_done == NULL);
}

/* Align the frame once more. */
static void align(fw_frame *frame)
{
    fw_instrument *instrument = &b.host.instrument;
    instrument->solve.tracker.owed = true;
    instrument->solve.tracker.owed_frame = frame->number;
    (void)fw_tracks_align(&instrument->link, frame);
}

/* A touch that only frames find is tracked once two of them have found it. A frame that is aligned
 * and not solved does not count. */
TEST(test_a_place_that_frames_find)
{
    set_up(&SKIN_WITH_FIELDS);
    STREAM(EITS_STREAM_DRIVE_TOUCHES, 1, 0);
    host_run(&b.host, 3 * SCAN_MS);
    fw_instrument *instrument = &b.host.instrument;
    fw_frame *frame = &instrument->solve.engine.frames[0];
    align(frame);
    for (uint32_t round = 0; round < 2; ++round) {
        eits_info info = *eits_get_info(instrument->solve.engine.ctx);
        eits_fast_touch touches[EITS_FAST_TOUCHES];
        uint32_t count = 0;
        eits_touch found[EITS_MAX_TOUCHES] = {
            {.id = 3, .x_mm = -2, .y_mm = 1, .strength_s_per_m_mm2 = 4, .explained = 0.5f}};
        /* the second frame with it reports it */
        CHECK_EQUAL(fw_tracker_note(&instrument->solve, true, found, 1, &info), round);
        CHECK(round == 0 || found[0].id == 1);
        for (uint32_t unsolved = 0; unsolved < 3 - 2 * round; ++unsolved)
            align(frame);
        CHECK_OK(
            eits_fast_touches(instrument->solve.engine.fast, touches, EITS_FAST_TOUCHES, &count));
        CHECK_EQUAL(count, round);
        CHECK(round == 0 ||
              touches[0].id == 1); /* drives follow it by the id it was reported with */
    }
}

/* Touches of frames are tracked although no reports are asked for; each frame has its touches, also
 * one in whose scan a touch lands, with the ids of drives. */
TEST(test_frames_alone)
{
    set_up(&SKIN_WITH_FIELDS);
    STREAM(EITS_STREAM_RAW | EITS_STREAM_TOUCHES, 1, 0);
    host_run(&b.host, 5 * SCAN_MS);
    host_forget(&b.host);
    touch(-2, 1, 4);
    host_run(&b.host, 30 * SCAN_MS);
    CHECK_EQUAL(host_count(&b.host, EITS_PACKET_DRIVE_TOUCHES), 0);
    const uint32_t frames = host_count(&b.host, EITS_PACKET_RAW);
    CHECK(frames >= 28);
    CHECK(host_count(&b.host, EITS_PACKET_TOUCHES) + 1 >= frames);
    CHECK(with_flags(EITS_RAW_ALIGNED) == frames);
    CHECK(with_flags(EITS_RAW_ALIGNED | EITS_RAW_TRUSTED) < frames);
    const host_packet *last = host_last(&b.host, EITS_PACKET_TOUCHES);
    eits_packet_solved head;
    memcpy(&head, last->payload, sizeof head);
    CHECK(head.count >= 1);
    eits_fast_touch followed[EITS_FAST_TOUCHES];
    uint32_t known = 0, count = 0;
    CHECK_OK(eits_fast_touches(b.host.instrument.solve.engine.fast, followed, EITS_FAST_TOUCHES,
                               &count));
    for (uint32_t k = 0; k < head.count; ++k) {
        eits_packet_touch one;
        memcpy(&one, last->payload + sizeof head + k * sizeof one, sizeof one);
        known += one.id == followed[0].id;
    }
    CHECK_EQUAL(known, 1);
}

/* A model without fields, and one of whose frames every second is streamed: touches come from
 * frames, at first unconfirmed, and keep their ids, which a tare ends. */
TEST(test_frames_without_drives)
{
    for (uint16_t every = 1; every <= 2; ++every) {
        set_up(every == 1 ? &SKIN_ADJACENT : &SKIN_WITH_FIELDS);
        STREAM(EITS_STREAM_TOUCHES, every, 0);
        host_run(&b.host, 5 * SCAN_MS);
        uint32_t id = 0;
        for (int again = 0; again < 2; ++again) {
            const uint32_t before = id;
            host_forget(&b.host);
            touch(-2, 1, 4);
            host_run(&b.host, 20 * SCAN_MS);
            uint32_t reports = 0;
            for (uint32_t k = 0; k < host_count(&b.host, EITS_PACKET_TOUCHES); ++k) {
                const host_packet *packet = host_packet_of(&b.host, EITS_PACKET_TOUCHES, k);
                eits_packet_solved head;
                eits_packet_touch one;
                memcpy(&head, packet->payload, sizeof head);
                memcpy(&one, packet->payload + sizeof head, head.count > 0 ? sizeof one : 0);
                if (head.count == 0)
                    continue;
                id = reports == 0 ? one.id : id;
                CHECK(one.id == id && id > before && one.confirmed == (reports > 0));
                ++reports;
            }
            CHECK(reports > 5);
            touch(-2, 1, 0.25); /* it lifts */
            host_run(&b.host, 5 * SCAN_MS);
            if (again == 0)
                TARE(8);
        }
    }
}

int main(void)
{
    run_tests();
    CASE("an idle main loop");
    test_a_touch(0, 0);
    CASE("a busy main loop and a slow link");
    test_a_touch(2000, 900000);
    bench_stop(&b);
    return checks_report("tracker");
}
