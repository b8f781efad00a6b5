#include "app/instrument.h"

#include "app/clock.h"
#include "app/link/report.h"
#include "app/link/scanning.h"
#include "app/link/stream.h"
#include "app/link/tracks.h"
#include "app/link/upload.h"
#include "app/safety/current_enable.h"
#include "app/safety/faults.h"
#include "app/safety/owner.h"
#include "app/solve/models.h"

#include <string.h>

enum { LED_ALIVE = 1, LED_TOUCH = 2, LED_FAULT = 4, ALIVE_MS = 512, DRAIN_US = 100000 };

static void wire(fw_instrument *instrument, const fw_board *board)
{
    memset(instrument, 0, sizeof *instrument);
    instrument->board = board;
    fw_link_init(&instrument->link, board, &instrument->safety, &instrument->acquire,
                 &instrument->solve);
    fw_safety_init(&instrument->safety, board,
                   (fw_safety_hooks){.fault_changed = fw_link_fault_changed,
                                     .current_changed = fw_scanning_current_changed,
                                     .user = &instrument->link});
    fw_acquire_init(&instrument->acquire, board, &instrument->safety);
    fw_solve_init(&instrument->solve, board, &instrument->safety, &instrument->acquire);
}

static void report_last_reset(fw_instrument *instrument)
{
    const fw_last_reset *last = &instrument->board->last_reset;
    const fw_fault_detail none = {0}, crash = {.words = last->words};
    fw_fault_set(&instrument->safety, EITS_FAULT_CRASH, last->crash != 0, crash);
    fw_fault_set(&instrument->safety, EITS_FAULT_WATCHDOG, last->watchdog != 0, none);
    fw_fault_set(&instrument->safety, EITS_FAULT_CLOCK, last->clock != 0, none);
    fw_fault_set(&instrument->safety, EITS_FAULT_SUPPLY, last->supply != 0, none);
}

void fw_instrument_init(fw_instrument *instrument, const fw_board *board)
{
    wire(instrument, board);
    report_last_reset(instrument);
    fw_models_open_newest(&instrument->solve);
    if (board->frames_given || fw_owner_keeps_current(&instrument->safety))
        (void)fw_current_on(&instrument->safety);
    else
        fw_scanning_restart(&instrument->link); /* puts the generator into reset */
    fw_send_info(&instrument->link, 0);
}

static void set_leds(fw_instrument *instrument)
{
    const fw_board *board = instrument->board;
    uint32_t leds = (fw_link_uptime_ms(&instrument->link) & ALIVE_MS) == 0 ? LED_ALIVE : 0;
    leds |= fw_solve_touched(&instrument->solve) ? LED_TOUCH : 0;
    leds |= fw_faults_raised(&instrument->safety) != 0 ? LED_FAULT : 0;
    if (leds != instrument->leds)
        board->system->set_leds(board->system_ctx, leds);
    instrument->leds = leds;
}

/* Without +-15 V no current flows and each row reads about nothing: say why. */
static void check_analog_supply(fw_instrument *instrument)
{
    const fw_board *board = instrument->board;
    if (board->system->analog_supply == NULL)
        return;
    const bool missing = !board->system->analog_supply(board->system_ctx);
    fw_fault_set(&instrument->safety, EITS_FAULT_ANALOG_SUPPLY, missing, (fw_fault_detail){0});
}

static bool process_frame(fw_instrument *instrument)
{
    fw_frame *frame = fw_acquire_take(&instrument->acquire);
    if (frame == NULL)
        return false;
    fw_tracks_at_frame(&instrument->link, true);
    if (!fw_current_drops_frame(&instrument->safety))
        fw_stream_frame(&instrument->link, frame);
    fw_acquire_release(&instrument->acquire);
    fw_tracks_at_frame(&instrument->link, false);
    return true;
}

bool fw_instrument_step(fw_instrument *instrument)
{
    instrument->board->system->feed_watchdog(instrument->board->system_ctx);
    fw_link_keep_time(&instrument->link);
    const bool heard = fw_link_read(&instrument->link);
    const bool framed = process_frame(instrument);
    fw_current_check(&instrument->safety, fw_acquire_running(&instrument->acquire));
    check_analog_supply(instrument);
    fw_scanning_probed(&instrument->link);
    fw_scanning_watch(&instrument->link);
    fw_upload_check(&instrument->link);
    set_leds(instrument);
    return heard || framed;
}

/* While the reply to RESET is sent, the board waits. */
static void restart(fw_instrument *instrument)
{
    const fw_board *board = instrument->board;
    const uint32_t began_us = fw_now_us(board);
    fw_acquire_shut_down(&instrument->acquire);
    while (fw_now_us(board) - began_us < DRAIN_US) {
        board->system->feed_watchdog(board->system_ctx);
        board->system->wait(board->system_ctx);
    }
    board->system->reset(board->system_ctx);
}

int fw_instrument_run(fw_instrument *instrument, const fw_board *board)
{
    if (board->workspace == NULL || (uintptr_t)board->workspace % 16 != 0 ||
        board->multiplexers.electrodes > FW_MAX_ELECTRODES)
        return 1;
    fw_instrument_init(instrument, board);
    for (;;) {
        const bool worked = fw_instrument_step(instrument);
        if (fw_link_reset_wanted(&instrument->link)) {
            restart(instrument);
            return 2; /* only if reset returns */
        }
        if (worked)
            continue;
        if (board->link.ops->ended != NULL && board->link.ops->ended(board->link.ctx))
            return 0;
        board->system->wait(board->system_ctx);
    }
}
