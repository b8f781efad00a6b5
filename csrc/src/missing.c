#include "missing.h"

#include "kernels.h"
#include "observed.h"
#include "vec.h"

/* How far the correlations lie beyond zero under the sign rule, into ctx->list_value. */
static const eits_real *beyond(const eits_context *ctx)
{
    const eits_real *g = ctx->gradient;
    eits_real *out = ctx->list_value;
    for (uint32_t j = 0; j < ctx->model->n_pixels; ++j)
        out[j] = ctx->options.sign == EITS_SIGN_INCREASE ? g[j] : ctx->options.sign == EITS_SIGN_DECREASE ? -g[j] : eits_fabs(g[j]);
    return out;
}

/* 1 where v[j] is the greatest among its neighbours; of equals the first is. */
static int is_peak(const eits_context *ctx, const eits_real *v, uint32_t j)
{
    const eits_model *m = ctx->model;
    const uint32_t ix = m->pixel[j].ix, iy = m->pixel[j].iy;
    const uint32_t left = ix > 0 ? ix - 1 : 0, low = iy > 0 ? iy - 1 : 0;
    for (uint32_t y = low; y <= iy + 1 && y < m->ny; ++y) {
        for (uint32_t x = left; x <= ix + 1 && x < m->nx; ++x) {
            const uint32_t other = ctx->cell[(size_t)y * m->nx + x];
            if (other != EITS_NO_PIXEL && (v[other] > v[j] || (v[other] == v[j] && other < j)))
                return 0;
        }
    }
    return 1;
}

/* The same for the neighbours in the row only: rules most columns out at once. */
static int is_peak_of_row(const eits_context *ctx, const eits_real *v, uint32_t j)
{
    const eits_pixel *p = ctx->model->pixel + j;
    if (j > 0 && p[-1].iy == p->iy && p[-1].ix + 1u == p->ix && v[j - 1] >= v[j])
        return 0;
    return !(j + 1 < ctx->model->n_pixels && p[1].iy == p->iy && p[1].ix == p->ix + 1u && v[j + 1] > v[j]);
}

uint32_t eits_list_missing(const eits_context *ctx, eits_real least, const uint8_t *marks)
{
    const eits_real *v = beyond(ctx);
    uint32_t count = 0, *list = ctx->list_index;
    for (uint32_t j = 0; j < ctx->model->n_pixels; ++j) {
        if (marks != NULL && !marks[j / EITS_PANEL]) {
            j |= EITS_PANEL - 1;
            continue;
        }
        if (!(v[j] > least) || !is_peak_of_row(ctx, v, j) || !is_peak(ctx, v, j))
            continue;
        uint32_t at = count++;
        for (; at > 0 && v[list[at - 1]] < v[j]; --at)
            list[at] = list[at - 1];
        list[at] = j;
    }
    return count;
}

enum { NEAR = 1 };

/* Mark the panels with a pixel near that of column j. */
static void mark_near(const eits_context *ctx, uint32_t j, uint8_t *marks)
{
    const eits_model *m = ctx->model;
    const uint32_t ix = m->pixel[j].ix, iy = m->pixel[j].iy;
    for (uint32_t y = iy > NEAR ? iy - NEAR : 0; y <= iy + NEAR && y < m->ny; ++y) {
        for (uint32_t x = ix > NEAR ? ix - NEAR : 0; x <= ix + NEAR && x < m->nx; ++x) {
            const uint32_t other = ctx->cell[(size_t)y * m->nx + x];
            if (other != EITS_NO_PIXEL)
                marks[other / EITS_PANEL] = 1;
        }
    }
}

uint64_t eits_gradient_nearby(eits_context *ctx, uint8_t *marks)
{
    const eits_matrix *s = &ctx->model->sensitivity;
    const eits_real *residual = eits_adjoint(ctx, ctx->residual, ctx->adjoint);
    uint64_t columns = 0;
    memset(marks, 0, EITS_PANEL_COLUMNS(s->cols) / EITS_PANEL);
    for (uint32_t k = 0; k < ctx->working_count; ++k)
        mark_near(ctx, ctx->working[k], marks);
    eits_zero(ctx->gradient, s->cols);
    for (uint32_t first = 0; first < s->cols; first += EITS_PANEL) {
        if (!marks[first / EITS_PANEL])
            continue;
        const uint32_t count = s->cols - first < EITS_PANEL ? s->cols - first : EITS_PANEL;
        uint32_t index[EITS_PANEL];
        for (uint32_t l = 0; l < count; ++l)
            index[l] = first + l;
        if (ctx->panels != NULL)
            ctx->kernels->mul_t_panels(s, ctx->panels + (size_t)first * s->rows, index, count, residual, ctx->gradient + first);
        else
            ctx->kernels->mul_t(s, index, count, residual, ctx->gradient + first);
        columns += count;
    }
    return columns * s->rows + eits_adjoint_macs(ctx);
}
