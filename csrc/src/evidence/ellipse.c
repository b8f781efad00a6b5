/* Whether a disc is an ellipse, and which: where the data tell it.
 *
 * An ellipse of conductivity answers the field along its long axis as a stronger dipole than the
 * field across. The two dipole terms of the test (shape.c), u = d cos 2 phi and v = d sin 2 phi for
 * a long axis at phi, say so far better than the two of its edge. Held at zero they make F rise by
 * u'B^-1 u with B their block of the linearisation's inverse. Where that is more than an error of
 * the model gives, phi is known to some degrees, and d grows with the aspect s:
 *
 *     (s - 1) / (s + 1) = MOST d / (d + HALF)
 *
 * fitted on scenes of ellipses and fingers (studies/results/other-worlds.md): the dipole of an
 * ellipse with a finite contrast, less what the prior holds back. An insulating touch is weaker
 * along its long axis.
 *
 * An ellipse is reported where the test has it, which knows its shape, and not where a disc fits
 * best. The radius of that disc is wrong, too: it makes up for a shape that a disc has not. What
 * the strength suggests counts for more then, where the change under a touch is known. */
#include "evidence/evidence.h"

#include "base/vec.h"
#include "evidence/constants.h"

void eits_long_axis(const eits_scratch *scratch, const eits_answer *answer,
                    const eits_likelihood *likelihood, uint32_t k, eits_real excess,
                    eits_real axis[2])
{
    const uint32_t first = k * answer->parameters + EITS_EDGE_PARAMETERS;
    const size_t stride = EITS_STRIDE(likelihood->count);
    axis[0] = axis[1] = 0;
    if (answer->parameters < EITS_SHAPE_PARAMETERS)
        return;
    const eits_real *row = scratch->square + stride * first + first, *next = row + stride,
                    *shape = &answer->shape[k][EITS_EDGE_PARAMETERS - EITS_PLACE_PARAMETERS],
                    u = shape[0] + likelihood->step[first],
                    v = shape[1] + likelihood->step[first + 1],
                    determinant = eits_fma(row[0], next[1], -(row[1] * row[1])),
                    rise = u * eits_fma(next[1], u, -(row[1] * v)) +
                           v * eits_fma(row[0], v, -(row[1] * u)),
                    d = eits_sqrt(eits_fma(u, u, v * v));
    if (!(determinant > 0) || !(rise > EITS_ELLIPSE_EVIDENCE * excess * determinant))
        return;
    const eits_real e = EITS_ELLIPSE_MOST * d / (d + EITS_ELLIPSE_HALF),
                    length = eits_sqrt((1 + e) / (1 - e)), polarity = answer->disc[k].polarity;
    eits_half_angle(polarity * u, polarity * v, d, axis);
    axis[0] *= length;
    axis[1] *= length;
}

void eits_place_ellipse(const eits_context *ctx, const eits_disc *disc, const eits_real axis[2],
                        eits_fit *f, uint32_t k)
{
    const eits_options *o = &ctx->options;
    const eits_real reach = EITS_MAX_MOVE * (eits_real)ctx->model->pixel_mm;
    const eits_real *apart = f->apart_mm[k];
    eits_real *ellipse = f->ellipse_mm[k], radius = disc->radius_mm;
    eits_zero(f->long_mm[k], 2);
    if ((axis[0] == 0 && axis[1] == 0) || !eits_all_finite(apart, 2))
        return;
    eits_disc there = *disc;
    there.x_mm += eits_clamp(apart[0], -reach, reach);
    there.y_mm += eits_clamp(apart[1], -reach, reach);
    if (!eits_disc_on_skin(ctx, &there))
        there = *disc;
    if (o->touch_change_s_per_m > 0)
        radius = eits_fma(EITS_ELLIPSE_EXPECTED, eits_expected_radius(o, disc) - radius, radius);
    ellipse[0] = there.x_mm;
    ellipse[1] = there.y_mm;
    ellipse[2] = radius;
    f->long_mm[k][0] = radius * axis[0];
    f->long_mm[k][1] = radius * axis[1];
}
