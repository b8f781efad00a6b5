#include "app/link/commands.h"

#include "app/acquire/acquire.h"
#include "app/acquire/scan.h"
#include "app/link/report.h"
#include "app/link/scanning.h"
#include "app/link/state.h"
#include "app/link/stream.h"
#include "app/link/tracks.h"
#include "app/link/upload.h"
#include "app/safety/current_enable.h"
#include "app/safety/faults.h"
#include "app/safety/owner.h"
#include "app/solve/frames.h"
#include "app/solve/models.h"
#include "app/solve/solve.h"
#include "app/solve/tare.h"
#include "app/solve/tracker.h"
#include "drivers/ad9833.h"

#include <string.h>

enum {
    MAX_ITERATIONS = 1000,
    MAX_SETTLE_US = 50000,
    MAX_PERIOD_US = 600000000,
    MIN_SAMPLES = 4,
    MIN_MODEL = 64
};
enum { MAX_EXCITATION_MILLIHZ = 250000000, MAX_UA_RMS = 10000 };
enum { MIN_SOURCE_UA = 10, MAX_SOURCE_UA = 7000, MIN_GAIN_PPM = 10000, MAX_GAIN_PPM = 400000000 };

static fw_answer ok(void)
{
    return (fw_answer){0};
}

/* If a field, at `offset` in the payload, is not between low and high, the answer is RANGE. */
static bool outside(fw_answer *out, size_t offset, uint32_t value, uint32_t low, uint32_t high)
{
    if (value >= low && value <= high)
        return false;
    *out = fw_refuse(EITS_REPLY_RANGE, (int32_t)offset, (int32_t)(value < low ? low : high));
    return true;
}

static bool fraction_outside(fw_answer *out, size_t offset, float value)
{
    if (value >= 0 && value <= 1)
        return false;
    *out = fw_refuse(EITS_REPLY_RANGE, (int32_t)offset, value > 1 ? 1 : 0); /* NaN: 0 */
    return true;
}

static fw_answer busy_with(eits_packet_type command)
{
    return fw_refuse(EITS_REPLY_BUSY, (int32_t)command, 0);
}

static fw_answer on_get_info(fw_host_link *link, const void *payload, size_t size)
{
    eits_command_plain c;
    (void)size;
    memcpy(&c, payload, sizeof c);
    fw_send_info(link, c.request);
    return (fw_answer){.later = true};
}

static fw_answer on_get_stats(fw_host_link *link, const void *payload, size_t size)
{
    eits_command_get_stats c;
    fw_answer bad;
    (void)size;
    memcpy(&c, payload, sizeof c);
    if (outside(&bad, offsetof(eits_command_get_stats, reset), c.reset, 0, 1))
        return bad;
    fw_send_stats(link, c.request, c.reset != 0);
    return (fw_answer){.later = true};
}

static fw_answer on_stream(fw_host_link *link, const void *payload, size_t size)
{
    eits_command_stream c;
    fw_answer bad;
    (void)size;
    memcpy(&c, payload, sizeof c);
    const uint32_t all = EITS_STREAM_RAW | EITS_STREAM_IMAGE | EITS_STREAM_TOUCHES |
                         EITS_STREAM_EVENTS | EITS_STREAM_DRIVE_TOUCHES;
    if (outside(&bad, offsetof(eits_command_stream, what), c.what, 0, all) ||
        outside(&bad, offsetof(eits_command_stream, every), c.every, 1, UINT16_MAX))
        return bad;
    if (c.what != 0 && fw_solve_model(link->solve) == NULL)
        return fw_refuse(EITS_REPLY_NO_MODEL, 0, 0);
    if ((c.what & ~EITS_STREAM_RAW) != 0 && !fw_solve_tared(link->solve))
        return fw_refuse(EITS_REPLY_NOT_TARED, 0, 0);
    if ((c.what & EITS_STREAM_DRIVE_TOUCHES) != 0 &&
        (c.every != 1 || !fw_tracker_possible(link->solve)))
        return fw_refuse(EITS_REPLY_DRIVES, 0, 0);
    if (c.what != 0 && !fw_current_on(link->safety))
        return fw_refuse(EITS_REPLY_TRIPPED, 0, 0);
    link->stream =
        (fw_stream){.what = c.what, .every = c.every, .left = c.frames, .counted = c.frames != 0};
    return ok();
}

static fw_answer on_tare(fw_host_link *link, const void *payload, size_t size)
{
    eits_command_tare c;
    fw_answer bad;
    (void)size;
    memcpy(&c, payload, sizeof c);
    const size_t at = offsetof(eits_command_tare, frames);
    if (outside(&bad, at, c.frames, 0, FW_TARE_MAX) ||
        (c.frames > 1 && outside(&bad, at, c.frames, 4, FW_TARE_MAX)))
        return bad;
    if (fw_solve_model(link->solve) == NULL)
        return fw_refuse(EITS_REPLY_NO_MODEL, 0, 0);
    if (c.frames == 0) {
        if (!fw_tare_undo(link->solve))
            return fw_refuse(EITS_REPLY_NOT_TARED, 0, 0);
        fw_reference_changed(link);
        return ok();
    }
    if (!fw_current_on(link->safety))
        return fw_refuse(EITS_REPLY_TRIPPED, 0, 0);
    fw_tare_begin(link->solve, c.request, c.frames);
    return (fw_answer){.later = true};
}

static fw_answer locked(void)
{
    return fw_refuse(EITS_REPLY_LOCKED, 0, 0);
}

/* Check the ranges of scan settings, and whether they fit together. */
static fw_answer check_scan(const fw_host_link *link, const eits_command_scan *c)
{
    fw_answer bad;
    if (outside(&bad, offsetof(eits_command_scan, excitation_millihz), c->excitation_millihz,
                fw_current_min_millihz(link->safety), MAX_EXCITATION_MILLIHZ) ||
        outside(&bad, offsetof(eits_command_scan, sample_rate_hz), c->sample_rate_hz,
                FW_MIN_RATE_HZ, FW_MAX_RATE_HZ) ||
        outside(&bad, offsetof(eits_command_scan, samples), c->samples, MIN_SAMPLES,
                FW_MAX_SAMPLES) ||
        outside(&bad, offsetof(eits_command_scan, settle_us), c->settle_us, 0, MAX_SETTLE_US) ||
        outside(&bad, offsetof(eits_command_scan, reserved), c->reserved, 0, 0) ||
        outside(&bad, offsetof(eits_command_scan, frame_period_us), c->frame_period_us, 0,
                MAX_PERIOD_US))
        return bad;
    const uint64_t half_rate_millihz = (uint64_t)c->sample_rate_hz * 500u;
    if (c->excitation_millihz >= half_rate_millihz) /* more than two samples per period */
        return fw_refuse(EITS_REPLY_RANGE, (int32_t)offsetof(eits_command_scan, excitation_millihz),
                         (int32_t)(half_rate_millihz - 1));
    const fw_generator *generator = &link->board->generator;
    if (generator->ops->nearest(generator->ctx, c->excitation_millihz).millihz == 0)
        return fw_refuse(EITS_REPLY_RANGE, (int32_t)offsetof(eits_command_scan, excitation_millihz),
                         (int32_t)fw_current_min_millihz(link->safety));
    if (!fw_whole_periods(c->excitation_millihz, c->sample_rate_hz, c->samples))
        return fw_refuse(
            EITS_REPLY_PERIODS,
            (int32_t)fw_nearest_integer(c->excitation_millihz, c->sample_rate_hz, c->samples), 0);
    return ok();
}

static fw_answer on_scan(fw_host_link *link, const void *payload, size_t size)
{
    eits_command_scan c;
    (void)size;
    memcpy(&c, payload, sizeof c);
    fw_answer checked = check_scan(link, &c);
    if (link->board->frames_given)
        return fw_refuse(EITS_REPLY_RANGE, (int32_t)offsetof(eits_command_scan, sample_rate_hz), 0);
    if (checked.status != EITS_REPLY_OK)
        return checked;
    /* at a lower frequency less current is safe: only the owner may lower it */
    if (c.excitation_millihz < fw_acquire_settings(link->acquire)->excitation_millihz &&
        fw_owner_refuses(link->safety, EITS_PACKET_SCAN))
        return locked();
    const fw_scan_settings settings = {c.excitation_millihz, c.sample_rate_hz, c.samples,
                                       c.settle_us,          c.check_every,    c.frame_period_us};
    const fw_scan_table table = fw_solve_table(link->solve);
    const uint64_t min_us = fw_acquire_min_period_us(&settings, &table);
    if (fw_solve_model(link->solve) != NULL && settings.frame_period_us != 0 &&
        settings.frame_period_us < min_us)
        return fw_refuse(EITS_REPLY_TOO_FAST, min_us > INT32_MAX ? INT32_MAX : (int32_t)min_us, 0);
    if (fw_acquire_set(link->acquire, &settings) == FW_OK) {
        fw_solve_scan_changed(link->solve);
        link->stream.what &= EITS_STREAM_RAW;
    } else {
        checked =
            fw_refuse(EITS_REPLY_RANGE, (int32_t)offsetof(eits_command_scan, sample_rate_hz), 0);
    }
    fw_scanning_restart(link);
    return checked;
}

/* The numbers of eits_solver have a gap at 2, which is reserved; for it the reply states the
 * greatest number that may be used. */
static bool no_solver(fw_answer *out, uint32_t solver)
{
    const bool reserved = solver == EITS_SOLVER_WORKING_SET + 1u;
    return outside(out, offsetof(eits_command_solver, solver), reserved ? UINT32_MAX : solver, 0,
                   EITS_SOLVER_ACTIVE_SET);
}

static fw_answer on_solver(fw_host_link *link, const void *payload, size_t size)
{
    eits_command_solver c;
    fw_answer bad;
    (void)size;
    memcpy(&c, payload, sizeof c);
    if (outside(&bad, offsetof(eits_command_solver, iterations), c.iterations, 1, MAX_ITERATIONS) ||
        outside(&bad, offsetof(eits_command_solver, max_touches), c.max_touches, 0,
                EITS_MAX_TOUCHES) ||
        outside(&bad, offsetof(eits_command_solver, warm_start), c.warm_start, 0, 1) ||
        outside(&bad, offsetof(eits_command_solver, sign), c.sign, 0, EITS_SIGN_BOTH) ||
        fraction_outside(&bad, offsetof(eits_command_solver, lambda_rel), c.lambda_rel) ||
        fraction_outside(&bad, offsetof(eits_command_solver, gap_rel), c.gap_rel) ||
        no_solver(&bad, c.solver) ||
        outside(&bad, offsetof(eits_command_solver, diagnostics), c.diagnostics, 0,
                EITS_DIAGNOSTICS_ALL))
        return bad;
    if (fw_solve_model(link->solve) == NULL)
        return fw_refuse(EITS_REPLY_NO_MODEL, 0, 0);
    eits_options options = *fw_solve_options(link->solve);
    options.iterations = c.iterations;
    options.max_touches = c.max_touches;
    options.warm_start = c.warm_start;
    options.sign = (eits_sign)c.sign;
    options.lambda_rel = c.lambda_rel;
    options.gap_rel = c.gap_rel;
    options.solver = (eits_solver)c.solver;
    options.mac_limit = c.mac_limit;
    options.diagnostics = c.diagnostics;
    const eits_status status = fw_solve_set_options(link->solve, &options);
    return status == EITS_OK ? ok() : fw_refuse(EITS_REPLY_CORE, (int32_t)status, 0);
}

static fw_answer on_mask_row(fw_host_link *link, const void *payload, size_t size)
{
    eits_command_mask_row c;
    fw_answer bad;
    (void)size;
    memcpy(&c, payload, sizeof c);
    if (fw_solve_model(link->solve) == NULL)
        return fw_refuse(EITS_REPLY_NO_MODEL, 0, 0);
    if (outside(&bad, offsetof(eits_command_mask_row, row), c.row, 0,
                fw_solve_model(link->solve)->n_rows - 1) ||
        outside(&bad, offsetof(eits_command_mask_row, masked), c.masked, 0, 1))
        return bad;
    fw_solve_mask_row(link->solve, c.row, c.masked != 0);
    return ok();
}

static fw_answer on_model_begin(fw_host_link *link, const void *payload, size_t size)
{
    eits_command_model_begin c;
    (void)size;
    memcpy(&c, payload, sizeof c);
    if (c.bytes < MIN_MODEL)
        return fw_refuse(EITS_REPLY_RANGE, (int32_t)offsetof(eits_command_model_begin, bytes),
                         MIN_MODEL);
    if (fw_owner_refuses(link->safety, EITS_PACKET_MODEL_BEGIN))
        return locked();
    return fw_upload_begin(link, c.bytes, c.crc);
}

static fw_answer on_model_data(fw_host_link *link, const void *payload, size_t size)
{
    eits_command_model_data c;
    memcpy(&c, payload, sizeof c);
    return fw_upload_data(link, c.offset, (const uint8_t *)payload + sizeof c, size - sizeof c);
}

static fw_answer on_model_commit(fw_host_link *link, const void *payload, size_t size)
{
    (void)payload;
    (void)size;
    return fw_upload_commit(link);
}

static fw_answer on_reset(fw_host_link *link, const void *payload, size_t size)
{
    (void)payload;
    (void)size;
    link->reset_wanted = true;
    return ok();
}

static fw_answer on_self_test(fw_host_link *link, const void *payload, size_t size)
{
    (void)payload;
    (void)size;
    if (fw_solve_model(link->solve) == NULL)
        return fw_refuse(EITS_REPLY_NO_MODEL, 0, 0);
    float difference;
    const eits_status status = fw_solve_self_test(link->solve, &difference);
    if (status != EITS_OK)
        return fw_refuse(EITS_REPLY_CORE, (int32_t)status, 0);
    return difference == 0 ? ok() : fw_refuse(EITS_REPLY_SELF_TEST, fw_billionths(difference), 0);
}

static fw_answer on_clear_faults(fw_host_link *link, const void *payload, size_t size)
{
    (void)payload;
    (void)size;
    fw_frames_forget(link->solve);
    fw_faults_clear(link->safety);
    fw_current_clear_trip(link->safety);
    fw_models_report(link->solve);
    return ok();
}

static fw_answer on_keepalive(fw_host_link *link, const void *payload, size_t size)
{
    eits_command_keepalive c;
    (void)size;
    memcpy(&c, payload, sizeof c);
    if (c.present == 0 && !fw_owner_keeps_current(link->safety) && fw_current_allowed(link->safety))
        fw_current_off(link->safety, EITS_DRIVE_OFF);
    return (fw_answer){.later = true};
}

/* The same for a number that may also be 0 (as designed) or EITS_KEPT. */
static bool setting_outside(fw_answer *out, size_t offset, uint32_t value, uint32_t low,
                            uint32_t high)
{
    return value != 0 && value != EITS_KEPT && outside(out, offset, value, low, high);
}

static bool settings_outside(fw_host_link *link, const eits_command_settings *c, fw_answer *bad)
{
    const uint32_t all = EITS_SETTING_KEEP_CURRENT | EITS_SETTING_LOCKED | EITS_SETTING_SENSE |
                         EITS_SETTING_BUTTON_LOW;
    if (outside(bad, offsetof(eits_command_settings, settings), c->settings, 0, all) ||
        setting_outside(bad, offsetof(eits_command_settings, current_limit_ua_rms),
                        c->current_limit_ua_rms, 0, MAX_UA_RMS))
        return true;
    if (!fw_owner_name_valid(c->name)) {
        *bad = fw_refuse(EITS_REPLY_RANGE, offsetof(eits_command_settings, name),
                         EITS_NAME_CHARACTERS);
        return true;
    }
    /* the current that is safe both at the present excitation and at the one after a restart */
    const uint32_t safe_ua =
        (uint32_t)((uint64_t)fw_acquire_settings(link->acquire)->excitation_millihz * 141u /
                   1000000u);
    const uint32_t most_ua = safe_ua < MAX_SOURCE_UA ? safe_ua : MAX_SOURCE_UA;
    return setting_outside(bad, offsetof(eits_command_settings, source_ua), c->source_ua,
                           MIN_SOURCE_UA, most_ua) ||
           setting_outside(bad, offsetof(eits_command_settings, gain_ppm), c->gain_ppm,
                           MIN_GAIN_PPM, MAX_GAIN_PPM);
}

static fw_answer on_settings(fw_host_link *link, const void *payload, size_t size)
{
    eits_command_settings c;
    fw_answer bad;
    (void)size;
    memcpy(&c, payload, sizeof c);
    if (settings_outside(link, &c, &bad))
        return bad;
    if (fw_owner_refuses(link->safety, EITS_PACKET_SETTINGS))
        return locked();
    if (fw_current_state(link->safety) !=
        EITS_DRIVE_TRIPPED) /* erasing the flash may take seconds */
        fw_current_off(link->safety, EITS_DRIVE_OFF);
    const fw_capture before = fw_owner_capture(link->safety);
    fw_owner_record wanted = {.settings = c.settings,
                              .current_limit_ua_rms = c.current_limit_ua_rms,
                              .source_ua = c.source_ua,
                              .gain_ppm = c.gain_ppm};
    memcpy(wanted.name, c.name, sizeof wanted.name);
    if (fw_owner_save(link->safety, &wanted) != FW_OK)
        return fw_refuse(EITS_REPLY_FLASH, 0, 0);
    if (fw_owner_capture(link->safety).front_end_gain_ppm != before.front_end_gain_ppm)
        fw_solve_scan_changed(link->solve); /* the reference has another scale */
    if ((c.settings & EITS_SETTING_KEEP_CURRENT) != 0)
        (void)fw_current_on(link->safety);
    return ok();
}

static fw_answer on_get_hashes(fw_host_link *link, const void *payload, size_t size)
{
    eits_command_plain c;
    (void)size;
    memcpy(&c, payload, sizeof c);
    fw_send_hashes(link, c.request);
    return (fw_answer){.later = true};
}

static bool can_probe(const fw_board *board, uint32_t electrodes)
{
    return electrodes == EITS_PROBE_OPEN || fw_can_join(board, electrodes);
}

static fw_answer on_probe(fw_host_link *link, const void *payload, size_t size)
{
    eits_command_probe c;
    fw_answer bad;
    (void)size;
    memcpy(&c, payload, sizeof c);
    fw_probe_setup setup = {.settings = *fw_acquire_settings(link->acquire),
                            .before = c.before,
                            .joined = c.joined,
                            .generator = c.generator != 0};
    const int32_t electrodes = (int32_t)link->board->multiplexers.electrodes;
    if (!can_probe(link->board, c.before))
        return fw_refuse(EITS_REPLY_RANGE, offsetof(eits_command_probe, before), electrodes);
    if (!can_probe(link->board, c.joined))
        return fw_refuse(EITS_REPLY_RANGE, offsetof(eits_command_probe, joined), electrodes);
    if (outside(&bad, offsetof(eits_command_probe, settle_us), c.settle_us, 0, MAX_SETTLE_US) ||
        outside(&bad, offsetof(eits_command_probe, samples), c.samples, MIN_SAMPLES,
                FW_MAX_SAMPLES) ||
        outside(&bad, offsetof(eits_command_probe, generator), c.generator, 0, 1))
        return bad;
    setup.settings.settle_us = c.settle_us;
    setup.settings.samples = c.samples;
    if (!fw_current_on(link->safety))
        return fw_refuse(EITS_REPLY_TRIPPED, 0, 0);
    if (link->board->frames_given || fw_acquire_stop(link->acquire) != FW_OK ||
        fw_acquire_probe(link->acquire, &setup) != FW_OK) {
        fw_scanning_restart(link);
        return fw_refuse(EITS_REPLY_RANGE, offsetof(eits_command_probe, samples), 0);
    }
    link->probe_request = c.request;
    return (fw_answer){.later = true};
}

/* Rules by which a command is rejected during a tare or an upload. */
enum { NOT_IN_TARE = 1, NOT_IN_UPLOAD = 2, MORE_BYTES = 4 };

typedef struct command {
    eits_packet_type type;
    uint16_t size; /* of the payload; with MORE_BYTES, of the part before them */
    uint16_t rules;
    fw_answer (*run)(fw_host_link *link, const void *payload, size_t size);
} command;

static const command COMMANDS[] = {
    {EITS_PACKET_GET_INFO, sizeof(eits_command_plain), 0, on_get_info},
    {EITS_PACKET_STREAM, sizeof(eits_command_stream), NOT_IN_UPLOAD, on_stream},
    {EITS_PACKET_TARE, sizeof(eits_command_tare), NOT_IN_TARE | NOT_IN_UPLOAD, on_tare},
    {EITS_PACKET_SCAN, sizeof(eits_command_scan), NOT_IN_TARE | NOT_IN_UPLOAD, on_scan},
    {EITS_PACKET_SOLVER, sizeof(eits_command_solver), NOT_IN_TARE | NOT_IN_UPLOAD, on_solver},
    {EITS_PACKET_MODEL_BEGIN, sizeof(eits_command_model_begin), NOT_IN_TARE, on_model_begin},
    {EITS_PACKET_MODEL_DATA, sizeof(eits_command_model_data), NOT_IN_TARE | MORE_BYTES,
     on_model_data},
    {EITS_PACKET_MODEL_COMMIT, sizeof(eits_command_plain), NOT_IN_TARE, on_model_commit},
    {EITS_PACKET_GET_STATS, sizeof(eits_command_get_stats), 0, on_get_stats},
    {EITS_PACKET_MASK_ROW, sizeof(eits_command_mask_row), NOT_IN_TARE | NOT_IN_UPLOAD, on_mask_row},
    {EITS_PACKET_RESET, sizeof(eits_command_plain), 0, on_reset},
    {EITS_PACKET_SELF_TEST, sizeof(eits_command_plain), NOT_IN_TARE | NOT_IN_UPLOAD, on_self_test},
    {EITS_PACKET_CLEAR_FAULTS, sizeof(eits_command_plain), 0, on_clear_faults},
    {EITS_PACKET_KEEPALIVE, sizeof(eits_command_keepalive), 0, on_keepalive},
    {EITS_PACKET_SETTINGS, sizeof(eits_command_settings), NOT_IN_TARE | NOT_IN_UPLOAD, on_settings},
    {EITS_PACKET_GET_HASHES, sizeof(eits_command_plain), NOT_IN_TARE | NOT_IN_UPLOAD,
     on_get_hashes},
    {EITS_PACKET_PROBE, sizeof(eits_command_probe), NOT_IN_TARE | NOT_IN_UPLOAD, on_probe},
};

static fw_answer dispatch(fw_host_link *link, const eits_link_packet *packet)
{
    for (size_t k = 0; k < sizeof COMMANDS / sizeof COMMANDS[0]; ++k) {
        const command *c = &COMMANDS[k];
        if (packet->type != c->type)
            continue;
        const bool more = (c->rules & MORE_BYTES) != 0;
        if (packet->size < c->size + (more ? 1u : 0u) || (!more && packet->size != c->size))
            return fw_refuse(EITS_REPLY_LENGTH, more ? c->size + 4 : c->size, 0);
        if ((c->rules & NOT_IN_TARE) != 0 && fw_tare_active(link->solve))
            return busy_with(EITS_PACKET_TARE);
        if ((c->rules & NOT_IN_UPLOAD) != 0 && link->upload.active)
            return busy_with(EITS_PACKET_MODEL_BEGIN);
        const fw_answer answer = c->run(link, packet->payload, packet->size);
        if (c->rules != 0) /* it may have changed what the tracker reads */
            fw_tracks_restart(link);
        return answer;
    }
    return fw_refuse(EITS_REPLY_UNKNOWN_COMMAND, 0, 0);
}

/* Returns whether a command was answered already, or is under way, and must not run again. */
static bool sent_again(fw_host_link *link, eits_packet_type type, uint32_t request)
{
    const eits_packet_reply *last = &link->replies.reply;
    if (type == EITS_PACKET_TARE && fw_tare_active(link->solve) &&
        fw_tare_request(link->solve) == request)
        return true;
    if (type == EITS_PACKET_TARE && link->replies.tare_answered &&
        link->replies.tare.request == request)
        last = &link->replies.tare;
    else if (!link->replies.answered || last->command != type || last->request != request)
        return false;
    (void)fw_tx_queue_send(&link->tx_queue, EITS_PACKET_REPLY, last, sizeof *last, NULL, 0);
    return true;
}

void fw_command(fw_host_link *link, const eits_link_packet *packet)
{
    const eits_packet_type type = (eits_packet_type)packet->type;
    uint32_t request = 0;
    if (packet->type < EITS_PACKET_GET_INFO) /* a board's packet: an echo */
        return;
    if (packet->size >= sizeof request)
        memcpy(&request, packet->payload, sizeof request);
    if (packet->size >= sizeof request && sent_again(link, type, request))
        return;
    const fw_answer given = dispatch(link, packet);
    if (!given.later)
        fw_send_reply(link, type, request, given);
}
