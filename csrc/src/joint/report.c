/* From the joint fit's shapes to the frame's touches, and whether they need a test. */
#include "joint/joint.h"

#include "base/vec.h"
#include "context/places.h"
#include "joint/constants.h"
#include "kernels/kernels.h"

static int all_finite(const eits_joint *j)
{
    int finite = eits_is_finite(j->cost);
    for (uint32_t k = 0; k < j->count; ++k) {
        const eits_shape *s = &j->shape[k];
        const eits_real numbers[] = {s->x, s->y, s->radius, s->amplitude, s->e1, s->e2};
        finite &= eits_all_finite(numbers, sizeof numbers / sizeof numbers[0]);
    }
    return finite;
}

/* Half of the long axis as a vector; 0, 0 for a disc. a = r ((1 + eta) / (1 - eta))^1/2. */
static void long_axis(const eits_shape *s, eits_real pixel, eits_real axis_mm[2])
{
    const eits_real eta = eits_pole_eta(s);
    axis_mm[0] = axis_mm[1] = 0;
    if (!(eta > EITS_JOINT_ROUND))
        return;
    const eits_real half = pixel * s->radius * eits_sqrt((1 + eta) / (1 - eta));
    eits_half_angle(s->e1, s->e2, eta, axis_mm);
    axis_mm[0] *= half;
    axis_mm[1] *= half;
}

/* Touch k is a part of what was disc `of`: it is as sure as that was. */
static void inherit(eits_fit *f, uint32_t of, uint32_t k)
{
    f->rise[k] = f->rise[of];
    f->pair[k] = f->pair[of];
    f->confidence[k] = f->confidence[of];
}

eits_real eits_joint_left(const eits_context *ctx, const eits_joint *j)
{
    return eits_larger(j->misfit - eits_joint_freedom(ctx, j), 0);
}

/* p (1 - p), where the other kind has the probability p = 1 / (1 + e^(2 x)), x = rise / 4: that is
 * 1 / (2 cosh x)^2, with the series of cosh^2 up to x^4. */
static eits_real doubt(eits_real rise)
{
    const eits_real x2 = rise * rise / 16;
    return 1 / (4 * eits_fma(x2, eits_fma(x2, R(1) / 3, 1), 1));
}

/* How well the place and the radius of a touch are known: by the normal equations, times the excess
 * of the misfit, and by the distance between what it is as either kind, strong or light. The radius
 * counts as known where the data exclude the other kind and leave little open within the own one.
 */
static void report_spread(const eits_context *ctx, const eits_shape *s,
                          const eits_joint_known *known, eits_real excess, eits_real *place_mm2,
                          eits_real *radius_sd_mm)
{
    const eits_real pixel = (eits_real)ctx->model->pixel_mm, *other = known->other_step,
                    rise = known->other_rise / excess, open = doubt(rise),
                    either = pixel * pixel * open,
                    least =
                        EITS_JOINT_PLACE_SHARE * eits_variance_of_all(ctx, EITS_JOINT_PLACE_MIN),
                    unit = pixel * pixel * excess *
                           (eits_joint_is_light(s) ? EITS_JOINT_PLACE_LIGHT : 1),
                    spread =
                        eits_sqrt(eits_fma(excess, known->log_radius, open * other[2] * other[2]));
    place_mm2[0] = eits_fma(unit, known->place[0], eits_fma(either * other[0], other[0], least));
    place_mm2[1] = eits_fma(unit, known->place[1], either * other[0] * other[1]);
    place_mm2[2] = eits_fma(unit, known->place[2], eits_fma(either * other[1], other[1], least));
    *radius_sd_mm = spread < EITS_JOINT_RADIUS_KNOWN && rise > EITS_JOINT_OTHER_EXCLUDED
                        ? spread * pixel * s->radius
                        : 0;
}

/* The square of a vector over the folds in use, plain and weighed, and its product with the drift
 * of the gain. */
typedef struct plain {
    eits_real square, weighed, along;
} plain;

static void add_plain(const eits_context *ctx, const eits_real *v, uint32_t first, uint32_t count,
                      plain *s)
{
    for (uint32_t i = 0; i < count; ++i) {
        const eits_real on = ctx->joint.weight[first + i] > 0 ? v[i] : 0;
        const eits_real of = on * ctx->joint.weight[first + i];
        s->square = eits_fma(on, on, s->square);
        s->weighed = eits_fma(of, of, s->weighed);
        s->along = eits_fma(on, ctx->projection.gain_drift[first + i], s->along);
    }
}

/* The square less its part along the drift, as a fraction of the data's. */
static eits_real share_of(const eits_context *ctx, plain s, eits_real drift)
{
    const eits_real left = drift > 0 ? s.square - s.along * s.along / drift : s.square;
    return ctx->joint.whole > 0 && left > 0 ? left / ctx->joint.whole : 0;
}

/* Note the shares of the data's energy that the shapes leave and that each one explains. Here all
 * folds count alike: the rise of F without a touch is multiplied by the mean variance of the folds
 * that it changes. */
static void report_shares(eits_context *ctx, const eits_joint *j, const eits_joint_known *known,
                          eits_fit *f)
{
    eits_real value[EITS_JOINT_BLOCK], left[EITS_JOINT_BLOCK];
    const uint32_t folds = ctx->model->n_folded;
    plain own[EITS_MAX_TOUCHES] = {{0, 0, 0}}, rest = {0, 0, 0}, drift = {0, 0, 0};
    for (uint32_t first = 0; first < folds; first += EITS_JOINT_BLOCK) {
        const uint32_t some = folds - first,
                       count = some < EITS_JOINT_BLOCK ? some : EITS_JOINT_BLOCK;
        const eits_pole_out out = {.value = value};
        eits_copy(left, ctx->frame.d + first, count);
        for (uint32_t k = 0; k < j->count; ++k) {
            f->macs +=
                eits_pole_rows(ctx, k, &j->shape[k], eits_joint_poles(j), first, count, &out);
            add_plain(ctx, value, first, count, &own[k]);
            eits_axpy(ctx->kernels, left, -1, value, count);
        }
        add_plain(ctx, left, first, count, &rest);
        add_plain(ctx, ctx->projection.gain_drift + first, first, count, &drift);
    }
    ctx->info.unexplained = share_of(ctx, rest, drift.square);
    for (uint32_t k = 0; k < j->count; ++k)
        f->explained[k] = ctx->joint.whole > 0 && own[k].weighed > 0
                              ? known[k].rise * (own[k].square / own[k].weighed) / ctx->joint.whole
                              : 0;
}

static void report(eits_context *ctx, const eits_joint *j, const eits_joint_known *known,
                   eits_fit *f)
{
    const eits_model *model = ctx->model;
    const eits_real pixel = (eits_real)model->pixel_mm, sheet = eits_pole_sheet(model),
                    excess = eits_joint_excess(ctx, j), whole = ctx->joint.energy;
    f->beyond_noise = whole > 0 ? eits_joint_left(ctx, j) / whole : 0;
    f->count = j->count;
    f->joint = 1;
    report_shares(ctx, j, known, f);
    for (uint32_t k = 0; k < j->count; ++k) {
        const eits_shape *s = &j->shape[k];
        eits_disc *d = &f->disc[k];
        d->polarity = s->amplitude < 0 ? R(-1) : R(1);
        d->x_mm = eits_fma(s->x, pixel, (eits_real)model->origin_x_mm);
        d->y_mm = eits_fma(s->y, pixel, (eits_real)model->origin_y_mm);
        d->radius_mm = s->radius * pixel;
        d->change = sheet * s->amplitude;
        long_axis(s, pixel, f->long_mm[k]);
        if (!(known[k].shape > EITS_JOINT_LONG * excess)) /* a disc, as far as the data tell */
            eits_zero(f->long_mm[k], 2);
        report_spread(ctx, s, &known[k], excess, f->place_mm2[k], &f->radius_sd_mm[k]);
    }
}

int eits_joint_explains(const eits_context *ctx, const eits_joint *j)
{
    return all_finite(j) && eits_joint_left(ctx, j) < EITS_JOINT_MAX_LEFT * ctx->joint.energy;
}

/* Whether any two shapes may be one: they are near, were not found better than one (split.c), and
 * one of them could go without much of a rise. */
static int any_may_be_one(const eits_context *ctx, const eits_joint *j,
                          const eits_joint_known *known)
{
    const eits_real least = EITS_JOINT_TWO_RISE * eits_joint_excess(ctx, j);
    for (uint32_t k = 1; k < j->count; ++k) {
        for (uint32_t i = 0; i < k; ++i) {
            if (j->from[i] != j->from[k] &&
                eits_joint_near(&j->shape[i], &j->shape[k], EITS_JOINT_CLEAR_APART) &&
                !(known[i].rise > least && known[k].rise > least))
                return 1;
        }
    }
    return 0;
}

/* Whether the shapes need no test: nothing is left of the data, and the frame is far likelier with
 * each than without. Where `fewer` stand for more discs, less may be left: two that are one leave
 * little. So where few have become more than the `begun`: two may make up for another that is
 * wrong. */
static int is_clear(const eits_context *ctx, const eits_joint *j, const eits_joint_known *known,
                    uint32_t fewer, uint32_t begun)
{
    const eits_real excess = eits_joint_excess(ctx, j);
    const int few = j->count < EITS_JOINT_CROWD,
              fewer_or_more = fewer > 0 || (few && j->count > begun);
    if (!(excess < (few ? EITS_JOINT_FITTED : EITS_JOINT_CROWD_FITTED)) ||
        (fewer_or_more && j->misfit > eits_joint_freedom(ctx, j) + EITS_JOINT_SPLIT_MISFIT))
        return 0;
    for (uint32_t k = 0; k < j->count; ++k) {
        /* one large light touch explains what two near ones do */
        if (!(known[k].rise > EITS_JOINT_CLEAR_RISE * excess) ||
            (fewer > 0 && eits_joint_is_light(&j->shape[k])))
            return 0;
    }
    return 1;
}

/* The shapes become the frame's touches, as sure as F says. */
static void take(eits_context *ctx, const eits_joint *j, const eits_joint_known *known, eits_fit *f)
{
    const eits_real excess = eits_joint_excess(ctx, j);
    report(ctx, j, known, f);
    f->tested = 1;
    for (uint32_t k = 0; k < f->count; ++k) {
        f->rise[k] = known[k].rise / excess;
        f->pair[k] = -1;
        f->confidence[k] = eits_confidence(f->rise[k]);
    }
}

int eits_joint_take_if_clear(eits_context *ctx, const eits_joint *j, uint32_t fewer, uint32_t begun,
                             eits_fit *f)
{
    const eits_joint_known *known = eits_joint_places(ctx, j, &f->macs);
    if (!is_clear(ctx, j, known, fewer, begun) || any_may_be_one(ctx, j, known))
        return 0;
    take(ctx, j, known, f);
    return 1;
}

void eits_joint_take(eits_context *ctx, const eits_joint *j, eits_fit *f)
{
    const eits_joint_known *known = eits_joint_places(ctx, j, &f->macs);
    take(ctx, j, known, f);
}

void eits_joint_refine(eits_context *ctx, const eits_joint *j, eits_fit *f)
{
    const eits_joint_known *known = eits_joint_places(ctx, j, &f->macs);
    for (uint32_t k = f->count; k < j->count; ++k) /* parts of what was split */
        inherit(f, j->from[k], k);
    report(ctx, j, known, f);
}
