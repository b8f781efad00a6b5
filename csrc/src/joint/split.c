/* One touch or two: what a single ellipse explains is tried as two touches on its long axis.
 *
 * Only what is clearly long is tried, the longest first. The two begin as discs that reach as far
 * as the ellipse, and become ellipses as all others are. They stand if the data then fit, if F
 * falls by enough, if their edges are about apart, and if the weaker is no shred of the other: a
 * finger that presses unevenly is one. */
#include "joint/joint.h"

#include "base/vec.h"
#include "joint/constants.h"

/* The longest touch that is long enough; j->count where there is none. */
static uint32_t longest(const eits_joint *j, const uint8_t *tried)
{
    uint32_t best = j->count;
    eits_real eta = EITS_JOINT_SPLIT_ETA;
    for (uint32_t k = 0; k < j->count; ++k) {
        if (!tried[k] && eits_pole_eta(&j->shape[k]) > eta) {
            best = k;
            eta = eits_pole_eta(&j->shape[k]);
        }
    }
    return best;
}

/* Two discs in the place of shape k, the second one last. */
static eits_joint as_two(const eits_joint *one, uint32_t k)
{
    eits_joint two = *one;
    two.shape[k] = eits_joint_as_strong(&one->shape[k]);
    eits_shape *a = &two.shape[k], *b = &two.shape[two.count++];
    const eits_real away = EITS_JOINT_SPLIT_AWAY * a->radius;
    eits_real axis[2];
    eits_half_angle(a->e1, a->e2, eits_pole_eta(a), axis);
    a->radius *= EITS_JOINT_SPLIT_RADIUS;
    a->e1 = a->e2 = 0;
    *b = *a;
    a->x = eits_fma(away, axis[0], a->x);
    a->y = eits_fma(away, axis[1], a->y);
    b->x = eits_fma(-away, axis[0], b->x);
    b->y = eits_fma(-away, axis[1], b->y);
    return two;
}

static int are_two(const eits_shape *a, const eits_shape *b)
{
    const eits_real dx = a->x - b->x, dy = a->y - b->y,
                    touching = EITS_JOINT_SPLIT_APART * (a->radius + b->radius),
                    p = a->amplitude * a->radius * a->radius,
                    q = b->amplitude * b->radius * b->radius;
    return eits_fma(dx, dx, dy * dy) > touching * touching && p * q > 0 &&
           p / q > EITS_JOINT_SPLIT_WEAKER && q / p > EITS_JOINT_SPLIT_WEAKER;
}

/* A light touch that is as large as two strong ones: the data hardly tell it from these, so they
 * are tried though it fits, and have to lower F by less. */
static int is_large(const eits_context *ctx, const eits_shape *s)
{
    return eits_joint_is_light(s) && eits_joint_offset(ctx, s, 2) > EITS_JOINT_LIGHT_LARGE;
}

/* Whether the two that shape k became stand, beside `one`. */
static int stand(const eits_context *ctx, const eits_joint *one, const eits_joint *two, uint32_t k)
{
    const eits_real excess = eits_joint_excess(ctx, two), fall = is_large(ctx, &one->shape[k])
                                                                     ? EITS_JOINT_SPLIT_LARGE
                                                                     : EITS_JOINT_SPLIT_FALL;
    return excess < EITS_JOINT_FITTED && one->cost - two->cost > fall * excess &&
           are_two(&two->shape[k], &two->shape[one->count]);
}

uint64_t eits_joint_split(eits_context *ctx, eits_joint *j, uint64_t spent)
{
    const uint64_t begin = spent;
    uint8_t tried[EITS_MAX_TOUCHES] = {0};
    int stale = 0;
    /* where one is wrong the data fit worse than noise does */
    const int fits = !(j->misfit > eits_joint_freedom(ctx, j) + EITS_JOINT_SPLIT_MISFIT);
    while (j->parameters == EITS_JOINT_ELLIPSE && j->count < ctx->options.max_touches &&
           (j->count + 1u) * EITS_JOINT_ELLIPSE <= EITS_JOINT_PARAMETERS) {
        const uint32_t k = longest(j, tried);
        if (k == j->count)
            break;
        tried[k] = 1;
        if (fits && !is_large(ctx, &j->shape[k]))
            continue;
        eits_joint two = as_two(j, k);
        if (!eits_pole_on_skin(ctx, two.shape[k].x, two.shape[k].y) ||
            !eits_pole_on_skin(ctx, two.shape[j->count].x, two.shape[j->count].y))
            continue;
        two.free_count = 2;
        two.free[0] = k;
        two.free[1] = j->count;
        stale = 1;
        eits_pole_clear(ctx, two.count);
        eits_joint_descend(ctx, &two, 2, j->cost - EITS_JOINT_SPLIT_LARGE, &spent);
        if (!stand(ctx, j, &two, k))
            continue;
        two.from[j->count] = j->from[k];
        eits_joint_free_all(&two);
        eits_joint_descend(ctx, &two, 1, R(INFINITY), &spent);
        *j = two;
        stale = 0;
    }
    if (stale) {
        eits_pole_clear(ctx, j->count);
        spent += eits_joint_evaluate(ctx, j, 2);
    }
    return spent - begin;
}
