/* A context in its workspace: where each part's arrays lie, and what is learned of the model. */
#include "context/context.h"

#include "base/vec.h"
#include "diagnostics/diagnostics.h"
#include "frame/reference.h"
#include "frame/whitening.h"
#include "model/options.h"

#include <string.h>

_Static_assert(sizeof(eits_context) <= EITS_CONTEXT_SIZE, "EITS_CONTEXT_SIZE is too small");
_Static_assert(sizeof(eits_context) + 128 > EITS_CONTEXT_SIZE, "EITS_CONTEXT_SIZE wastes memory");

size_t eits_workspace_size(const eits_model *model, int prepared)
{
    if (model == NULL)
        return 0;
    return EITS_WORKSPACE_SIZE(model->n_rows, model->n_folded, model->rank, model->n_pixels,
                               (size_t)model->nx * model->ny, prepared);
}

/* The rest of the workspace. EITS_WORKSPACE_SIZE counts what is taken here. */
typedef struct arena {
    uint8_t *next;
} arena;

/* Cleared, so that no result depends on what was in the caller's memory before. */
static void *take(arena *a, size_t bytes)
{
    uint8_t *taken = a->next;
    a->next += EITS_ALIGN16(bytes);
    memset(taken, 0, bytes);
    return taken;
}

static eits_real *take_reals(arena *a, size_t count)
{
    return take(a, count * sizeof(eits_real));
}

/* What a stage uses and leaves: handed down from stage to stage, never kept. */
static void lay_out_scratch(eits_context *ctx, arena *a)
{
    const size_t pixels = ctx->model->n_pixels, stride = EITS_STRIDE(ctx->model->rank);
    const size_t list = EITS_LIST(pixels, ctx->model->n_folded);
    eits_scratch *s = &ctx->scratch;
    s->value = take_reals(a, list);
    s->index = take(a, list * sizeof *s->index);
    for (int k = 0; k < EITS_SCRATCH_ROWS; ++k)
        s->row[k] = take_reals(a, stride);
    for (int k = 0; k < EITS_SCRATCH_PIXELS; ++k)
        s->pixel[k] = take_reals(a, pixels);
    /* lent to the active set's factor and to the evidence, which never run in one another */
    s->square = take_reals(a, ctx->model->rank * stride);
}

/* What outlives a frame, or is looked at by more than one stage. */
static void lay_out_frame(eits_context *ctx, arena *a)
{
    const size_t rows = ctx->model->n_rows, folded = ctx->model->n_folded;
    const size_t stride = EITS_STRIDE(ctx->model->rank),
                 triangle = EITS_PADDED_TRIANGLE(ctx->model->rank);
    ctx->reference.v0 = take_reals(a, rows);
    ctx->reference.m2 = take_reals(a, rows);
    ctx->reference.row_gain = take_reals(a, rows);
    /* 1 and not 0: a model without row gains multiplies by these as well, to the same bits */
    for (size_t i = 0; i < rows; ++i)
        ctx->reference.row_gain[i] = 1;
    ctx->rows.masked = take(a, rows);
    ctx->rows.unusable = take(a, rows);
    ctx->frame.sides = take(a, folded);
    ctx->frame.kept_sides = take(a, folded);
    ctx->frame.d = take_reals(a, folded);
    ctx->frame.reciprocity_error = take_reals(a, folded);
    ctx->frame.y = take_reals(a, stride);
    ctx->frame.y_log = take_reals(a, stride);
    ctx->projection.gain_drift = take_reals(a, folded);
    ctx->projection.basis = take_reals(a, stride + 2 * triangle);
    /* Up to rank directions, or one and two triangles: never both (frame/fold.c). */
    ctx->whitening.map = ctx->projection.basis + stride;
    ctx->whitening.metric = ctx->whitening.map + triangle;
    ctx->whitening.row_scale = take_reals(a, stride);
    ctx->whitening.row_strength = take_reals(a, stride);
    ctx->range.off_range = take_reals(a, folded);
    ctx->range.inverse = take_reals(a, stride);
    ctx->range.shrink = take_reals(a, stride);
}

/* The image outlives the frame, for a warm start; all else of the solvers is lent by the scratch.
 */
static void lay_out_solver(eits_context *ctx, arena *a)
{
    const size_t pixels = ctx->model->n_pixels;
    const eits_scratch *lent = &ctx->scratch;
    eits_solve_state *s = &ctx->solver;
    s->x = take_reals(a, pixels);
    s->image = take_reals(a, pixels);
    s->working = take(a, pixels * sizeof *s->working);
    s->working_slot = take(a, EITS_CACHED(pixels) * sizeof *s->working_slot);
    /* Rows 5 to 7 stay free for what one solver alone needs (solve/active_set.c). */
    s->residual = lent->row[0];
    s->sx = lent->row[1];
    s->sx_next = lent->row[2];
    s->sz = lent->row[3];
    s->adjoint = lent->row[4];
    s->gradient = lent->pixel[0];
    s->z = lent->pixel[1];
    s->x_next = lent->pixel[2];
    s->factor = lent->square;
}

/* The evidence has a factor of its own: the scratch's square changes with each hypothesis that is
 * tried under it. */
static void lay_out_touches(eits_context *ctx, arena *a)
{
    const size_t stride = EITS_STRIDE(ctx->model->rank);
    ctx->touch.y_separate = take_reals(a, stride);
    ctx->touch.atoms = take_reals(a, EITS_MAX_TOUCHES * stride);
    ctx->evidence.factor = take_reals(a, ctx->model->rank * stride);
    ctx->evidence.column = take_reals(a, EITS_EVIDENCE_COLUMNS * stride);
    ctx->evidence.data = take_reals(a, stride);
    ctx->evidence.left = take_reals(a, stride);
    ctx->evidence.gain_drift = take_reals(a, stride);
}

/* Columns of a stored Jacobian decoded to reals: the few that a frame uses are decoded once. */
static void lay_out_columns(eits_context *ctx, arena *a)
{
    const size_t pixels = ctx->model->n_pixels, room = EITS_CACHED(pixels);
    eits_columns *c = &ctx->columns;
    c->s = &ctx->model->sensitivity;
    c->room = (uint32_t)room;
    c->data = take(a, room * EITS_STRIDE(ctx->model->rank) * sizeof *c->data);
    c->slot = take(a, pixels * sizeof *c->slot);
    c->column = take(a, room * sizeof *c->column);
    c->wanted = take(a, room);
    eits_clear_column_cache(c);
}

/* From a line of the processor's cache on, so that no vector of theirs lies across two. */
static void lay_out_panels(eits_context *ctx, arena *a)
{
    const size_t numbers = EITS_PANEL_COLUMNS(ctx->model->n_pixels) * ctx->model->rank;
    a->next += (EITS_LINE - (uintptr_t)a->next % EITS_LINE) % EITS_LINE;
    ctx->columns.panels = take_reals(a, numbers);
    ctx->solver.working_panels = take_reals(a, numbers);
    eits_make_panels(&ctx->model->sensitivity, ctx->columns.panels);
}

/* The way from a cell of the image to its kept pixel.
 *
 * Without it each look at a pixel's neighbours would search all pixels. There are at most 65535, so
 * that 16 bits hold each and one value is left for none. */
static uint16_t *map_cells(const eits_model *model, arena *a)
{
    const size_t cells = (size_t)model->nx * model->ny;
    uint16_t *cell = take(a, cells * sizeof *cell);
    for (size_t c = 0; c < cells; ++c)
        cell[c] = EITS_NO_PIXEL;
    for (uint32_t j = 0; j < model->n_pixels; ++j)
        cell[(size_t)model->pixel[j].iy * model->nx + model->pixel[j].ix] = (uint16_t)j;
    return cell;
}

eits_status eits_init(void *workspace, size_t size, const eits_model *model, eits_context **ctx)
{
    if (ctx == NULL || model == NULL || workspace == NULL)
        return EITS_E_ARGUMENT;
    if ((uintptr_t)workspace % 16 != 0 || size < eits_workspace_size(model, 0))
        return EITS_E_WORKSPACE;
    /* The scratch before the parts that borrow of it. */
    eits_context *made = workspace;
    arena a = {(uint8_t *)workspace + EITS_CONTEXT_SIZE};
    *made = (eits_context){.model = model,
                           .kernels = eits_kernels_best(),
                           .projection.stale = 1,
                           .whitening.noise_ratio = 1,
                           .tracker.next_id = 1};
    made->cell = map_cells(model, &a);
    lay_out_scratch(made, &a);
    lay_out_frame(made, &a);
    lay_out_solver(made, &a);
    lay_out_touches(made, &a);
    lay_out_columns(made, &a);
    /* By the memory that there is, not by a flag: the caller has decided with the size. */
    if (size >= eits_workspace_size(model, 1))
        lay_out_panels(made, &a);
    eits_learn_range(made);
    eits_whitening_init(made, &made->scratch);
    /* Learned from the model above, once: it does not change. */
    (void)eits_options_default(model, &made->options);
    /* The context is given also where the arithmetic fails: eits_self_test then says by how much.
     */
    *ctx = made;
    eits_real left[EITS_ARITHMETIC_TRIALS];
    eits_try_arithmetic(left);
    return eits_judge_arithmetic(left);
}

/* What was found with other options may not hold any more: coefficients of another sign are no
 * start, and the directions to ignore depend on these two. */
eits_status eits_set_options(eits_context *ctx, const eits_options *o)
{
    if (ctx == NULL || o == NULL || !eits_options_in_range(o))
        return EITS_E_ARGUMENT;
    if (o->sign != ctx->options.sign)
        ctx->solver.warm = 0;
    if (o->project_reference != ctx->options.project_reference ||
        o->regularisation_noise_factor != ctx->options.regularisation_noise_factor)
        ctx->projection.stale = 1;
    /* The gains were learned from the reference, which is still here: no new tare is needed. */
    const int row_gains = o->row_gains != ctx->options.row_gains;
    ctx->options = *o;
    if (row_gains && ctx->reference.ready)
        eits_learn_row_gains(ctx);
    return EITS_OK;
}

/* For tests that compare two builds of the kernels on one machine: the bits are the same. */
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
    /* ids count on: one that a host has seen never names another finger */
    ctx->solver.warm = 0;
    ctx->tracker.count = 0;
    eits_follow_break(ctx);
}
