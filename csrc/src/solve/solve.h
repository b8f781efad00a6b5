/* Solve one frame: from reduced data to coefficients and image. */
#ifndef EITSKIN_SOLVE_FRAME_H
#define EITSKIN_SOLVE_FRAME_H

#include "context/context.h"

/* Solve for frame.y: lambda, detection threshold, start, solver, image. info has the frame stage's
 * counts, and zeros. `from_last`: 1 to start from the last coefficients. Errors: EITS_E_NOT_FINITE.
 */
eits_status eits_solve_frame(eits_context *ctx, const eits_scratch *scratch, int from_last);

/* Make x = 0 the result, for the reason `why`. */
void eits_answer_zero(eits_context *ctx, eits_stop why);

/* ---- the solvers ----
 *
 * Each starts from solver.x and solver.sx = S x (both zero, or those of a warm start).
 * `gradient_known`: x is zero and solver.gradient holds S'y. Each leaves its result in x and sx,
 * and the reason for its end in info. If info.stop is EITS_STOP_DIVERGED, x is useless. */

/* Run FISTA, on a working set if the options say so, else on every column, until the number of
 * iterations or the gap is reached. Iterations that info already counts are included. If the
 * objective rises above its value at zero, the step is halved and the solve starts over from zero.
 */
void eits_run_fista(eits_context *ctx, const eits_scratch *scratch, eits_real lambda,
                    int gradient_known);

/* Run the active set method, until the number of rounds or the gap is reached, or until no column
 * is missing. If its factor breaks down, FISTA on every column continues from the coefficients
 * reached, for the iterations left. */
void eits_run_active_set(eits_context *ctx, const eits_scratch *scratch, eits_real lambda,
                         int gradient_known);

/* ---- duality_gap.c: what all solvers share ---- */

typedef struct eits_duality_gap {
    eits_real gap;
    eits_real objective;
    eits_real residual_squared;
} eits_duality_gap;

/* The layout of a solver's coefficients: solver.x[j] for each column j, or solver.x[k] for column
 * solver.working[k]. */
typedef enum eits_layout { EITS_LAYOUT_FULL = 0, EITS_LAYOUT_WORKING = 1 } eits_layout;

/* solver.residual = Q (y - F sx), where y is already projected and F is that of whitening.h.
 * Returns the multiply-accumulates. */
uint64_t eits_take_residual(eits_context *ctx, const eits_real *sx);

/* solver.residual = Q (y - F sx), and solver.gradient = S' F' residual for every column. Adds the
 * cost to info. */
void eits_take_gradient(eits_context *ctx, const eits_real *sx);

/* Return objective and gap at solver.x. solver.residual and solver.gradient must be those of
 * eits_take_gradient. */
eits_duality_gap eits_duality_gap_of(const eits_context *ctx, eits_real lambda, eits_layout layout);

/* Call eits_take_gradient at solver.sx, then eits_duality_gap_of. */
eits_duality_gap eits_find_duality_gap(eits_context *ctx, eits_real lambda, eits_layout layout);

/* Return objective and gap at x = 0, from info alone: no product is needed. */
eits_duality_gap eits_duality_gap_at_zero(const eits_context *ctx, eits_real lambda);

/* Return the multiply-accumulates of eits_take_gradient if solver.sx is known. */
uint64_t eits_gradient_macs(const eits_context *ctx);

/* Return 1 if `macs` more stay within mac_limit, or if there is no limit. */
int eits_affords(const eits_context *ctx, uint64_t macs);

/* Return the greatest objective that a result may have: that of x = 0, plus a little for rounding.
 * A result above it is worse than no image. */
eits_real eits_ceiling(const eits_context *ctx);

/* Write gap and residual into info. */
void eits_report_duality_gap(eits_context *ctx, eits_duality_gap c);

/* ---- working_set.c: FISTA's working set, and functions that the other solvers use, too ---- */

/* List the columns of solver.x that are not zero and keep x for these only, so that
 * solver.x[k] is that of solver.working[k]. */
void eits_working_set_begin(eits_context *ctx);

/* Choose the set again, by solver.gradient of every column at z: the columns with a non-zero x or
 * z, and those that the step would move. Compacts x, z and gradient accordingly. */
void eits_working_set_choose(eits_context *ctx, const eits_scratch *scratch, eits_real lambda);

/* Leave out the columns at rest, by solver.gradient of the working set at z. The rule is the same,
 * but other columns are not examined. */
void eits_working_set_prune(eits_context *ctx, eits_real lambda);

/* Spread solver.x over all columns again. */
void eits_working_set_end(eits_context *ctx);

/* Return 1 if a column at x = z = 0 with this gradient would move. */
int eits_moves(eits_real gradient, eits_real lambda, eits_sign sign);

/* out = S' v for the working set's columns, by panels if there are any. */
void eits_apply_t_working(const eits_context *ctx, const eits_real *v, eits_real *out);

/* out = S x, where x has the coefficients of the working set. Returns the number of non-zeros. */
uint32_t eits_apply_working(const eits_context *ctx, const eits_scratch *scratch,
                            const eits_real *x, eits_real *out);

/* Unpack the working set's columns that are not in the column cache yet and, in a prepared context,
 * copy their panels. This is needed after each change of solver.working. */
void eits_pack_panels(eits_context *ctx);

#endif
