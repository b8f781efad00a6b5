#include "app/link/scanning.h"

#include "app/link/report.h"
#include "app/link/tracks.h"

fw_status fw_stop_scan(fw_instrument *instrument)
{
    return fw_scan_stop(&instrument->scan);
}

float fw_noise_floor_v(const fw_instrument *instrument)
{
    const fw_scan_settings *s = &instrument->settings;
    if (instrument->board->frames_given)
        return 0;
    return fw_rounding_v(fw_volts_per_code_nv(&instrument->board->capture), s->excitation_millihz,
                         s->sample_rate_hz, s->samples);
}

/* The generator at the tuning word that the settings ask for; it is left alone where it has it
 * already, for its phase. */
static fw_status start_generator(fw_instrument *instrument)
{
    fw_ad9833 *generator = &instrument->generator;
    const uint32_t tuning =
        fw_ad9833_tuning(instrument->board->mclk_hz, instrument->settings.excitation_millihz);
    if (generator->state == FW_AD9833_RUNNING && generator->tuning == tuning)
        return FW_OK;
    instrument->engine.phase_known = false; /* it begins with the write that starts it */
    return fw_ad9833_start(generator, tuning, 0, FW_SINE);
}

static fw_status stop_generator(fw_instrument *instrument)
{
    fw_ad9833 *generator = &instrument->generator;
    return generator->state == FW_AD9833_RESET ? FW_OK : fw_ad9833_stop(generator);
}

bool fw_scan_wanted(const fw_instrument *instrument)
{
    return instrument->drive.state == EITS_DRIVE_ON && instrument->engine.open &&
           !instrument->upload.active;
}

void fw_start_scan(fw_instrument *instrument)
{
    const fw_board *board = instrument->board;
    const fw_scan_settings *s = &instrument->settings;
    /* Where the multiplexers do not open, nothing may drive: the generator goes into reset, and
     * what is wanted is tried again. */
    const fw_status stopped = fw_stop_scan(instrument);
    fw_follow_forget(instrument);
    instrument->tried_us = fw_now_us(instrument);
    const fw_fault_detail detail = {.frame = instrument->last_frame};
    const bool wanted = stopped == FW_OK && fw_scan_wanted(instrument);
    fw_status status = wanted ? start_generator(instrument) : stop_generator(instrument);
    if (stopped != FW_OK)
        status = stopped;
    bool bus = status != FW_OK;
    if (status == FW_OK && wanted) {
        const fw_scan_table table = fw_engine_table(&instrument->engine);
        status = fw_demodulate_setup(&instrument->demodulator, &board->capture, board->mclk_hz,
                                     instrument->generator.tuning, s->excitation_millihz,
                                     s->sample_rate_hz, s->samples);
        if (status == FW_OK)
            status = fw_scan_start(&instrument->scan, s, &table, instrument->engine.frames);
        bus = status == FW_E_BUS;
    }
    fw_fault_set(&instrument->faults, EITS_FAULT_BUS, bus, detail);
    if (status != FW_OK && !bus) /* a frame takes the fault back */
        fw_fault_set(&instrument->faults, EITS_FAULT_SCAN_STALLED, true, detail);
    if (status != FW_OK)
        fw_fail_tare(instrument, EITS_E_REFERENCE_SHORT);
}

void fw_fail_tare(fw_instrument *instrument, eits_status why)
{
    if (!instrument->tare.active)
        return;
    fw_tare_abort(&instrument->tare, &instrument->engine);
    fw_send_tare_reply(instrument,
                       (fw_answer){.status = EITS_REPLY_CORE, .detail = {(int32_t)why}});
}
