#include "app/main_loop.h"

#include "app/link/commands.h"
#include "app/link/report.h"
#include "app/link/scanning.h"
#include "app/link/stream.h"
#include "app/link/tracks.h"
#include "app/link/upload.h"
#include "app/safety/current_enable.h"
#include "app/solve/models.h"

#include <string.h>

enum { LED_ALIVE = 1, LED_TOUCH = 2, LED_FAULT = 4, ALIVE_MS = 512, DRAIN_US = 100000 };

void fw_instrument_init(fw_instrument *instrument, const fw_board *board)
{
    memset(instrument, 0, sizeof *instrument);
    instrument->board = board;
    instrument->settings = (fw_scan_settings)FW_SCAN_DEFAULT;
    instrument->settings.frame_period_us = board->frame_period_us;
    fw_tx_queue_init(&instrument->tx_queue, board->link);
    fw_faults_init(&instrument->faults, &instrument->tx_queue);
    fw_ad9833_init(&instrument->generator, board->generator);
    fw_engine_init(&instrument->engine, board->workspace, board->workspace_bytes);
    fw_scan_init(&instrument->scan, board, &instrument->demodulator);
    fw_follow_init(instrument);
    (void)eits_link_decoder_init(&instrument->decoder, instrument->received, FW_RECEIVE_ROOM);
    instrument->uptime_us = fw_now_us(instrument);
    const fw_last_reset *last = &board->last_reset;
    fw_fault_set(&instrument->faults, EITS_FAULT_CRASH, last->crash != 0,
                 (fw_fault_detail){.words = last->words});
    fw_fault_set(&instrument->faults, EITS_FAULT_WATCHDOG, last->watchdog != 0,
                 (fw_fault_detail){0});
    fw_engine_set_noise_floor(&instrument->engine, fw_noise_floor_v(instrument));
    fw_fault_set(&instrument->faults, EITS_FAULT_CLOCK, last->clock != 0, (fw_fault_detail){0});
    fw_fault_set(&instrument->faults, EITS_FAULT_SUPPLY, last->supply != 0, (fw_fault_detail){0});
    instrument->kept = fw_kept_load(&board->store);
    fw_open_newest(instrument);
    if (board->frames_given || (instrument->kept.settings & EITS_SETTING_KEEP_DRIVE) != 0)
        (void)fw_drive_on(instrument);
    else
        fw_start_scan(instrument); /* puts the generator into reset */
    fw_send_info(instrument, 0);
}

/* Take what has come and run the commands in it; false: nothing has. */
static bool read_link(fw_instrument *instrument)
{
    const fw_link *link = &instrument->board->link;
    const size_t size = link->ops->read(link->ctx, instrument->chunk, sizeof instrument->chunk);
    for (size_t at = 0; at < size;) {
        eits_link_packet packet;
        at += eits_link_feed(&instrument->decoder, instrument->chunk + at, size - at, &packet);
        if (packet.payload == NULL)
            continue;
        fw_follow_hold(instrument);
        fw_command(instrument, &packet);
        fw_follow_release(instrument);
        fw_drive_heard(instrument); /* the host waits for what a long command does */
    }
    return size > 0;
}

static void keep_time(fw_instrument *instrument)
{
    const uint32_t ms = (fw_now_us(instrument) - instrument->uptime_us) / 1000u;
    instrument->uptime_ms += ms;
    instrument->uptime_us += ms * 1000u;
}

static void set_leds(const fw_instrument *instrument)
{
    const fw_board *board = instrument->board;
    uint32_t leds = (instrument->uptime_ms & ALIVE_MS) == 0 ? LED_ALIVE : 0;
    leds |= instrument->touched ? LED_TOUCH : 0;
    leds |= instrument->faults.raised != 0 ? LED_FAULT : 0;
    board->system->set_leds(board->system_ctx, leds);
}

/* A scan that gives nothing is started again; so is one that could not be started. */
static void watch_scan(fw_instrument *instrument)
{
    const uint32_t now_us = fw_now_us(instrument);
    if (fw_scan_stalled(&instrument->scan, now_us)) {
        fw_fault_set(&instrument->faults, EITS_FAULT_SCAN_STALLED, true,
                     (fw_fault_detail){.frame = instrument->last_frame});
        fw_fail_tare(instrument, EITS_E_REFERENCE_SHORT);
        fw_start_scan(instrument);
    } else if (fw_scan_wanted(instrument) && !instrument->scan.running &&
               now_us - instrument->tried_us > FW_RETRY_US) {
        fw_start_scan(instrument);
    }
}

bool fw_instrument_step(fw_instrument *instrument)
{
    const fw_board *board = instrument->board;
    board->system->feed_watchdog(board->system_ctx);
    keep_time(instrument);
    bool worked = read_link(instrument);
    fw_frame *frame = fw_scan_take(&instrument->scan);
    if (frame != NULL) {
        fw_follow_take(instrument, true);
        if (instrument->drive.settling > 0)
            --instrument->drive.settling;
        else
            fw_process_frame(instrument, frame);
        fw_scan_release(&instrument->scan);
        fw_follow_take(instrument, false);
        worked = true;
    }
    fw_drive_check(instrument);
    watch_scan(instrument);
    fw_upload_check(instrument);
    set_leds(instrument);
    return worked;
}

/* The reply to RESET is on its way when the board restarts. */
static void restart(fw_instrument *instrument)
{
    const fw_board *board = instrument->board;
    const uint32_t began_us = fw_now_us(instrument);
    (void)fw_stop_scan(instrument);
    (void)fw_ad9833_stop(&instrument->generator);
    while (fw_now_us(instrument) - began_us < DRAIN_US) {
        board->system->feed_watchdog(board->system_ctx);
        board->system->wait(board->system_ctx);
    }
    board->system->reset(board->system_ctx);
}

int fw_instrument_run(fw_instrument *instrument, const fw_board *board)
{
    if (board->workspace == NULL || (uintptr_t)board->workspace % 16 != 0 ||
        board->mclk_hz % 1000000u != 0)
        return 1;
    fw_instrument_init(instrument, board);
    for (;;) {
        const bool worked = fw_instrument_step(instrument);
        if (instrument->reset_wanted) {
            restart(instrument);
            return 2; /* only where reset returns */
        }
        if (worked)
            continue;
        if (board->link.ops->ended != NULL && board->link.ops->ended(board->link.ctx))
            return 0;
        board->system->wait(board->system_ctx);
    }
}
