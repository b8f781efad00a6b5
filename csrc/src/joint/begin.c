/* From fitted discs to the joint fit: before the test of touches and after it. */
#include "context/places.h"
#include "joint/constants.h"
#include "joint/joint.h"
#include "touch/interaction.h"

/* A disc as a touch that is not light. */
static eits_shape shape_of(const eits_context *ctx, const eits_disc *d)
{
    const eits_shape found = eits_disc_as_shape(ctx, d);
    return eits_joint_as_strong(&found);
}

/* The fit's discs as shapes, each of the strength that was found. */
static eits_joint begin(const eits_context *ctx, const eits_fit *f)
{
    eits_joint j = {.count = f->count, .parameters = EITS_JOINT_DISC, .searches = 0};
    for (uint32_t k = 0; k < f->count; ++k) {
        j.from[k] = k;
        j.shape[k] = shape_of(ctx, &f->disc[k]);
    }
    return j;
}

/* Whether a shape's middle is away from the rim. */
static int is_inside(const eits_context *ctx, const eits_shape *s)
{
    const eits_real r = EITS_JOINT_RIM;
    return eits_pole_on_skin(ctx, s->x - r, s->y) && eits_pole_on_skin(ctx, s->x + r, s->y) &&
           eits_pole_on_skin(ctx, s->x, s->y - r) && eits_pole_on_skin(ctx, s->x, s->y + r);
}

/* Leave out weak peaks, which the image often shows beside touches, above all at the rim. If the
 * others explain the frame, these were none. */
static void leave_out_weak(const eits_context *ctx, eits_joint *j)
{
    eits_real greatest = 0;
    uint32_t count = 0;
    for (uint32_t k = 0; k < j->count; ++k) {
        greatest = eits_larger(greatest, eits_fabs(eits_joint_strength(&j->shape[k])));
    }
    for (uint32_t k = 0; k < j->count; ++k) {
        const eits_shape *s = &j->shape[k];
        const eits_real least = is_inside(ctx, s) ? EITS_JOINT_WEAK : EITS_JOINT_WEAK_AT_RIM;
        if (eits_fabs(eits_joint_strength(s)) < least * greatest)
            continue;
        j->from[count] = j->from[k];
        j->shape[count++] = *s;
    }
    j->count = count;
}

int eits_can_fit_jointly(const eits_context *ctx)
{
    return ctx->options.touch_test && !ctx->reference.far && eits_may_fit_jointly(ctx) &&
           ctx->model->uncertainty.errors != NULL;
}

/* Whether these touches are few enough, and the frame is one that the joint fit takes. */
static int may_fit(const eits_context *ctx, const eits_fit *f)
{
    return f->count > 0 && f->count * EITS_JOINT_DISC <= EITS_JOINT_PARAMETERS &&
           eits_can_fit_jointly(ctx);
}

int eits_joint_is_likely(const eits_context *ctx, const eits_joint *j)
{
    return j->count > 0 && eits_joint_explains(ctx, j) &&
           eits_joint_excess(ctx, j) < EITS_JOINT_LIKELY;
}

void eits_joint_give(const eits_context *ctx, const eits_joint *j, eits_fit *f)
{
    const eits_model *model = ctx->model;
    const eits_real pixel = (eits_real)model->pixel_mm, sheet = eits_pole_sheet(model);
    f->count = j->count;
    for (uint32_t k = 0; k < j->count; ++k) {
        const eits_shape *s = &j->shape[k];
        f->disc[k] = (eits_disc){
            .x_mm = eits_fma(s->x, pixel, (eits_real)model->origin_x_mm),
            .y_mm = eits_fma(s->y, pixel, (eits_real)model->origin_y_mm),
            .radius_mm = eits_clamp(s->radius * pixel, ctx->options.touch_min_radius_mm,
                                    ctx->options.touch_max_radius_mm),
            .change = sheet * s->amplitude,
            .polarity = s->amplitude < 0 ? R(-1) : R(1),
        };
    }
}

int eits_fit_clearly(eits_context *ctx, const eits_scratch *scratch, eits_fit *f, eits_joint *j)
{
    j->count = 0;
    if (!may_fit(ctx, f))
        return 0;
    *j = begin(ctx, f);
    j->searches = 1;
    if (!f->settled)
        leave_out_weak(ctx, j);
    const uint32_t fewer = eits_joint_merge(j), begun = j->count;
    if (begun == 0 || begun * j->parameters > EITS_JOINT_PARAMETERS) {
        j->count = 0;
        return 0;
    }
    if (fewer == 0)
        eits_joint_guess_kinds(ctx, j);
    f->macs += eits_joint_metric(ctx);
    eits_joint_settle(ctx, scratch, j, &f->macs);
    return eits_joint_explains(ctx, j) && eits_joint_take_if_clear(ctx, j, fewer, begun, f);
}

/* Whether *j has a shape at each of the fit's discs. */
static int same_touches(const eits_context *ctx, const eits_fit *f, const eits_joint *j)
{
    int same = f->count == j->count;
    for (uint32_t k = 0; k < f->count && same; ++k) {
        const eits_shape s = shape_of(ctx, &f->disc[k]);
        uint32_t near = 0;
        for (uint32_t i = 0; i < j->count; ++i)
            near += (uint32_t)eits_joint_near(&s, &j->shape[i], EITS_JOINT_SAME);
        same = near == 1;
    }
    return same;
}

/* Whether the fit before the test explains the frame far better than that of what the test left:
 * near the rim the discs of the test are a poor model, and it drops touches or adds some. */
static int was_better(const eits_context *ctx, const eits_joint *first, const eits_joint *j)
{
    return !eits_joint_explains(ctx, j) && first->count > 0 && eits_joint_explains(ctx, first) &&
           eits_joint_left(ctx, first) < EITS_JOINT_SURE * ctx->joint.energy;
}

void eits_fit_jointly(eits_context *ctx, const eits_scratch *scratch, eits_fit *f, eits_joint *j)
{
    const eits_joint first = *j;
    if (!f->tested || !may_fit(ctx, f))
        return;
    if (!same_touches(ctx, f, j)) {
        *j = begin(ctx, f);
        eits_joint_guess_kinds(ctx, j);
        f->macs += eits_joint_metric(ctx);
        eits_joint_settle(ctx, scratch, j, &f->macs);
    }
    if (was_better(ctx, &first, j)) {
        *j = first;
        f->macs += eits_joint_return_to(ctx, j);
        eits_joint_take(ctx, j, f);
        return;
    }
    if (!eits_joint_explains(ctx, j) ||
        (f->drifts && eits_joint_excess(ctx, j) > EITS_JOINT_FITTED))
        return;
    f->macs += eits_joint_return_to(ctx, j); /* the slots hold the discs of the test */
    eits_joint_refine(ctx, j, f);
}
