/* The derivatives of the data by a disc's parameters, and the answers of shapes that are no discs.
 *
 * An ellipse differs from a disc of its area to first order in two ways: its edge lies r cos 2 phi
 * and r sin 2 phi further out, and its dipole is stronger along one axis than along the other. With
 * complex fields E of drive and measuring pair the latter is Re and Im of E_drive E_measure, beside
 * Re E_drive conj(E_measure) of the disc. Fingers, and contacts that press harder in the middle,
 * are made of the same and of a radius that is not known.
 *
 * Costs of one disc: six products over its covered pixels, its fields, two products with P, and
 * eight with R'^-1. What all leave of the data needs one product of each for a disc, and one with
 * R'^-1 for all: a fifth of that. */
#include "evidence/evidence.h"

#include "base/vec.h"
#include "context/places.h"
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
    const uint32_t all = eits_has_poles(ctx) ? EITS_SHAPE_PARAMETERS : EITS_EDGE_PARAMETERS;
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

/* Let slot k of the multipole model hold the electrodes' fields about disc k. */
static uint64_t take_fields(eits_context *ctx, uint32_t k, const eits_disc *disc)
{
    const eits_shape shape = eits_disc_as_shape(ctx, disc);
    return eits_pole_home(ctx, k, &shape);
}

/* The answer of disc k as a dipole that is stronger along one axis: part[0] of the real part of the
 * product of both fields, and part[1] of the imaginary part. */
static uint64_t dipole(eits_context *ctx, const eits_scratch *scratch, uint32_t k,
                       const eits_disc *disc, const eits_real part[2], eits_real *out)
{
    const uint32_t electrodes = ctx->model->n_electrodes, folds = ctx->model->n_folded;
    const eits_real *field = ctx->multipole.own + EITS_POLE_FIELD(electrodes) * k; /* E_x - i E_y */
    const eits_real pi = R(3.14159265358979323846), pixel = (eits_real)ctx->model->pixel_mm,
                    area = pi * eits_fma(disc->radius_mm, disc->radius_mm, pixel * pixel / 12),
                    factor = -((eits_real)ctx->model->fields.volts * disc->change * area),
                    re = factor * part[0], im = factor * part[1];
    uint32_t count = 0;
    for (uint32_t f = 0; f < folds; ++f) {
        const uint8_t *row = eits_row(ctx, ctx->model->fold[f].first);
        const eits_real x = field[row[0]] - field[row[1]],
                        y = field[electrodes + row[1]] - field[electrodes + row[0]];
        const eits_real u = field[row[2]] - field[row[3]],
                        v = field[electrodes + row[3]] - field[electrodes + row[2]];
        scratch->index[count] = f;
        scratch->value[count] = eits_fma(re, eits_fma(x, u, -(y * v)), im * eits_fma(x, v, y * u));
        count += ctx->frame.sides[f] != EITS_SIDE_NONE;
    }
    return 6u * folds + eits_reduce(ctx, scratch, count, out);
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
    if (parameters == EITS_SHAPE_PARAMETERS) {
        static const eits_real re[2] = {1, 0}, im[2] = {0, 1};
        macs += take_fields(ctx, k, disc);
        macs += dipole(ctx, scratch, k, disc, re, column[6]);
        macs += dipole(ctx, scratch, k, disc, im, column[7]);
    }
    for (uint32_t p = 0; p < parameters; ++p) {
        macs += eits_whiten_errors(ctx, column[p]);
        eits_axpy(ctx->kernels, ctx->evidence.left, -eits_shape_part(answer, k, p), column[p],
                  rank);
    }
    return macs + (uint64_t)parameters * rank;
}

uint64_t eits_shape_residual(eits_context *ctx, const eits_scratch *scratch,
                             const eits_answer *answer, eits_real *left)
{
    const uint32_t rank = ctx->model->rank;
    const size_t stride = EITS_STRIDE(rank);
    eits_real *whole = scratch->row[2], *one = scratch->row[3];
    uint64_t macs = 0;
    eits_zero(whole, stride);
    for (uint32_t k = 0; k < answer->count; ++k) {
        const eits_disc *disc = &answer->disc[k];
        const eits_real *shape = answer->shape[k],
                        edge_mm[2] = {disc->radius_mm * shape[0], disc->radius_mm * shape[1]};
        macs += eits_disc_ellipse(ctx, scratch, disc, edge_mm, one);
        eits_axpy(ctx->kernels, whole, disc->change, one, rank);
        if (answer->parameters < EITS_SHAPE_PARAMETERS || (shape[2] == 0 && shape[3] == 0))
            continue;
        macs += take_fields(ctx, k, disc);
        macs += dipole(ctx, scratch, k, disc, &shape[2], one);
        eits_axpy(ctx->kernels, whole, 1, one, rank);
    }
    macs += eits_whiten_errors(ctx, whole);
    eits_copy(left, ctx->evidence.data, stride);
    eits_axpy(ctx->kernels, left, -1, whole, rank);
    return macs + 3u * (uint64_t)rank * answer->count;
}
