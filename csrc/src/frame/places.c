/* Learn from the reference how places are displaced (sections GEOM and MOVE of a model).
 *
 * Electrodes or an outline that differ from the model change the untouched skin's voltages in other
 * ways than an uneven sheet, and they move every touch that is found. With y = log(v0 / v_ref) over
 * the folds, z = M y are the parts of y that show this, in mm, and a touch at x, y is found off by
 *
 *     sum_t T_t(x, y) sum_j U_tj z_j,    T_t = 1, x, y, x^2, x y, y^2, ...
 *
 * along either axis, with x and y from the grid's middle over half its longer side.
 * context/places.c subtracts this shift; |N'y|^2 is the variance of the remaining error. Directions
 * of y that no such skin has show how much of y comes from gains of single rows: the more, the
 * smaller the correction. Touches that are fitted jointly, on the folds, are displaced in another
 * way than those of reduced data, so section ROWE has its own M and U.
 * python/eitskin/model/tare_places.py has the formulas. */
#include "frame/reference.h"

#include "base/vec.h"
#include "context/places.h"
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
    const eits_row_errors *joint = &model->row_errors;
    const float *seen = joint->moved + (size_t)joint->move_rows * k;
    for (uint32_t j = 0; j < joint->move_rows; ++j)
        sums->joint[j] = eits_fma((eits_real)seen[j], log_gain, sums->joint[j]);
}

/* Returns the trust in the correction, 0 to 1: gains of single rows look like displaced electrodes,
 * too. */
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
    const eits_row_errors *joint = &ctx->model->row_errors;
    const int together = eits_may_fit_jointly(ctx);
    const uint32_t rows = together ? joint->move_rows : u->move_rows;
    const float *moves = together ? joint->moves[eits_weighs_errors(ctx)] : u->moves;
    const eits_real *seen = together ? sums->joint : sums->move;
    for (uint32_t axis = 0; axis < 2; ++axis) {
        for (uint32_t t = 0; t < u->move_terms; ++t) {
            const float *row = moves + (size_t)rows * (axis * u->move_terms + t);
            eits_real shift = 0;
            for (uint32_t j = 0; j < rows; ++j)
                shift = eits_fma((eits_real)row[j], seen[j], shift);
            /* the gains' logarithms are -y, so this shift is the correction */
            b->shift_mm[axis][t] = b->place_trust * shift;
        }
    }
}
