/* The board's clock, for all modules. */
#ifndef FW_CLOCK_H
#define FW_CLOCK_H

#include "hal/hal.h"

static inline uint32_t fw_now_us(const fw_board *board)
{
    return board->system->time_us(board->system_ctx);
}

#endif
