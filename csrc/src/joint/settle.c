/* Which model of the touches: discs, ellipses, or one touch as two. */
#include "joint/joint.h"

#include "joint/constants.h"

/* As ellipses, where discs leave more than noise; *j becomes that where F falls by enough. */
static void try_ellipses(eits_context *ctx, eits_joint *j, uint64_t *macs)
{
    eits_joint shaped = *j;
    shaped.parameters = EITS_JOINT_ELLIPSE;
    eits_joint_descend(ctx, &shaped, 1, R(INFINITY), macs);
    const eits_real needed =
        EITS_JOINT_SHAPE_FALL + EITS_JOINT_SHAPE_FALL_EACH * (eits_real)j->count;
    if (j->cost - shaped.cost > needed * eits_joint_excess(ctx, &shaped)) {
        *j = shaped;
        return;
    }
    eits_pole_clear(ctx, j->count);
    *macs += eits_joint_evaluate(ctx, j, 2);
}

uint64_t eits_joint_settle(eits_context *ctx, eits_joint *j)
{
    const eits_real folds = (eits_real)eits_joint_folds(ctx);
    const uint64_t begin = j->spent;
    uint64_t macs = begin;
    eits_pole_clear(ctx, j->count);
    eits_joint_free_all(j);
    eits_joint_descend(ctx, j, 2, folds + EITS_JOINT_HOPELESS, &macs);
    if (j->parameters == EITS_JOINT_DISC &&
        j->count * EITS_JOINT_ELLIPSE <= EITS_JOINT_PARAMETERS &&
        j->misfit > folds + EITS_JOINT_FITS && macs + 3u * (macs - begin) < EITS_JOINT_WORK)
        try_ellipses(ctx, j, &macs);
    macs += eits_joint_split(ctx, j, macs);
    eits_joint_choose_kinds(ctx, j, macs - begin, &macs);
    j->spent = macs;
    return macs - begin;
}
