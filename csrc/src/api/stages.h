/* Functions of this folder that its public functions share. */
#ifndef EITSKIN_API_STAGES_H
#define EITSKIN_API_STAGES_H

#include "context/context.h"

/* Does the work of eits_frame_stage without its checks; the reference need not be finished. */
eits_status eits_frame_data(eits_context *ctx, const eits_scratch *scratch, const eits_real *frame,
                            uint32_t *masked, uint64_t *macs);

/* Solve again, from zero, for the data `y` (stride numbers); frame.y is then `y`. Adds to the
 * counts in info. If the result is zero or not finite, the frame's own data are solved again. */
void eits_solve_again(eits_context *ctx, const eits_scratch *scratch, const eits_real *y);

#endif
