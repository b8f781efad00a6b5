/* From tare to stream: the reference, images with the same bits as the core's, streaming every n-th
 * frame, back-pressure. */
#include "steps.h"

#include "app/solve/tare.h"

#include "context/context.h"

/* The core as a host runs it beside the board, on the frames that the board sends. */
static struct mirror {
    eits_context *ctx;
    _Alignas(16) uint8_t workspace[FAKE_WORKSPACE];
    _Alignas(16) uint8_t tracker[FAKE_WORKSPACE];
    eits_fast *fast;
    uint32_t taken; /* packets seen */
    uint32_t images, touches, frames_of_events, events, different;
    eits_gestures gestures;
    eits_touch found[EITS_MAX_TOUCHES];
    uint32_t found_count;
    float volts[256];
    uint32_t frame;
} mirror;

static void mirror_start(uint32_t untouched)
{
    memset(&mirror, 0, sizeof mirror);
    CHECK_OK(eits_init(mirror.workspace, eits_workspace_size(&b.open, 0), &b.open, &mirror.ctx));
    eits_options options = *eits_get_options(mirror.ctx);
    CHECK_OK(eits_options_track(&options)); /* as the firmware does */
    options.noise_floor_v = eits_get_options(b.host.instrument.solve.engine.ctx)->noise_floor_v;
    options.warm_start = 1; /* for both, so that a frame depends on earlier ones */
    b.host.instrument.solve.engine.ctx->options.warm_start = 1;
    CHECK_OK(eits_set_options(mirror.ctx, &options));
    CHECK_OK(eits_fast_init(mirror.tracker, FAKE_WORKSPACE, mirror.ctx, &mirror.fast));
    if (untouched > 1)
        CHECK_OK(eits_reference_begin(mirror.ctx, untouched));
}

static int same_bits(const void *a, const void *c, size_t size)
{
    return memcmp(a, c, size) == 0;
}

static void mirror_image(const host_packet *packet)
{
    const eits_packet_solved *head = (const eits_packet_solved *)(const void *)packet->payload;
    const eits_info *info = eits_get_info(mirror.ctx);
    CHECK_EQUAL(head->frame, mirror.frame);
    const eits_status status =
        eits_reconstruct(mirror.ctx, mirror.volts, b.open.n_rows, NULL, NULL);
    ++mirror.images;
    mirror.different +=
        head->status != (uint16_t)-status || head->count != b.open.n_pixels ||
        !same_bits(packet->payload + sizeof *head, mirror.ctx->solver.image, 4 * b.open.n_pixels) ||
        head->iterations != info->iterations || head->macs != info->macs ||
        head->stop != (uint8_t)info->stop || head->masked != info->masked ||
        !same_bits(&head->residual, &info->residual, 4) ||
        !same_bits(&head->lambda, &info->lambda, 4) ||
        !same_bits(&head->data_norm, &info->data_norm, 4);
}

static void mirror_touches(const host_packet *packet)
{
    const eits_packet_solved *head = (const eits_packet_solved *)(const void *)packet->payload;
    eits_touch *touches = mirror.found, found[EITS_MAX_TOUCHES];
    uint32_t count = 0;
    if (mirror.ctx->info.stop != EITS_STOP_BELOW_THRESHOLD || head->status == 0)
        CHECK_OK(eits_find_touches(mirror.ctx, found, EITS_MAX_TOUCHES, &count));
    ++mirror.touches;
    const uint32_t all = count;
    if (head->status == 0)
        CHECK_OK(eits_fast_report(mirror.fast, found, all, touches, &count));
    uint32_t drawn = 0;
    for (uint32_t k = 0; k < count; ++k)
        drawn += touches[k].explained > 0;
    const uint8_t shown =
        drawn < all ? EITS_SHOWN_SOLVER : (uint8_t)eits_get_info(mirror.ctx)->shown;
    mirror.different +=
        head->count != count || head->shown != shown ||
        packet->size != sizeof *head + count * sizeof(eits_packet_touch) ||
        !same_bits(packet->payload + sizeof *head, touches, count * sizeof(eits_packet_touch));
    mirror.found_count = count;
}

/* The board's events are the ones that follow from its touches here. */
static void mirror_events(const host_packet *packet)
{
    const eits_packet_events *head = (const eits_packet_events *)(const void *)packet->payload;
    const eits_packet_event *sent = (const eits_packet_event *)(const void *)(head + 1);
    eits_event events[EITS_MAX_EVENTS];
    uint32_t count = 0;
    CHECK_OK(eits_gestures_update(&mirror.gestures, mirror.found, mirror.found_count, head->time_us,
                                  events, EITS_MAX_EVENTS, &count));
    ++mirror.frames_of_events;
    mirror.events += count;
    mirror.different += head->frame != mirror.frame || head->count != count ||
                        packet->size != sizeof *head + count * sizeof *sent;
    for (uint32_t k = 0; k < count && k < head->count; ++k)
        mirror.different += sent[k].kind != events[k].kind || sent[k].phase != events[k].phase ||
                            sent[k].first_id != events[k].first_id ||
                            sent[k].second_id != events[k].second_id ||
                            !same_bits(&sent[k].x_mm, &events[k].x_mm, 4) ||
                            !same_bits(&sent[k].y_mm, &events[k].y_mm, 4) ||
                            !same_bits(&sent[k].direction_deg, &events[k].direction_deg, 4) ||
                            !same_bits(&sent[k].value, &events[k].value, 4);
}

/* Take the packets that have come since the last call. */
static void mirror_catch_up(void)
{
    for (; mirror.taken < b.host.packets; ++mirror.taken) {
        const host_packet *packet = &b.host.packet[mirror.taken];
        const eits_packet_raw *head = (const eits_packet_raw *)(const void *)packet->payload;
        if (packet->type == EITS_PACKET_RAW) {
            memcpy(mirror.volts, packet->payload + sizeof *head, 4 * b.open.n_rows);
            mirror.frame = head->frame;
            if ((head->flags & EITS_RAW_REFERENCE) != 0)
                CHECK_OK(mirror.ctx->reference.wanted > 0
                             ? eits_reference_add(mirror.ctx, mirror.volts, b.open.n_rows)
                             : eits_reference_set(mirror.ctx, mirror.volts, b.open.n_rows));
        } else if (packet->type == EITS_PACKET_REPLY &&
                   ((const eits_packet_reply *)(const void *)head)->command == EITS_PACKET_TARE) {
            if (mirror.ctx->reference.wanted > 0)
                CHECK_OK(eits_reference_finish(mirror.ctx));
            eits_forget(mirror.ctx);
            eits_fast_forget_all(mirror.fast);
            CHECK_OK(eits_gestures_init(&mirror.gestures, NULL));
        } else if (packet->type == EITS_PACKET_IMAGE) {
            mirror_image(packet);
        } else if (packet->type == EITS_PACKET_TOUCHES) {
            mirror_touches(packet);
        } else if (packet->type == EITS_PACKET_EVENTS) {
            mirror_events(packet);
        }
    }
}

/* Images and touches have the same bits as those that the core computes here from the frames that
 * were sent, with warm starts and masked rows. */
typedef struct stream_case {
    const char *name;
    const skin_spec *spec;
    uint32_t untouched;
    uint16_t every, check_every;
    uint32_t busy_ms, run_ms; /* of each write; of each part of the test */
} stream_case;

static void test_same_bits(const stream_case *c)
{
    CASE(c->name);
    bench_start(&b, c->spec);
    b.board.noise_codes = 2;
    b.board.write_cost_ns =
        c->busy_ms * 1000000u; /* meanwhile the scan continues while it has a free frame */
    if (c->check_every != 1)
        check_each(c->check_every);
    STREAM(EITS_STREAM_RAW, 1, 0);
    host_forget(&b.host);
    mirror_start(c->untouched);
    TARE(c->untouched);
    STREAM(15, c->every, 0);
    mirror_catch_up();
    CHECK(b.host.instrument.solve.engine.ctx->reference.correlation > 0.99f);
    CHECK(same_bits(mirror.ctx->reference.v0, b.host.instrument.solve.engine.ctx->reference.v0,
                    4 * b.open.n_rows));
    CHECK(same_bits(&mirror.ctx->reference.lambda_noise,
                    &b.host.instrument.solve.engine.ctx->reference.lambda_noise, 4));
    touch(2, -3, 4);
    host_run(&b.host, c->run_ms);
    touch(-4, 1, 3);
    host_run(&b.host, c->run_ms);
    mirror_catch_up();
    STREAM(EITS_STREAM_RAW, 1, 0);
    if (c->untouched > 1)
        CHECK_OK(eits_reference_begin(mirror.ctx, c->untouched));
    /* a tare of touched frames: the touches and their ids are gone */
    TARE(c->untouched);
    STREAM(15, c->every, 0);
    touch(4, -2, 3);
    host_run(&b.host, c->run_ms);
    mirror_catch_up();
    TAKEN(mask_row(17, 1));
    host_run(&b.host, c->run_ms);
    mirror_catch_up(); /* the row comes as NaN, and nothing else is needed */
    sheet_init(&b.sheet);
    host_run(&b.host, c->run_ms);
    mirror_catch_up();
    CHECK(mirror.images >= 25u / c->every);
    CHECK_EQUAL(mirror.images, mirror.touches);
    CHECK_EQUAL(mirror.images, mirror.frames_of_events);
    CHECK(mirror.events > 0);
    CHECK_EQUAL(mirror.different, 0);
    CHECK_EQUAL(b.host.gaps, 0);
    CHECK_EQUAL(host_info(&b.host).tared, 1);
}

/* If the skin is the model's, the gain is 1 and voltages have the right sign at every phase. */
TEST(test_phase_of_the_voltages)
{
    for (int k = 0; k < 9; ++k) {
        bench_start(&b, &SKIN_ADJACENT);
        b.board.extra_turn = k / 9.0;
        STREAM(EITS_STREAM_RAW, 1, 0);
        TARE(8);
        CHECK_NEAR(b.host.instrument.solve.engine.ctx->reference.gain, 1, 1e-3);
        CHECK(b.host.instrument.solve.engine.ctx->reference.correlation > 0.9999f);
        host_run(&b.host, 3000); /* the generator, 12 mHz off, would turn by 13 degrees */
        CHECK(raw_steps_off(host_last(&b.host, EITS_PACKET_RAW), 1) <= 0.5);
        /* a turn after the tare is not corrected: half of the voltage is left */
        b.board.extra_turn += 1 / 6.0;
        host_run(&b.host, 60);
        CHECK(raw_steps_off(host_last(&b.host, EITS_PACKET_RAW), 0.5) <= 0.5);
    }
}

TEST(test_streaming)
{
    bench_start(&b, &SKIN_ADJACENT);
    TARE(1);
    STREAM(EITS_STREAM_TOUCHES, 3, 5);
    hear(600);
    CHECK_EQUAL(host_count(&b.host, EITS_PACKET_TOUCHES), 5);
    CHECK_EQUAL(host_count(&b.host, EITS_PACKET_IMAGE) + host_count(&b.host, EITS_PACKET_RAW), 0);
    for (uint32_t k = 1; k < 5; ++k) {
        const eits_packet_solved *now =
            (const void *)host_packet_of(&b.host, EITS_PACKET_TOUCHES, k)->payload;
        const eits_packet_solved *last =
            (const void *)host_packet_of(&b.host, EITS_PACKET_TOUCHES, k - 1)->payload;
        CHECK_EQUAL(now->frame - last->frame, 3);
        CHECK(now->age_us < 1000);
    }
    CHECK_EQUAL(host_info(&b.host).streaming, 0); /* it stops after five */
    CHECK_EQUAL(host_stats(&b.host, 0).frames_solved, 5);
    host_forget(&b.host);
    STREAM(EITS_STREAM_EVENTS, 1, 4);
    host_run(&b.host, 200);
    CHECK_EQUAL(host_count(&b.host, EITS_PACKET_EVENTS), 4); /* also if nothing happened */
    CHECK_EQUAL(host_count(&b.host, EITS_PACKET_TOUCHES), 0);
    CHECK_EQUAL(host_packet_of(&b.host, EITS_PACKET_EVENTS, 0)->size, sizeof(eits_packet_events));
    STREAM(EITS_STREAM_IMAGE, 2, 0);
    const eits_packet_info info = host_info(&b.host);
    CHECK_EQUAL(info.streaming, EITS_STREAM_IMAGE);
    CHECK_EQUAL(info.every, 2);
    STREAM(0, 1, 0);
    hear(200);
    CHECK_EQUAL(b.host.packets, 0);
}

/* If the link is full, whole packets are dropped and counted, and nothing waits. */
TEST(test_back_pressure)
{
    bench_start(&b, &SKIN_ADJACENT);
    TARE(1);
    STREAM(7, 1, 0);
    const uint32_t sent = b.host.instrument.link.tx_queue.sent;
    b.host.gaps = 0;
    b.board.host_room = 3000;
    host_run(&b.host, 200);
    const uint32_t frames = b.host.instrument.safety.faults.frame;
    b.board.host_room = SIZE_MAX;
    host_run(&b.host, 200);
    CHECK(b.host.instrument.safety.faults.frame >= frames + 9);
    const eits_packet_stats stats = host_stats(&b.host, 0);
    CHECK(stats.packets_dropped >= 15);
    CHECK_EQUAL(b.host.gaps, stats.packets_dropped);
    CHECK(stats.packets_sent > sent);
    CHECK_EQUAL(b.host.decoder.crc_errors + b.host.decoder.framing_errors, 0);
}

/* A tare that fails keeps the last reference, its phase and its images. */
TEST(test_failed_tare)
{
    bench_start(&b, &SKIN_ADJACENT);
    TARE(16);
    STREAM(EITS_STREAM_RAW | EITS_STREAM_IMAGE, 1, 0);
    mirror_start(0);
    const fw_engine *engine = &b.host.instrument.solve.engine;
    static float v0[256];
    memcpy(v0, engine->ctx->reference.v0, sizeof(float) * 208);
    const eits_reference before = engine->ctx->reference;
    const float cosine = engine->cosine;
    touch(0, 0, 5);
    eits_command_tare tare = {.request = ++b.host.request, .frames = 16};
    host_send(&b.host, EITS_PACKET_TARE, &tare, sizeof tare);
    host_run(&b.host, 180); /* half of it */
    b.sheet.detached[3] = true;
    b.board.extra_turn += 0.1;
    const eits_packet_reply reply = host_reply(&b.host, tare.request);
    CHECK_EQUAL(reply.status, EITS_REPLY_CORE);
    CHECK_EQUAL(reply.detail[0], EITS_E_FRAME_ROWS);
    CHECK(same_bits(v0, engine->ctx->reference.v0, sizeof(float) * 208));
    CHECK_EQUAL(engine->ctx->reference.ready, 1);
    CHECK(same_bits(&before.noise_v, &engine->ctx->reference.noise_v, 4));
    CHECK(same_bits(&before.gain, &engine->ctx->reference.gain, 4));
    CHECK(engine->cosine == cosine);
    CHECK_EQUAL(host_info(&b.host).tared, 1);
    b.sheet.detached[3] = false;
    b.board.extra_turn -= 0.1;
    sheet_init(&b.sheet);
    hear(100);
    const host_packet *image = host_last(&b.host, EITS_PACKET_IMAGE);
    CHECK(image != NULL);
    float peak = 0;
    for (uint32_t j = 0; image != NULL && j < b.open.n_pixels; ++j) {
        float value;
        memcpy(&value, image->payload + sizeof(eits_packet_solved) + 4 * j, 4);
        peak = value > peak ? value : peak;
    }
    CHECK(peak < 1e-5f);
}

/* A tare in which something lands on the skin is refused, and the last reference stays. */
TEST(test_tare_of_a_skin_that_is_touched_meanwhile)
{
    bench_start(&b, &SKIN_ADJACENT);
    TARE(16);
    static float v0[256];
    const fw_engine *engine = &b.host.instrument.solve.engine;
    memcpy(v0, engine->ctx->reference.v0, sizeof(float) * 208);
    eits_command_tare tare = {.request = ++b.host.request, .frames = 16};
    host_send(&b.host, EITS_PACKET_TARE, &tare, sizeof tare);
    host_run(&b.host, 180); /* half of it */
    touch(0, 0, 5);
    const eits_packet_reply reply = host_reply(&b.host, tare.request);
    CHECK_EQUAL(reply.status, EITS_REPLY_CORE);
    CHECK_EQUAL(reply.detail[0], EITS_E_REFERENCE_TOUCHED);
    CHECK(same_bits(v0, engine->ctx->reference.v0, sizeof(float) * 208));
    CHECK_EQUAL(host_info(&b.host).tared, 1);
}

/* A tare can be undone once: the reference before it comes back, with the options that were set
 * since. */
TEST(test_undo_of_a_tare)
{
    bench_start(&b, &SKIN_ADJACENT);
    static float v0[256];
    const fw_engine *engine = &b.host.instrument.solve.engine;
    TARE(16);
    CHECK_EQUAL(host_tare(&b.host, 0).status, EITS_REPLY_NOT_TARED); /* there was none before */
    memcpy(v0, engine->ctx->reference.v0, sizeof(float) * 208);
    touch(0, 0, 5);
    TARE(16);
    CHECK(!same_bits(v0, engine->ctx->reference.v0, sizeof(float) * 208));
    eits_options options = *eits_get_options(engine->ctx);
    options.iterations = 7;
    CHECK_OK(fw_solve_set_options(&b.host.instrument.solve, &options));
    TARE(0);
    CHECK(same_bits(v0, engine->ctx->reference.v0, sizeof(float) * 208));
    CHECK_EQUAL(eits_get_options(engine->ctx)->iterations, 7);
    CHECK_EQUAL(host_tare(&b.host, 0).status, EITS_REPLY_NOT_TARED);
    TARE(16);
    TAKEN(mask_row(17, 1));
    CHECK_EQUAL(host_tare(&b.host, 0).status, EITS_REPLY_NOT_TARED); /* other masks */
    TAKEN(mask_row(17, 0));
    TARE(16);
    TAKEN(host_plain(&b.host, EITS_PACKET_SELF_TEST));
    CHECK_EQUAL(host_tare(&b.host, 0).status, EITS_REPLY_NOT_TARED); /* its place was needed */
}

/* Frames whose scan began before the command do not count as untouched. All frames of a tare are
 * sent, whatever `every` is. */
TEST(test_reference_frames)
{
    bench_start(&b, &SKIN_ADJACENT);
    STREAM(EITS_STREAM_RAW, 5, 0);
    host_run(&b.host, 31);
    host_forget(&b.host);
    const uint32_t asked_us = (uint32_t)(b.board.now_ns / 1000);
    TARE(6);
    uint32_t untouched = 0, last = 0;
    for (uint32_t k = 0; k < b.host.packets; ++k) {
        const eits_packet_raw *head = (const void *)b.host.packet[k].payload;
        if (b.host.packet[k].type != EITS_PACKET_RAW || (head->flags & EITS_RAW_REFERENCE) == 0)
            continue;
        CHECK((int32_t)(head->time_us - asked_us) >= 0);
        CHECK(untouched == 0 || head->frame == last + 1);
        last = head->frame;
        ++untouched;
    }
    CHECK_EQUAL(untouched, 6);
    CHECK_EQUAL(b.host.packet[b.host.packets - 1].type, EITS_PACKET_REPLY);
}

TEST(test_self_test_keeps_the_tare)
{
    bench_start(&b, &SKIN_ADJACENT);
    STREAM(EITS_STREAM_RAW, 1, 0);
    host_forget(&b.host);
    mirror_start(4);
    TARE(4);
    STREAM(7, 1, 0);
    touch(3, 3, 4);
    host_run(&b.host, 100);
    mirror_catch_up();
    STREAM(EITS_STREAM_RAW, 1, 0);
    TAKEN(host_plain(&b.host, EITS_PACKET_SELF_TEST));
    STREAM(7, 1, 0);
    mirror_catch_up();
    eits_forget(mirror.ctx);          /* a self-test forgets the warm start */
    mirror.ctx->projection.stale = 1; /* and the basis, which costs MACs to build again */
    host_run(&b.host, 100);
    mirror_catch_up();
    CHECK(mirror.images >= 8);
    CHECK_EQUAL(mirror.different, 0);
    /* nor does it forget the phase: a turn now is not corrected */
    b.board.extra_turn += 1 / 6.0;
    host_run(&b.host, 60);
    const float volts = raw_volts(host_last(&b.host, EITS_PACKET_RAW), 0);
    CHECK_NEAR(volts, 0.5 * bench_volts(&b, 0), 0.5 * fake_lsb_v(&b.board));
}

/* A tare takes frames whose scan began with the command or later, also if the clock wraps. */
TEST(test_tare_begins_with_the_command)
{
    static const struct {
        const char *name;
        uint32_t since_us;
    } commands[] = {{"no wrap", 1000},
                    {"the clock is at 0", 0},
                    {"the clock is about to wrap", 0xFFFFFFFFu},
                    {"half of the clock's range", 0x80000000u}};
    for (size_t k = 0; IN_TABLE(k, commands); ++k) {
        CASE(commands[k].name);
        const fw_solve tare = {.tare = {.active = true, .since_us = commands[k].since_us}},
                       over = {.tare = {.since_us = commands[k].since_us}};
        for (int late = -2; late <= 2; ++late) {
            const fw_frame frame = {.time_us = commands[k].since_us + (uint32_t)late};
            CHECK_EQUAL(fw_tare_wants(&tare, &frame), late >= 0);
            CHECK(!fw_tare_wants(&over, &frame));
        }
    }
}

int main(void)
{
    const stream_case cases[] = {
        {"every frame", &SKIN_ADJACENT, 8, 1, 1, 0, 150},
        {"one untouched frame, every second frame", &SKIN_ADJACENT, 1, 2, 1, 0, 150},
        {"reciprocal scans of an opposite protocol", &SKIN_OPPOSITE, 5, 1, 4, 0, 150},
        {"a slow link", &SKIN_ADJACENT, 4, 1, 1, 50, 1500},
    };
    for (size_t k = 0; k < COUNT_OF(cases); ++k)
        test_same_bits(&cases[k]);
    run_tests();
    bench_stop(&b);
    return checks_report("instrument");
}
