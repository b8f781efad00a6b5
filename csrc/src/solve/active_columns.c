/* Add and drop the active set's columns, and keep their factor: rows K with K G K' = 1, where G =
 * S_A'S_A has the products of the active columns.
 *
 * Newton's step of the active set is d = G^-1 b. It is computed many times while columns are added
 * and dropped. A Cholesky factor would give it by two triangular solves, each a chain of divisions
 * in which every number waits for the one before. K gives G^-1 = K'K, so the step is two plain
 * products that vector units run at full width, and no division at all. The price: K is dense after
 * a drop, so a solve costs 2 count^2 multiply-accumulates instead of the count^2 of triangles. With
 * the tens of columns of a skin's frame, this is less than one product with S.
 *
 * To add a column, a row is appended, from the new column's projection on the others (Gram-Schmidt
 * in the metric G). To drop a column, a reflection puts it into one row, and that row is dropped; a
 * reflection is orthogonal, so rounding does not grow. K is never factored again within a solve. If
 * it becomes wrong, the objective rises; the solver notices that and continues by another method
 * (active_set.c).
 *
 * In memory: rank rows of `stride` reals, only the first `count` rows and columns in use. Entries
 * beyond `count` are zero up to the next multiple of eight, since the kernels read whole vectors.
 */
#include "solve/active_columns.h"

#include "base/vec.h"
#include "context/products.h"
#include "context/projection.h"
#include "frame/whitening.h"
#include "kernels/column.h"
#include "kernels/kernels.h"
#include "solve/constants.h"
#include "solve/solve.h"

/* ---- the factor ---- */

static eits_real *row(const eits_context *ctx, uint32_t i)
{
    return ctx->solver.factor + EITS_STRIDE(ctx->model->rank) * i;
}

/* Two products with K replace two triangular solves: there is no division, and no number has to
 * wait for the one before. */
void eits_factor_solve(const eits_context *ctx, uint32_t count, eits_real *b, eits_real *w,
                       eits_real *d)
{
    const size_t stride = EITS_STRIDE(ctx->model->rank), length = EITS_STRIDE(count);
    eits_zero(b + count, length - count);
    ctx->kernels->rows_dot(ctx->solver.factor, stride, count, length, b, w);
    eits_zero(d, length);
    ctx->kernels->rows_add(ctx->solver.factor, stride, count, length, w, d);
}

/* The new row makes the new column orthonormal to the others: (1, -d) over the root of the rest of
 * its square. */
static void append_row(eits_context *ctx, uint32_t count, const eits_real *d, eits_real left)
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
 * column, and dropping the last row removes it (Golub and Van Loan, Matrix Computations, section
 * 5.1). The last column moves to its place, as the solver's lists do. */
static void drop_row(eits_context *ctx, uint32_t count, uint32_t place, eits_real *scratch,
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
    /* the sign that avoids cancellation */
    scratch[last] = scratch[last] < 0 ? -(norm + end) : norm + end;
    /* Householder's vector v = scratch; each row minus 2 v (v'row) / |v|^2. */
    const eits_real twice = norm > 0 ? 1 / (norm * (norm + end)) : 0;
    eits_zero(more, length);
    ctx->kernels->rows_add(ctx->solver.factor, stride, count, length, scratch, more);
    for (uint32_t i = 0; i < last; ++i) {
        eits_real *r = row(ctx, i);
        eits_axpy(ctx->kernels, r, -twice * scratch[i], more, length);
        r[place] = r[last];
        r[last] = 0;
    }
}

/* ---- columns ---- */

uint64_t eits_macs_to_finish(const eits_context *ctx, uint32_t count)
{
    return (uint64_t)count * ctx->model->rank + eits_gradient_macs(ctx);
}

/* Return 1 if the limit leaves room for `macs`, S x with one more column, and the gap after it.
 *
 * Once a step is too expensive the solve ends. Cheaper steps are not tried instead, so that the
 * result does not depend on the order of tests. */
int eits_active_affords(const eits_context *ctx, eits_active *a, uint64_t macs)
{
    a->limited = a->limited ||
                 !eits_affords(ctx, macs + eits_macs_to_finish(ctx, ctx->solver.working_count + 1));
    return !a->limited;
}

/* The last active column moves to the free place, so that nothing has to be shifted. Uses a->work
 * and a->step. */
void eits_active_drop(eits_context *ctx, eits_active *a, uint32_t place)
{
    const uint32_t count = ctx->solver.working_count, last = count - 1;
    if (eits_active_affords(
            ctx, a, eits_factor_macs(count))) { /* otherwise the factor is no longer needed */
        ctx->info.macs += eits_factor_macs(count);
        drop_row(ctx, count, place, a->work, a->step);
    }
    ctx->solver.working_count = last;
    ctx->solver.working[place] = ctx->solver.working[last];
    ctx->solver.x[place] = ctx->solver.x[last];
    a->pull[place] = a->pull[last];
    a->sign[place] = a->sign[last];
}

/* Make column j active without a row in the factor. This is allowed only if the solve then ends or
 * FISTA continues it. */
static void activate_dependent(eits_context *ctx, uint32_t j, eits_real x)
{
    ctx->solver.working[ctx->solver.working_count] = j;
    ctx->solver.x[ctx->solver.working_count++] = x;
}

/* Write into a->column the part of column j that the projection leaves. Returns its square, or 0 if
 * it is only rounding.
 */
static eits_real read_column(eits_context *ctx, eits_active *a, uint32_t j)
{
    const eits_matrix *s = &ctx->model->sensitivity;
    const uint32_t rank = ctx->model->rank;
    const eits_real scale = eits_column_scale(s, j), *from = eits_column(s, j, ctx->solver.sz);
    for (uint32_t i = 0; i < rank; ++i)
        a->column[i] = scale * from[i];
    const eits_real before = eits_dot(ctx->kernels, a->column, a->column, rank);
    ctx->info.macs += rank;
    /* No direction is projected out and F = 1: the column is used as it is. */
    if (ctx->projection.count == 0 && !ctx->whitening.form)
        return before;
    ctx->info.macs += rank + eits_forward(ctx, a->column);
    const eits_real square = eits_dot(ctx->kernels, a->column, a->column, rank);
    return square > EITS_INDEPENDENT * before ? square : 0;
}

/* a->step = the combination of the active columns that is nearest to the new one. Returns the
 * square of the rest of the new column. */
static eits_real part_left(eits_context *ctx, eits_active *a, eits_real square)
{
    const uint32_t count = ctx->solver.working_count;
    ctx->kernels->dots(&ctx->model->sensitivity, ctx->solver.working, count,
                       eits_adjoint(ctx, a->column, ctx->solver.adjoint), a->step);
    eits_factor_solve(ctx, count, a->step, a->work, a->step);
    ctx->info.macs += (uint64_t)count * ctx->model->rank + eits_adjoint_macs(ctx) +
                      eits_factor_macs(count) + count;
    /* By Pythagoras: |s_j|^2 - |K S_A's_j|^2. */
    return square - eits_dot(ctx->kernels, a->work, a->work, count);
}

/* Column j becomes active, with part_left's combination in a->step as its new factor row. */
static void activate(eits_context *ctx, eits_active *a, uint32_t j, eits_real x, eits_real sign,
                     eits_real pull, eits_real left)
{
    const uint32_t k = ctx->solver.working_count++;
    append_row(ctx, k, a->step, left);
    ctx->solver.working[k] = j;
    ctx->solver.x[k] = x;
    a->sign[k] = sign;
    a->pull[k] = pull;
}

/* The new column depends on the active ones (a->step as above). Move along the direction that
 * leaves S x unchanged, if this lowers the objective, until a coefficient is zero, and drop that
 * column. Returns the change of the new coefficient, or 0 if the objective cannot be lowered in
 * this way. */
static eits_real exchange(eits_context *ctx, eits_active *a, eits_real sign, eits_real pull)
{
    const uint32_t count = ctx->solver.working_count;
    ctx->info.macs += count;
    /* The objective's slope along the exchange is the sum of the pulls, because S x does not
     * change. */
    eits_real slope = sign * pull, shortest = R(INFINITY);
    uint32_t place = count;
    for (uint32_t k = 0; k < count; ++k) {
        const eits_real d = -sign * a->step[k];
        slope = eits_fma(d, a->pull[k], slope);
        if (d * a->sign[k] < 0 && ctx->solver.x[k] / -d < shortest) {
            shortest = ctx->solver.x[k] / -d;
            place = k;
        }
    }
    if (!(slope > 0) || place == count)
        return 0;
    for (uint32_t k = 0; k < count; ++k)
        ctx->solver.x[k] = eits_fma(-sign * shortest, a->step[k], ctx->solver.x[k]);
    eits_active_drop(ctx, a, place);
    a->moved = 1;
    return shortest;
}

/* Add column j with the coefficient zero.
 *
 * If it depends on the active columns, or if these span all directions, exchange() removes one of
 * them and the test is repeated, because the remaining columns span another space. Each turn drops
 * one column, so the loop ends. The coefficient that the exchanges have given is kept in x. If no
 * further exchange is possible while x is not zero, the column stays active without a factor row,
 * and FISTA continues the solve. */
void eits_active_add(eits_context *ctx, eits_active *a, uint32_t j)
{
    const eits_real sign = ctx->solver.gradient[j] > 0 ? 1 : -1,
                    pull = ctx->solver.gradient[j] - sign * a->lambda;
    const uint32_t rank = ctx->model->rank;
    eits_real x = 0, square = 0;
    for (int first = 1;; first = 0) {
        const uint32_t count = ctx->solver.working_count;
        if (!eits_active_affords(ctx, a,
                                 (uint64_t)rank * (count + 2u) + eits_forward_macs(ctx) +
                                     eits_adjoint_macs(ctx) + eits_factor_macs(count) + 2u * count))
            break;
        if (first && !((square = read_column(ctx, a, j)) > 0))
            return;
        const eits_real left = part_left(ctx, a, square);
        if (count < a->max && left > EITS_INDEPENDENT * square) {
            activate(ctx, a, j, sign * x, sign, pull, left);
            return;
        }
        const eits_real moved = exchange(ctx, a, sign, pull);
        x += moved;
        if (ctx->solver.working_count == count) /* no further exchange is possible */
            break;
    }
    if (x == 0)
        return;
    activate_dependent(ctx, j, sign * x);
    a->loose = 1;
}

/* Build the factor of a warm start's columns, except those that depend on the others. Returns 0,
 * and changes nothing, if the limit of multiply-accumulates leaves no room for it. */
int eits_active_begin_warm(eits_context *ctx, eits_active *a)
{
    const uint64_t active_count = ctx->info.nonzeros, rank = ctx->model->rank;
    if (!eits_affords(ctx, active_count * ((active_count + 2u) * rank + eits_forward_macs(ctx) +
                                           eits_adjoint_macs(ctx)) +
                               active_count * eits_factor_macs((uint32_t)active_count) +
                               active_count * (rank + active_count) + 2u * eits_gradient_macs(ctx)))
        return 0;
    for (uint32_t j = 0; j < ctx->model->n_pixels; ++j) {
        const eits_real x = ctx->solver.x[j];
        const eits_real square =
            x != 0 && ctx->solver.working_count < a->max ? read_column(ctx, a, j) : 0;
        if (!(square > 0))
            continue;
        const eits_real left = part_left(ctx, a, square);
        if (left > EITS_INDEPENDENT * square)
            activate(ctx, a, j, x, x > 0 ? 1 : -1, 0, left);
    }
    return 1;
}
