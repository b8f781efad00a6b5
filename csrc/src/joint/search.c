/* Find the number of touches in a crowd. The image often shows too few or too many of them.
 *
 * A touch that the image does not show is sought in what the others leave of the data. They have
 * taken up most of its answer, so that the greatest rest is seldom where it lies. What the touches
 * leave is reduced as the frame's data are and laid over the pixels (S'P r, the first gradient of
 * the solver). A disc at each of the greatest peaks then gets a column beside the normal equations:
 * by how much F falls with it, all others free, is linearised. The best is fitted with the others,
 * and stays where F falls by enough. A disc without which F hardly rises goes. */
#include "joint/joint.h"

#include "base/vec.h"
#include "context/places.h"
#include "context/products.h"
#include "frame/fold.h"
#include "frame/whitening.h"
#include "joint/constants.h"
#include "solve/violations.h"

enum {
    CANDIDATES = 8,
    SCORED = 3 /* evaluations that it takes to score them and to fit the best */
};

/* Whether a place lies within a shape. */
static int is_within(const eits_joint *j, eits_real x, eits_real y)
{
    for (uint32_t k = 0; k < j->count; ++k) {
        const eits_shape *s = &j->shape[k];
        const eits_real dx = x - s->x, dy = y - s->y;
        if (eits_fma(dx, dx, dy * dy) < s->radius * s->radius)
            return 1;
    }
    return 0;
}

/* S' of what the shapes leave, over the pixels. */
static const eits_real *rest_by_pixel(eits_context *ctx, const eits_scratch *scratch, eits_joint *j,
                                      uint64_t *macs)
{
    const uint32_t folds = ctx->model->n_folded;
    j->free_count = 0;
    *macs += eits_joint_hold(ctx, j, 1);
    for (uint32_t k = 0; k < folds; ++k) {
        scratch->index[k] = k;
        scratch->value[k] = ctx->joint.weight[k] > 0 ? ctx->joint.rest[k] : 0;
    }
    *macs += eits_reduce(ctx, scratch, folds, scratch->row[5]);
    eits_apply_t(ctx, eits_adjoint(ctx, scratch->row[5], scratch->row[6]), scratch->pixel[0]);
    *macs += (uint64_t)ctx->model->n_pixels * ctx->model->rank + eits_adjoint_macs(ctx);
    return scratch->pixel[0];
}

/* The greatest peaks outside the shapes, of a sign that is looked for, as discs of the expected
 * size; returns how many. */
static uint32_t find_candidates(const eits_context *ctx, const eits_scratch *scratch,
                                const eits_joint *j, const eits_real *map, eits_shape *found)
{
    const eits_model *model = ctx->model;
    const eits_sign sign = ctx->options.sign;
    eits_real height[CANDIDATES], *size = scratch->pixel[1];
    uint32_t count = 0;
    for (uint32_t p = 0; p < model->n_pixels; ++p)
        size[p] = sign == EITS_SIGN_INCREASE   ? map[p]
                  : sign == EITS_SIGN_DECREASE ? -map[p]
                                               : eits_fabs(map[p]);
    for (uint32_t p = 0; p < model->n_pixels; ++p) {
        const eits_real x = (eits_real)model->pixel[p].ix + R(0.5),
                        y = (eits_real)model->pixel[p].iy + R(0.5);
        if (!(size[p] > 0) || !eits_is_peak(ctx, size, p) || is_within(j, x, y))
            continue;
        uint32_t at = count;
        while (at > 0 && size[p] > height[at - 1u])
            --at;
        if (at == CANDIDATES)
            continue;
        count += count < CANDIDATES;
        for (uint32_t i = count - 1u; i > at; --i) {
            height[i] = height[i - 1u];
            found[i] = found[i - 1u];
        }
        height[at] = size[p];
        found[at] = eits_joint_usual(ctx, x, y, map[p] < 0);
    }
    return count;
}

/* *j with the candidate by which F falls most, and by more than `least`; 0 where there is none. */
static int with_best(eits_context *ctx, const eits_scratch *scratch, eits_joint *j, eits_real least,
                     eits_joint *more, uint64_t *macs)
{
    const uint32_t spare = EITS_JOINT_PARAMETERS - j->count * j->parameters,
                   slots = EITS_MAX_TOUCHES - j->count;
    eits_shape found[CANDIDATES];
    eits_real gain[CANDIDATES], scale[CANDIDATES];
    uint32_t best = CANDIDATES,
             count = find_candidates(ctx, scratch, j, rest_by_pixel(ctx, scratch, j, macs), found);
    count = count < spare ? count : spare;
    count = count < slots ? count : slots;
    for (uint32_t i = 0; i < count; ++i)
        j->shape[j->count + i] = found[i];
    eits_joint_free_all(j);
    *macs += eits_joint_score(ctx, j, count, gain, scale);
    for (uint32_t i = 0; i < count; ++i) {
        if (scale[i] < EITS_JOINT_ADD_STRENGTH || !(gain[i] > least))
            continue;
        least = gain[i];
        best = i;
    }
    if (best == CANDIDATES)
        return 0;
    *more = *j;
    more->shape[j->count] = j->shape[j->count + best];
    more->shape[j->count].radius *= eits_sqrt(eits_clamp(scale[best], 0, EITS_JOINT_ADD_MOST));
    more->from[j->count] = EITS_MAX_TOUCHES + j->count; /* of no disc of the fit's */
    ++more->count;
    eits_joint_free_all(more);
    return 1;
}

/* Whether the shapes leave more than noise. */
static int leaves_more(const eits_context *ctx, const eits_joint *j)
{
    return j->misfit > EITS_JOINT_SEARCHED * eits_joint_freedom(ctx, j);
}

/* Whether they do, and there is room for one more. Where they leave very
 * much they are far from any minimum. */
static int goes_on(const eits_context *ctx, const eits_joint *j)
{
    return j->count < ctx->options.max_touches &&
           (j->count + 1u) * j->parameters <= EITS_JOINT_PARAMETERS && leaves_more(ctx, j) &&
           j->misfit < EITS_JOINT_SEARCHABLE * ctx->joint.energy;
}

/* One more disc; *j becomes that where F falls by enough. */
static int try_more(eits_context *ctx, const eits_scratch *scratch, eits_joint *j, uint64_t *macs)
{
    const eits_real fall =
        EITS_JOINT_SPLIT_FALL * (eits_weighs_errors(ctx) ? EITS_JOINT_SPLIT_FAR : 1);
    eits_joint more;
    if (!with_best(ctx, scratch, j, fall, &more, macs))
        return 0;
    eits_pole_lift(ctx, j->count);
    eits_joint_descend(ctx, &more, 1, R(INFINITY), macs);
    if (!(j->cost - more.cost > fall * eits_joint_excess(ctx, &more)))
        return 0;
    *j = more;
    return 1;
}

/* Return the shape that F needs least: without it F rises by less than without any other. */
static uint32_t weakest(const eits_joint *j, const eits_joint_known *known)
{
    uint32_t of = 0;
    for (uint32_t k = 1; k < j->count; ++k)
        of = known[k].rise < known[of].rise ? k : of;
    return of;
}

static void leave_out(eits_joint *j, uint32_t k)
{
    --j->count;
    for (uint32_t l = k; l < j->count; ++l) {
        j->shape[l] = j->shape[l + 1u];
        j->from[l] = j->from[l + 1u];
    }
    eits_joint_free_all(j);
}

/* Leave out the weakest shape where the data do without it; *j becomes that. */
static int try_fewer(eits_context *ctx, eits_joint *j, uint64_t *macs)
{
    const eits_joint_known *known = eits_joint_places(ctx, j, macs);
    const uint32_t k = weakest(j, known);
    if (j->count < 2u || !(known[k].rise < EITS_JOINT_NEEDED * eits_joint_excess(ctx, j)))
        return 0;
    eits_joint fewer = *j;
    leave_out(&fewer, k);
    eits_joint_descend(ctx, &fewer, 1, R(INFINITY), macs);
    if (!(fewer.cost < j->cost + EITS_JOINT_NEEDED * eits_joint_excess(ctx, &fewer)))
        return 0;
    *j = fewer;
    return 1;
}

/* Two near shapes that are rather one touch, k after i; 0 if there are none. The image may show a
 * touch at the rim as two. */
static int find_halves(const eits_joint *j, uint32_t *first, uint32_t *second)
{
    for (uint32_t k = 1; k < j->count; ++k) {
        for (uint32_t i = 0; i < k; ++i) {
            const eits_shape *a = &j->shape[i], *b = &j->shape[k];
            if (!eits_joint_near(a, b, EITS_JOINT_CLEAR_APART) || eits_joint_are_two(a, b))
                continue;
            *first = i;
            *second = k;
            return 1;
        }
    }
    return 0;
}

/* Two such shapes as one of their strength; *j becomes that where the data do with it. */
static int try_merged(eits_context *ctx, eits_joint *j, uint64_t *macs)
{
    uint32_t i, k;
    if (!find_halves(j, &i, &k))
        return 0;
    eits_joint merged = *j;
    eits_shape *a = &merged.shape[i], *b = &merged.shape[k];
    const eits_real p = eits_joint_strength(a), q = eits_joint_strength(b), share = q / (p + q);
    a->x = eits_fma(share, b->x - a->x, a->x);
    a->y = eits_fma(share, b->y - a->y, a->y);
    a->amplitude = eits_fma(share, b->amplitude - a->amplitude, a->amplitude);
    a->radius = eits_sqrt((p + q) / a->amplitude);
    leave_out(&merged, k);
    eits_pole_clear(ctx, merged.count);
    eits_joint_descend(ctx, &merged, 2, R(INFINITY), macs);
    if (merged.cost < j->cost + EITS_JOINT_NEEDED * eits_joint_excess(ctx, &merged)) {
        *j = merged;
        return 1;
    }
    *macs += eits_joint_return_to(ctx, j);
    return 0;
}

/* Try each light shape as a strong one of the same strength; what lowers F stands. In a crowd,
 * where a touch is missing, its neighbours have become light to make up for it. */
static int try_strong(eits_context *ctx, eits_joint *j, uint64_t *macs)
{
    uint32_t turned = 0, rounds = 1;
    for (uint32_t k = 0; k < j->count; ++k) {
        if (!eits_joint_is_light(&j->shape[k]) || *macs > j->most)
            continue;
        eits_joint_free_one(j, k);
        *macs += eits_joint_hold(ctx, j, rounds);
        rounds = 0;
        if (eits_joint_turn(ctx, j, k, EITS_JOINT_SHAPE_FALL, macs)) {
            ++turned;
            rounds = 1;
        } else
            *macs += eits_joint_restore(ctx, j, k);
    }
    eits_joint_free_all(j);
    if (turned > 0)
        eits_joint_descend(ctx, j, 1, R(INFINITY), macs);
    return turned > 0;
}

void eits_joint_search(eits_context *ctx, const eits_scratch *scratch, eits_joint *j,
                       uint64_t *macs)
{
    j->further = j->most =
        eits_joint_limit(ctx, j, *macs + eits_fit_limit(ctx, EITS_JOINT_SEARCH_WORK));
    while (*macs + ctx->joint.evaluated < j->most && try_merged(ctx, j, macs))
        continue;
    if (leaves_more(ctx, j) && !(goes_on(ctx, j) && try_strong(ctx, j, macs)))
        *macs += eits_joint_evaluate(ctx, j, 1);
    while (*macs < j->most &&
           (try_fewer(ctx, j, macs) ||
            (goes_on(ctx, j) && *macs + SCORED * ctx->joint.evaluated < j->most &&
             try_more(ctx, scratch, j, macs))))
        continue;
}
