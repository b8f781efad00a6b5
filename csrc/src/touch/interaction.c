/* The effect of touches on each other's data is taken out (interaction.h has the physics).
 *
 * The Jacobian is linear: two touches give the sum of what each gives alone. In truth each lies in
 * the field that the other has changed. For strong touches near each other that shifts the fitted
 * places. With the discs as fitted so far, the difference is computed by the multipole model and
 * subtracted, and the fit goes on with data that the linear model can give. touch.c does so in turn
 * with the fit, since either needs the other's result.
 *
 * One round of the induced field is second order in the changes. More rounds cost more and find no
 * more touches. */
#include "touch/interaction.h"

#include "base/vec.h"
#include "context/places.h"
#include "frame/fold.h"
#include "kernels/kernels.h"
#include "touch/constants.h"

enum { BLOCK = 64 }; /* folds at a time */

static const eits_poles OTHERS = {.orders = EITS_POLE_DISC_ORDERS, .sent = 2, .of_others = 1};

int eits_has_interaction(const eits_context *ctx)
{
    return eits_has_poles(ctx) && (ctx->options.touch_fit & EITS_TOUCH_FIT_INTERACTION) != 0;
}

eits_shape eits_disc_as_shape(const eits_context *ctx, const eits_disc *disc)
{
    const eits_model *model = ctx->model;
    const eits_real pixel = (eits_real)model->pixel_mm;
    return (eits_shape){.x = (disc->x_mm - (eits_real)model->origin_x_mm) / pixel,
                        .y = (disc->y_mm - (eits_real)model->origin_y_mm) / pixel,
                        .radius = disc->radius_mm / pixel,
                        .amplitude = disc->change / eits_pole_sheet(model)};
}

/* Add `sign` times the answers of all shapes, in their present fields, to each fold's `sum`. */
static uint64_t add_answers(eits_context *ctx, const eits_shape *shape, uint32_t count,
                            eits_real sign, eits_real *sum)
{
    const uint32_t folds = ctx->model->n_folded;
    eits_real value[BLOCK];
    const eits_pole_out out = {.value = value};
    uint64_t macs = 0;
    for (uint32_t first = 0; first < folds; first += BLOCK) {
        const uint32_t some = folds - first < BLOCK ? folds - first : BLOCK;
        for (uint32_t k = 0; k < count; ++k) {
            macs += eits_pole_rows(ctx, k, &shape[k], &OTHERS, first, some, &out);
            for (uint32_t i = 0; i < some; ++i)
                sum[first + i] = eits_fma(sign, value[i], sum[first + i]);
        }
    }
    return macs;
}

/* The folds' sums in scratch->value, of those in use, reduced. */
static uint64_t reduce(eits_context *ctx, const eits_scratch *scratch, eits_real *out)
{
    uint32_t count = 0;
    for (uint32_t k = 0; k < ctx->model->n_folded; ++k) {
        scratch->index[count] = k;
        scratch->value[count] = scratch->value[k];
        count += ctx->frame.sides[k] != EITS_SIDE_NONE;
    }
    return eits_reduce(ctx, scratch, count, out);
}

/* Less than two discs have no interaction. If what comes of it is a large part of the data, the
 * discs are too strong or too near for second order, and nothing is taken out. */
uint64_t eits_remove_interaction(eits_context *ctx, const eits_scratch *scratch,
                                 const eits_disc *disc, uint32_t count, eits_real *data)
{
    const uint32_t rank = ctx->model->rank;
    eits_real *added_data = scratch->row[1];
    eits_shape shape[EITS_MAX_TOUCHES];
    uint64_t macs = 2u * rank;
    eits_copy(data, ctx->frame.y, EITS_STRIDE(rank));
    if (count < 2 || !eits_has_interaction(ctx))
        return 0;
    for (uint32_t k = 0; k < count; ++k) {
        shape[k] = eits_disc_as_shape(ctx, &disc[k]);
        macs += eits_pole_home(ctx, k, &shape[k]);
    }
    eits_pole_clear(ctx, count);
    eits_zero(scratch->value, ctx->model->n_folded);
    macs += add_answers(ctx, shape, count, -1, scratch->value);
    macs += eits_pole_induced(ctx, shape, count, &OTHERS, 1);
    macs += add_answers(ctx, shape, count, 1, scratch->value);
    macs += reduce(ctx, scratch, added_data);
    const eits_real total = eits_dot(ctx->kernels, ctx->frame.y, ctx->frame.y, rank),
                    added = eits_dot(ctx->kernels, added_data, added_data, rank);
    if (added <= EITS_INTERACTION_MAX * total) /* else discs that are no touches */
        eits_axpy(ctx->kernels, data, -1, added_data, rank);
    return macs;
}
