/* What the reference tells of places (sections GEOM and MOVE of a model).
 *
 * Electrodes and an outline that lie elsewhere than modelled change the untouched skin's voltages
 * in other ways than a sheet that is uneven, and they move every touch that is found. With y =
 * log(v0 / v_ref) over the folds, z = M y are the parts of y that say so, in mm, and a touch at x,
 * y is found off by
 *
 *     sum_t T_t(x, y) sum_j U_tj z_j,    T_t = 1, x, y, x^2, x y, y^2, ...
 *
 * along either axis, x and y from the grid's middle over half its longer side. That is taken back;
 * |N'y|^2 is the variance of what it leaves. Directions of y that no such skin has tell how much of
 * it is of rows with gains of their own: the more, the less is taken back.
 * python/eitskin/model/tare_places.py has the formulas. */
#include "frame/reference.h"

#include "base/vec.h"
#include "frame/constants.h"

void eits_add_log_gain(const eits_model *model, uint32_t k, eits_real log_gain,
                       eits_place_sums *sums)
{
    const eits_uncertainty *u = &model->uncertainty;
    const size_t place = (size_t)u->place_rows * k, move = (size_t)u->move_rows * k,
                 rest = (size_t)u->rest_rows * k;
    for (uint32_t j = 0; j < u->place_rows; ++j)
        sums->place[j] = eits_fma((eits_real)u->places[place + j], log_gain, sums->place[j]);
    for (uint32_t j = 0; j < u->move_rows; ++j)
        sums->move[j] = eits_fma((eits_real)u->moved[move + j], log_gain, sums->move[j]);
    for (uint32_t j = 0; j < u->rest_rows; ++j)
        sums->rest[j] = eits_fma((eits_real)u->rest[rest + j], log_gain, sums->rest[j]);
}

/* How far to trust the correction: rows with gains of their own look like electrodes elsewhere,
 * too.
 */
static eits_real trust(const eits_uncertainty *u, const eits_real *rest)
{
    eits_real square = 0;
    for (uint32_t j = 0; j < u->rest_rows; ++j)
        square = eits_fma(rest[j], rest[j], square);
    const eits_real limit = EITS_ROW_SPREAD * EITS_ROW_SPREAD * (eits_real)u->rest_rows;
    const eits_real part = u->rest_rows > 0 ? limit / (limit + square) : 1;
    return part * part;
}

void eits_learn_places(eits_context *ctx, const eits_place_sums *sums)
{
    const eits_uncertainty *u = &ctx->model->uncertainty;
    eits_reference *b = &ctx->reference;
    b->place_mm2 = 0;
    b->place_trust = trust(u, sums->rest);
    for (uint32_t j = 0; j < u->place_rows; ++j)
        b->place_mm2 = eits_fma(sums->place[j], sums->place[j], b->place_mm2);
    for (uint32_t axis = 0; axis < 2; ++axis) {
        for (uint32_t t = 0; t < u->move_terms; ++t) {
            const float *row = u->moves + (size_t)u->move_rows * (axis * u->move_terms + t);
            eits_real shift = 0;
            for (uint32_t j = 0; j < u->move_rows; ++j)
                shift = eits_fma((eits_real)row[j], sums->move[j], shift);
            /* the gains' logarithms are -y: it takes back */
            b->shift_mm[axis][t] = b->place_trust * shift;
        }
    }
}

/* By how much a touch found at `at` lies elsewhere. */
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
