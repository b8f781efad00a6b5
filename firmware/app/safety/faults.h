/* Faults: each is reported once when it rises and once when it has gone. Those of an electrode
 * (ELECTRODE_OPEN, BRIDGED, ELECTRODE_NOISY) count for each electrode, detail.index, below 32. */
#ifndef FW_FAULTS_H
#define FW_FAULTS_H

#include "app/link/tx_queue.h"

typedef struct fw_faults {
    fw_tx_queue *tx_queue;
    uint32_t raised;             /* bit k: fault number k */
    uint32_t there[EITS_FAULTS]; /* of an electrode's: bit e; of others: bit 0 */
    /* frames in a row without what is there, or with what is not, by the same bits */
    uint8_t run[EITS_FAULTS][32];
} fw_faults;

typedef struct fw_fault_detail {
    uint32_t frame;
    int32_t index, value;
    const uint32_t *words; /* 5, or NULL */
} fw_fault_detail;

void fw_faults_init(fw_faults *faults, fw_tx_queue *tx_queue);

/* The fault is there, or is not: a packet goes out where that changed. */
void fw_fault_set(fw_faults *faults, eits_fault code, bool there, fw_fault_detail detail);

/* A frame shows the fault, or does not: it rises at once, from ELECTRODE_NOISY on with the
 * EITS_FAULT_RAISE_FRAMES-th in a row, and goes with the EITS_FAULT_CLEAR_FRAMES-th that does not,
 * so that what comes and goes with the noise does not fill the line. */
void fw_fault_observe(fw_faults *faults, eits_fault code, bool found, fw_fault_detail detail);

bool fw_fault_is(const fw_faults *faults, eits_fault code);

/* All are taken to be gone; those that are still there will rise again. */
void fw_faults_clear(fw_faults *faults, uint32_t frame);

#endif
