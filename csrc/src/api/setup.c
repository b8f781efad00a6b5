/* Set up a context in its workspace: lay out the arrays of each part, and learn the constants of
 * the model. */
#include "context/context.h"

#include "base/vec.h"
#include "diagnostics/diagnostics.h"
#include "frame/reference.h"
#include "frame/whitening.h"
#include "model/options.h"
#include "multipole/multipole.h"

#include <string.h>

_Static_assert(sizeof(eits_context) <= EITS_CONTEXT_SIZE, "EITS_CONTEXT_SIZE is too small");
_Static_assert(sizeof(eits_context) + 128 > EITS_CONTEXT_SIZE, "EITS_CONTEXT_SIZE wastes memory");

/* Electrodes whose fields the model has. */
static uint32_t poles_of(const eits_model *model)
{
    return model->fields.at.data != NULL ? model->n_electrodes : 0;
}

size_t eits_workspace_size(const eits_model *model, int prepared)
{
    if (model == NULL)
        return 0;
    return EITS_WORKSPACE_SIZE(model->n_rows, model->n_folded, model->rank, model->n_pixels,
                               (size_t)model->nx * model->ny, poles_of(model), prepared);
}

/* Take the next part of the workspace and clear it, so that no result depends on the earlier
 * content of the caller's memory. */
static void *take(uint8_t **next, size_t bytes)
{
    uint8_t *taken = *next;
    *next += EITS_ALIGN16(bytes);
    memset(taken, 0, bytes);
    return taken;
}

/* The list of arrays is the one that EITS_WORKSPACE_SIZE adds up (eitskin/sizes.h). */
#define TAKE(place, element, count)                                                          \
    _Static_assert(sizeof *((eits_context *)NULL)->place == sizeof(element), "its element"); \
    ctx->place = take(next, (size_t)(count) * sizeof(element));

static void lay_out(eits_context *ctx, uint8_t **next)
{
    const eits_model *m = ctx->model;
    EITS_WORKSPACE_ARRAYS(TAKE, m->n_rows, m->n_folded, m->rank, m->n_pixels, (size_t)m->nx * m->ny,
                          poles_of(m))
}

/* Panels begin at a line of the processor's cache, so that none of their vectors lies across two
 * lines. */
static void lay_out_panels(eits_context *ctx, uint8_t **next)
{
    const eits_model *m = ctx->model;
    *next += (EITS_LINE - (uintptr_t)*next % EITS_LINE) % EITS_LINE;
    EITS_PREPARED_ARRAYS(TAKE, m->rank, m->n_pixels)
    eits_make_panels(&m->sensitivity, ctx->columns.panels);
}

/* Place some vectors of the solvers and the whitening in other arrays. Scratch rows 5 to 7 stay
 * free for a solver's own vectors (solve/active_set.c). */
static void lend(eits_context *ctx)
{
    const eits_scratch *from = &ctx->scratch;
    eits_solve_state *s = &ctx->solver;
    s->residual = from->row[0];
    s->sx = from->row[1];
    s->sx_next = from->row[2];
    s->sz = from->row[3];
    s->adjoint = from->row[4];
    s->gradient = from->pixel[0];
    s->z = from->pixel[1];
    s->x_next = from->pixel[2];
    s->factor = from->square;
    ctx->whitening.map = ctx->projection.basis + EITS_STRIDE(ctx->model->rank);
    ctx->whitening.metric = ctx->whitening.map + EITS_PADDED_TRIANGLE(ctx->model->rank);
}

/* Map each cell of the image to its kept pixel: without this map each look at a pixel's neighbours
 * would search all pixels. There are at most 65535 pixels, so 16 bits hold each number and one
 * value is left for "none". */
static void map_cells(const eits_model *model, uint16_t *cell)
{
    const size_t cells = (size_t)model->nx * model->ny;
    for (size_t c = 0; c < cells; ++c)
        cell[c] = EITS_NO_PIXEL;
    for (uint32_t j = 0; j < model->n_pixels; ++j)
        cell[(size_t)model->pixel[j].iy * model->nx + model->pixel[j].ix] = (uint16_t)j;
}

eits_status eits_init(void *workspace, size_t size, const eits_model *model, eits_context **ctx)
{
    if (ctx == NULL || model == NULL || workspace == NULL)
        return EITS_E_ARGUMENT;
    if ((uintptr_t)workspace % 16 != 0 || size < eits_workspace_size(model, 0))
        return EITS_E_WORKSPACE;
    eits_context *made = workspace;
    uint8_t *next = (uint8_t *)workspace + EITS_CONTEXT_SIZE;
    *made = (eits_context){.model = model,
                           .kernels = eits_kernels_best(),
                           .columns.s = &model->sensitivity,
                           .columns.room = (uint32_t)EITS_CACHED(model->n_pixels),
                           .projection.stale = 1,
                           .whitening.noise_ratio = 1};
    lay_out(made, &next);
    lend(made);
    map_cells(model, made->cell);
    eits_clear_column_cache(&made->columns);
    eits_pole_init(made);
    /* 1 and not 0: a model without row gains multiplies by these numbers too, which leaves the bits
     * unchanged */
    for (uint32_t i = 0; i < model->n_rows; ++i)
        made->reference.row_gain[i] = 1;
    /* The size of the memory decides and not a flag: the caller chose by giving that size. */
    if (size >= eits_workspace_size(model, 1))
        lay_out_panels(made, &next);
    const float *errors = model->uncertainty.errors, *drift = model->uncertainty.drift;
    if (errors != NULL && (!eits_is_covariance(made, &made->scratch, errors) ||
                           !eits_is_covariance(made, &made->scratch, drift)))
        return EITS_E_MODEL_VALUE;
    eits_learn_range(made);
    eits_whitening_init(made, &made->scratch);
    /* The above is learned from the model once, since the model does not change. */
    (void)eits_options_default(model, &made->options);
    /* The context is returned even if the arithmetic fails: eits_self_test then reports the
     * deviation. */
    *ctx = made;
    eits_real left[EITS_ARITHMETIC_TRIALS];
    eits_try_arithmetic(left);
    return eits_judge_arithmetic(left);
}

/* Results found with other options may not hold any more: coefficients of another sign are not a
 * valid start, and the basis and the whitening depend on project_reference and
 * regularisation_noise_factor. */
eits_status eits_set_options(eits_context *ctx, const eits_options *o)
{
    if (ctx == NULL || o == NULL || !eits_options_in_range(o))
        return EITS_E_ARGUMENT;
    if (o->sign != ctx->options.sign)
        ctx->solver.warm = 0;
    if (o->project_reference != ctx->options.project_reference ||
        o->regularisation_noise_factor != ctx->options.regularisation_noise_factor)
        ctx->projection.stale = 1;
    /* Gains are learned from the reference, which the context still has: no new tare is needed. */
    const int row_gains = o->row_gains != ctx->options.row_gains;
    ctx->options = *o;
    if (row_gains && ctx->reference.ready)
        eits_learn_row_gains(ctx);
    return EITS_OK;
}

/* Tests use this to compare two builds of the kernels on one machine: the bits are the same. */
eits_status eits_use_portable_kernels(eits_context *ctx, int portable)
{
    if (ctx == NULL)
        return EITS_E_ARGUMENT;
    ctx->kernels = portable ? &eits_kernels_portable : eits_kernels_best();
    return EITS_OK;
}

void eits_forget(eits_context *ctx)
{
    if (ctx == NULL)
        return;
    ctx->solver.warm = 0;
    eits_reference_tracking_break(ctx);
}
