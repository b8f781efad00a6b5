/* Draw touches: compute the fraction of each pixel that they cover.
 *
 * The cover of a pixel is clamp(1/2 + d, 0, 1), with d the distance in pixels from its centre to
 * the touch's edge, positive inside. This is the covered fraction for a straight edge that crosses
 * the pixel squarely. For an ellipse with half axes a and b, and (s, t) the place in its own axes
 * over a and b, the distance is, to first order at the edge and exactly for a disc,
 *
 *     rho = |(s, t)|,    d = (1 - rho) rho / |(s / a, t / b)|
 *
 * Covers of touches that overlap in a pixel are added, up to 1. Sums run in the order of the
 * touches and use no function but the root, so that a host draws the bits of a board. */
#include "eitskin/touch.h"

#include "base/vec.h"
#include "touch/constants.h"

static const eits_real PI = R(3.14159265358979323846);

/* A touch in pixels. */
typedef struct outline {
    eits_real x, y; /* the centre */
    eits_real a, b; /* half axes, a along (along_x, along_y) */
    eits_real along_x, along_y;
    eits_real beyond; /* the square of a distance beyond which nothing is covered */
} outline;

static outline outline_of(const eits_model *model, const eits_touch *touch)
{
    const eits_real pixel = (eits_real)model->pixel_mm, radius = touch->radius_mm / pixel,
                    long_x = touch->long_x_mm / pixel, long_y = touch->long_y_mm / pixel,
                    length = eits_sqrt(eits_fma(long_x, long_x, long_y * long_y));
    outline o = {
        .x = (touch->x_mm - (eits_real)model->origin_x_mm) / pixel,
        .y = (touch->y_mm - (eits_real)model->origin_y_mm) / pixel,
        .a = radius,
        .b = radius,
        .along_x = 1,
    };
    if (length > 0) {
        o.a = length;
        o.b = radius * (radius / length);
        o.along_x = long_x / length;
        o.along_y = long_y / length;
    }
    const eits_real reach = (o.a > o.b ? o.a : o.b) + 1;
    o.beyond = reach * reach;
    return o;
}

/* Return the cover of the pixel whose centre is at dx, dy from the touch's centre. */
static eits_real cover_of(const outline *o, eits_real dx, eits_real dy)
{
    const eits_real s = eits_fma(dx, o->along_x, dy * o->along_y) / o->a,
                    t = eits_fma(dy, o->along_x, -(dx * o->along_y)) / o->b;
    const eits_real rho = eits_sqrt(eits_fma(s, s, t * t));
    /* at the very centre the formula is 0 / 0; there the edge is nearest along the short axis */
    eits_real inside = o->a < o->b ? o->a : o->b;
    if (rho > EITS_NO_DIRECTION) {
        const eits_real u = s / o->a, v = t / o->b;
        inside = (1 - rho) * (rho / eits_sqrt(eits_fma(u, u, v * v)));
    }
    const eits_real cover = R(0.5) + inside;
    return cover > 0 ? (cover < 1 ? cover : 1) : 0;
}

/* Return 1 if a touch is drawn: it was found in this frame, and its numbers give an outline. */
static int is_drawn(const eits_touch *touch)
{
    const eits_real numbers[] = {touch->x_mm,      touch->y_mm,      touch->radius_mm,
                                 touch->long_x_mm, touch->long_y_mm, touch->strength_s_per_m_mm2};
    return touch->explained > 0 && touch->radius_mm > 0 &&
           eits_all_finite(numbers, sizeof numbers / sizeof numbers[0]);
}

/* Return the height of every touch: the expected change or, if the model states none, the mean
 * change of these touches over their area. */
static eits_real height_of(const eits_model *model, const eits_touch *touches, uint32_t count)
{
    const eits_real expected = (eits_real)model->defaults->touch_change_s_per_m;
    if (expected > 0)
        return expected;
    eits_real strength = 0, area_mm2 = 0;
    for (uint32_t k = 0; k < count; ++k) {
        if (!is_drawn(&touches[k]))
            continue;
        strength += eits_fabs(touches[k].strength_s_per_m_mm2);
        area_mm2 = eits_fma(touches[k].radius_mm, touches[k].radius_mm, area_mm2);
    }
    const eits_real height = area_mm2 > 0 ? strength / (PI * area_mm2) : 0;
    return eits_is_finite(height) ? height : 0;
}

eits_status eits_draw_touches(const eits_model *model, const eits_touch *touches, uint32_t count,
                              eits_real *image)
{
    if (model == NULL || image == NULL || (touches == NULL && count > 0))
        return EITS_E_ARGUMENT;
    eits_zero(image, model->n_pixels);
    for (uint32_t k = 0; k < count; ++k) {
        if (!is_drawn(&touches[k]))
            continue;
        const outline o = outline_of(model, &touches[k]);
        const eits_real sign = touches[k].strength_s_per_m_mm2 < 0 ? R(-1) : R(1);
        for (uint32_t j = 0; j < model->n_pixels; ++j) {
            const eits_real dx = (eits_real)model->pixel[j].ix + R(0.5) - o.x,
                            dy = (eits_real)model->pixel[j].iy + R(0.5) - o.y;
            if (eits_fma(dx, dx, dy * dy) < o.beyond)
                image[j] = eits_clamp(eits_fma(sign, cover_of(&o, dx, dy), image[j]), -1, 1);
        }
    }
    const eits_real height = height_of(model, touches, count);
    for (uint32_t j = 0; j < model->n_pixels; ++j)
        image[j] *= height;
    return EITS_OK;
}
