#include "app/link/report.h"

#include "app/acquire/acquire.h"
#include "app/acquire/scan.h"
#include "app/link/sha256.h"
#include "app/link/state.h"
#include "app/safety/current_enable.h"
#include "app/safety/faults.h"
#include "app/safety/owner.h"
#include "app/solve/models.h"
#include "app/solve/solve.h"
#include "app/solve/store.h"
#include "app/solve/tare.h"

enum { NO_BUTTON = 2 };

static void copy_text(char *to, size_t room, const char *from)
{
    for (size_t k = 0; k < room && from != NULL && from[k] != 0; ++k)
        to[k] = from[k];
}

static void report_model(const fw_host_link *link, eits_packet_info *info)
{
    const eits_model *model = fw_solve_model(link->solve);
    if (model == NULL)
        return;
    const fw_model_file file = fw_models_file(link->solve);
    info->model_bytes = file.size;
    info->model_crc = file.crc;
    info->bank = file.bank;
    info->protocol_hash = model->protocol_hash;
    info->n_electrodes = model->n_electrodes;
    info->n_rows = model->n_rows;
    info->n_folded = model->n_folded;
    info->rank = model->rank;
    info->n_pixels = model->n_pixels;
    info->nx = model->nx;
    info->ny = model->ny;
    info->storage = (uint32_t)model->sensitivity.storage;
    info->tared = fw_solve_tared(link->solve);
}

static void report_scan(const fw_host_link *link, eits_packet_info *info)
{
    const fw_board *board = link->board;
    const fw_scan_settings *s = fw_acquire_settings(link->acquire);
    const fw_generator *generator = &board->generator;
    info->check_every = (uint16_t)s->check_every;
    info->frame_period_us = s->frame_period_us;
    if (board->frames_given)
        return;
    info->excitation_millihz =
        generator->ops->nearest(generator->ctx, s->excitation_millihz).millihz;
    info->sample_rate_hz = s->sample_rate_hz;
    info->samples = (uint16_t)s->samples;
    info->settle_us = (uint16_t)s->settle_us;
    info->slot_us = fw_slot_us(s);
    const fw_capture capture = fw_owner_capture(link->safety);
    info->volts_per_code_nv = fw_volts_per_code_nv(&capture);
}

static uint32_t button_level(const fw_board *board)
{
    return board->system->button == NULL ? NO_BUTTON : board->system->button(board->system_ctx);
}

void fw_send_info(fw_host_link *link, uint32_t request)
{
    const fw_board *board = link->board;
    const fw_safety *safety = link->safety;
    eits_packet_info info = {.request = request,
                             .firmware = {FW_VERSION_MAJOR, FW_VERSION_MINOR, FW_VERSION_PATCH, 0},
                             .f_cpu_hz = board->f_cpu_hz,
                             .electrodes = board->multiplexers.electrodes,
                             .bank_bytes = fw_store_room(&board->store),
                             .data_bytes = FW_DATA_BYTES,
                             .streaming = link->stream.what,
                             .every = link->stream.every,
                             .faults = fw_faults_raised(safety),
                             .drive = (uint16_t)fw_current_state(safety),
                             .settings = (uint16_t)fw_owner_settings(safety),
                             .source_ua_rms = fw_owner_source_ua_rms(safety),
                             .current_ua_rms = fw_current_ua(safety),
                             .current_limit_ua_rms = fw_current_limit_ua(safety),
                             .source_ua = fw_owner_source_ua(safety),
                             .gain_ppm = fw_owner_gain_ppm(safety),
                             .button = button_level(board)};
    report_scan(link, &info);
    copy_text(info.board, sizeof info.board - 1, board->name);
    copy_text(info.serial, sizeof info.serial, board->serial);
    copy_text(info.name, sizeof info.name, fw_owner_name(safety));
    report_model(link, &info);
    (void)fw_tx_queue_send(&link->tx_queue, EITS_PACKET_INFO, &info, sizeof info, NULL, 0);
}

void fw_send_hashes(fw_host_link *link, uint32_t request)
{
    const fw_board *board = link->board;
    eits_packet_hashes hashes = {.request = request};
    if (fw_solve_model(link->solve) != NULL) {
        const fw_model_file file = fw_models_file(link->solve);
        fw_sha256(file.bytes, file.size, hashes.model);
    }
    if (board->image != NULL)
        fw_sha256(board->image, board->image_bytes, hashes.firmware);
    (void)fw_tx_queue_send(&link->tx_queue, EITS_PACKET_HASHES, &hashes, sizeof hashes, NULL, 0);
}

static void collect(const fw_host_link *link, eits_packet_stats *stats)
{
    const fw_board *board = link->board;
    const eits_link_decoder *decoder = &link->decoder;
    *stats = (eits_packet_stats){.uptime_ms = link->uptime_ms,
                                 .frames_scanned = fw_acquire_frames_scanned(link->acquire),
                                 .frames_solved = fw_solve_frames_solved(link->solve),
                                 .packets_sent = link->tx_queue.sent,
                                 .packets_dropped = link->tx_queue.dropped,
                                 .deadlines_missed = link->deadlines_missed,
                                 .slots_repeated = fw_acquire_slots_repeated(link->acquire),
                                 .outliers = fw_solve_outliers(link->solve),
                                 .link_packets = decoder->packets,
                                 .link_crc_errors = decoder->crc_errors,
                                 .link_framing_errors = decoder->framing_errors,
                                 .link_overruns = decoder->overruns,
                                 .stack_bytes = board->stack_bytes,
                                 .stack_used = board->system->stack_used(board->system_ctx),
                                 .workspace_bytes = (uint32_t)board->workspace_bytes,
                                 .workspace_used = fw_solve_workspace_used(link->solve)};
    for (uint32_t k = 0; k < EITS_STAGES; ++k)
        stats->stage[k] = fw_stats_of(&link->stats, (eits_stage)k);
}

void fw_send_stats(fw_host_link *link, uint32_t request, bool reset)
{
    fw_replies *replies = &link->replies;
    /* a request that is sent again gets the same numbers */
    if (!replies->stats_answered || replies->stats.request != request) {
        collect(link, &replies->stats);
        replies->stats.request = request;
        replies->stats_answered = true;
        if (reset)
            fw_stats_clear(&link->stats);
    }
    (void)fw_tx_queue_send(&link->tx_queue, EITS_PACKET_STATS, &replies->stats,
                           sizeof replies->stats, NULL, 0);
}

static eits_packet_reply make_reply(eits_packet_type command, uint32_t request, fw_answer answer)
{
    return (eits_packet_reply){.request = request,
                               .command = (uint16_t)command,
                               .status = (uint16_t)answer.status,
                               .detail = {answer.detail[0], answer.detail[1]}};
}

static void send_reply(fw_host_link *link, const eits_packet_reply *reply)
{
    (void)fw_tx_queue_send(&link->tx_queue, EITS_PACKET_REPLY, reply, sizeof *reply, NULL, 0);
}

void fw_send_reply(fw_host_link *link, eits_packet_type command, uint32_t request, fw_answer answer)
{
    link->replies.reply = make_reply(command, request, answer);
    link->replies.answered = true;
    send_reply(link, &link->replies.reply);
}

void fw_send_tare_reply(fw_host_link *link, fw_answer answer)
{
    link->replies.tare = make_reply(EITS_PACKET_TARE, fw_tare_request(link->solve), answer);
    link->replies.tare_answered = true;
    send_reply(link, &link->replies.tare);
}
