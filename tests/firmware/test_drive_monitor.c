/* The drive monitor finds violations: in traces written by hand, and in an instrument with a
 * planted fault. */
#include "steps.h"

#include "app/instrument.h"
#include "app/safety/current_enable.h"

enum {
    MS = 1000000,
    ALL = 0xF0000,
    OTHERS = 0xF00000,
    ROW = 0x3210,
    NEXT = 0x4321,
    FULL = 0x2000,
    RESET = 0x2100
};
enum { END, HOST, WORD, ADDRESSES, ENABLES, WAIT, LOOK };

typedef struct step {
    int what;
    uint32_t value;
} step;

#define RUNS {WORD, FULL}
#define JOIN          \
    {ADDRESSES, ROW}, \
    {                 \
        ENABLES, ALL  \
    }
#define OPEN                        \
    {ENABLES, 0},                   \
    {                               \
        WAIT, DRIVE_MONITOR_OPEN_NS \
    }
#define LATE {WAIT, DRIVE_MONITOR_SILENT_NS + 1}

static const struct trace {
    const char *violation; /* NULL: none */
    step steps[12];
} TRACES[] = {
    {NULL, {{HOST, 0}, RUNS, JOIN, OPEN, {ADDRESSES, NEXT}, {ENABLES, ALL}, {LOOK, 0}}},
    {NULL, {{HOST, 0}, RUNS, JOIN, LATE, {HOST, 0}, {LOOK, 0}}},
    {NULL, {{HOST, 0}, RUNS, JOIN, {WAIT, DRIVE_MONITOR_SILENT_NS}, {LOOK, 0}}},
    {NULL, {{HOST, 0}, RUNS, JOIN, {WORD, RESET}, LATE, {LOOK, 0}}},
    {"a multiplexer's address changes while it is enabled",
     {{HOST, 0}, RUNS, JOIN, {ADDRESSES, NEXT}}},
    {"a multiplexer's address changes before it is open",
     {{HOST, 0}, RUNS, JOIN, {ENABLES, 0}, {WAIT, DRIVE_MONITOR_OPEN_NS - 1}, {ADDRESSES, NEXT}}},
    {"I+ and I- are on the same electrode", {{HOST, 0}, {ADDRESSES, 0x3211}, {ENABLES, ALL}}},
    {NULL, {{HOST, 0}, {ADDRESSES, 0x3211}, {ENABLES, 0xD0000 | 0x200000}}}, /* electrodes 1, 17 */
    {"I+ and I- are on the same electrode", {{HOST, 0}, {ADDRESSES, 0x3211}, {ENABLES, OTHERS}}},
    {"one of I+, I-, V+ and V- is on two electrodes",
     {{HOST, 0}, {ADDRESSES, ROW}, {ENABLES, ALL | 0x100000}}},
    {"V+ and V- are on the same electrode", {{HOST, 0}, {ADDRESSES, 0x2210}, {ENABLES, ALL}}},
    {"the generator changes while multiplexers are enabled", {{HOST, 0}, RUNS, JOIN, {WORD, FULL}}},
    {"the generator changes while multiplexers are enabled",
     {{HOST, 0}, RUNS, JOIN, {WORD, 0x4000}}},
    {"current flows and no host has ever asked", {RUNS, JOIN}},
    {"current flows more than 1 s after the host's last packet",
     {{HOST, 0}, RUNS, JOIN, LATE, {LOOK, 0}}},
    {"current flows more than 1 s after the host's last packet",
     {{HOST, 0}, RUNS, JOIN, LATE, {ENABLES, 0x30000}}},
};

static const char *seen(const step *steps, bool needs_host)
{
    drive_monitor m = {.needs_host = needs_host};
    ad9833_model part = {0};
    uint64_t now_ns = MS;
    for (; steps->what != END; ++steps) {
        switch (steps->what) {
        case HOST:
            drive_monitor_heard(&m, now_ns);
            break;
        case WORD:
            (void)ad9833_model_write(&part, (uint16_t)steps->value);
            drive_monitor_word(&m, &part, (uint16_t)steps->value, now_ns);
            break;
        case ADDRESSES:
            drive_monitor_lines(&m, 0xFFFF, steps->value, now_ns);
            break;
        case ENABLES:
            drive_monitor_lines(&m, ALL | OTHERS, steps->value, now_ns);
            break;
        case WAIT:
            now_ns += steps->value;
            break;
        default:
            drive_monitor_look(&m, now_ns);
        }
    }
    return m.violation;
}

static bool same(const char *a, const char *b)
{
    return a == NULL || b == NULL ? a == b : strcmp(a, b) == 0;
}

static void test_traces(void)
{
    for (size_t k = 0; IN_TABLE(k, TRACES); ++k) {
        const char *wanted = TRACES[k].violation;
        const char *found = seen(TRACES[k].steps, true);
        if (!same(found, wanted))
            printf("trace %zu: %s\n", k, found != NULL ? found : "nothing");
        CHECK(same(found, wanted));
        const bool of_hosts = wanted != NULL && strncmp(wanted, "current", 7) == 0;
        CHECK(same(seen(TRACES[k].steps, false), of_hosts ? NULL : wanted));
    }
}

/* ---- instruments with a fault ---- */

static fw_lines_ops sound;

static fw_status never_opens(void *ctx, uint32_t mask, uint32_t levels)
{
    return levels == 0 && mask == ALL ? FW_OK : sound.write(ctx, mask, levels);
}

static fw_status one_line_twice(void *ctx, uint32_t mask, uint32_t levels)
{
    return sound.write(ctx, mask, (levels & ~0xF0u) | (levels & 15u) << 4);
}

static void does_not_wait(void *ctx, uint32_t ns)
{
    (void)ctx;
    (void)ns;
}

/* The monitor's sentence after two seconds of an instrument with a host, or of one that wrongly
 * assumes a host. */
static const char *run(fw_lines_ops ops, bool asked, bool heard)
{
    b.host.quiet = true;
    bench_start(&b, &SKIN_ADJACENT);
    fw_instrument *instrument = &b.host.instrument;
    sound = *b.board.adg1206.lines.ops;
    ops.write = ops.write != NULL ? ops.write : sound.write;
    ops.wait_ns = ops.wait_ns != NULL ? ops.wait_ns : sound.wait_ns;
    b.board.adg1206.lines.ops = &ops;
    fw_instrument_init(instrument, &b.board.board);
    if (asked)
        drive_monitor_heard(&b.board.monitor, b.board.now_ns);
    (void)fw_current_on(&instrument->safety);
    const uint64_t until_ns = b.board.now_ns + (uint64_t)2000 * MS;
    while (b.board.now_ns < until_ns && b.board.monitor.violation == NULL) {
        fw_current_heard(&instrument->safety);
        if (heard)
            drive_monitor_heard(&b.board.monitor, b.board.now_ns);
        if (!fw_instrument_step(instrument))
            fake_wait(&b.board);
        b.board.to_host_size = 0;
    }
    CHECK(b.board.bursts > 0 || b.board.monitor.violation != NULL);
    return b.board.monitor.violation;
}

static void test_instruments(void)
{
    const fw_lines_ops right = {0};
    CHECK(same(run(right, true, true), NULL));
    CHECK(same(run((fw_lines_ops){.write = never_opens}, true, true),
               "a multiplexer's address changes while it is enabled"));
    CHECK(same(run((fw_lines_ops){.write = one_line_twice}, true, true),
               "I+ and I- are on the same electrode"));
    CHECK(same(run((fw_lines_ops){.wait_ns = does_not_wait}, true, true),
               "a multiplexer's address changes before it is open"));
    CHECK(same(run(right, false, false), "current flows and no host has ever asked"));
    CHECK(
        same(run(right, true, false), "current flows more than 1 s after the host's last packet"));
}

int main(void)
{
    test_traces();
    test_instruments();
    bench_stop(&b);
    return checks_report("drive monitor");
}
