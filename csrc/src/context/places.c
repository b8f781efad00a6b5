/* Correct the places of touches for the displacement of electrodes and outline that the reference
 * shows (frame/places.c learns it). The polynomials cost some sixty multiplications per touch. */
#include "context/places.h"

#include "base/vec.h"
#include "context/constants.h"

/* Compute the displacement of a touch that is found at `at`, mm. */
static void shift_at(const eits_context *ctx, const eits_real at[2], eits_real shift[2])
{
    const eits_model *model = ctx->model;
    const eits_reference *b = &ctx->reference;
    const eits_real pixel = (eits_real)model->pixel_mm, reach = EITS_MAX_SHIFT * pixel,
                    side = (eits_real)(model->nx > model->ny ? model->nx : model->ny),
                    half = R(0.5) * side * pixel,
                    x = (at[0] - (eits_real)model->origin_x_mm -
                         R(0.5) * (eits_real)model->nx * pixel) /
                        half,
                    y = (at[1] - (eits_real)model->origin_y_mm -
                         R(0.5) * (eits_real)model->ny * pixel) /
                        half;
    eits_real power[EITS_MAX_MOVE_DEGREE + 1] = {1}; /* x^n y^0 to x^0 y^n */
    shift[0] = shift[1] = 0;
    for (uint32_t n = 0, t = 0; t < model->uncertainty.move_terms; ++n) {
        for (uint32_t j = 0; j <= n; ++j, ++t) {
            shift[0] = eits_fma(b->shift_mm[0][t], power[j], shift[0]);
            shift[1] = eits_fma(b->shift_mm[1][t], power[j], shift[1]);
        }
        if (t == model->uncertainty.move_terms)
            break;
        power[n + 1] = power[n] * y;
        for (uint32_t j = 0; j <= n; ++j)
            power[j] *= x;
    }
    shift[0] = eits_clamp(shift[0], -reach, reach);
    shift[1] = eits_clamp(shift[1], -reach, reach);
}

int eits_has_poles(const eits_context *ctx)
{
    return ctx->model->fields.at.data != NULL && ctx->model->data_kind == EITS_DATA_DIFFERENCE;
}

int eits_may_fit_jointly(const eits_context *ctx)
{
    const eits_model *model = ctx->model;
    return (ctx->options.touch_fit & EITS_TOUCH_FIT_JOINT) != 0 && eits_has_poles(ctx) &&
           model->row_errors.vectors != NULL;
}

uint32_t eits_weighs_errors(const eits_context *ctx)
{
    return ctx->reference.distance > EITS_ERRORS_FROM * (eits_real)ctx->model->row_errors.distance;
}

int eits_corrects_places(const eits_context *ctx)
{
    return ctx->reference.row_gains && ctx->model->uncertainty.move_terms > 0;
}

void eits_place_on_skin(const eits_context *ctx, eits_real at[2])
{
    eits_real shift[2];
    if (!eits_corrects_places(ctx))
        return;
    shift_at(ctx, at, shift);
    at[0] += shift[0];
    at[1] += shift[1];
}

void eits_place_in_model(const eits_context *ctx, eits_real at[2])
{
    eits_real shift[2];
    if (!eits_corrects_places(ctx))
        return;
    shift_at(ctx, at, shift); /* which hardly differs over its own length */
    at[0] -= shift[0];
    at[1] -= shift[1];
}
