#include "app/link/commands.h"

#include "app/link/report.h"
#include "app/link/scanning.h"
#include "app/link/tracks.h"
#include "app/link/upload.h"
#include "app/safety/current_enable.h"
#include "app/solve/models.h"

#include <string.h>

enum {
    MAX_ITERATIONS = 1000,
    MAX_SETTLE_US = 50000,
    MAX_PERIOD_US = 600000000,
    MIN_SAMPLES = 4,
    MIN_MODEL = 64
};
enum { MIN_EXCITATION_MILLIHZ = 1000, MAX_EXCITATION_MILLIHZ = 250000000 };
/* IEC 60601-1, patient auxiliary current: 100 uA rms up to 1 kHz and in proportion above, so that a
 * microampere needs 10 Hz; at most 10 mA. */
enum { SAFE_UA_RMS = 100, MILLIHZ_A_UA = 10000, MAX_UA_RMS = 10000 };

static fw_answer ok(void)
{
    return (fw_answer){0};
}

/* RANGE where a field, at `offset` in the payload, is not between low and high. */
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
    *out = fw_refuse(EITS_REPLY_RANGE, (int32_t)offset, value > 1 ? 1 : 0); /* NaN is neither */
    return true;
}

static fw_answer busy_with(eits_packet_type command)
{
    return fw_refuse(EITS_REPLY_BUSY, (int32_t)command, 0);
}

static fw_answer on_get_info(fw_instrument *instrument, const void *payload, size_t size)
{
    eits_command_plain c;
    (void)size;
    memcpy(&c, payload, sizeof c);
    fw_send_info(instrument, c.request);
    return (fw_answer){.later = true};
}

static fw_answer on_get_stats(fw_instrument *instrument, const void *payload, size_t size)
{
    eits_command_get_stats c;
    fw_answer bad;
    (void)size;
    memcpy(&c, payload, sizeof c);
    if (outside(&bad, offsetof(eits_command_get_stats, reset), c.reset, 0, 1))
        return bad;
    fw_send_stats(instrument, c.request, c.reset != 0);
    return (fw_answer){.later = true};
}

static fw_answer on_stream(fw_instrument *instrument, const void *payload, size_t size)
{
    eits_command_stream c;
    fw_answer bad;
    (void)size;
    memcpy(&c, payload, sizeof c);
    const uint32_t all = EITS_STREAM_RAW | EITS_STREAM_IMAGE | EITS_STREAM_TOUCHES |
                         EITS_STREAM_EVENTS | EITS_STREAM_FOLLOWED;
    if (outside(&bad, offsetof(eits_command_stream, what), c.what, 0, all) ||
        outside(&bad, offsetof(eits_command_stream, every), c.every, 1, UINT16_MAX))
        return bad;
    if (c.what != 0 && !instrument->engine.open)
        return fw_refuse(EITS_REPLY_NO_MODEL, 0, 0);
    if ((c.what & ~EITS_STREAM_RAW) != 0 && !instrument->engine.tared)
        return fw_refuse(EITS_REPLY_NOT_TARED, 0, 0);
    if ((c.what & EITS_STREAM_FOLLOWED) != 0 && (c.every != 1 || !fw_follow_possible(instrument)))
        return fw_refuse(EITS_REPLY_DRIVES, 0, 0);
    if (c.what != 0 && !fw_drive_on(instrument))
        return fw_refuse(EITS_REPLY_TRIPPED, 0, 0);
    instrument->stream =
        (fw_stream){.what = c.what, .every = c.every, .left = c.frames, .counted = c.frames != 0};
    return ok();
}

static fw_answer on_tare(fw_instrument *instrument, const void *payload, size_t size)
{
    eits_command_tare c;
    fw_answer bad;
    (void)size;
    memcpy(&c, payload, sizeof c);
    const size_t at = offsetof(eits_command_tare, frames);
    if (outside(&bad, at, c.frames, 1, FW_TARE_MAX) ||
        (c.frames > 1 && outside(&bad, at, c.frames, 4, FW_TARE_MAX)))
        return bad;
    if (!instrument->engine.open)
        return fw_refuse(EITS_REPLY_NO_MODEL, 0, 0);
    if (!fw_drive_on(instrument))
        return fw_refuse(EITS_REPLY_TRIPPED, 0, 0);
    fw_tare_begin(&instrument->tare, &instrument->engine, c.request, c.frames,
                  fw_now_us(instrument));
    return (fw_answer){.later = true};
}

/* The least excitation at which the board's current is allowed. */
static uint32_t least_excitation_millihz(const fw_board *board)
{
    const uint32_t ua = board->source_ua_rms;
    return ua <= SAFE_UA_RMS ? MIN_EXCITATION_MILLIHZ : ua * MILLIHZ_A_UA;
}

/* Whether what is asked for needs the owner, who does not hold the button. */
static bool owner_away(const fw_instrument *instrument)
{
    const fw_board *board = instrument->board;
    return (instrument->kept.settings & EITS_SETTING_LOCKED) != 0 &&
           (board->system->button == NULL || !board->system->button(board->system_ctx));
}

static fw_answer refuse_locked(fw_instrument *instrument, eits_packet_type type)
{
    const fw_fault_detail detail = {.frame = instrument->last_frame, .index = (int32_t)type};
    fw_fault_set(&instrument->faults, EITS_FAULT_LOCKED, true, detail);
    return fw_refuse(EITS_REPLY_LOCKED, 0, 0);
}

/* What is wrong with scan settings by themselves; OK where nothing is. */
static fw_answer check_scan(const fw_instrument *instrument, const eits_command_scan *c)
{
    fw_answer bad;
    if (outside(&bad, offsetof(eits_command_scan, excitation_millihz), c->excitation_millihz,
                least_excitation_millihz(instrument->board), MAX_EXCITATION_MILLIHZ) ||
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
    if (c->excitation_millihz >= half_rate_millihz) /* more than two samples a period */
        return fw_refuse(EITS_REPLY_RANGE, (int32_t)offsetof(eits_command_scan, excitation_millihz),
                         (int32_t)(half_rate_millihz - 1));
    if (fw_ad9833_tuning(instrument->board->mclk_hz, c->excitation_millihz) == 0)
        return fw_refuse(EITS_REPLY_RANGE, (int32_t)offsetof(eits_command_scan, excitation_millihz),
                         (int32_t)least_excitation_millihz(instrument->board));
    if (!fw_whole_periods(c->excitation_millihz, c->sample_rate_hz, c->samples))
        return fw_refuse(
            EITS_REPLY_PERIODS,
            (int32_t)fw_nearest_integer(c->excitation_millihz, c->sample_rate_hz, c->samples), 0);
    return ok();
}

static fw_answer on_scan(fw_instrument *instrument, const void *payload, size_t size)
{
    eits_command_scan c;
    (void)size;
    memcpy(&c, payload, sizeof c);
    fw_answer checked = check_scan(instrument, &c);
    if (instrument->board->frames_given)
        return fw_refuse(EITS_REPLY_RANGE, (int32_t)offsetof(eits_command_scan, sample_rate_hz), 0);
    if (checked.status != EITS_REPLY_OK)
        return checked;
    /* the limit on current falls with the frequency */
    if (c.excitation_millihz < instrument->settings.excitation_millihz && owner_away(instrument))
        return refuse_locked(instrument, EITS_PACKET_SCAN);
    const fw_scan_settings settings = {c.excitation_millihz, c.sample_rate_hz, c.samples,
                                       c.settle_us,          c.check_every,    c.frame_period_us};
    const fw_scan_table table = fw_engine_table(&instrument->engine);
    const uint64_t min_us = (uint64_t)fw_scan_rows(&settings, &table) * fw_slot_us(&settings);
    if (instrument->engine.open && settings.frame_period_us != 0 &&
        settings.frame_period_us < min_us)
        return fw_refuse(EITS_REPLY_TOO_FAST, min_us > INT32_MAX ? INT32_MAX : (int32_t)min_us, 0);
    (void)fw_stop_scan(instrument);
    if (fw_scan_configure(&instrument->scan, &settings) == FW_OK) {
        instrument->settings = settings;
        fw_engine_set_noise_floor(&instrument->engine, fw_noise_floor_v(instrument));
        instrument->engine.tared = instrument->engine.phase_known = false;
        instrument->stream.what &= EITS_STREAM_RAW;
    } else {
        checked =
            fw_refuse(EITS_REPLY_RANGE, (int32_t)offsetof(eits_command_scan, sample_rate_hz), 0);
    }
    fw_start_scan(instrument);
    return checked;
}

/* What tracking changes is the model's own without it. */
static void set_tracking(const fw_instrument *instrument, eits_options *options, bool track)
{
    eits_options usual;
    (void)eits_options_default(&instrument->engine.model, &usual);
    options->detection_factor = usual.detection_factor;
    options->track_confirm = usual.track_confirm;
    options->track_hold = usual.track_hold;
    options->track_smooth = usual.track_smooth;
    if (track)
        (void)eits_options_track(options);
}

/* The numbers of eits_solver have a gap at 2, which is reserved; for it the reply states the
 * greatest number that may be used. */
static bool no_solver(fw_answer *out, uint32_t solver)
{
    const bool reserved = solver == EITS_SOLVER_WORKING_SET + 1u;
    return outside(out, offsetof(eits_command_solver, solver), reserved ? UINT32_MAX : solver, 0,
                   EITS_SOLVER_ACTIVE_SET);
}

static fw_answer on_solver(fw_instrument *instrument, const void *payload, size_t size)
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
                EITS_DIAGNOSTICS_ALL) ||
        outside(&bad, offsetof(eits_command_solver, track), c.track, 0, 1))
        return bad;
    if (!instrument->engine.open)
        return fw_refuse(EITS_REPLY_NO_MODEL, 0, 0);
    eits_options options = *eits_get_options(instrument->engine.ctx);
    options.iterations = c.iterations;
    options.max_touches = c.max_touches;
    options.warm_start = c.warm_start;
    options.sign = (eits_sign)c.sign;
    options.lambda_rel = c.lambda_rel;
    options.gap_rel = c.gap_rel;
    options.solver = (eits_solver)c.solver;
    options.mac_limit = c.mac_limit;
    options.diagnostics = c.diagnostics;
    set_tracking(instrument, &options, c.track != 0);
    const eits_status status = eits_set_options(instrument->engine.ctx, &options);
    return status == EITS_OK ? ok() : fw_refuse(EITS_REPLY_CORE, (int32_t)status, 0);
}

static fw_answer on_mask_row(fw_instrument *instrument, const void *payload, size_t size)
{
    eits_command_mask_row c;
    fw_answer bad;
    (void)size;
    memcpy(&c, payload, sizeof c);
    if (!instrument->engine.open)
        return fw_refuse(EITS_REPLY_NO_MODEL, 0, 0);
    if (outside(&bad, offsetof(eits_command_mask_row, row), c.row, 0,
                instrument->engine.model.n_rows - 1) ||
        outside(&bad, offsetof(eits_command_mask_row, masked), c.masked, 0, 1))
        return bad;
    (void)eits_mask_row(instrument->engine.ctx, c.row, c.masked);
    return ok();
}

static fw_answer on_model_begin(fw_instrument *instrument, const void *payload, size_t size)
{
    eits_command_model_begin c;
    (void)size;
    memcpy(&c, payload, sizeof c);
    if (c.bytes < MIN_MODEL)
        return fw_refuse(EITS_REPLY_RANGE, (int32_t)offsetof(eits_command_model_begin, bytes),
                         MIN_MODEL);
    if (owner_away(instrument))
        return refuse_locked(instrument, EITS_PACKET_MODEL_BEGIN);
    return fw_upload_begin(instrument, c.bytes, c.crc);
}

static fw_answer on_model_data(fw_instrument *instrument, const void *payload, size_t size)
{
    eits_command_model_data c;
    memcpy(&c, payload, sizeof c);
    return fw_upload_data(instrument, c.offset, (const uint8_t *)payload + sizeof c,
                          size - sizeof c);
}

static fw_answer on_model_commit(fw_instrument *instrument, const void *payload, size_t size)
{
    (void)payload;
    (void)size;
    return fw_upload_commit(instrument);
}

static fw_answer on_reset(fw_instrument *instrument, const void *payload, size_t size)
{
    (void)payload;
    (void)size;
    instrument->reset_wanted = true;
    return ok();
}

static fw_answer on_self_test(fw_instrument *instrument, const void *payload, size_t size)
{
    (void)payload;
    (void)size;
    if (!instrument->engine.open)
        return fw_refuse(EITS_REPLY_NO_MODEL, 0, 0);
    float difference;
    const eits_model model = instrument->engine.model;
    const eits_status status = fw_engine_self_test(&instrument->engine, &model, &difference);
    if (status != EITS_OK)
        return fw_refuse(EITS_REPLY_CORE, (int32_t)status, 0);
    const int32_t parts = (int32_t)(1e9f * (difference < 2 ? difference : 2));
    return difference == 0 ? ok() : fw_refuse(EITS_REPLY_SELF_TEST, parts, 0);
}

static fw_answer on_clear_faults(fw_instrument *instrument, const void *payload, size_t size)
{
    (void)payload;
    (void)size;
    instrument->doubtful = instrument->agreeing = 0;
    fw_faults_clear(&instrument->faults, instrument->last_frame);
    if (instrument->drive.state == EITS_DRIVE_TRIPPED) /* somebody has looked */
        instrument->drive.state = EITS_DRIVE_OFF;
    fw_report_no_model(instrument);
    return ok();
}

static fw_answer on_keepalive(fw_instrument *instrument, const void *payload, size_t size)
{
    eits_command_keepalive c;
    (void)size;
    memcpy(&c, payload, sizeof c);
    const bool stays = (instrument->kept.settings & EITS_SETTING_KEEP_DRIVE) != 0;
    if (c.present == 0 && !stays && instrument->drive.state == EITS_DRIVE_ON)
        fw_drive_off(instrument, EITS_DRIVE_OFF);
    return (fw_answer){.later = true};
}

static fw_answer on_settings(fw_instrument *instrument, const void *payload, size_t size)
{
    eits_command_settings c;
    fw_answer bad;
    (void)size;
    memcpy(&c, payload, sizeof c);
    const uint32_t all = EITS_SETTING_KEEP_DRIVE | EITS_SETTING_LOCKED | EITS_SETTING_SENSE;
    if (c.current_limit_ua_rms == EITS_LIMIT_KEPT)
        c.current_limit_ua_rms = instrument->kept.current_limit_ua_rms;
    if (outside(&bad, offsetof(eits_command_settings, settings), c.settings, 0, all) ||
        outside(&bad, offsetof(eits_command_settings, current_limit_ua_rms), c.current_limit_ua_rms,
                0, MAX_UA_RMS))
        return bad;
    if (owner_away(instrument))
        return refuse_locked(instrument, EITS_PACKET_SETTINGS);
    if (instrument->drive.state != EITS_DRIVE_TRIPPED) /* the flash may have to be erased */
        fw_drive_off(instrument, EITS_DRIVE_OFF);
    const fw_store *store = &instrument->board->store;
    if (fw_kept_save(store, c.settings, c.current_limit_ua_rms) != FW_OK)
        return fw_refuse(EITS_REPLY_FLASH, 0, 0);
    instrument->kept = fw_kept_load(store);
    if ((c.settings & EITS_SETTING_KEEP_DRIVE) != 0)
        (void)fw_drive_on(instrument);
    return ok();
}

static fw_answer on_get_hashes(fw_instrument *instrument, const void *payload, size_t size)
{
    eits_command_plain c;
    (void)size;
    memcpy(&c, payload, sizeof c);
    fw_send_hashes(instrument, c.request);
    return (fw_answer){.later = true};
}

/* When a command has to wait: during a tare, or an upload. */
enum { NOT_IN_TARE = 1, NOT_IN_UPLOAD = 2, MORE_BYTES = 4 };

typedef struct command {
    eits_packet_type type;
    uint16_t size; /* of the payload, or of what precedes the bytes */
    uint16_t rules;
    fw_answer (*run)(fw_instrument *instrument, const void *payload, size_t size);
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
};

static fw_answer dispatch(fw_instrument *instrument, const eits_link_packet *packet)
{
    for (size_t k = 0; k < sizeof COMMANDS / sizeof COMMANDS[0]; ++k) {
        const command *c = &COMMANDS[k];
        if (packet->type != c->type)
            continue;
        const bool more = (c->rules & MORE_BYTES) != 0;
        if (packet->size < c->size + (more ? 1u : 0u) || (!more && packet->size != c->size))
            return fw_refuse(EITS_REPLY_LENGTH, more ? c->size + 4 : c->size, 0);
        if ((c->rules & NOT_IN_TARE) != 0 && instrument->tare.active)
            return busy_with(EITS_PACKET_TARE);
        if ((c->rules & NOT_IN_UPLOAD) != 0 && instrument->upload.active)
            return busy_with(EITS_PACKET_MODEL_BEGIN);
        const fw_answer answer = c->run(instrument, packet->payload, packet->size);
        if (c->rules != 0) /* it may have changed what drives build on */
            fw_follow_forget(instrument);
        return answer;
    }
    return fw_refuse(EITS_REPLY_UNKNOWN_COMMAND, 0, 0);
}

/* A command that was answered already, or is under way, is not run again. */
static bool sent_again(fw_instrument *instrument, eits_packet_type type, uint32_t request)
{
    const eits_packet_reply *last = &instrument->reply;
    if (type == EITS_PACKET_TARE && instrument->tare.active && instrument->tare.request == request)
        return true;
    if (type == EITS_PACKET_TARE && instrument->tare_reported &&
        instrument->tare_reply.request == request)
        last = &instrument->tare_reply;
    else if (!instrument->answered || last->command != type || last->request != request)
        return false;
    (void)fw_tx_queue_send(&instrument->tx_queue, EITS_PACKET_REPLY, last, sizeof *last, NULL, 0);
    return true;
}

void fw_command(fw_instrument *instrument, const eits_link_packet *packet)
{
    const eits_packet_type type = (eits_packet_type)packet->type;
    uint32_t request = 0;
    if (packet->type < EITS_PACKET_GET_INFO) /* a board's packet: an echo */
        return;
    if (packet->size >= sizeof request)
        memcpy(&request, packet->payload, sizeof request);
    if (packet->size >= sizeof request && sent_again(instrument, type, request))
        return;
    const fw_answer given = dispatch(instrument, packet);
    if (!given.later)
        fw_send_reply(instrument, type, request, given);
}
