/* What the core, or before a tare the board, found wrong with a frame: reported as faults by name,
 * and in the head of its packets. */
#ifndef FW_DIAGNOSTICS_H
#define FW_DIAGNOSTICS_H

#include "app/safety/faults.h"
#include "app/solve/quality.h"

/* Open electrodes, bit e: electrode e. */
void fw_diagnostics_open(fw_faults *faults, uint32_t frame, uint64_t open);

/* Bridged and noisy electrodes, mismatch. */
void fw_diagnostics_skin(fw_faults *faults, uint32_t frame, const eits_info *info);

/* A stale reference: only frames that were solved tell. */
void fw_diagnostics_reference(fw_faults *faults, uint32_t frame, const eits_info *info);

/* The head's fields for what was found. The converter knows saturated rows, and the core gets them
 * as no numbers: they are added where `options` names them. */
void fw_diagnostics_head(eits_packet_solved *head, const eits_info *info, const fw_quality *quality,
                         const eits_options *options);

#endif
