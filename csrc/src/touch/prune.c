/* Backward elimination decides which discs are touches.
 *
 * The image has more peaks than touches: ripple around a strong one, noise, a second peak of one
 * wide touch near the rim. A disc stays if the data are worse without it by enough (a fraction
 * touch_min_fraction of |y|^2) and if it stands out of the noise at its own pixel.
 *
 * What the data lose without disc k, all other strengths refitted, is change_k^2 / (G^-1)_kk with G
 * the atoms' Gram matrix: the usual formula of least squares for leaving one variable out. It needs
 * no refit for each candidate: one Cholesky factor of at most EITS_MAX_TOUCHES squared serves all.
 * In: f with its atoms and residual. Out: fewer discs, f->explained of those that stay, which is
 * reported as the touch's. */
#include "touch/constants.h"
#include "touch/disc_fit.h"

#include "base/cholesky.h"
#include "base/vec.h"
#include "frame/whitening.h"
#include "kernels/column.h"
#include "kernels/kernels.h"

/* The part of the data that each disc alone explains: change^2 / (G^-1)_kk of the atoms' Gram
 * matrix G, by its Cholesky factor and the factor's inverse. */
void eits_fit_explain(eits_context *ctx, eits_fit *f)
{
    const uint32_t rank = ctx->model->rank, n = f->count;
    eits_real lower[EITS_LOWER_SIZE(EITS_MAX_TOUCHES)], norm[EITS_MAX_TOUCHES];
    for (uint32_t i = 0; i < n; ++i) {
        eits_real *row = eits_lower_row(lower, i);
        norm[i] = eits_sqrt(eits_dot(ctx->kernels, eits_atom(ctx, i), eits_atom(ctx, i), rank));
        for (uint32_t j = 0; j < i; ++j) {
            const eits_real both = norm[i] * norm[j];
            row[j] = both > 0
                         ? eits_dot(ctx->kernels, eits_atom(ctx, i), eits_atom(ctx, j), rank) / both
                         : 0;
        }
        /* On a unit diagonal, lifted a little: two discs in one place are dependent, and would make
         * the factor's last pivot zero or less. They then explain about nothing each, and one goes.
         */
        row[i] = 1 + EITS_GAIN_LIFT;
        const eits_real pivot = eits_cholesky_row(lower, i);
        row[i] = eits_sqrt(pivot > EITS_GAIN_PIVOT ? pivot : EITS_GAIN_PIVOT);
    }
    /* Leaving k out lets the others take up what it explained, as far as they can: that is what the
     * inverse Gram matrix says, and a disc beside a stronger one is not credited with what both can
     * do. */
    f->macs += (uint64_t)n * (n + 1) / 2 * rank;
    for (uint32_t k = 0; k < n; ++k) { /* column k of L^-1; its squared norm is (G^-1)_kk */
        eits_real column[EITS_MAX_TOUCHES] = {0}, squared = 0;
        column[k] = 1;
        eits_lower_solve(lower, n, column);
        for (uint32_t i = k; i < n; ++i)
            squared = eits_fma(column[i], column[i], squared);
        /* Over the squared norm of L^-1's column: what no other disc can take over. */
        const eits_real size = f->disc[k].change * norm[k];
        f->explained[k] = f->total > 0 ? size * size / (squared * f->total) : 0;
    }
}

/* The cell at `at` from the grid's origin, one of `count`; the nearest where it is beyond. */
static uint32_t cell_of(eits_real at, eits_real pixel, uint32_t count)
{
    const eits_real cell = at / pixel, last = (eits_real)(count - 1u);
    return cell > 0 ? (cell < last ? (uint32_t)cell : count - 1u) : 0;
}

/* Whether the disc stands out of the noise by the same test as the whole frame: S_j'(y - other
 * discs) at its pixel.
 *
 * The frame passed the detection threshold as a whole; a disc of its own has to as well, at a
 * pixel near its centre and with the other discs taken out. Otherwise a strong touch would lift
 * noise beside it over the threshold. */
static int stands_out(eits_context *ctx, const eits_scratch *scratch, eits_fit *f, uint32_t k)
{
    const eits_real min = eits_detection_threshold(ctx);
    const uint32_t rank = ctx->model->rank;
    if (!(min > 0))
        return 1;
    const eits_disc *disc = &f->disc[k];
    const eits_real *atom = eits_adjoint(ctx, eits_atom(ctx, k), scratch->row[5]);
    const eits_real *residual = eits_adjoint(ctx, f->residual, scratch->row[6]);
    eits_real best = 0;
    f->macs += 2u * eits_adjoint_macs(ctx);
    const eits_model *model = ctx->model;
    const eits_real pixel = (eits_real)model->pixel_mm, near = EITS_STANDS_OUT_NEAR * pixel;
    const uint32_t x = cell_of(disc->x_mm - (eits_real)model->origin_x_mm, pixel, model->nx),
                   y = cell_of(disc->y_mm - (eits_real)model->origin_y_mm, pixel, model->ny);
    for (uint32_t place = 0; place < 25; ++place) { /* its cell and two to either side */
        const uint32_t ix = x + place % 5u - 2u, iy = y + place / 5u - 2u; /* 0 - 1: none */
        if (ix >= model->nx || iy >= model->ny)
            continue;
        const uint32_t j = ctx->cell[(size_t)iy * model->nx + ix];
        const eits_real dx =
            eits_fma((eits_real)ix + R(0.5), pixel, (eits_real)model->origin_x_mm) - disc->x_mm;
        const eits_real dy =
            eits_fma((eits_real)iy + R(0.5), pixel, (eits_real)model->origin_y_mm) - disc->y_mm;
        if (j == EITS_NO_PIXEL || eits_fabs(dx) > near || eits_fabs(dy) > near)
            continue;
        const eits_real *column = eits_column(&model->sensitivity, j, scratch->row[1]),
                        scale = eits_column_scale(&model->sensitivity, j);
        const eits_real seen =
            scale * eits_fma(disc->change, eits_dot(ctx->kernels, column, atom, rank),
                             eits_dot(ctx->kernels, column, residual, rank));
        f->macs += 2u * rank;
        best = seen * disc->polarity > best ? seen * disc->polarity : best;
    }
    return best >= min;
}

/* The residual gets back what the disc explained; the rest keep their order, which is that of their
 * peaks. */
static void drop(eits_context *ctx, eits_fit *f, uint32_t k)
{
    const uint32_t rank = ctx->model->rank;
    eits_axpy(ctx->kernels, f->residual, f->disc[k].change, eits_atom(ctx, k), rank);
    --f->count;
    for (uint32_t l = k; l < f->count; ++l) {
        f->disc[l] = f->disc[l + 1];
        eits_copy(eits_atom(ctx, l), eits_atom(ctx, l + 1), EITS_STRIDE(rank));
    }
}

/* The weakest goes first, and what it explained is offered to the others before the next is
 * judged: two halves of one touch then become one whole touch instead of none. */
void eits_fit_prune(eits_context *ctx, const eits_scratch *scratch, eits_fit *f)
{
    /* One at a time: when the weakest is gone the others may explain more. */
    while (f->count > 0) {
        eits_fit_explain(ctx, f);
        uint32_t weakest = 0;
        for (uint32_t k = 1; k < f->count; ++k)
            weakest = f->explained[k] < f->explained[weakest] ? k : weakest;
        const int alone = f->count == 1;
        const int enough =
            alone ? f->explained[0] > 0 : f->explained[weakest] >= ctx->options.touch_min_fraction;
        if (enough && stands_out(ctx, scratch, f, weakest))
            return;
        drop(ctx, f, weakest);
        eits_fit_move_all(ctx, scratch, f,
                          ctx->options.touch_sweeps < EITS_DROP_SWEEPS ? ctx->options.touch_sweeps
                                                                       : EITS_DROP_SWEEPS);
    }
}
