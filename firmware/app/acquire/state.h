/* What the acquire module keeps. Besides its own files only app/instrument.h may include this. */
#ifndef FW_ACQUIRE_STATE_H
#define FW_ACQUIRE_STATE_H

#include "app/acquire/demodulate.h"
#include "app/acquire/frame.h"
#include "app/acquire/probe.h"
#include "app/acquire/scan.h"
#include "drivers/ad9833.h"

struct fw_acquire {
    const fw_board *board;
    struct fw_safety *safety;
    fw_ad9833 generator;
    fw_demodulator demodulator;
    fw_scan_settings settings;
    fw_scan scan;
    fw_probe probe;
    uint32_t tried_us; /* when a start was last tried */
};

#endif
