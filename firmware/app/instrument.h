/* The application of one board: its four modules, start-up, and the main loop. */
#ifndef FW_INSTRUMENT_H
#define FW_INSTRUMENT_H

#include "app/acquire/acquire.h"
#include "app/acquire/state.h"
#include "app/link/link.h"
#include "app/link/state.h"
#include "app/safety/safety.h"
#include "app/safety/state.h"
#include "app/solve/solve.h"
#include "app/solve/state.h"

/* Each module keeps its own state. A module uses those above it in this list, by their functions.
 */
typedef struct fw_instrument {
    const fw_board *board;
    fw_safety safety;
    fw_acquire acquire;
    fw_solve solve;
    fw_host_link link;
    uint32_t leds; /* as set; a board starts with all off */
} fw_instrument;

/* Switch on: open the newest model, start the scan if the owner lets current flow without a host,
 * report INFO. */
void fw_instrument_init(fw_instrument *instrument, const fw_board *board);

/* One turn of the main loop. Returns false if there was nothing to do. */
bool fw_instrument_step(fw_instrument *instrument);

/* fw_run on the caller's instrument. */
int fw_instrument_run(fw_instrument *instrument, const fw_board *board);

#endif
