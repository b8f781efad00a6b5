/* What the public functions use of each other. */
#ifndef EITSKIN_API_STAGES_H
#define EITSKIN_API_STAGES_H

#include "context/context.h"

/* eits_frame_stage without its checks; the reference need not be finished. */
eits_status eits_frame_data(eits_context *ctx, const eits_scratch *scratch, const eits_real *frame,
                            uint32_t *masked, uint64_t *macs);

/* Solve once more, from zero, for the data `y` (stride numbers); frame.y is then `y`. Adds to what
 * info counts; where nothing comes of it, the frame's own data are solved again. */
void eits_solve_again(eits_context *ctx, const eits_scratch *scratch, const eits_real *y);

#endif
