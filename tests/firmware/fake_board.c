#include "fake_board.h"

#include "small_model.h"

#include <math.h>
#include <string.h>

enum { MAX_WAIT_NS = 1000000, ERASE_STEPS = 2 };

static void record(fake_board *f, fake_kind kind, uint32_t a, uint32_t b)
{
    if (f->log != NULL)
        f->log[f->writes % f->log_room] = (fake_write){kind, f->now_ns, a, b};
    ++f->writes;
}

static bool fails(uint32_t call, uint32_t from, uint32_t count)
{
    return call >= from && call - from < count;
}

/* ---- generator ---- */

static fw_status spi_write(void *ctx, const uint16_t *words, size_t count)
{
    fake_board *f = ctx;
    if (fails(f->spi_calls++, f->spi_fail_from, f->spi_fails))
        return FW_E_BUS;
    for (size_t k = 0; k < count; ++k) {
        record(f, FAKE_SPI, words[k], 0);
        if (ad9833_model_write(&f->generator, words[k]))
            f->released_ns = f->now_ns;
        drive_monitor_word(&f->monitor, &f->generator, words[k], f->now_ns);
        f->now_ns += 2000;
    }
    return FW_OK;
}

double fake_generator_hz(const fake_board *f)
{
    const double turn = ad9833_model_runs(&f->generator) ? f->generator.tuning : 0;
    return turn * FAKE_MCLK_HZ / 268435456.0;
}

/* Sine of the generator, in turns since it was released; 0 while it is off. */
static double generator(const fake_board *f, double at_ns)
{
    /* only a sine is modelled */
    if (fake_generator_hz(f) == 0 || (f->generator.control & 0x002Au) != 0)
        return 0;
    const double turns = fake_generator_hz(f) * 1e-9 * (at_ns - (double)f->released_ns) +
                         f->generator.phase / 4096.0 + f->extra_turn;
    return sin(2 * acos(-1.0) * (turns - floor(turns)));
}

/* ---- multiplexers ---- */

static double amplitude_at(const fake_board *f, double at_ns)
{
    for (uint32_t back = 1; back <= f->events && back <= FAKE_EVENTS; ++back) {
        const fake_event *e = &f->event[(f->events - back) % FAKE_EVENTS];
        if ((double)e->at_ns > at_ns)
            continue;
        return f->tau_ns > 0 ? e->target + (e->amplitude - e->target) *
                                               exp(-(at_ns - (double)e->at_ns) / f->tau_ns)
                             : e->target;
    }
    return 0;
}

static fw_status lines_write(void *ctx, uint32_t mask, uint32_t levels)
{
    fake_board *f = ctx;
    if (fails(f->lines_calls++, f->lines_fail_from, f->lines_fails))
        return FW_E_BUS;
    record(f, FAKE_LINES, mask, levels);
    drive_monitor_lines(&f->monitor, mask, levels, f->now_ns);
    uint8_t electrodes[4];
    const bool all = drive_monitor_joined(f->monitor.lines, electrodes) == 4;
    const double amplitude = amplitude_at(f, (double)f->now_ns);
    f->event[f->events++ % FAKE_EVENTS] =
        (fake_event){f->now_ns, amplitude,
                     all && f->volts != NULL ? f->volts(f->user, electrodes, f->now_ns) : 0};
    f->now_ns += 20;
    return FW_OK;
}

static void lines_wait(void *ctx, uint32_t ns)
{
    ((fake_board *)ctx)->now_ns += ns;
}

/* ---- capture ---- */

double fake_lsb_v(const fake_board *f)
{
    const fw_capture *c = &f->board.capture;
    return c->reference_uv * 1e-6 / (c->full_scale_code + 1.0) / (c->front_end_gain_ppm * 1e-6);
}

static uint16_t code_of(fake_board *f, double volts)
{
    const double full = f->board.capture.full_scale_code,
                 noise = f->noise_codes * small_random(&f->random);
    const double code = floor(volts / fake_lsb_v(f) + (full + 1) / 2 + 0.5 + noise);
    return (uint16_t)(code < 0 ? 0 : (code > full ? full : code));
}

static fw_status capture_configure(void *ctx, const fw_capture_setup *setup,
                                   void (*done)(void *, const fw_burst *), void *user)
{
    fake_board *f = ctx;
    if (f->configure_status != FW_OK)
        return f->configure_status;
    if (setup->samples == 0 || setup->samples > FW_MAX_SAMPLES || setup->sample_rate_hz > 2400000u)
        return FW_E_RANGE;
    f->setup = *setup;
    f->done = done;
    f->done_user = user;
    return FW_OK;
}

static fw_status capture_start(void *ctx)
{
    fake_board *f = ctx;
    f->slot_ns = (f->now_ns / 1000u + 21u) * 1000u;
    f->capturing = true;
    return FW_OK;
}

static void capture_stop(void *ctx)
{
    ((fake_board *)ctx)->capturing = false;
}

static uint64_t burst_ns(const fake_board *f)
{
    return (uint64_t)f->setup.samples * 1000000000u / f->setup.sample_rate_hz;
}

static uint64_t next_interrupt_ns(const fake_board *f)
{
    return f->capturing && !f->stalled ? f->slot_ns + burst_ns(f) + f->latency_ns + f->late_once_ns
                                       : UINT64_MAX;
}

static void run_later(fake_board *f)
{
    void (*const work)(void *user) = f->later;
    f->later = NULL;
    if (work != NULL)
        work(f->later_user);
}

static void system_later(void *ctx, void (*work)(void *user), void *user)
{
    fake_board *f = ctx;
    f->later = work;
    f->later_user = user;
    if (!f->in_interrupt)
        run_later(f);
}

static void interrupt(fake_board *f)
{
    uint16_t *samples = f->samples[f->bursts % 2u];
    const double step_ns = 1e9 / f->setup.sample_rate_hz;
    for (uint32_t k = 0; k < f->setup.samples; ++k) {
        const double at_ns = (double)f->slot_ns + k * step_ns;
        samples[k] = code_of(f, amplitude_at(f, at_ns) * generator(f, at_ns));
    }
    (void)drive_monitor_joined(f->monitor.lines, f->selected[f->bursts++ % FAKE_ROWS]);
    fw_burst burst = {
        .samples = samples, .start_us = (uint32_t)(f->slot_ns / 1000u), .lost = f->lose > 0};
    f->slot_ns += (uint64_t)f->setup.slot_us * 1000u;
    burst.entered_us = (uint32_t)(f->now_ns / 1000u);
    f->lose -= f->lose > 0;
    f->late_once_ns = 0;
    f->in_interrupt = true;
    f->done(f->done_user, &burst);
    f->in_interrupt = false;
    run_later(f);
}

void fake_advance(fake_board *f, uint64_t ns)
{
    const uint64_t until = f->now_ns + ns;
    while (!f->in_interrupt && next_interrupt_ns(f) <= until) {
        if (f->now_ns < next_interrupt_ns(f))
            f->now_ns = next_interrupt_ns(f);
        interrupt(f);
    }
    if (f->now_ns < until)
        f->now_ns = until;
}

void fake_wait(fake_board *f)
{
    const uint64_t next = next_interrupt_ns(f), limit = f->now_ns + MAX_WAIT_NS;
    fake_advance(f, next < limit && next > f->now_ns ? next - f->now_ns
                                                     : (next <= f->now_ns ? 0 : MAX_WAIT_NS));
}

/* ---- flash ---- */

static void flash_step(fake_board *f)
{
    if (++f->flash_steps == f->cut_at)
        longjmp(f->cut, 1);
}

static const uint8_t *store_bank(void *ctx, uint32_t bank)
{
    fake_board *f = ctx;
    return bank < FW_BANKS ? f->bank[bank] : f->page[bank - FW_BANKS];
}

static uint32_t bytes_of(uint32_t bank)
{
    return bank < FW_BANKS ? FAKE_BANK : FAKE_PAGE;
}

static fw_status store_erase(void *ctx, uint32_t bank)
{
    fake_board *f = ctx;
    ++f->erases;
    /* after a power cut during an erase a sector may hold anything */
    for (uint32_t part = 0; part < ERASE_STEPS; ++part) {
        const uint32_t bytes = bytes_of(bank) / ERASE_STEPS;
        uint8_t *sector = (uint8_t *)store_bank(ctx, bank) + part * bytes;
        for (uint32_t k = 0; k < bytes; k += 7)
            sector[k] |= (uint8_t)(k * 37u);
        flash_step(f);
        memset(sector, 0xFF, bytes);
    }
    f->now_ns += 2000000000u;
    drive_monitor_heard(&f->monitor, f->now_ns); /* the host waits for the answer */
    return f->erase_status;
}

static fw_status store_program(void *ctx, uint32_t bank, uint32_t offset, const void *bytes,
                               size_t size)
{
    fake_board *f = ctx;
    if (offset % 4u != 0 || size % 4u != 0 || offset + size > bytes_of(bank))
        return FW_E_ARGUMENT;
    if (f->program_status != FW_OK)
        return f->program_status;
    uint8_t *cells = (uint8_t *)store_bank(ctx, bank) + offset;
    for (size_t k = 0; k < size; ++k) {
        uint8_t *cell = &cells[k];
        const uint8_t byte = ((const uint8_t *)bytes)[k];
        if (k % 4u == 2) /* a power cut within a word */
            flash_step(f);
        f->rewrites += (uint32_t)((*cell & byte) != byte);
        *cell &= byte;
    }
    return memcmp(cells, bytes, size) == 0 ? FW_OK : FW_E_FLASH;
}

void fake_put_model(fake_board *f, uint32_t bank, uint32_t generation, const uint8_t *blob,
                    size_t size)
{
    uint32_t record[8] = {0x4B4E4245u, generation, (uint32_t)size, eits_crc32(0, blob, size)};
    record[7] = eits_crc32(0, record, 28);
    memset(f->bank[bank], 0xFF, FAKE_BANK);
    memcpy(f->bank[bank], blob, size);
    memcpy(f->bank[bank] + FAKE_BANK - 32, record, sizeof record);
}

/* ---- link ---- */

static bool link_write(void *ctx, const uint8_t *bytes, size_t size)
{
    fake_board *f = ctx;
    if (size > f->host_room || size > FAKE_WIRE - f->to_host_size)
        return false;
    if (f->host_room != SIZE_MAX)
        f->host_room -= size;
    memcpy(f->to_host + f->to_host_size, bytes, size);
    f->to_host_size += size;
    f->nested_writes += f->writing;
    f->writing = true;
    fake_advance(f, f->write_cost_ns);
    f->writing = false;
    return true;
}

static size_t link_read(void *ctx, uint8_t *bytes, size_t room)
{
    fake_board *f = ctx;
    const size_t left = f->to_board_size - f->to_board_at, size = left < room ? left : room;
    memcpy(bytes, f->to_board + f->to_board_at, size);
    if (size > 0)
        drive_monitor_heard(&f->monitor, f->now_ns);
    f->to_board_at += size;
    if (f->to_board_at == f->to_board_size)
        f->to_board_at = f->to_board_size = 0;
    return size;
}

static bool link_ended(void *ctx)
{
    return ((fake_board *)ctx)->ended;
}

/* ---- the rest ---- */

static uint32_t time_us(void *ctx)
{
    fake_board *f = ctx;
    if (!f->in_interrupt)
        fake_advance(f, f->clock_cost_ns);
    return (uint32_t)(f->now_ns / 1000u);
}

static void system_wait(void *ctx)
{
    fake_wait(ctx);
}

static uint32_t system_lock(void *ctx)
{
    (void)ctx;
    return 0;
}

static void system_unlock(void *ctx, uint32_t state)
{
    (void)ctx;
    (void)state;
}

static void feed_watchdog(void *ctx)
{
    ++((fake_board *)ctx)->feeds;
}

static void system_reset(void *ctx)
{
    ++((fake_board *)ctx)->resets;
}

static uint32_t stack_used(void *ctx)
{
    (void)ctx;
    return 1234;
}

static void system_set_leds(void *ctx, uint32_t leds)
{
    ((fake_board *)ctx)->leds = leds;
}

static bool button(void *ctx)
{
    return ((fake_board *)ctx)->button;
}

static bool analog_supply(void *ctx)
{
    return !((fake_board *)ctx)->supply_missing;
}

static uint32_t measure_ua_rms(void *ctx)
{
    return ((fake_board *)ctx)->current_ua;
}

static const fw_spi_ops SPI = {spi_write};
static const fw_lines_ops LINES = {lines_write, lines_wait};
static const fw_capture_ops CAPTURE = {capture_configure, capture_start, capture_stop};
static const fw_link_ops LINK = {link_write, link_read, link_ended};
static const fw_store_ops STORE = {store_bank, store_erase, store_program};
static const fw_system_ops SYSTEM = {time_us,       system_wait,  system_lock,  system_unlock,
                                     feed_watchdog, system_reset, stack_used,   system_set_leds,
                                     button,        system_later, analog_supply};

void fake_restart(fake_board *f)
{
    f->capturing = f->stalled = f->in_interrupt = false;
    f->generator = (ad9833_model){0};
    f->monitor = (drive_monitor){.violation = f->monitor.violation, .opened_ns = f->now_ns - 1000};
    f->events = f->bursts = 0;
    f->to_board_size = f->to_board_at = f->to_host_size = 0;
    f->host_room = SIZE_MAX;
    f->cut_at = 0;
    f->board.last_reset = (fw_last_reset){0};
    memset(f->workspace, 0xA5, sizeof f->workspace);
}

void fake_init(fake_board *f, uint32_t start_us)
{
    memset(f, 0, sizeof *f);
    f->now_ns = (uint64_t)start_us * 1000u + 400u;
    f->latency_ns = 600;
    f->tau_ns = 1000;
    f->random = 99;
    f->extra_turn = 0.137;
    memset(f->bank, 0xFF, sizeof f->bank);
    memset(f->page, 0xFF, sizeof f->page);
    f->board =
        (fw_board){.name = "fake",
                   .serial = "00112233445566778899AABB",
                   .f_cpu_hz = 216000000,
                   .stack_bytes = 8192,
                   .source_ua_rms = 350,
                   .generator = fw_ad9833_generator(&f->ad9833, (fw_spi){&SPI, f}, FAKE_MCLK_HZ),
                   .multiplexers =
                       fw_adg1206_multiplexers(&f->adg1206, (fw_lines){&LINES, f}, FAKE_ELECTRODES),
                   .capture = {&CAPTURE, f, 4095, 3300000, 1000000},
                   .link = {&LINK, f},
                   .store = {&STORE, f, FAKE_BANK, FAKE_PAGE},
                   .system = &SYSTEM,
                   .system_ctx = f,
                   .sense = {measure_ua_rms, f},
                   .workspace = f->workspace,
                   .workspace_bytes = sizeof f->workspace};
    fake_restart(f);
}
