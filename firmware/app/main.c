/* The application of a board: one instrument, in static memory. */
#include "app/instrument.h"

static fw_instrument instrument;

int fw_run(const fw_board *board)
{
    return fw_instrument_run(&instrument, board);
}
