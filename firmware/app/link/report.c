#include "app/link/report.h"

#include "app/link/sha256.h"

#include <string.h>

static void copy_text(char *to, size_t room, const char *from)
{
    for (size_t k = 0; k < room && from != NULL && from[k] != 0; ++k)
        to[k] = from[k];
}

static void report_model(const fw_instrument *instrument, eits_packet_info *info)
{
    const eits_model *model = &instrument->engine.model;
    if (!instrument->engine.open)
        return;
    info->model_bytes = instrument->record.model_bytes;
    info->model_crc = instrument->record.model_crc;
    info->protocol_hash = model->protocol_hash;
    info->n_electrodes = model->n_electrodes;
    info->n_rows = model->n_rows;
    info->n_folded = model->n_folded;
    info->rank = model->rank;
    info->n_pixels = model->n_pixels;
    info->nx = model->nx;
    info->ny = model->ny;
    info->storage = (uint32_t)model->sensitivity.storage;
    info->bank = instrument->bank;
    info->tared = instrument->engine.tared;
}

void fw_send_info(fw_instrument *instrument, uint32_t request)
{
    const fw_board *board = instrument->board;
    const fw_scan_settings *s = &instrument->settings;
    const uint32_t tuning = fw_ad9833_tuning(board->mclk_hz, s->excitation_millihz);
    eits_packet_info info = {.request = request,
                             .firmware = {FW_VERSION_MAJOR, FW_VERSION_MINOR, FW_VERSION_PATCH, 0},
                             .f_cpu_hz = board->f_cpu_hz,
                             .electrodes = FW_ELECTRODES,
                             .bank_bytes = fw_store_room(&board->store),
                             .data_bytes = FW_DATA_BYTES,
                             .check_every = (uint16_t)s->check_every,
                             .streaming = instrument->stream.what,
                             .every = instrument->stream.every,
                             .frame_period_us = s->frame_period_us,
                             .faults = instrument->faults.raised,
                             .drive = (uint16_t)instrument->drive.state,
                             .settings = (uint16_t)instrument->kept.settings,
                             .source_ua_rms = board->source_ua_rms,
                             .current_ua_rms = instrument->drive.current_ua,
                             .current_limit_ua_rms =
                                 fw_current_limit_ua(&instrument->kept, board->source_ua_rms)};
    if (!board->frames_given) {
        info.excitation_millihz = (uint32_t)fw_ad9833_millihertz(board->mclk_hz, tuning);
        info.sample_rate_hz = s->sample_rate_hz;
        info.samples = (uint16_t)s->samples;
        info.settle_us = (uint16_t)s->settle_us;
        info.slot_us = fw_slot_us(s);
        info.volts_per_code_nv = fw_volts_per_code_nv(&board->capture);
    }
    copy_text(info.board, sizeof info.board - 1, board->name);
    copy_text(info.serial, sizeof info.serial, board->serial);
    report_model(instrument, &info);
    (void)fw_tx_queue_send(&instrument->tx_queue, EITS_PACKET_INFO, &info, sizeof info, NULL, 0);
}

void fw_send_hashes(fw_instrument *instrument, uint32_t request)
{
    const fw_board *board = instrument->board;
    eits_packet_hashes hashes = {.request = request};
    if (instrument->engine.open)
        fw_sha256(board->store.ops->bank(board->store.ctx, instrument->bank),
                  instrument->record.model_bytes, hashes.model);
    if (board->image != NULL)
        fw_sha256(board->image, board->image_bytes, hashes.firmware);
    (void)fw_tx_queue_send(&instrument->tx_queue, EITS_PACKET_HASHES, &hashes, sizeof hashes, NULL,
                           0);
}

static void collect(fw_instrument *instrument, eits_packet_stats *stats)
{
    const fw_board *board = instrument->board;
    const eits_link_decoder *decoder = &instrument->decoder;
    *stats = (eits_packet_stats){.uptime_ms = instrument->uptime_ms,
                                 .frames_scanned = instrument->scan.frames_scanned,
                                 .frames_solved = instrument->frames_solved,
                                 .packets_sent = instrument->tx_queue.sent,
                                 .packets_dropped = instrument->tx_queue.dropped,
                                 .deadlines_missed = instrument->deadlines_missed,
                                 .slots_repeated = instrument->scan.slots_repeated,
                                 .outliers = instrument->outliers,
                                 .link_packets = decoder->packets,
                                 .link_crc_errors = decoder->crc_errors,
                                 .link_framing_errors = decoder->framing_errors,
                                 .link_overruns = decoder->overruns,
                                 .stack_bytes = board->stack_bytes,
                                 .stack_used = board->system->stack_used(board->system_ctx),
                                 .workspace_bytes = (uint32_t)board->workspace_bytes,
                                 .workspace_used = (uint32_t)instrument->engine.used_bytes};
    for (uint32_t k = 0; k < EITS_STAGES; ++k)
        stats->stage[k] = fw_stats_of(&instrument->stats, (eits_stage)k);
}

void fw_send_stats(fw_instrument *instrument, uint32_t request, bool reset)
{
    eits_packet_stats *stats = &instrument->last_stats;
    /* a request sent again gets the same numbers */
    if (!instrument->stats_reported || stats->request != request) {
        collect(instrument, stats);
        stats->request = request;
        instrument->stats_reported = true;
        if (reset)
            fw_stats_clear(&instrument->stats);
    }
    (void)fw_tx_queue_send(&instrument->tx_queue, EITS_PACKET_STATS, stats, sizeof *stats, NULL, 0);
}

static eits_packet_reply make_reply(eits_packet_type command, uint32_t request, fw_answer answer)
{
    return (eits_packet_reply){.request = request,
                               .command = (uint16_t)command,
                               .status = (uint16_t)answer.status,
                               .detail = {answer.detail[0], answer.detail[1]}};
}

void fw_send_reply(fw_instrument *instrument, eits_packet_type command, uint32_t request,
                   fw_answer answer)
{
    instrument->reply = make_reply(command, request, answer);
    instrument->answered = true;
    (void)fw_tx_queue_send(&instrument->tx_queue, EITS_PACKET_REPLY, &instrument->reply,
                           sizeof instrument->reply, NULL, 0);
}

void fw_send_tare_reply(fw_instrument *instrument, fw_answer answer)
{
    instrument->tare_reply = make_reply(EITS_PACKET_TARE, instrument->tare.request, answer);
    instrument->tare_reported = true;
    (void)fw_tx_queue_send(&instrument->tx_queue, EITS_PACKET_REPLY, &instrument->tare_reply,
                           sizeof instrument->tare_reply, NULL, 0);
}
