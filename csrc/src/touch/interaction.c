/* The effect of touches on each other's data is taken out to second order (interaction.h has the
 * physics).
 *
 * The Jacobian is linear: two touches give the sum of what each gives alone. In truth each lies in
 * the field that the other has changed. For strong touches near each other that
 * shifts the fitted places. With the discs as
 * fitted so far the second-order term is computed and subtracted, and the fit goes on with data
 * that the linear model can give. touch.c does so in turn with the fit, since either needs the
 * other's result.
 *
 * In: discs with change, place and radius; the model's fields (section FLDS), per electrode, so
 * that a row's field is a difference of two. Out: `data`, reduced, whitened and projected as
 * frame.y is.
 *
 * Costs: a field per disc (covered pixels x field stride), then 4 multiply-accumulates an electrode
 * for each ordered pair of discs and 3 a folded row for each disc, and one product with P. No
 * transcendental function and no solve: the field of a dipole in the plane is 1 / z^2.
 *
 * Fields live in scratch->square, one row a disc and one for the sum: no solver runs meanwhile. */
#include "touch/interaction.h"

#include "base/vec.h"
#include "frame/fold.h"
#include "kernels/kernels.h"
#include "touch/constants.h"

static const eits_real PI = R(3.14159265358979323846);

typedef struct complex_number {
    eits_real re, im;
} complex_number;

static complex_number product(complex_number a, complex_number b)
{
    return (complex_number){eits_fma(a.re, b.re, -(a.im * b.im)),
                            eits_fma(a.re, b.im, a.im * b.re)};
}

/* 1 / a^2, or 0 where a is all but zero: a dipole does not describe the field that discs in one
 * place have at each other. */
static complex_number inverse_square(complex_number a)
{
    const eits_real square = eits_fma(a.re, a.re, a.im * a.im);
    if (!(square > EITS_NO_DIPOLE_MM2))
        return (complex_number){0, 0};
    const complex_number inverse = {a.re / square, -(a.im / square)};
    return product(inverse, inverse);
}

int eits_has_interaction(const eits_context *ctx)
{
    return ctx->model->fields.at.data != NULL && ctx->model->data_kind == EITS_DATA_DIFFERENCE &&
           (ctx->options.touch_fit & EITS_TOUCH_FIT_INTERACTION) != 0;
}

/* The change of the disc's conductivity times the area that its covers add up to.
 *
 * The covers fall from 1 to 0 over one pixel across the rim; their integral over the plane is
 * pi (r^2 + pixel^2 / 12): eits_disc_area away from the edge of the skin, without its walk. */
eits_real eits_disc_moment(const eits_context *ctx, const eits_disc *disc)
{
    const eits_real pixel = (eits_real)ctx->model->pixel_mm;
    return disc->change * PI * eits_fma(disc->radius_mm, disc->radius_mm, pixel * pixel / 12);
}

/* Add to `induced` the field that disc j, in the field `source`, adds to the field of each
 * electrode's current at disc i: L numbers for x, then L for y, as the fields are.
 *
 * A dipole's field in the plane is 1 / z^2 in complex numbers, its mirror in a circle likewise,
 * so each pair of discs costs two complex factors and then two multiply-adds per electrode. Only
 * the field at the other's centre counts: that is second order in the changes, as far as this
 * goes. */
static void add_induced(const eits_context *ctx, const eits_disc *i, const eits_disc *j,
                        const eits_real *source, eits_real *induced)
{
    const uint32_t electrodes = ctx->model->n_electrodes;
    /* The dipole of disc j, per unit of the field that it lies in. */
    const eits_real s = eits_disc_moment(ctx, j) * (eits_real)ctx->model->fields.per_sheet;
    const eits_real *mirror = source + 2 * (size_t)electrodes;
    const complex_number z = {i->x_mm, i->y_mm}, apart = {i->x_mm - j->x_mm, i->y_mm - j->y_mm};
    const complex_number b_z = product((complex_number){mirror[2], mirror[3]}, z);
    /* inside each other discs are no dipoles: there the field is taken that they have where they
     * touch */
    const eits_real distance = eits_sqrt(eits_fma(apart.re, apart.re, apart.im * apart.im)),
                    touching = i->radius_mm + j->radius_mm;
    const eits_real fraction = distance < touching ? distance / touching : 1;
    const complex_number total = inverse_square(apart),
                         direct = {fraction * fraction * total.re, fraction * fraction * total.im};
    const complex_number mirrored =
        inverse_square((complex_number){mirror[0] - b_z.re, mirror[1] - b_z.im});
    /* conj(dE) = s ((direct - mirrored) E_x + i (direct + mirrored) E_y) */
    const complex_number by_x = {s * (direct.re - mirrored.re), s * (direct.im - mirrored.im)};
    const complex_number by_y = {-(s * (direct.im + mirrored.im)), s * (direct.re + mirrored.re)};
    for (uint32_t e = 0; e < electrodes; ++e) {
        const eits_real x = source[e], y = source[electrodes + e];
        induced[e] = eits_fma(by_x.re, x, eits_fma(by_y.re, y, induced[e]));
        induced[electrodes + e] =
            eits_fma(-by_x.im, x, eits_fma(-by_y.im, y, induced[electrodes + e]));
    }
}

/* Add to each fold's `sum` the answer of disc `i` to the field `induced`, measured in its `own`
 * field. */
static void answer(const eits_context *ctx, const eits_disc *i, const eits_real *own,
                   const eits_real *induced, eits_real *sum)
{
    const uint32_t electrodes = ctx->model->n_electrodes;
    /* By reciprocity: what the pair measures of a change is the field of the drive times that of
     * the measuring pair, if that carried the current. */
    const eits_real factor = -((eits_real)ctx->model->fields.volts * eits_disc_moment(ctx, i));
    for (uint32_t k = 0; k < ctx->model->n_folded; ++k) {
        const uint8_t *row = eits_row(ctx, ctx->model->fold[k].first);
        const eits_real x = induced[row[0]] - induced[row[1]],
                        y = induced[electrodes + row[0]] - induced[electrodes + row[1]];
        const eits_real u = own[row[2]] - own[row[3]],
                        v = own[electrodes + row[2]] - own[electrodes + row[3]];
        sum[k] = eits_fma(factor, eits_fma(x, u, y * v), sum[k]);
    }
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

/* Less than two discs have no interaction. The fields are averaged over each disc's cover, as
 * its atom is. If what comes of it is a large part of the data, the discs are too strong or too
 * near for second order, and nothing is taken out. */
uint64_t eits_remove_interaction(eits_context *ctx, const eits_scratch *scratch,
                                 const eits_disc *disc, uint32_t count, eits_real *data)
{
    eits_real *added_data = scratch->row[1];
    const eits_model *model = ctx->model;
    const size_t stride = model->fields.at.stride, room = model->rank * EITS_STRIDE(model->rank);
    eits_copy(data, ctx->frame.y, EITS_STRIDE(model->rank));
    if (count < 2 || !eits_has_interaction(ctx) || (count + 1) * stride > room)
        return 0;
    uint64_t macs = 0;
    eits_real *field = scratch->square, *induced = scratch->square + stride * count;
    for (uint32_t i = 0; i < count; ++i)
        macs += eits_disc_field(ctx, scratch, &disc[i], field + stride * i);
    eits_zero(scratch->value, model->n_folded);
    for (uint32_t i = 0; i < count; ++i) {
        eits_zero(induced, stride);
        for (uint32_t j = 0; j < count; ++j) {
            if (j != i)
                add_induced(ctx, &disc[i], &disc[j], field + stride * j, induced);
        }
        answer(ctx, &disc[i], field + stride * i, induced, scratch->value);
    }
    macs += (uint64_t)count * ((count - 1u) * 4u * model->n_electrodes + 3u * model->n_folded);
    macs += reduce(ctx, scratch, added_data);
    const eits_real total = eits_dot(ctx->kernels, ctx->frame.y, ctx->frame.y, model->rank),
                    added = eits_dot(ctx->kernels, added_data, added_data, model->rank);
    if (!(added <= EITS_INTERACTION_MAX *
                       total)) /* far beyond the second order: discs that are no touches */
        return macs + 2u * model->rank;
    for (uint32_t i = 0; i < model->rank; ++i)
        data[i] -= added_data[i];
    return macs + 2u * model->rank;
}
