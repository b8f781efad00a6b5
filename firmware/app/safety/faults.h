/* Faults: each is reported once when it is raised and once when it is cleared. The faults of an
 * electrode (ELECTRODE_OPEN, BRIDGED, ELECTRODE_NOISY) are counted for each electrode by itself;
 * its number is detail.index, below 32. */
#ifndef FW_FAULTS_H
#define FW_FAULTS_H

#include "eitskin/link.h"

#include <stdbool.h>
#include <stdint.h>

typedef struct fw_safety fw_safety;

typedef struct fw_fault_detail {
    int32_t index, value;
    const uint32_t *words; /* 5, or NULL */
} fw_fault_detail;

/* Set the number of the frame that is processed from now on; reports of faults name it. */
void fw_faults_at_frame(fw_safety *safety, uint32_t frame);

/* Set whether the fault is present. A change is reported. */
void fw_fault_set(fw_safety *safety, eits_fault code, bool there, fw_fault_detail detail);

/* Note whether a frame shows the fault. The fault is raised at once; from ELECTRODE_NOISY on only
 * by the EITS_FAULT_RAISE_FRAMES-th consecutive frame that shows it. It is cleared by the
 * EITS_FAULT_CLEAR_FRAMES-th consecutive frame that does not. So a fault that flickers with the
 * noise does not fill the link. */
void fw_fault_observe(fw_safety *safety, eits_fault code, bool shown, fw_fault_detail detail);

/* Bit k: fault number k is raised. */
uint32_t fw_faults_raised(const fw_safety *safety);

/* Clear all faults; those that persist are raised again. */
void fw_faults_clear(fw_safety *safety);

#endif
