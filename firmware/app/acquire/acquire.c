#include "app/acquire/acquire.h"

#include "app/acquire/state.h"
#include "app/clock.h"
#include "app/safety/current_enable.h"
#include "app/safety/faults.h"
#include "app/safety/owner.h"

void fw_acquire_init(fw_acquire *acquire, const fw_board *board, fw_safety *safety)
{
    *acquire = (fw_acquire){.board = board, .safety = safety, .settings = FW_SCAN_DEFAULT};
    acquire->settings.frame_period_us = board->frame_period_us;
    fw_scan_init(&acquire->scan, board, &acquire->demodulator);
}

const fw_scan_settings *fw_acquire_settings(const fw_acquire *acquire)
{
    return &acquire->settings;
}

fw_status fw_acquire_set(fw_acquire *acquire, const fw_scan_settings *settings)
{
    (void)fw_acquire_stop(acquire);
    const fw_status status = fw_scan_configure(&acquire->scan, settings);
    if (status == FW_OK)
        acquire->settings = *settings;
    return status;
}

uint64_t fw_acquire_min_period_us(const fw_scan_settings *settings, const fw_scan_table *table)
{
    return (uint64_t)fw_scan_rows(settings, table) * fw_slot_us(settings);
}

void fw_acquire_fit_period(fw_acquire *acquire, const fw_scan_table *table)
{
    fw_scan_settings *settings = &acquire->settings;
    if (!acquire->board->frames_given &&
        settings->frame_period_us < fw_acquire_min_period_us(settings, table))
        settings->frame_period_us = 0;
}

float fw_acquire_noise_floor_v(const fw_acquire *acquire)
{
    const fw_scan_settings *s = &acquire->settings;
    if (acquire->board->frames_given)
        return 0;
    const fw_capture capture = fw_owner_capture(acquire->safety);
    return fw_rounding_v(fw_volts_per_code_nv(&capture), s->excitation_millihz, s->sample_rate_hz,
                         s->samples);
}

fw_status fw_acquire_stop(fw_acquire *acquire)
{
    fw_probe_stop(&acquire->probe);
    return fw_scan_stop(&acquire->scan);
}

/* Start the tone that the settings ask for. If the generator already makes it, it is not restarted,
 * so that it keeps its phase. */
static fw_status start_generator(fw_acquire *acquire, bool *new_phase)
{
    const fw_generator *generator = &acquire->board->generator;
    const uint32_t wanted_millihz = acquire->settings.excitation_millihz;
    const fw_tone tone = generator->ops->nearest(generator->ctx, wanted_millihz);
    *new_phase =
        acquire->generating != FW_GENERATING_TONE || acquire->tone.turn_per_us != tone.turn_per_us;
    if (!*new_phase)
        return FW_OK;
    const fw_status status = generator->ops->start(generator->ctx, wanted_millihz);
    acquire->tone = tone;
    acquire->generating = status == FW_OK ? FW_GENERATING_TONE : FW_GENERATING_UNKNOWN;
    return status;
}

static fw_status stop_generator(fw_acquire *acquire)
{
    const fw_generator *generator = &acquire->board->generator;
    if (acquire->generating == FW_GENERATING_NOTHING)
        return FW_OK;
    const fw_status status = generator->ops->stop(generator->ctx);
    acquire->generating = status == FW_OK ? FW_GENERATING_NOTHING : FW_GENERATING_UNKNOWN;
    return status;
}

static fw_status start_scan(fw_acquire *acquire, const fw_scan_table *table, fw_frame *frames)
{
    const fw_scan_settings *s = &acquire->settings;
    const fw_capture capture = fw_owner_capture(acquire->safety);
    const fw_status status =
        fw_demodulate_setup(&acquire->demodulator, &capture, acquire->tone.turn_per_us,
                            s->excitation_millihz, s->sample_rate_hz, s->samples);
    return status == FW_OK ? fw_scan_start(&acquire->scan, s, table, frames) : status;
}

fw_started fw_acquire_start(fw_acquire *acquire, fw_status stopped, const fw_scan_table *table,
                            fw_frame *frames)
{
    fw_started started = {.status = stopped};
    /* the generator must not run while multiplexers may be closed */
    const bool wanted = stopped == FW_OK && table != NULL && fw_current_allowed(acquire->safety);
    acquire->tried_us = fw_now_us(acquire->board);
    const fw_status generator =
        wanted ? start_generator(acquire, &started.new_phase) : stop_generator(acquire);
    if (stopped == FW_OK)
        started.status = generator;
    bool bus = started.status != FW_OK;
    if (!bus && wanted) {
        started.status = start_scan(acquire, table, frames);
        bus = started.status == FW_E_BUS;
    }
    fw_fault_set(acquire->safety, EITS_FAULT_BUS, bus, (fw_fault_detail){0});
    if (started.status != FW_OK && !bus) /* the next frame clears it */
        fw_fault_set(acquire->safety, EITS_FAULT_SCAN_STALLED, true, (fw_fault_detail){0});
    return started;
}

fw_status fw_acquire_probe(fw_acquire *acquire, const fw_probe_setup *setup)
{
    const bool joins = setup->before != EITS_PROBE_OPEN || setup->joined != EITS_PROBE_OPEN;
    if (joins && setup->generator && !fw_current_allowed(acquire->safety))
        return FW_E_ARGUMENT;
    bool new_phase;
    const fw_status status =
        setup->generator ? start_generator(acquire, &new_phase) : stop_generator(acquire);
    return status == FW_OK ? fw_probe_start(&acquire->probe, acquire->board, setup) : status;
}

const fw_probe *fw_acquire_probed(const fw_acquire *acquire)
{
    return fw_probe_active(&acquire->probe) ? &acquire->probe : NULL;
}

bool fw_acquire_running(const fw_acquire *acquire)
{
    return acquire->scan.running;
}

bool fw_acquire_stalled(fw_acquire *acquire)
{
    return fw_scan_stalled(&acquire->scan, fw_now_us(acquire->board));
}

bool fw_acquire_retry_due(const fw_acquire *acquire)
{
    return !acquire->scan.running && !fw_probe_active(&acquire->probe) &&
           fw_current_allowed(acquire->safety) &&
           fw_now_us(acquire->board) - acquire->tried_us > FW_RETRY_US;
}

void fw_acquire_shut_down(fw_acquire *acquire)
{
    (void)fw_acquire_stop(acquire);
    acquire->generating = FW_GENERATING_UNKNOWN; /* its state is unknown, so it must be stopped */
    (void)stop_generator(acquire);
}

fw_frame *fw_acquire_take(fw_acquire *acquire)
{
    return fw_scan_take(&acquire->scan);
}

void fw_acquire_release(fw_acquire *acquire)
{
    fw_scan_release(&acquire->scan);
}

void fw_acquire_report_drives(fw_acquire *acquire, void (*done)(void *user), void *user)
{
    acquire->scan.user = user;
    acquire->scan.newest = done != NULL;
    acquire->scan.drive_done = done;
}

const fw_scan_drive *fw_acquire_next_drive(const fw_acquire *acquire)
{
    return fw_scan_next_drive(&acquire->scan);
}

void fw_acquire_take_drive(fw_acquire *acquire)
{
    fw_scan_take_drive(&acquire->scan);
}

uint32_t fw_acquire_row_at(const fw_acquire *acquire, uint32_t position)
{
    return fw_scan_row_at(&acquire->scan, position);
}

uint32_t fw_acquire_frames_scanned(const fw_acquire *acquire)
{
    return acquire->scan.frames_scanned;
}

uint32_t fw_acquire_slots_repeated(const fw_acquire *acquire)
{
    return acquire->scan.slots_repeated;
}
