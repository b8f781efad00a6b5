/* The state of the acquire module. Besides its own files only app/instrument.h may include this
 * file. */
#ifndef FW_ACQUIRE_STATE_H
#define FW_ACQUIRE_STATE_H

#include "app/acquire/demodulate.h"
#include "app/acquire/frame.h"
#include "app/acquire/probe.h"
#include "app/acquire/scan.h"

typedef enum fw_generating {
    FW_GENERATING_UNKNOWN, /* never started or stopped, or the last attempt failed */
    FW_GENERATING_NOTHING,
    FW_GENERATING_TONE
} fw_generating;

struct fw_acquire {
    const fw_board *board;
    struct fw_safety *safety;
    fw_generating generating;
    fw_tone tone; /* the last that was started */
    fw_demodulator demodulator;
    fw_scan_settings settings;
    fw_scan scan;
    fw_probe probe;
    uint32_t tried_us; /* when a start was last tried */
};

#endif
