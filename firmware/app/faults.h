/* Faults: each is told once when it rises and once when it has gone. */
#ifndef FW_FAULTS_H
#define FW_FAULTS_H

#include "app/outbox.h"

typedef struct fw_faults {
    fw_outbox *outbox;
    uint32_t raised;          /* bit k: fault number k */
    uint32_t open_electrodes; /* bit e: electrode e */
} fw_faults;

typedef struct fw_fault_detail {
    uint32_t frame;
    int32_t index, value;
    const uint32_t *words; /* 5, or NULL */
} fw_fault_detail;

void fw_faults_init(fw_faults *faults, fw_outbox *outbox);

/* The fault is there, or is not: a packet goes out where that changed. ELECTRODE_OPEN counts for each electrode (detail.index,
 * below 32). */
void fw_fault_set(fw_faults *faults, eits_fault code, bool there, fw_fault_detail detail);

bool fw_fault_is(const fw_faults *faults, eits_fault code);

/* All are taken to be gone; those that are still there will rise anew. */
void fw_faults_clear(fw_faults *faults, uint32_t frame);

#endif
