/* One touch or two: what an ellipse does not explain is tried as two touches in its place.
 *
 * Two fingers side by side are as round as one, so four directions are looked at; the one that the
 * linearisation finds best is fitted. The two stand if the data then fit, if F falls by enough, if
 * their edges are about apart, and if the weaker is no shred of the other: a finger that presses
 * unevenly is one. */
#include "joint/joint.h"

#include "base/vec.h"
#include "context/places.h"
#include "joint/constants.h"

enum { DIRECTIONS = 4 };

/* the radius of a disc of half the area */
#define HALF_AREA R(0.70710678118654752440)

/* The longest touch that was not tried; j->count where there is none. */
static uint32_t longest(const eits_joint *j, const uint8_t *tried)
{
    uint32_t best = j->count;
    eits_real most = 0;
    for (uint32_t k = 0; k < j->count; ++k) {
        const eits_real eta = eits_pole_eta(&j->shape[k]),
                        size = j->shape[k].radius * eits_sqrt((1 + eta) / (1 - eta));
        if (!tried[k] && size > most) {
            best = k;
            most = size;
        }
    }
    return best;
}

/* Across the long axis, between, and along it. */
static void direction(const eits_shape *s, int d, eits_real axis[2])
{
    const eits_real eta = eits_pole_eta(s), half = R(0.70710678118654752440);
    eits_real along[2] = {1, 0};
    if (eta > R(1e-6))
        eits_half_angle(s->e1, s->e2, eta, along);
    const eits_real cosine[DIRECTIONS] = {0, half, half, 1}, sine[DIRECTIONS] = {1, half, -half, 0};
    axis[0] = eits_fma(cosine[d], along[0], -(sine[d] * along[1]));
    axis[1] = eits_fma(sine[d], along[0], cosine[d] * along[1]);
}

/* Return the half width of the ellipse along a unit vector. */
static eits_real reach(const eits_shape *s, eits_real x, eits_real y)
{
    const eits_real eta = eits_pole_eta(s), r2 = s->radius * s->radius;
    /* cos and sin of twice the vector's angle, times eta: e . (cos, sin) is eta cos 2 psi */
    const eits_real twice = eits_fma(s->e1, eits_fma(x, x, -(y * y)), s->e2 * 2 * x * y);
    /* a^2 b^2 / (b^2 cos^2 + a^2 sin^2) with a^2 + b^2 and a^2 - b^2 by eta */
    const eits_real sum = 1 + eta * eta, difference = 2 * twice;
    return eits_sqrt(r2 * (1 - eta * eta) / (sum - difference));
}

/* Shape k becomes two of its kind that are `away` from its middle along an axis. The second one is
 * the last shape, and only these two are free. */
static void divide(eits_joint *j, uint32_t k, const eits_real axis[2], eits_real away)
{
    eits_shape *a = &j->shape[k], *b = &j->shape[j->count];
    *b = *a;
    a->x = eits_fma(away, axis[0], a->x);
    a->y = eits_fma(away, axis[1], a->y);
    b->x = eits_fma(-away, axis[0], b->x);
    b->y = eits_fma(-away, axis[1], b->y);
    j->from[j->count] = j->from[k];
    j->free_count = 2;
    j->free[0] = k;
    j->free[1] = j->count++;
}

/* Two strong touches in the place of shape k, the second one last: they have its strength, its
 * extent across the line of their middles, and its second moment along it. With half axes w along
 * that line and middles h to either side of the one's, two have h^2 + w^2 / 4 there; the one, which
 * reaches L, has L^2 / 4. */
static eits_joint as_two(const eits_joint *one, uint32_t k, int d)
{
    eits_joint two = *one;
    eits_shape *a = &two.shape[k];
    eits_real axis[2];
    direction(a, d, axis);
    const eits_real length = reach(a, axis[0], axis[1]), area = a->radius * a->radius;
    a->radius *= HALF_AREA;
    *a = eits_joint_as_strong(a);
    const eits_real r2 = a->radius * a->radius, narrow = eits_sqrt(r2 / EITS_JOINT_SPLIT_ASPECT),
                    wide = eits_larger(r2 * length / area, narrow), across = r2 / wide,
                    eta = (across - wide) / (across + wide),
                    away = eits_sqrt(eits_larger(eits_fma(length, length, -(wide * wide)),
                                                 length * length / 2)) /
                           2;
    a->e1 = eits_clamp(-eta * eits_fma(axis[0], axis[0], -(axis[1] * axis[1])), -EITS_JOINT_MAX_ETA,
                       EITS_JOINT_MAX_ETA);
    a->e2 = eits_clamp(-eta * 2 * axis[0] * axis[1], -EITS_JOINT_MAX_ETA, EITS_JOINT_MAX_ETA);
    divide(&two, k, axis, away);
    two.parameters = EITS_JOINT_ELLIPSE;
    return two;
}

/* Whether shape k and the last one have their middles on the skin. */
static int are_on_skin(const eits_context *ctx, const eits_joint *two, uint32_t k)
{
    const eits_shape *a = &two->shape[k], *b = &two->shape[two->count - 1u];
    return eits_pole_on_skin(ctx, a->x, a->y) && eits_pole_on_skin(ctx, b->x, b->y);
}

void eits_joint_set_apart(eits_context *ctx, eits_joint *j, uint64_t *macs)
{
    const eits_real away = EITS_JOINT_FAR_APART * eits_joint_usual(ctx, 0, 0, 0).radius;
    uint32_t rounds = 2;
    j->parameters = EITS_JOINT_DISC;
    j->cost = R(INFINITY);
    j->further = j->most =
        eits_joint_limit(ctx, j, *macs + eits_fit_limit(ctx, EITS_JOINT_SEARCH_WORK));
    for (uint32_t k = 0; k < j->count; ++k) {
        j->shape[k] = eits_joint_as_strong(&j->shape[k]);
        j->shape[k].e1 = j->shape[k].e2 = 0;
    }
    eits_joint best = *j;
    eits_pole_clear(ctx, j->count);
    for (uint32_t k = 0; k < j->count && *macs < j->most; ++k) {
        eits_joint_free_one(j, k);
        *macs += eits_joint_hold(ctx, j, rounds);
        rounds = 0;
        for (int d = 0; d < DIRECTIONS; ++d) {
            eits_joint two = *j;
            eits_real axis[2];
            direction(&j->shape[k], d, axis);
            two.shape[k].radius *= HALF_AREA;
            divide(&two, k, axis, away);
            if (!are_on_skin(ctx, &two, k))
                continue;
            two.cost = eits_joint_expect(ctx, &two, macs);
            if (two.cost < best.cost)
                best = two;
        }
        *macs += eits_joint_restore(ctx, j, k);
    }
    if (best.count > j->count) {
        eits_joint_free_all(&best);
        eits_pole_clear(ctx, best.count);
        eits_joint_descend(ctx, &best, 2, R(INFINITY), macs);
    }
    *j = best;
}

int eits_joint_are_two(const eits_shape *a, const eits_shape *b)
{
    const eits_real dx = a->x - b->x, dy = a->y - b->y,
                    apart = eits_sqrt(eits_fma(dx, dx, dy * dy)), p = eits_joint_strength(a),
                    q = eits_joint_strength(b);
    if (!(apart > 0))
        return 0;
    const eits_real touching = EITS_JOINT_SPLIT_APART * (reach(a, dx / apart, dy / apart) +
                                                         reach(b, dx / apart, dy / apart));
    return apart > touching && p * q > 0 && p / q > EITS_JOINT_SPLIT_WEAKER &&
           q / p > EITS_JOINT_SPLIT_WEAKER;
}

/* Two strong touches in its place are tried though the light one fits, and have to lower F by less.
 */
int eits_joint_is_large(const eits_context *ctx, const eits_shape *s)
{
    return eits_joint_is_light(s) && eits_joint_offset(ctx, s, 2) > EITS_JOINT_LIGHT_LARGE;
}

/* Return the least fall of F where shape k becomes two. Of noise two ellipses explain more beside a
 * disc than beside an ellipse, which has two numbers more. */
static eits_real needed_fall(const eits_context *ctx, const eits_joint *j, uint32_t k)
{
    const eits_real fall = eits_joint_is_large(ctx, &j->shape[k]) ? EITS_JOINT_SPLIT_LARGE
                           : j->parameters == EITS_JOINT_ELLIPSE  ? EITS_JOINT_SPLIT_SHAPED
                                                                  : EITS_JOINT_SPLIT_FALL;
    return eits_weighs_errors(ctx) ? EITS_JOINT_SPLIT_FAR * fall : fall;
}

/* Whether the two that shape k became stand, beside `one`: the frame then fits, or fits much better
 * than before: others may be wrong as well. */
static int stand(const eits_context *ctx, const eits_joint *one, const eits_joint *two, uint32_t k)
{
    const eits_real excess = eits_joint_excess(ctx, two);
    const int explains =
        excess < EITS_JOINT_FITTED || excess < EITS_JOINT_SPLIT_MOST * eits_joint_excess(ctx, one);
    return explains && one->cost - two->cost > needed_fall(ctx, one, k) * excess &&
           eits_joint_are_two(&two->shape[k], &two->shape[one->count]);
}

/* Shape k as two along the direction that the linearisation finds best, or along one by which the
 * data would fit; 0 where none promises enough. The normal equations are those about *best then. */
static int best_two(eits_context *ctx, const eits_joint *one, uint32_t k, eits_joint *best,
                    uint64_t *spent)
{
    const eits_real fits = eits_joint_freedom(ctx, one);
    eits_real least = one->cost - EITS_JOINT_SPLIT_HOPE * needed_fall(ctx, one, k);
    const int is_long = eits_pole_eta(&one->shape[k]) > EITS_JOINT_SPLIT_ETA,
              far = eits_weighs_errors(ctx) != 0;
    int found = 0;
    int current = 0;     /* whether the normal equations are those about *best */
    if (far && !is_long) /* the model's errors look like two fingers side by side, too */
        return 0;
    for (int d = 0; d < (far ? 1 : DIRECTIONS) && !(found && least < fits) && *spent < one->most;
         ++d) {
        /* what is clearly long is cut across first */
        eits_joint two = as_two(one, k, is_long ? DIRECTIONS - 1 - d : d);
        if (!are_on_skin(ctx, &two, k))
            continue;
        const eits_real expected = eits_joint_expect(ctx, &two, spent);
        current = expected < least;
        if (current) {
            *best = two;
            least = expected;
            found = 1;
        }
    }
    if (found && !current)
        (void)eits_joint_expect(ctx, best, spent);
    return found;
}

/* Shape k as two, where they stand; *j becomes that. */
static int try_two(eits_context *ctx, eits_joint *j, uint32_t k, uint64_t *spent)
{
    eits_joint two;
    if (!best_two(ctx, j, k, &two, spent))
        return 0;
    eits_joint_continue(ctx, &two, R(INFINITY), spent);
    if (!stand(ctx, j, &two, k))
        return 0;
    *j = two;
    return 1;
}

/* Whether a shape is worth trying as something else: where one is wrong the data fit worse than
 * noise does. */
static int is_doubtful(const eits_context *ctx, const eits_joint *j, uint32_t k)
{
    const eits_real more =
        j->parameters == EITS_JOINT_ELLIPSE ? EITS_JOINT_SPLIT_ELLIPSE : EITS_JOINT_SPLIT_MISFIT;
    return j->misfit > eits_joint_freedom(ctx, j) + more || eits_joint_is_large(ctx, &j->shape[k]);
}

/* Whether one more shape may be tried. A crowd of discs is searched instead (search.c). */
static int may_split(const eits_context *ctx, const eits_joint *j)
{
    const int crowd = j->parameters == EITS_JOINT_DISC && j->count >= EITS_JOINT_CROWD;
    return !crowd && j->count < ctx->options.max_touches &&
           (j->count + 1u) * EITS_JOINT_ELLIPSE <= EITS_JOINT_PARAMETERS;
}

void eits_joint_split(eits_context *ctx, eits_joint *j, uint64_t *macs)
{
    uint8_t tried[EITS_MAX_TOUCHES] = {0};
    uint32_t tries = 0, taken = 0, rounds = 1;
    j->further = j->most =
        eits_joint_limit(ctx, j, *macs + eits_fit_limit(ctx, EITS_JOINT_SPLIT_WORK));
    while (may_split(ctx, j) && tries < EITS_JOINT_SPLIT_TRIES + taken && *macs < j->most) {
        const uint32_t k = longest(j, tried);
        if (k == j->count)
            break;
        tried[k] = 1;
        if (!is_doubtful(ctx, j, k))
            continue;
        if (tries++ == 0)
            eits_joint_keep(ctx, j);
        eits_joint_free_one(j, k);
        *macs += eits_joint_hold(ctx, j, rounds);
        rounds = 0;
        if (eits_joint_turn(ctx, j, k, EITS_JOINT_SHAPE_FALL, macs) || try_two(ctx, j, k, macs)) {
            ++taken;
            rounds = 1;
        } else
            *macs += eits_joint_restore(ctx, j, k);
    }
    eits_joint_free_all(j);
    if (taken > 0)
        eits_joint_descend(ctx, j, 1, R(INFINITY), macs);
    else if (tries > 0)
        eits_joint_back(ctx, j);
}
