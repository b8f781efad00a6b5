/* What a disc's parameters move the data by, and shapes that are no discs.
 *
 * An ellipse differs from a disc of its area to first order in two ways: its edge lies r cos 2 phi
 * and r sin 2 phi further out, and its dipole is stronger along one axis than along the other. With
 * complex fields E of drive and measuring pair the latter is Re and Im of E_drive E_measure, beside
 * Re E_drive conj(E_measure) of the disc. Fingers, and contacts that press harder in the middle,
 * are made of the same and of a radius that is not known.
 *
 * Costs of one disc: six products over its covered pixels, its fields, two products with P, and
 * eight with R'^-1. */
#include "evidence/evidence.h"

#include "base/vec.h"
#include "evidence/constants.h"
#include "frame/fold.h"
#include "kernels/kernels.h"
#include "touch/interaction.h"

/* As many for each disc as the workspace has columns for: with its shape, else its place and radius
 * alone, else none, and the test is left out. */
uint32_t eits_shape_parameters(const eits_context *ctx, uint32_t count)
{
    const uint32_t room =
        ctx->model->rank < EITS_EVIDENCE_COLUMNS ? ctx->model->rank : EITS_EVIDENCE_COLUMNS;
    const eits_matrix *fields = &ctx->model->fields.at;
    /* a disc's fields are kept in scratch->square */
    const int dipoles = fields->data != NULL && ctx->model->data_kind == EITS_DATA_DIFFERENCE &&
                        fields->stride <= ctx->model->rank * EITS_STRIDE(ctx->model->rank);
    const uint32_t all = dipoles ? EITS_SHAPE_PARAMETERS : EITS_EDGE_PARAMETERS;
    if (count * all <= room && count * all <= EITS_SHAPE_COLUMNS)
        return all;
    return count * EITS_PLACE_PARAMETERS <= room ? EITS_PLACE_PARAMETERS : 0;
}

eits_real eits_shape_part(const eits_answer *answer, uint32_t k, uint32_t parameter)
{
    if (parameter < EITS_PLACE_PARAMETERS)
        return parameter == 0;
    return answer->shape[k][parameter - EITS_PLACE_PARAMETERS];
}

void eits_leave_out(eits_answer *answer, uint32_t k)
{
    const size_t after = --answer->count - k;
    memmove(&answer->disc[k], &answer->disc[k + 1u], after * sizeof answer->disc[k]);
    memmove(&answer->radius_mm[k], &answer->radius_mm[k + 1u], after * sizeof answer->radius_mm[k]);
    memmove(&answer->shape[k], &answer->shape[k + 1u], after * sizeof answer->shape[k]);
}

/* Re and Im of what the disc answers as a dipole that turns: `out`, two columns. */
static uint64_t dipoles(eits_context *ctx, const eits_scratch *scratch, const eits_disc *disc,
                        eits_real *const out[2])
{
    const uint32_t electrodes = ctx->model->n_electrodes, folds = ctx->model->n_folded;
    eits_real *field = scratch->square;
    uint64_t macs = eits_disc_field(ctx, scratch, disc, field);
    const eits_real factor = -((eits_real)ctx->model->fields.volts * eits_disc_moment(ctx, disc));
    for (int part = 0; part < 2; ++part) {
        uint32_t count = 0;
        for (uint32_t k = 0; k < folds; ++k) {
            const uint8_t *row = eits_row(ctx, ctx->model->fold[k].first);
            const eits_real x = field[row[0]] - field[row[1]],
                            y = field[electrodes + row[0]] - field[electrodes + row[1]];
            const eits_real u = field[row[2]] - field[row[3]],
                            v = field[electrodes + row[2]] - field[electrodes + row[3]];
            scratch->index[count] = k;
            scratch->value[count] =
                factor * (part == 0 ? eits_fma(x, u, -(y * v)) : eits_fma(x, v, y * u));
            count += ctx->frame.sides[k] != EITS_SIDE_NONE;
        }
        macs += 4u * folds + eits_reduce(ctx, scratch, count, out[part]);
    }
    return macs;
}

uint64_t eits_shape_columns(eits_context *ctx, const eits_scratch *scratch,
                            const eits_answer *answer, uint32_t k)
{
    const uint32_t rank = ctx->model->rank, parameters = answer->parameters;
    const size_t stride = EITS_STRIDE(rank);
    const eits_disc *disc = &answer->disc[k];
    const eits_real pixel = (eits_real)ctx->model->pixel_mm;
    eits_real *column[EITS_SHAPE_PARAMETERS];
    for (uint32_t p = 0; p < EITS_SHAPE_PARAMETERS; ++p)
        column[p] = ctx->evidence.column + stride * (k * parameters + (p < parameters ? p : 0));
    eits_real *edge[2] = {column[4], column[5]};
    uint64_t macs = eits_disc_shape(ctx, scratch, disc, column[0], &column[1],
                                    parameters > EITS_PLACE_PARAMETERS ? edge : NULL);
    const eits_real unit[EITS_EDGE_PARAMETERS] = {disc->change,
                                                  disc->change * pixel,
                                                  disc->change * pixel,
                                                  disc->change * answer->radius_mm[k],
                                                  disc->change * disc->radius_mm,
                                                  disc->change * disc->radius_mm};
    for (uint32_t p = 0; p < parameters && p < EITS_EDGE_PARAMETERS; ++p) {
        for (uint32_t i = 0; i < rank; ++i)
            column[p][i] *= unit[p];
    }
    if (parameters == EITS_SHAPE_PARAMETERS)
        macs += dipoles(ctx, scratch, disc, &column[6]);
    for (uint32_t p = 0; p < parameters; ++p) {
        macs += eits_whiten_errors(ctx, column[p]);
        eits_axpy(ctx->kernels, ctx->evidence.left, -eits_shape_part(answer, k, p), column[p],
                  rank);
    }
    return macs + (uint64_t)parameters * rank;
}
