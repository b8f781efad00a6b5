/* The priors of touches: what is assumed of them before the data are seen.
 *
 * The data tell a touch's strength q r^2 far better than its radius r or its amplitude q, so the
 * two come from what touches are expected to be. Radii spread about that of a fit's seed. Touches
 * are of two kinds: strong ones, of a contrast of 3 to 10 or of .1 to .5, and light ones, of 1.15
 * to 2 or of .5 to .87. Each kind has a normal prior of log |q|, and the prior's part of F is the
 * lesser of the two. */
#include "joint/joint.h"

#include "base/log.h"
#include "base/vec.h"
#include "joint/constants.h"

/* Touches whose log |q| is about that of `amplitude`, within `spread`. */
typedef struct kind {
    eits_real amplitude, spread;
} kind;

static const kind LIGHT = {EITS_JOINT_LIGHT, EITS_JOINT_LIGHT_SPREAD},
                  STRONG = {EITS_JOINT_STRONG, EITS_JOINT_STRONG_SPREAD},
                  INSULATING = {EITS_JOINT_INSULATING, EITS_JOINT_INSULATING_SPREAD};

static const kind *strong_kind(const eits_shape *s)
{
    return s->amplitude < 0 ? &INSULATING : &STRONG;
}

/* The logarithm of a number that may be none: not above 0, or not finite. */
static eits_real log_of(eits_real number)
{
    return eits_log(eits_clamp(number, R(1e-6), R(1e6)));
}

/* log |q| less what the kind has. */
static eits_real off_from(const kind *of, const eits_shape *s)
{
    return log_of(eits_fabs(s->amplitude) / of->amplitude);
}

static eits_real cost_as(const kind *of, const eits_shape *s)
{
    const eits_real off = off_from(of, s) / of->spread;
    return off * off;
}

/* The kind that the shape is likelier to be. */
static const kind *kind_of(const eits_shape *s)
{
    const kind *strong = strong_kind(s);
    return cost_as(&LIGHT, s) < cost_as(strong, s) ? &LIGHT : strong;
}

eits_real eits_joint_offset(const eits_context *ctx, const eits_shape *s, uint32_t p)
{
    const eits_real radius =
        EITS_JOINT_RADIUS * ctx->options.touch_seed_radius_mm / (eits_real)ctx->model->pixel_mm;
    switch (p) {
    case 2:
        return log_of(s->radius / radius);
    case 3:
        return off_from(kind_of(s), s);
    case 4:
        return s->e1;
    case 5:
        return s->e2;
    default:
        return 0;
    }
}

eits_shape eits_joint_usual(const eits_context *ctx, eits_real x, eits_real y, int insulates)
{
    return (eits_shape){.x = x,
                        .y = y,
                        .radius = EITS_JOINT_RADIUS * ctx->options.touch_seed_radius_mm /
                                  (eits_real)ctx->model->pixel_mm,
                        .amplitude = insulates ? -INSULATING.amplitude : STRONG.amplitude};
}

static eits_real deviation(const eits_shape *s, uint32_t p)
{
    return p == 2   ? EITS_JOINT_RADIUS_SPREAD
           : p == 3 ? kind_of(s)->spread
                    : EITS_JOINT_SHAPE_SPREAD;
}

eits_real eits_joint_precision(const eits_shape *s, uint32_t p)
{
    return p < 2 ? 0 : 1 / (deviation(s, p) * deviation(s, p));
}

eits_real eits_joint_prior(const eits_context *ctx, const eits_shape *s, uint32_t parameters)
{
    eits_real sum = 0;
    for (uint32_t p = 2; p < parameters; ++p) {
        const eits_real off = eits_joint_offset(ctx, s, p) / deviation(s, p);
        sum = eits_fma(off, off, sum);
    }
    return sum;
}

eits_real eits_joint_priors(const eits_context *ctx, const eits_joint *j)
{
    eits_real sum = 0;
    for (uint32_t k = 0; k < j->count; ++k)
        sum += eits_joint_prior(ctx, &j->shape[k], j->parameters);
    return sum;
}

/* The shape of the same strength q r^2 that has the amplitude of `as`. */
static eits_shape shape_as(const kind *as, const eits_shape *s)
{
    const eits_real strength = eits_fabs(eits_joint_strength(s));
    eits_shape out = *s;
    out.radius = eits_sqrt(strength / as->amplitude);
    out.amplitude = s->amplitude < 0 ? -as->amplitude : as->amplitude;
    return out;
}

eits_shape eits_joint_as_strong(const eits_shape *s)
{
    return shape_as(strong_kind(s), s);
}

int eits_joint_is_light(const eits_shape *s)
{
    return kind_of(s) == &LIGHT;
}

static const kind *other_kind(const eits_shape *s)
{
    return eits_joint_is_light(s) ? strong_kind(s) : &LIGHT;
}

void eits_joint_guess_kinds(const eits_context *ctx, eits_joint *j)
{
    eits_joint strong = *j, light = *j;
    eits_real rise = 0;
    for (uint32_t k = 0; k < j->count; ++k) {
        strong.shape[k] = eits_joint_as_strong(&j->shape[k]);
        light.shape[k] = shape_as(&LIGHT, &strong.shape[k]);
        rise += eits_joint_prior(ctx, &light.shape[k], EITS_JOINT_DISC) -
                eits_joint_prior(ctx, &strong.shape[k], EITS_JOINT_DISC);
    }
    *j = rise < 0 ? light : strong;
}

eits_shape eits_joint_as_other(const eits_shape *s)
{
    return shape_as(other_kind(s), s);
}

void eits_joint_other_prior(const eits_shape *s, eits_joint_change *of)
{
    const kind *other = other_kind(s), *own = kind_of(s);
    const eits_real precision = 1 / (other->spread * other->spread),
                    before = 1 / (own->spread * own->spread);
    of->cost = cost_as(other, s) - cost_as(own, s);
    of->precision = precision - before;
    of->gradient = eits_fma(before, off_from(own, s), -(precision * off_from(other, s)));
}
