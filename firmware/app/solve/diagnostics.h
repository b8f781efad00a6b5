/* The diagnostics of a frame, from the core or, before a tare, from the board. They are reported as
 * faults, and in the head of the frame's packets. */
#ifndef FW_DIAGNOSTICS_H
#define FW_DIAGNOSTICS_H

#include "app/solve/quality.h"

typedef struct fw_safety fw_safety;

/* Report open electrodes; bit e is electrode e. */
void fw_diagnostics_open(fw_safety *safety, uint64_t open);

/* Report bridged and noisy electrodes, and model mismatch. */
void fw_diagnostics_skin(fw_safety *safety, const eits_info *info);

/* Report a stale reference; only frames that were solved show it. */
void fw_diagnostics_reference(fw_safety *safety, const eits_info *info);

/* Clear the faults of the old reference: a new one is neither stale nor unlike the model. */
void fw_diagnostics_new_reference(fw_safety *safety);

/* Fill in the head's fields. The core gets saturated rows as NaN, so only the board knows them;
 * they are added if `options` asks for this diagnostic. */
void fw_diagnostics_head(eits_packet_solved *head, const eits_info *info, const fw_quality *quality,
                         const eits_options *options);

#endif
