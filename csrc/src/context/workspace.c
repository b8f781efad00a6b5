/* The context: its workspace, options and start. */
#include "eitskin/context.h"

#include "base/vec.h"
#include "context/column_cache.h"
#include "diagnostics/diagnostics.h"
#include "frame/regularisation.h"
#include "frame/whitening.h"
#include "kernels/kernels.h"

size_t eits_workspace_size(const eits_model *model, int prepared)
{
    if (model == NULL)
        return 0;
    return EITS_WORKSPACE_SIZE(model->n_rows, model->n_folded, model->rank, model->n_pixels,
                               (size_t)model->nx * model->ny, prepared);
}

eits_status eits_options_default(const eits_model *model, eits_options *options)
{
    if (model == NULL || options == NULL)
        return EITS_E_ARGUMENT;
    const eits_defaults *d = model->defaults;
    const eits_options chosen = {
        .iterations = d->iterations,
        .gap_every = 10,
        .max_touches = d->max_touches < EITS_MAX_TOUCHES ? d->max_touches : EITS_MAX_TOUCHES,
        .max_masked = model->n_rows / 2,
        .sign = EITS_SIGN_INCREASE,
        .solver = (eits_solver)d->solver,
        .warm_start = 0,
        .project_reference = 1,
        .lambda_abs = 0,
        .lambda_rel = (eits_real)d->lambda_rel,
        .lambda_noise_factor = (eits_real)d->lambda_noise_factor,
        .detection_factor = (eits_real)d->detection_factor,
        .gap_rel = 0,
        .mac_limit = 0,
        .saturation_v = 0,
        .touch_threshold = (eits_real)d->touch_threshold,
        .touch_min_fraction = (eits_real)d->touch_min_fraction,
        .touch_min_radius_mm = (eits_real)d->touch_min_radius_mm,
        .touch_max_radius_mm = (eits_real)d->touch_max_radius_mm,
        .touch_seed_radius_mm = (eits_real)d->touch_seed_radius_mm,
        .touch_change_s_per_m = (eits_real)d->touch_change_s_per_m,
        .touch_sweeps = 6,
        .touch_radius_weight = (eits_real)d->touch_radius_weight,
        .follow_mm = (eits_real)d->follow_mm,
        .diagnostics = EITS_DIAGNOSTICS_ALL,
        .touch_fit = EITS_TOUCH_FIT_ALL & ~d->touch_fit_left_out,
        .second_pass = 0,
        .track_confirm = 0,
        .track_hold = 0,
        .track_smooth = 0,
        .regularisation_noise_factor = EITS_REGULARISATION_NOISE_FACTOR,
    };
    *options = chosen;
    return EITS_OK;
}

eits_status eits_options_track(eits_options *options)
{
    if (options == NULL)
        return EITS_E_ARGUMENT;
    options->detection_factor *= R(0.75);
    options->track_confirm = 2;
    options->track_hold = 2;
    options->track_smooth = R(0.66);
    return EITS_OK;
}

typedef struct arena {
    uint8_t *next;
} arena;

static eits_real *take_reals(arena *a, size_t count)
{
    eits_real *taken = (eits_real *)(void *)a->next;
    a->next += EITS_REALS(count);
    eits_zero(taken, count);
    return taken;
}

static uint8_t *take_bytes(arena *a, size_t count)
{
    uint8_t *taken = a->next;
    a->next += EITS_ALIGN16(count);
    memset(taken, 0, count);
    return taken;
}

/* The way from a cell of the image to its kept pixel. */
static void map_cells(eits_context *ctx)
{
    const eits_model *model = ctx->model;
    for (size_t c = 0; c < (size_t)model->nx * model->ny; ++c)
        ctx->cell[c] = EITS_NO_PIXEL;
    for (uint32_t j = 0; j < model->n_pixels; ++j)
        ctx->cell[(size_t)model->pixel[j].iy * model->nx + model->pixel[j].ix] = (uint16_t)j;
}

static void lay_out(eits_context *ctx, arena *a, int prepared)
{
    const size_t rows = ctx->model->n_rows, folded = ctx->model->n_folded,
                 pixels = ctx->model->n_pixels;
    const size_t stride = EITS_STRIDE(ctx->model->rank);
    ctx->reference.v0 = take_reals(a, rows);
    ctx->reference.m2 = take_reals(a, rows);
    ctx->masked = take_bytes(a, rows);
    ctx->unusable = take_bytes(a, rows);
    ctx->basis_for = take_bytes(a, folded);
    ctx->d = take_reals(a, folded);
    ctx->reciprocity_error = take_reals(a, folded);
    ctx->gain_drift = take_reals(a, folded);
    ctx->off_range = take_reals(a, folded);
    ctx->range_inverse = take_reals(a, stride);
    ctx->range_shrink = take_reals(a, stride);
    ctx->y = take_reals(a, stride);
    ctx->y_log = take_reals(a, stride);
    ctx->y_separate = take_reals(a, stride);
    ctx->basis = take_reals(a, stride + 2 * EITS_PADDED_TRIANGLE(ctx->model->rank));
    ctx->row_scale = take_reals(a, stride);
    ctx->row_strength = take_reals(a, stride);
    ctx->adjoint = take_reals(a, stride);
    ctx->residual = take_reals(a, stride);
    ctx->sx = take_reals(a, stride);
    ctx->sx_next = take_reals(a, stride);
    ctx->sz = take_reals(a, stride);
    for (int k = 0; k < 3; ++k)
        ctx->slope[k] = take_reals(a, stride);
    ctx->x = take_reals(a, pixels);
    ctx->x_next = take_reals(a, pixels);
    ctx->z = take_reals(a, pixels);
    ctx->gradient = take_reals(a, pixels);
    ctx->list_value = take_reals(a, EITS_LIST(pixels, folded));
    ctx->list_index = (uint32_t *)(void *)take_bytes(a, EITS_LIST(pixels, folded) * 4);
    ctx->working = (uint32_t *)(void *)take_bytes(a, pixels * 4);
    ctx->factor = take_reals(a, ctx->model->rank * stride);
    ctx->image = take_reals(a, pixels);
    ctx->atoms = take_reals(a, EITS_MAX_TOUCHES * stride);
    ctx->cell = (uint16_t *)(void *)take_bytes(a, (size_t)ctx->model->nx * ctx->model->ny * 2);
    map_cells(ctx);
    const size_t room = EITS_CACHED(pixels);
    ctx->cache = (float *)(void *)take_bytes(a, room * stride * 4);
    ctx->cache_slot = (uint16_t *)(void *)take_bytes(a, pixels * 2);
    ctx->cache_column = (uint16_t *)(void *)take_bytes(a, room * 2);
    ctx->cache_wanted = take_bytes(a, room);
    ctx->working_slot = (uint32_t *)(void *)take_bytes(a, room * 4);
    eits_clear_column_cache(ctx);
    if (prepared) {
        a->next += (EITS_LINE - (uintptr_t)a->next % EITS_LINE) % EITS_LINE;
        ctx->panels = take_reals(a, EITS_PANEL_COLUMNS(pixels) * ctx->model->rank);
        ctx->working_panels = take_reals(a, EITS_PANEL_COLUMNS(pixels) * ctx->model->rank);
        eits_make_panels(&ctx->model->sensitivity, ctx->panels);
    }
}

eits_status eits_init(eits_context *ctx, const eits_model *model, void *workspace, size_t size)
{
    if (ctx == NULL || model == NULL || workspace == NULL)
        return EITS_E_ARGUMENT;
    if ((uintptr_t)workspace % 16 != 0 || size < eits_workspace_size(model, 0))
        return EITS_E_WORKSPACE;
    *ctx = (eits_context){.model = model,
                          .kernels = eits_kernels_best(),
                          .next_id = 1,
                          .basis_stale = 1,
                          .noise_ratio = 1};
    arena a = {workspace};
    lay_out(ctx, &a, size >= eits_workspace_size(model, 1));
    eits_learn_range(ctx);
    eits_whitening_init(ctx);
    return eits_options_default(model, &ctx->options);
}

static int in_range(eits_real value, eits_real low, eits_real high)
{
    return eits_is_finite(value) && value >= low && value <= high;
}

eits_status eits_set_options(eits_context *ctx, const eits_options *o)
{
    if (ctx == NULL || o == NULL)
        return EITS_E_ARGUMENT;
    const eits_real huge = R(1e30);
    const int right =
        o->iterations >= 1 && o->gap_every >= 1 && o->max_touches <= EITS_MAX_TOUCHES &&
        (uint32_t)o->sign <= (uint32_t)EITS_SIGN_BOTH &&
        (uint32_t)o->solver <= (uint32_t)EITS_SOLVER_ACTIVE_SET && o->warm_start <= 1 &&
        o->project_reference <= 1 && in_range(o->lambda_abs, 0, huge) &&
        in_range(o->lambda_rel, 0, 1) && in_range(o->lambda_noise_factor, 0, huge) &&
        in_range(o->detection_factor, 0, huge) && in_range(o->gap_rel, 0, 1) &&
        in_range(o->saturation_v, 0, huge) && in_range(o->touch_threshold, 0, 1) &&
        in_range(o->touch_min_fraction, 0, 1) && in_range(o->touch_change_s_per_m, 0, huge) &&
        in_range(o->touch_radius_weight, 0, huge) &&
        in_range(o->touch_min_radius_mm, R(1e-6), huge) &&
        in_range(o->touch_max_radius_mm, o->touch_min_radius_mm, huge) &&
        in_range(o->touch_seed_radius_mm, o->touch_min_radius_mm, o->touch_max_radius_mm) &&
        in_range(o->follow_mm, 0, huge) && o->touch_sweeps <= 1000 &&
        o->diagnostics <= EITS_DIAGNOSTICS_ALL && o->touch_fit <= EITS_TOUCH_FIT_ALL &&
        o->second_pass <= 1 && o->track_confirm <= EITS_MAX_TRACK_FRAMES &&
        o->track_hold <= EITS_MAX_TRACK_FRAMES && in_range(o->track_smooth, 0, huge) &&
        in_range(o->regularisation_noise_factor, 0, huge);
    if (!right)
        return EITS_E_ARGUMENT;
    if (o->sign != ctx->options.sign)
        ctx->warm = 0;
    if (o->project_reference != ctx->options.project_reference ||
        o->regularisation_noise_factor != ctx->options.regularisation_noise_factor)
        ctx->basis_stale = 1;
    ctx->options = *o;
    return EITS_OK;
}

eits_status eits_use_portable_kernels(eits_context *ctx, int portable)
{
    if (ctx == NULL)
        return EITS_E_ARGUMENT;
    ctx->kernels = portable ? &eits_kernels_portable : eits_kernels_best();
    return EITS_OK;
}

const char *eits_kernels_name(const eits_context *ctx)
{
    return ctx == NULL ? "" : ctx->kernels->name;
}

void eits_forget(eits_context *ctx)
{
    if (ctx == NULL)
        return;
    ctx->warm = 0;
    ctx->followed_count = 0;
}
