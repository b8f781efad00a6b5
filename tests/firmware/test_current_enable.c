/* Current flows only while a host that asked for frames is heard; the owner's settings and lock;
 * the limit on current; hashes. */
#include "steps.h"

#include "app/acquire/demodulate.h"
#include "app/link/sha256.h"
#include "app/safety/current_enable.h"
#include "app/safety/owner_record.h"

static bool drives(void)
{
    return (b.board.monitor.lines & DRIVE_MONITOR_ENABLES) != 0 || fake_generator_hz(&b.board) > 0;
}

/* Start with a host that is heard only by its packets. */
static void start_unheard(void)
{
    b.host.quiet = true;
    bench_start(&b, &SKIN_ADJACENT);
}

static void keep_alive(uint32_t present)
{
    const eits_command_keepalive c = {0, present};
    host_send(&b.host, EITS_PACKET_KEEPALIVE, &c, sizeof c);
    host_step(&b.host);
}

static void run_alive(uint32_t ms)
{
    for (; ms > 0; ms -= ms < 250 ? ms : 250) {
        keep_alive(1);
        host_run(&b.host, ms < 250 ? ms : 250);
    }
}

static eits_packet_reply set_named(uint32_t settings, uint32_t limit_ua, const char *name)
{
    eits_command_settings c = {0, settings, limit_ua, {0}, 0, 0};
    memcpy(c.name, name, strlen(name));
    return host_command(&b.host, EITS_PACKET_SETTINGS, &c, sizeof c);
}

static eits_packet_reply set(uint32_t settings, uint32_t limit_ua)
{
    return set_named(settings, limit_ua, "");
}

TEST(test_off_until_asked)
{
    start_unheard();
    CHECK_EQUAL(b.board.generator.control & AD9833_MODEL_RESET, AD9833_MODEL_RESET);
    host_run(&b.host, 5000);
    CHECK(!drives());
    run_alive(1000); /* keepalives and questions do not ask for current */
    CHECK_EQUAL(host_info(&b.host).drive, EITS_DRIVE_OFF);
    (void)host_stats(&b.host, 0);
    TAKEN(host_plain(&b.host, EITS_PACKET_SELF_TEST));
    STREAM(0, 1, 0);
    CHECK(!drives());
    CHECK_EQUAL(b.board.bursts, 0);
    TARE(4);
    CHECK(drives());
    CHECK_EQUAL(host_info(&b.host).drive, EITS_DRIVE_ON);
    keep_alive(0); /* the host says that it leaves */
    CHECK(!drives());
    CHECK_EQUAL(host_info(&b.host).drive, EITS_DRIVE_OFF);
}

/* Silence ends the current and the stream within a second, but not the reference: a host that asks
 * again gets frames against the same tare. */
TEST(test_silence)
{
    start_unheard();
    b.board.board.settle_frames = 2;
    TARE(4);
    STREAM(EITS_STREAM_RAW | EITS_STREAM_IMAGE, 1, 0);
    run_alive(3000);
    CHECK(drives());
    const host_packet *raw = host_last(&b.host, EITS_PACKET_RAW);
    float before[208];
    for (uint32_t i = 0; i < 208; ++i)
        before[i] = raw_volts(raw, i);
    keep_alive(1);
    host_run(&b.host, 850);
    CHECK(drives());
    host_run(&b.host, 150);
    CHECK(!drives());
    hear(2000);
    CHECK_EQUAL(host_count(&b.host, EITS_PACKET_RAW), 0);
    const eits_packet_info info = host_info(&b.host);
    CHECK_EQUAL(info.drive, EITS_DRIVE_SILENT);
    CHECK_EQUAL(info.streaming, 0);
    CHECK_EQUAL(info.tared, 1);
    host_run(&b.host, 20); /* the host is heard, but did not ask again */
    CHECK(!drives());
    const uint32_t scanned = host_stats(&b.host, 0).frames_scanned;
    STREAM(EITS_STREAM_RAW | EITS_STREAM_IMAGE, 1, 0);
    host_run(&b.host, 200);
    raw = host_packet_of(&b.host, EITS_PACKET_RAW, 0);
    const eits_packet_raw *head = (const void *)raw->payload;
    CHECK_EQUAL(head->frame, scanned + 2); /* two were dropped while capacitors settled */
    for (uint32_t i = 0; i < 208; ++i)
        CHECK_NEAR(raw_volts(raw, i), before[i], fake_lsb_v(&b.board));
    CHECK(host_count(&b.host, EITS_PACKET_IMAGE) > 0);
    /* a tare fails if the host falls silent, and the old reference stays */
    eits_command_tare c = {77, 200};
    host_send(&b.host, EITS_PACKET_TARE, &c, sizeof c);
    host_run(&b.host, 1500);
    const eits_packet_reply reply = host_reply(&b.host, 77);
    CHECK_EQUAL(reply.status, EITS_REPLY_CORE);
    CHECK_EQUAL(host_info(&b.host).tared, 1);
}

TEST(test_owner_keeps_it)
{
    start_unheard();
    TAKEN(set(EITS_SETTING_KEEP_CURRENT, 0));
    CHECK(drives());
    b.board.monitor.needs_host = false; /* the owner allows it */
    b.host.kept_on = true;
    host_run(&b.host, 5000);
    keep_alive(0);
    CHECK(drives());
    bench_restart(&b);
    CHECK(drives());
    CHECK_EQUAL(host_info(&b.host).settings, EITS_SETTING_KEEP_CURRENT);
    b.host.kept_on = false;
}

TEST(test_lock)
{
    start_unheard();
    CHECK_EQUAL(set(16, 0).status, EITS_REPLY_RANGE);
    CHECK_EQUAL(set(0, 10001).status, EITS_REPLY_RANGE);
    TAKEN(set(EITS_SETTING_LOCKED, 400));
    bench_restart(&b);
    CHECK_EQUAL(host_info(&b.host).settings, EITS_SETTING_LOCKED);
    CHECK_EQUAL(host_info(&b.host).current_limit_ua_rms, 400);
    const struct {
        const char *name;
        bool button;
        uint16_t status;
        bool reported;
        uint32_t settings; /* afterwards */
    } cases[] = {
        {"button not held", false, EITS_REPLY_LOCKED, true, EITS_SETTING_LOCKED},
        {"button held", true, EITS_REPLY_OK, false, EITS_SETTING_SENSE},
    };
    eits_command_model_begin begin = {0, 64, 0};
    eits_command_scan scan = host_default_scan();
    scan.excitation_millihz = 25000000;
    for (size_t k = 0; IN_TABLE(k, cases); ++k) {
        CASE(cases[k].name);
        b.board.button = cases[k].button;
        host_forget(&b.host);
        CHECK_EQUAL(scan_with(scan).status, cases[k].status);
        const eits_packet_fault *fault = host_fault(&b.host, EITS_FAULT_LOCKED, true, 0);
        CHECK_EQUAL(fault != NULL, cases[k].reported);
        CHECK(fault == NULL || fault->index == EITS_PACKET_SCAN);
        CHECK_EQUAL(host_command(&b.host, EITS_PACKET_MODEL_BEGIN, &begin, sizeof begin).status,
                    cases[k].status);
        host_run(&b.host, 11000); /* the upload times out */
        CHECK_EQUAL(set(EITS_SETTING_SENSE, 0).status, cases[k].status);
        CHECK_EQUAL(host_info(&b.host).settings, cases[k].settings);
    }
}

/* A name that cannot be a part of topics and addresses is refused and changes nothing; another one
 * is in INFO, also after a restart, and goes where none is given. */
TEST(test_name)
{
    start_unheard();
    CHECK_EQUAL(host_info(&b.host).name[0], 0);
    const char longest[] = "0123456789-abcdefghij_KLMNOPQRST";
    TAKEN(set_named(EITS_SETTING_SENSE, 400, longest));
    bench_restart(&b);
    const char *const refused[] = {"a b", "-a", "_a", "a/b", "a.b", "a#", "\xc3\xa4", "a\n", "~"};
    for (size_t k = 0; IN_TABLE(k, refused); ++k) {
        CASE(refused[k]);
        const eits_packet_reply reply = set_named(0, 0, refused[k]);
        CHECK_EQUAL(reply.status, EITS_REPLY_RANGE);
        CHECK_EQUAL(reply.detail[0], offsetof(eits_command_settings, name));
    }
    eits_command_settings behind = {0, 0, 0, "a", 0, 0};
    behind.name[EITS_NAME_CHARACTERS - 1] = 'b'; /* not zero-filled */
    CHECK_EQUAL(host_command(&b.host, EITS_PACKET_SETTINGS, &behind, sizeof behind).status,
                EITS_REPLY_RANGE);
    const eits_packet_info info = host_info(&b.host);
    CHECK(memcmp(info.name, longest, sizeof info.name) == 0);
    CHECK_EQUAL(info.settings, EITS_SETTING_SENSE);
    CHECK_EQUAL(info.current_limit_ua_rms, 400);
    TAKEN(set(0, 0));
    CHECK_EQUAL(host_info(&b.host).name[0], 0);
}

/* Source and gain as fitted scale the volts and the safe frequency; they are kept, also where a
 * later command leaves them; out of range they are refused and change nothing. */
TEST(test_source_and_gain)
{
    start_unheard();
    b.board.board.source_ua = 500;
    b.board.board.gain_ppm = 3000000;
    eits_command_settings c = {0, 0, 0, {0}, 250, 6000000};
    const uint32_t before_nv = fw_volts_per_code_nv(&b.board.board.capture);
    TAKEN(host_command(&b.host, EITS_PACKET_SETTINGS, &c, sizeof c));
    eits_packet_info info = host_info(&b.host);
    CHECK_EQUAL(info.source_ua, 250);
    CHECK_EQUAL(info.source_ua_rms, 176);
    CHECK_EQUAL(info.current_limit_ua_rms, 176 + 44);
    CHECK_EQUAL(info.gain_ppm, 6000000);
    const fw_capture fitted = {.full_scale_code = b.board.board.capture.full_scale_code,
                               .reference_uv = b.board.board.capture.reference_uv,
                               .front_end_gain_ppm = 1500000};
    CHECK_EQUAL(info.volts_per_code_nv, fw_volts_per_code_nv(&fitted));
    CHECK(before_nv > 0);
    c.source_ua = c.gain_ppm = EITS_KEPT;
    TAKEN(host_command(&b.host, EITS_PACKET_SETTINGS, &c, sizeof c));
    CHECK_EQUAL(host_info(&b.host).source_ua, 250);
    const struct {
        uint32_t source_ua, gain_ppm, offset;
    } refused[] = {{9, 0, offsetof(eits_command_settings, source_ua)},
                   {7001, 0, offsetof(eits_command_settings, source_ua)},
                   {0, 9999, offsetof(eits_command_settings, gain_ppm)},
                   {0, 400000001, offsetof(eits_command_settings, gain_ppm)}};
    for (size_t k = 0; IN_TABLE(k, refused); ++k) {
        c.source_ua = refused[k].source_ua;
        c.gain_ppm = refused[k].gain_ppm;
        const eits_packet_reply reply = host_command(&b.host, EITS_PACKET_SETTINGS, &c, sizeof c);
        CHECK_EQUAL(reply.status, EITS_REPLY_RANGE);
        CHECK_EQUAL(reply.detail[0], refused[k].offset);
    }
    CHECK_EQUAL(host_info(&b.host).gain_ppm, 6000000);
    c.source_ua = c.gain_ppm = 0;
    TAKEN(host_command(&b.host, EITS_PACKET_SETTINGS, &c, sizeof c));
    info = host_info(&b.host);
    CHECK_EQUAL(info.source_ua, 500);
    CHECK_EQUAL(info.source_ua_rms, 350);
}

static fw_status save(const fw_store *store, uint32_t settings)
{
    fw_owner_record wanted = {.settings = settings, .current_limit_ua_rms = 100 + settings};
    wanted.name[EITS_NAME_CHARACTERS - 1] = (char)settings;
    return fw_owner_record_save(store, &wanted);
}

/* Power is cut at any write while settings change, also when a page is full and erased: afterwards
 * the old settings or the new ones are valid. */
TEST(test_cuts)
{
    static fw_store store; /* not in registers that longjmp forgets */
    static volatile uint32_t step, saved;
    for (step = 1; step < 240; ++step) {
        fake_init(&b.board, 0);
        store = b.board.board.store;
        uint32_t done = 0;
        for (; done < 7; ++done)
            CHECK_EQUAL(save(&store, done), FW_OK);
        b.board.cut_at = b.board.flash_steps + step;
        saved = done;
        if (setjmp(b.board.cut) == 0) {
            for (; saved < 14; ++saved)
                (void)save(&store, saved);
        }
        b.board.cut_at = 0;
        const fw_owner_record kept = fw_owner_record_load(&store);
        CHECK(kept.magic == FW_OWNER_RECORD_MAGIC &&
              kept.current_limit_ua_rms == 100 + kept.settings &&
              kept.name[EITS_NAME_CHARACTERS - 1] == (char)kept.settings);
        CHECK(kept.settings + 1 == saved || kept.settings == saved);
        for (uint32_t more = 20; more < 40; ++more) { /* later changes work */
            CHECK_EQUAL(save(&store, more), FW_OK);
            CHECK_EQUAL(fw_owner_record_load(&store).settings, more);
        }
        CHECK_EQUAL(b.board.rewrites, 0);
    }
    store.page_bytes = 0;
    CHECK_EQUAL(save(&store, 1), FW_E_RANGE);
    CHECK_EQUAL(fw_owner_record_load(&store).magic, 0);
}

TEST(test_limit)
{
    start_unheard();
    TAKEN(set(0, EITS_KEPT));
    CHECK_EQUAL(fw_owner_record_load(&b.board.board.store).current_limit_ua_rms, 0);
    CHECK_EQUAL(host_info(&b.host).current_limit_ua_rms, 437); /* 1.25 times 350 */
    b.board.current_ua = 500;
    STREAM(EITS_STREAM_RAW, 1, 0);
    run_alive(500);
    CHECK(drives()); /* the owner has not said that the board can measure it */
    TAKEN(set(EITS_SETTING_SENSE, 400));
    CHECK(!drives());
    b.board.current_ua = 400;
    STREAM(EITS_STREAM_RAW, 1, 0);
    run_alive(500);
    CHECK(drives());
    CHECK_EQUAL(host_info(&b.host).current_ua_rms, 400);
    host_forget(&b.host);
    b.board.current_ua = 401;
    run_alive(60);
    CHECK(!drives());
    const eits_packet_fault *fault = host_fault(&b.host, EITS_FAULT_CURRENT, true, 0);
    CHECK(fault != NULL && fault->value == 401);
    CHECK_EQUAL(host_info(&b.host).drive, EITS_DRIVE_TRIPPED);
    CHECK_EQUAL(host_info(&b.host).current_ua_rms, 401);
    CHECK_EQUAL(host_stream(&b.host, EITS_STREAM_RAW, 1, 0).status, EITS_REPLY_TRIPPED);
    CHECK_EQUAL(host_tare(&b.host, 4).status, EITS_REPLY_TRIPPED);
    TAKEN(set(EITS_SETTING_KEEP_CURRENT | EITS_SETTING_SENSE, 400));
    CHECK(!drives());
    TAKEN(set(EITS_SETTING_SENSE, EITS_KEPT));
    CHECK_EQUAL(host_info(&b.host).current_limit_ua_rms, 400);
    TAKEN(host_plain(&b.host, EITS_PACKET_CLEAR_FAULTS));
    b.board.current_ua = 350;
    TARE(4);
    TAKEN(set(EITS_SETTING_SENSE, 1)); /* the lowest limit */
    STREAM(EITS_STREAM_RAW, 1, 0);
    run_alive(500);
    CHECK_EQUAL(host_info(&b.host).drive, EITS_DRIVE_TRIPPED);
}

/* If the multiplexers do not open when current is asked for, none flows until they do. */
TEST(test_lines_that_do_not_open)
{
    start_unheard();
    b.board.lines_fail_from = b.board.lines_calls;
    b.board.lines_fails = 1000000;
    eits_command_tare c = {5, 4};
    host_send(&b.host, EITS_PACKET_TARE, &c, sizeof c);
    run_alive(300);
    CHECK_EQUAL(b.board.generator.control & AD9833_MODEL_RESET, AD9833_MODEL_RESET);
    CHECK(!drives());
    CHECK((host_info(&b.host).faults & 1u << EITS_FAULT_BUS) != 0);
    b.board.lines_fails = 0;
    run_alive(500);
    CHECK(drives());
    TAKEN(host_reply(&b.host, c.request)); /* the tare has waited */
    CHECK_EQUAL(host_info(&b.host).faults & 1u << EITS_FAULT_BUS, 0);
}

TEST(test_resets_are_reported)
{
    start_unheard();
    b.board.board.last_reset = (fw_last_reset){.clock = 1, .supply = 1};
    host_start(&b.host, &b.board);
    CHECK(host_fault(&b.host, EITS_FAULT_CLOCK, true, 0) != NULL);
    CHECK(host_fault(&b.host, EITS_FAULT_SUPPLY, true, 0) != NULL);
}

/* Examples of FIPS 180-2, appendix B. */
TEST(test_sha256)
{
    static uint8_t million[1000000];
    memset(million, 'a', sizeof million);
    const struct {
        const char *name;
        const void *bytes;
        size_t size;
        uint8_t digest[4]; /* its beginning */
    } cases[] = {
        {"no bytes", NULL, 0, {0xe3, 0xb0, 0xc4, 0x42}},
        {"three bytes", "abc", 3, {0xba, 0x78, 0x16, 0xbf}},
        {"two blocks",
         "abcdbcdecdefdefgefghfghighijhijkijkljklmklmnlmnomnopnopq",
         56,
         {0x24, 0x8d, 0x6a, 0x61}},
        {"a million times a", million, sizeof million, {0xcd, 0xc7, 0x6e, 0x5c}},
    };
    for (size_t k = 0; IN_TABLE(k, cases); ++k) {
        uint8_t digest[32];
        CASE(cases[k].name);
        fw_sha256(cases[k].bytes, cases[k].size, digest);
        CHECK(memcmp(digest, cases[k].digest, 4) == 0);
    }
}

TEST(test_hashes)
{
    start_unheard();
    b.board.board.image = (const uint8_t *)"abc";
    b.board.board.image_bytes = 3;
    const eits_command_plain c = {31};
    host_send(&b.host, EITS_PACKET_GET_HASHES, &c, sizeof c);
    host_run(&b.host, 10);
    const eits_packet_hashes *hashes =
        (const void *)host_last(&b.host, EITS_PACKET_HASHES)->payload;
    uint8_t digest[32];
    fw_sha256(b.model.blob, b.model.size, digest);
    CHECK_EQUAL(hashes->request, 31);
    CHECK(memcmp(hashes->model, digest, 32) == 0);
    fw_sha256((const uint8_t *)"abc", 3, digest);
    CHECK(memcmp(hashes->firmware, digest, 32) == 0);
}

RUN_TESTS("drive", bench_stop(&b))
