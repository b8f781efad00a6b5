#include "simulated.h"

#include "app/acquire/sincos.h"
#include "app/link/scanning.h"
#include "app/safety/current_enable.h"
#include "app/solve/models.h"
#include "app/solve/tare.h"
#include "boards/parts/nor_model.h"

#include <math.h>
#include <string.h>

enum {
    FULL_SCALE_CODE = 65535,
    MCLK_HZ = 8000000,
    LEAD_US = 20,  /* from the start of a capture to its first slot */
    IDLE_US = 1000 /* per turn while nothing is scanned */
};
#define RANGE_MARGIN 1.05f /* the converter's range over the largest voltage that is shown */
#define MAX_RANGE_UV 4000000000u

size_t sim_board_bytes(void)
{
    return sizeof(sim_board);
}

static uint64_t now_ns(const sim_board *sim)
{
    return 1000u * sim->now_us + sim->waited_ns;
}

/* ---- generator ---- */

static fw_status write_words(void *ctx, const uint16_t *words, size_t count)
{
    sim_board *sim = ctx;
    for (size_t k = 0; k < count; ++k) {
        if (ad9833_model_write(&sim->generator, words[k]))
            sim->released_us = (uint32_t)sim->now_us;
        drive_monitor_word(&sim->monitor, &sim->generator, words[k], now_ns(sim));
    }
    return FW_OK;
}

/* ---- multiplexers ---- */

static fw_status write_lines(void *ctx, uint32_t mask, uint32_t levels)
{
    sim_board *sim = ctx;
    drive_monitor_lines(&sim->monitor, mask, levels, now_ns(sim));
    return FW_OK;
}

static void wait_ns(void *ctx, uint32_t ns)
{
    ((sim_board *)ctx)->waited_ns += ns;
}

/* ---- skin ---- */

static uint32_t frame_number(const sim_scene *scene, uint64_t at_us)
{
    const double passed_us = (double)(at_us - scene->began_us);
    const double number = passed_us * scene->rate_hz / 1e6 + 0.5;
    return number < (double)scene->frames ? (uint32_t)number : scene->frames;
}

/* When the next scan begins if none is under way. Earlier bursts are dropped. */
static uint64_t next_scan_us(const sim_board *sim)
{
    const fw_scan *scan = &sim->instrument.acquire.scan;
    const sim_converter *converter = &sim->converter;
    const int32_t early_us = (int32_t)(scan->next_due_us - (uint32_t)converter->slot_us);
    const uint32_t slot_us = converter->setup.slot_us;
    if (!converter->running || scan->frame != NULL || !scan->due_known || early_us <= 0)
        return converter->slot_us;
    return converter->slot_us + ((uint32_t)early_us + slot_us - 1) / slot_us * slot_us;
}

bool sim_scene_over(const sim_board *sim)
{
    const sim_scene *scene = &sim->scene;
    return scene->begun && !scene->begins_with_scan &&
           frame_number(scene, next_scan_us(sim)) >= scene->frames;
}

void sim_begin_scene(sim_board *sim)
{
    sim->scene.begun = true;
    sim->scene.begins_with_scan = true;
}

/* Choose the voltages of a scan that may begin at at_us. Returns false if they were not given yet.
 */
static bool choose_frame(sim_board *sim, uint64_t at_us)
{
    sim_scene *scene = &sim->scene;
    const fw_solve *solve = &sim->instrument.solve;
    if (fw_tare_active(solve) && fw_tare_first(solve))
        scene->untouched_shown = 0;
    if (scene->begins_with_scan)
        scene->began_us = at_us;
    uint32_t frame = scene->untouched_shown % scene->untouched;
    if (scene->begun) {
        const uint32_t number = frame_number(scene, at_us);
        frame = scene->untouched + (number < scene->frames ? number : scene->frames - 1u);
    }
    scene->wanted = frame;
    scene->wanted_us = at_us;
    if (frame < scene->first || frame - scene->first >= scene->count ||
        (scene->once && scene->put_us != at_us))
        return false;
    const size_t place = (size_t)(frame - scene->first) * sim->instrument.solve.engine.model.n_rows;
    scene->shown = scene->volts + place;
    return true;
}

static void scan_has_begun(sim_board *sim)
{
    sim->scene.begins_with_scan = false;
    ++sim->scene.untouched_shown;
}

/* Amplitude between V+ and V-; 0 if the connected electrodes are not a row of the table. */
static float volts_now(sim_board *sim)
{
    const eits_model *model = &sim->instrument.solve.engine.model;
    uint8_t joined[4];
    if (drive_monitor_joined(sim->monitor.lines, joined) != 4 ||
        !ad9833_model_runs(&sim->generator))
        return 0;
    for (uint32_t tried = 0; tried < model->n_rows; ++tried) {
        sim->row = sim->row + 1u < model->n_rows ? sim->row + 1u : 0;
        if (memcmp(model->protocol + 4 * (size_t)sim->row, joined, sizeof joined) == 0)
            return sim->scene.shown[sim->row];
    }
    return 0;
}

/* ---- converter ---- */

static fw_status configure(void *ctx, const fw_capture_setup *setup,
                           void (*done)(void *user, const fw_burst *burst), void *user)
{
    sim_converter *converter = &((sim_board *)ctx)->converter;
    converter->setup = *setup;
    converter->done = done;
    converter->user = user;
    return FW_OK;
}

static fw_status start(void *ctx)
{
    sim_board *sim = ctx;
    sim_converter *converter = &sim->converter;
    /* the advance of the generator's phase per second, in units of 2^-28 turns */
    const uint64_t turn = (uint64_t)sim->generator.tuning * MCLK_HZ;
    for (uint32_t k = 0; k < converter->setup.samples; ++k) {
        const uint64_t phase = turn * k / converter->setup.sample_rate_hz;
        fw_sincos((uint32_t)phase << 4, &converter->cosine[k], &converter->sine[k]);
    }
    converter->slot_us = sim->now_us + LEAD_US;
    converter->running = true;
    return FW_OK;
}

static void stop(void *ctx)
{
    ((sim_board *)ctx)->converter.running = false;
}

static void convert(sim_board *sim, float volts)
{
    sim_converter *converter = &sim->converter;
    const uint32_t passed_us = (uint32_t)converter->slot_us - sim->released_us;
    const float steps_a_volt =
        (FULL_SCALE_CODE + 1) / (1e-6f * (float)sim->board.capture.reference_uv);
    const float steps = volts * steps_a_volt;
    float c, s;
    fw_sincos((sim->generator.tuning * (MCLK_HZ / 1000000u) * passed_us) << 4, &c, &s);
    for (uint32_t k = 0; k < converter->setup.samples; ++k) {
        const float code = 0.5f * (FULL_SCALE_CODE + 1) + 0.5f +
                           steps * (c * converter->sine[k] + s * converter->cosine[k]);
        const float low = code < 0 ? 0 : code;
        converter->codes[k] = (uint16_t)(int32_t)(low > FULL_SCALE_CODE ? FULL_SCALE_CODE : low);
    }
}

/* Time passes only while the host reads, so the host is present. */
static void listen(sim_board *sim)
{
    drive_monitor_heard(&sim->monitor, now_ns(sim));
    fw_current_heard(&sim->instrument.safety);
}

static void run_later(sim_board *sim)
{
    void (*const work)(void *user) = sim->later;
    sim->later = NULL;
    if (work != NULL)
        work(sim->later_user);
}

static void later(void *ctx, void (*work)(void *user), void *user)
{
    sim_board *sim = ctx;
    sim->later = work;
    sim->later_user = user;
    if (!sim->converter.interrupts)
        run_later(sim);
}

/* Run to the end of the next burst, which the application gets. Returns false if its frame is
 * missing. */
static bool next_burst(sim_board *sim)
{
    const fw_scan *scan = &sim->instrument.acquire.scan;
    sim_converter *converter = &sim->converter;
    const fw_capture_setup *setup = &converter->setup;
    converter->slot_us = next_scan_us(sim);
    const bool between = scan->frame == NULL;
    const uint32_t frames = scan->frames_scanned;
    const uint64_t start_us = converter->slot_us;
    if (between && !choose_frame(sim, start_us))
        return false;
    convert(sim, volts_now(sim));
    converter->slot_us += setup->slot_us;
    sim->now_us = start_us + ((uint64_t)setup->samples * 1000000u + setup->sample_rate_hz - 1) /
                                 setup->sample_rate_hz;
    listen(sim);
    const fw_burst burst = {.samples = converter->codes,
                            .start_us = (uint32_t)start_us,
                            .entered_us = (uint32_t)sim->now_us};
    converter->interrupts = true;
    converter->done(converter->user, &burst);
    converter->interrupts = false;
    run_later(sim);
    if (between && (scan->frame != NULL || scan->frames_scanned != frames))
        scan_has_begun(sim);
    return true;
}

/* ---- flash ---- */

static const uint8_t *bank_start(void *ctx, uint32_t bank)
{
    const sim_board *sim = ctx;
    return bank < FW_BANKS ? sim->bank[bank] : sim->page[bank - FW_BANKS];
}

static uint32_t bytes_of(const sim_board *sim, uint32_t bank)
{
    return bank < FW_BANKS ? sim->board.store.bank_bytes : SIM_PAGE_BYTES;
}

static fw_status erase(void *ctx, uint32_t bank)
{
    return nor_model_erase((uint8_t *)bank_start(ctx, bank), bytes_of(ctx, bank));
}

static fw_status program(void *ctx, uint32_t bank, uint32_t offset, const void *bytes, size_t size)
{
    return nor_model_program((uint8_t *)bank_start(ctx, bank), bytes_of(ctx, bank), offset, bytes,
                             size);
}

/* ---- link ---- */

static bool write_bytes(void *ctx, const uint8_t *bytes, size_t size)
{
    sim_board *sim = ctx;
    if (size > sizeof sim->to_host - sim->to_host_bytes)
        return false;
    memcpy(sim->to_host + sim->to_host_bytes, bytes, size);
    sim->to_host_bytes += size;
    return true;
}

static size_t read_bytes(void *ctx, uint8_t *bytes, size_t room)
{
    sim_board *sim = ctx;
    const size_t size = sim->to_board_bytes < room ? sim->to_board_bytes : room;
    if (size > 0)
        memcpy(bytes, sim->to_board, size);
    sim->to_board += size;
    sim->to_board_bytes -= size;
    return size;
}

size_t sim_read(sim_board *sim, uint8_t *bytes, size_t room)
{
    const size_t size = sim->to_host_bytes < room ? sim->to_host_bytes : room;
    memcpy(bytes, sim->to_host, size);
    sim->to_host_bytes -= size;
    memmove(sim->to_host, sim->to_host + size, sim->to_host_bytes);
    return size;
}

/* ---- the rest of the board ---- */

static uint32_t time_us(void *ctx)
{
    return (uint32_t)((const sim_board *)ctx)->now_us;
}

static void wait_idle(void *ctx)
{
    ((sim_board *)ctx)->now_us += IDLE_US;
}

static uint32_t lock(void *ctx)
{
    (void)ctx;
    return 0;
}

static void unlock(void *ctx, uint32_t state)
{
    (void)ctx;
    (void)state;
}

static void nothing(void *ctx)
{
    (void)ctx;
}

static uint32_t no_stack(void *ctx)
{
    (void)ctx;
    return 0;
}

static void show_leds(void *ctx, uint32_t leds)
{
    (void)ctx;
    (void)leds;
}

static bool button(void *ctx)
{
    return ((const sim_board *)ctx)->button;
}

static const fw_spi_ops GENERATOR = {write_words};
static const fw_lines_ops MULTIPLEXERS = {write_lines, wait_ns};
static const fw_capture_ops CAPTURE = {configure, start, stop};
static const fw_link_ops LINK = {.write = write_bytes, .read = read_bytes};
static const fw_store_ops STORE = {bank_start, erase, program};
static const fw_system_ops SYSTEM = {time_us,  wait_idle, lock,   unlock, nothing, nothing,
                                     no_stack, show_leds, button, later,  NULL};

void sim_init(sim_board *sim, const sim_setup *setup)
{
    memset(sim, 0, sizeof *sim);
    for (uint32_t k = 0; k < FW_BANKS; ++k)
        sim->bank[k] = setup->banks[k];
    sim->board = (fw_board){
        .name = setup->name,
        .serial = setup->serial,
        .frame_period_us = setup->frame_period_us,
        .generator = fw_ad9833_generator(&sim->ad9833, (fw_spi){&GENERATOR, sim}, MCLK_HZ),
        .multiplexers = fw_adg1206_multiplexers(&sim->adg1206, (fw_lines){&MULTIPLEXERS, sim},
                                                FW_MAX_ELECTRODES),
        .capture = {&CAPTURE, sim, FULL_SCALE_CODE, 1, 1000000},
        .link = {&LINK, sim},
        .store = {&STORE, sim, setup->bank_bytes, SIM_PAGE_BYTES},
        .system = &SYSTEM,
        .system_ctx = sim,
        .frames_given = setup->frames_given,
        .workspace = setup->workspace,
        .workspace_bytes = setup->workspace_bytes};
    memset(sim->page, 0xFF, sizeof sim->page);
    sim_start(sim);
}

void sim_start(sim_board *sim)
{
    sim->converter.running = false;
    sim->generator = (ad9833_model){0};
    sim->monitor = (drive_monitor){.violation = sim->monitor.violation,
                                   .opened_ns = now_ns(sim) - DRIVE_MONITOR_OPEN_NS,
                                   .needs_host = false};
    sim->to_board_bytes = 0;
    fw_instrument_init(&sim->instrument, &sim->board);
    sim->monitor.needs_host =
        !sim->board.frames_given && sim->instrument.safety.current.state == EITS_DRIVE_OFF;
}

static void step(sim_board *sim)
{
    (void)fw_instrument_step(&sim->instrument);
    if (fw_link_reset_wanted(&sim->instrument.link))
        sim_start(sim);
}

void sim_write(sim_board *sim, const uint8_t *bytes, size_t size)
{
    drive_monitor_heard(&sim->monitor, now_ns(sim));
    sim->to_board = bytes;
    sim->to_board_bytes = size;
    while (sim->to_board_bytes > 0)
        step(sim);
}

bool sim_wants_frame(const sim_board *sim)
{
    const fw_instrument *instrument = &sim->instrument;
    return fw_solve_model(&instrument->solve) != NULL && !instrument->link.upload.active &&
           (fw_tare_active(&instrument->solve) || instrument->link.stream.what != 0);
}

bool sim_tares(const sim_board *sim)
{
    return fw_tare_active(&sim->instrument.solve);
}

bool sim_mask_row(sim_board *sim, uint32_t row, bool masked)
{
    fw_solve *solve = &sim->instrument.solve;
    const bool before = eits_is_masked(solve->engine.ctx, row) != 0;
    fw_solve_mask_row(solve, row, masked);
    return before;
}

const uint8_t *sim_model(const sim_board *sim, uint32_t *bytes, uint32_t *crc)
{
    const fw_solve *solve = &sim->instrument.solve;
    const fw_model_file file = fw_models_file(solve);
    *bytes = file.size;
    *crc = file.crc;
    return fw_solve_model(solve) != NULL ? file.bytes : NULL;
}

void sim_show(sim_board *sim, float largest_v, uint32_t untouched, uint32_t frames, double rate_hz)
{
    sim->scene.untouched = untouched;
    sim->scene.frames = frames;
    sim->scene.rate_hz = rate_hz;
    sim->scene.count = 0;
    const float range_uv = 2e6f * RANGE_MARGIN * largest_v;
    sim->board.capture.reference_uv =
        range_uv < (float)MAX_RANGE_UV ? 1u + (uint32_t)range_uv : MAX_RANGE_UV;
    fw_scanning_restart(&sim->instrument.link);
}

void sim_put(sim_board *sim, const float *volts, uint32_t first, uint32_t count)
{
    sim->scene.volts = volts;
    sim->scene.first = first;
    sim->scene.count = count;
    sim->scene.once = false;
}

void sim_put_once(sim_board *sim, const float *volts, uint32_t first)
{
    sim_put(sim, volts, first, 1);
    sim->scene.once = true;
    sim->scene.put_us = sim->scene.wanted_us;
}

double sim_wanted_s(const sim_board *sim)
{
    const sim_scene *scene = &sim->scene;
    return scene->begun ? (double)(scene->wanted_us - scene->began_us) / 1e6 : 0;
}

void sim_row_delays(const sim_board *sim, uint32_t *delays_us)
{
    const fw_scan *scan = &sim->instrument.acquire.scan;
    memset(delays_us, 0, sim->instrument.solve.engine.model.n_rows * sizeof *delays_us);
    for (uint32_t position = 0; position < fw_scan_next_rows(scan); ++position)
        delays_us[fw_scan_row_at(scan, position)] = position * scan->slot_us;
}

uint32_t sim_frame_wanted(const sim_board *sim)
{
    return sim->scene.wanted;
}

bool sim_scan_frame(sim_board *sim)
{
    const uint32_t frames = sim->instrument.acquire.scan.frames_scanned;
    while (sim->instrument.acquire.scan.frames_scanned == frames && sim_wants_frame(sim)) {
        if (!sim->converter.running)
            wait_idle(sim);
        else if (!next_burst(sim))
            return false;
        step(sim);
    }
    return true;
}

void sim_give_frame(sim_board *sim, const float *iq, uint32_t passed_us, uint32_t period_us)
{
    fw_instrument *instrument = &sim->instrument;
    fw_scan *scan = &instrument->acquire.scan;
    sim->now_us += passed_us;
    instrument->acquire.settings.frame_period_us = sim->board.frame_period_us = period_us;
    if (!scan->running) {
        step(sim); /* an upload, or no model */
        return;
    }
    fw_frame *frame = &scan->frames[scan->filled % 2u];
    *frame = (fw_frame){.number = scan->next_number++,
                        .time_us = (uint32_t)sim->now_us,
                        .end_us = (uint32_t)sim->now_us,
                        .z = frame->z,
                        .volts = frame->volts,
                        .quality = frame->quality};
    for (uint32_t i = 0; i < instrument->solve.engine.model.n_rows; ++i) {
        const bool usable = isfinite(iq[2 * i]) && isfinite(iq[2 * i + 1]);
        frame->z[i] = usable ? (fw_iq){iq[2 * i], iq[2 * i + 1]} : (fw_iq){0, 0};
        frame->quality[i] = usable ? 0 : EITS_QUALITY_UNSETTLED;
    }
    ++scan->bursts;
    ++scan->frames_scanned;
    ++scan->filled;
    step(sim);
}

const char *sim_violation(const sim_board *sim)
{
    return sim->monitor.violation;
}

void sim_press(sim_board *sim, bool held)
{
    sim->button = held;
}

void sim_let_pass(sim_board *sim, uint32_t passed_us)
{
    sim->now_us += passed_us;
    step(sim);
}
