/* One burst of the converter's codes for a fixed row, for bring-up and for makers of boards. Two
 * bursts are taken: the first one with the electrodes `before`, the second one with the electrodes
 * that are joined then, so that its first samples show how the voltage settles. */
#ifndef FW_PROBE_H
#define FW_PROBE_H

#include "app/acquire/frame.h"
#include "hal/hal.h"

typedef struct fw_probe_setup {
    fw_scan_settings settings; /* rate, samples, settling */
    /* electrodes as fw_multiplexers_ops takes them, which the board can join; EITS_PROBE_OPEN */
    uint32_t before, joined;
    bool generator; /* it runs; otherwise it is stopped */
} fw_probe_setup;

typedef struct fw_probe {
    fw_probe_setup setup;
    const fw_board *board;
    volatile uint32_t state;
    uint32_t began_us;
    uint32_t start_us;    /* of the second burst */
    uint32_t switched_us; /* when its electrodes were joined */
    bool lost;
    uint16_t codes[FW_MAX_SAMPLES];
} fw_probe;

/* Start a probe. The generator must be in the state that `setup` names, and nothing else may run.
 * Errors: those of the lines and the capture; all electrodes are then open. */
fw_status fw_probe_start(fw_probe *probe, const fw_board *board, const fw_probe_setup *setup);

/* Open the electrodes and end the measurement. */
void fw_probe_stop(fw_probe *probe);

/* The first function returns whether the probe is under way, the second whether its codes are
 * available. */
bool fw_probe_active(const fw_probe *probe);
bool fw_probe_done(const fw_probe *probe);

#endif
