/* The active set's factor: rows K with K G K' = 1, G = S_A'S_A the active columns' products.
 *
 * Newton's step of the active set is d = G^-1 b, again and again while columns come and go. A
 * Cholesky factor would give it by two triangular solves, each a chain of divisions in which every
 * number waits for the one before. K gives G^-1 = K'K, so the step is two plain products that
 * vector units run at full width, and no division at all. Price: K is dense after a drop, so a
 * solve costs 2 count^2 multiply-accumulates where triangles cost count^2. With the tens of columns
 * that a skin's frame has, that is less than one product with S.
 *
 * Coming: one row appended, from the new column's projection on the others (Gram-Schmidt in the
 * metric G). Going: a reflection that puts the leaving column into one row, which is dropped; a
 * reflection is orthogonal, so rounding does not grow. K is never refactored within a solve; the
 * solver notices a factor gone wrong by an objective that rises, and goes on by another method
 * (active_set.c).
 *
 * In memory: rank rows of `stride` reals, only the first `count` rows and columns in use. Entries
 * beyond `count` are zero up to the next multiple of eight, since the kernels read whole vectors.
 */
#include "solve/gram_factor.h"

#include "base/vec.h"
#include "kernels/kernels.h"

static eits_real *row(const eits_context *ctx, uint32_t i)
{
    return ctx->solver.factor + EITS_STRIDE(ctx->model->rank) * i;
}

/* Two products with K instead of two triangular solves: no division, no chain in which each
 * number waits for the one before. */
void eits_factor_solve(const eits_context *ctx, uint32_t count, eits_real *b, eits_real *w,
                       eits_real *d)
{
    const size_t stride = EITS_STRIDE(ctx->model->rank), length = EITS_STRIDE(count);
    eits_zero(b + count, length - count);
    ctx->kernels->rows_dot(ctx->solver.factor, stride, count, length, b, w);
    ctx->kernels->rows_sum(ctx->solver.factor, stride, count, length, w, d);
}

/* The new row is what makes the new column orthonormal to the others: (1, -d) over the root of
 * what is left of its square. */
void eits_factor_append(eits_context *ctx, uint32_t count, const eits_real *d, eits_real left)
{
    const eits_real fraction = 1 / eits_sqrt(left);
    eits_real *r = row(ctx, count);
    eits_zero(r, EITS_STRIDE(ctx->model->rank));
    for (uint32_t k = 0; k < count; ++k)
        r[k] = -fraction * d[k];
    r[count] = fraction;
}

/* K G K' = 1 stays true under K -> H K for each orthogonal H. H is the Householder reflection that
 * takes column `place` of K to a multiple of the last unit vector: then no other row uses that
 * column any more, and without the last row it is gone (Golub and Van Loan, Matrix Computations,
 * section 5.1). The last column moves to its place, as the solver's lists do. */
void eits_factor_drop(eits_context *ctx, uint32_t count, uint32_t place, eits_real *scratch,
                      eits_real *more)
{
    const size_t stride = EITS_STRIDE(ctx->model->rank), length = EITS_STRIDE(count);
    const uint32_t last = count - 1;
    eits_real square = 0;
    for (uint32_t i = 0; i < count; ++i) {
        scratch[i] = row(ctx, i)[place];
        square += scratch[i] * scratch[i];
    }
    const eits_real norm = eits_sqrt(square), end = eits_fabs(scratch[last]);
    /* the sign that does not cancel */
    scratch[last] = scratch[last] < 0 ? -(norm + end) : norm + end;
    /* Householder's vector v = scratch; rows less twice v (v'rows) / |v|^2. */
    const eits_real twice = norm > 0 ? 1 / (norm * (norm + end)) : 0;
    ctx->kernels->rows_sum(ctx->solver.factor, stride, count, length, scratch, more);
    for (uint32_t i = 0; i < last; ++i) {
        eits_real *r = row(ctx, i);
        eits_axpy(ctx->kernels, r, -twice * scratch[i], more, length);
        r[place] = r[last];
        r[last] = 0;
    }
}
