/* Decide which model describes the touches: discs, ellipses, or one touch as two. */
#include "joint/joint.h"

#include "context/places.h"
#include "joint/constants.h"

/* As ellipses, where discs leave more than noise; *j becomes that where F falls by enough. Nothing
 * is fitted where the linearisation about discs does not promise it. */
static void try_ellipses(eits_context *ctx, eits_joint *j, uint64_t *macs)
{
    eits_joint shaped = *j;
    const eits_real needed =
        EITS_JOINT_SHAPE_FALL + EITS_JOINT_SHAPE_FALL_EACH * (eits_real)j->count;
    shaped.parameters = EITS_JOINT_ELLIPSE;
    eits_joint_keep(ctx, j);
    if (j->cost - eits_joint_expect(ctx, &shaped, macs) > EITS_JOINT_SHAPE_HOPE * needed) {
        eits_joint_continue(ctx, &shaped, EITS_JOINT_LOST * eits_joint_freedom(ctx, &shaped), macs);
        if (j->cost - shaped.cost > needed * eits_joint_excess(ctx, &shaped)) {
            *j = shaped;
            return;
        }
    }
    eits_joint_back(ctx, j);
}

/* Whether touches may be sought. On a sheet that has drifted the image shows many light touches,
 * which leave much; there nothing is sought. */
static int may_search(const eits_context *ctx, const eits_joint *j)
{
    uint32_t strong = 0;
    for (uint32_t k = 0; k < j->count; ++k)
        strong += !eits_joint_is_light(&j->shape[k]);
    return j->searches &&
           (2u * strong > j->count || j->misfit < EITS_JOINT_LIGHT_SEARCHABLE * ctx->joint.energy);
}

/* Whether one of few shapes may stand for two touches: they leave more than noise, or one of them
 * is light and so large that it fits what two touches answer. Much more than noise is left where a
 * finger lands or slides during the scan; there nothing is sought. */
static int few_may_miss(const eits_context *ctx, const eits_joint *j)
{
    int open = j->misfit > EITS_JOINT_FAR_LEAVES * eits_joint_freedom(ctx, j);
    for (uint32_t k = 0; k < j->count; ++k)
        open |= eits_joint_is_large(ctx, &j->shape[k]);
    return open && eits_joint_excess(ctx, j) < EITS_JOINT_FAR_MOST && j->count > 1 &&
           j->count < EITS_JOINT_CROWD && j->count < ctx->options.max_touches &&
           may_search(ctx, j) && !eits_weighs_errors(ctx);
}

/* Whether touches are sought: in a crowd some may be missing, or too many. */
static int crowd_may_miss(const eits_context *ctx, const eits_joint *j)
{
    return j->count >= EITS_JOINT_CROWD && may_search(ctx, j);
}

/* Whether the last shape is far from all others. While a finger lands at the rim, a second shape
 * beside it explains the rows that were measured earlier. */
static int is_far_apart(const eits_context *ctx, const eits_joint *j)
{
    const eits_real least = EITS_JOINT_FAR_LEAST * eits_joint_usual(ctx, 0, 0, 0).radius;
    const eits_shape *last = &j->shape[j->count - 1u];
    for (const eits_shape *one = j->shape; one < last; ++one) {
        const eits_real dx = last->x - one->x, dy = last->y - one->y;
        if (!(eits_fma(dx, dx, dy * dy) > least * least))
            return 0;
    }
    return 1;
}

/* Whether F falls by more than `fall`, times the excess over noise, if `found` takes j's place. */
static int is_better(const eits_context *ctx, const eits_joint *j, const eits_joint *found,
                     eits_real fall)
{
    return j->cost - found->cost > fall * eits_joint_excess(ctx, found);
}

/* Search from `discs`; *j becomes what is found, where that fits better, or needs fewer touches. */
static void try_search(eits_context *ctx, const eits_scratch *scratch, eits_joint *j,
                       const eits_joint *discs, uint64_t *macs)
{
    eits_joint found = *discs;
    eits_joint_keep(ctx, j);
    eits_joint_search(ctx, scratch, &found, macs);
    const int fewer = found.count < j->count;
    if (is_better(ctx, j, &found, fewer ? -EITS_JOINT_NEEDED : EITS_JOINT_SPLIT_FALL))
        *j = found;
    else
        eits_joint_back(ctx, j);
}

/* One of the few shapes of `first` as two; *j becomes that, where it fits better. */
static void try_apart(eits_context *ctx, eits_joint *j, const eits_joint *first, uint64_t *macs)
{
    eits_joint found = *first;
    eits_joint_keep(ctx, j);
    eits_joint_set_apart(ctx, &found, macs);
    if (is_better(ctx, j, &found, EITS_JOINT_SPLIT_FALL) && is_far_apart(ctx, &found))
        *j = found;
    else
        eits_joint_back(ctx, j);
}

void eits_joint_settle(eits_context *ctx, const eits_scratch *scratch, eits_joint *j,
                       uint64_t *macs)
{
    const eits_real folds = (eits_real)eits_joint_folds(ctx);
    const uint64_t begin = *macs, most = eits_fit_limit(ctx, EITS_JOINT_WORK),
                   further = j->searches ? eits_fit_limit(ctx, EITS_JOINT_FURTHER) : 0;
    j->most = eits_joint_limit(ctx, j, begin + most);
    j->further = eits_joint_limit(ctx, j, begin + most + further);
    eits_pole_clear(ctx, j->count);
    eits_joint_free_all(j);
    eits_joint_descend(ctx, j, 2, folds + EITS_JOINT_HOPELESS, macs);
    j->further = j->most;
    const eits_joint first = *j;
    if (j->parameters == EITS_JOINT_DISC) {
        if (j->count * EITS_JOINT_ELLIPSE <= EITS_JOINT_PARAMETERS &&
            j->misfit > folds + EITS_JOINT_FITS && 3u * (*macs - begin) < most && *macs < j->most)
            try_ellipses(ctx, j, macs);
        if (crowd_may_miss(ctx, j) && *macs <= eits_joint_limit(ctx, j, UINT64_MAX))
            try_search(ctx, scratch, j, &first, macs);
    }
    if (few_may_miss(ctx, j) && *macs <= eits_joint_limit(ctx, j, UINT64_MAX))
        try_apart(ctx, j, &first, macs);
    if (eits_joint_excess(ctx, j) < EITS_JOINT_LOST)
        eits_joint_split(ctx, j, macs);
    eits_joint_choose_kinds(ctx, j, *macs - begin, macs);
}
