/* Products with the fastest form of S that a context has: panels, cached columns or the stored
 * matrix. All give the same bits. */
#ifndef EITSKIN_PRODUCTS_H
#define EITSKIN_PRODUCTS_H

#include "context/context.h"

/* out = S' v by panels if there are any, else from the columns. */
void eits_apply_t(const eits_context *ctx, const eits_real *v, eits_real *out);

/* out = S x; returns the number of non-zeros. */
uint32_t eits_apply(const eits_context *ctx, const eits_scratch *scratch, const eits_real *x,
                    eits_real *out);

#endif
