/* Start-up, and the main loop. */
#ifndef FW_MAIN_LOOP_H
#define FW_MAIN_LOOP_H

#include "app/instrument.h"

/* Switch on: open the newest model, start the scan, report INFO. */
void fw_instrument_init(fw_instrument *instrument, const fw_board *board);

/* One turn of the main loop; false: nothing was to be done. */
bool fw_instrument_step(fw_instrument *instrument);

/* fw_run on the caller's instrument. */
int fw_instrument_run(fw_instrument *instrument, const fw_board *board);

#endif
