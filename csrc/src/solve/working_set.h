/* FISTA's working set, and what coordinate descent and active set use of it. */
#ifndef EITSKIN_WORKING_SET_H
#define EITSKIN_WORKING_SET_H

#include "context/context.h"

/* List the columns of solver.x that are not zero and keep x for these only, so that
 * solver.x[k] is that of solver.working[k]. */
void eits_working_set_begin(eits_context *ctx);

/* Choose again from solver.gradient, that of every column at z: those where x or z is not zero,
 * and those that the step would move. Compacts x, z and gradient likewise. */
void eits_working_set_choose(eits_context *ctx, const eits_scratch *scratch, eits_real lambda);

/* Leave out the columns at rest, by solver.gradient, that of the working set at z: the same
 * rule, no look at the others. */
void eits_working_set_prune(eits_context *ctx, eits_real lambda);

/* Spread solver.x over all columns again. */
void eits_working_set_end(eits_context *ctx);

/* 1 where a column at rest with this gradient would move. */
int eits_moves(eits_real gradient, eits_real lambda, eits_sign sign);

/* out = the working set's S' v, by its panels if there are any, else from the columns. */
void eits_apply_t_working(const eits_context *ctx, const eits_real *v, eits_real *out);

/* out = S x, x being that of the working set; returns the number of non-zeros. */
uint32_t eits_apply_working(const eits_context *ctx, const eits_scratch *scratch,
                            const eits_real *x, eits_real *out);

/* Keep the working set's columns at hand: those of S that are not cached yet are unpacked, and in a
 * prepared context their panels copied. Needed after each change of solver.working. */
void eits_pack_panels(eits_context *ctx);

#endif
