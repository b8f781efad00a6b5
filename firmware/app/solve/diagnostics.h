/* What the core, or before a tare the board, found wrong with a frame: reported as faults, and in
 * the head of its packets. */
#ifndef FW_DIAGNOSTICS_H
#define FW_DIAGNOSTICS_H

#include "app/solve/quality.h"

typedef struct fw_safety fw_safety;

/* Open electrodes, bit e: electrode e. */
void fw_diagnostics_open(fw_safety *safety, uint64_t open);

/* Bridged and noisy electrodes, model mismatch. */
void fw_diagnostics_skin(fw_safety *safety, const eits_info *info);

/* A stale reference; only frames that were solved show it. */
void fw_diagnostics_reference(fw_safety *safety, const eits_info *info);

/* A new reference is neither stale nor unlike the model. */
void fw_diagnostics_new_reference(fw_safety *safety);

/* The head's fields. The core gets saturated rows as NaN, so that only the converter knows them;
 * they are added if `options` asks for this diagnostic. */
void fw_diagnostics_head(eits_packet_solved *head, const eits_info *info, const fw_quality *quality,
                         const eits_options *options);

#endif
