/* Strong or light: where the data leave both open, each shape is tried as the other kind.
 *
 * A light touch and a smaller strong one of the same strength answer alike but for the higher
 * orders, so F has a minimum for each kind, and the first guess, by the priors alone, may lie in
 * the wrong one. On a skin that is far from the model, and where the shapes do not fit, errors hide
 * the higher orders, and the guess stays. */
#include "joint/joint.h"

#include "context/places.h"
#include "joint/constants.h"

int eits_joint_turn(eits_context *ctx, eits_joint *j, uint32_t k, eits_real fall, uint64_t *macs)
{
    eits_joint other = *j;
    other.shape[k] = eits_joint_as_other(&j->shape[k]);
    if (eits_joint_expect(ctx, &other, macs) < j->cost - fall) {
        eits_joint_continue(ctx, &other, R(INFINITY), macs);
        if (other.cost < j->cost - fall) {
            *j = other;
            return 1;
        }
    }
    return 0;
}

void eits_joint_choose_kinds(eits_context *ctx, eits_joint *j, uint64_t settled, uint64_t *macs)
{
    uint8_t open[EITS_MAX_TOUCHES];
    uint32_t tried = 0, turned = 0;
    if (eits_weighs_errors(ctx) || !(eits_joint_excess(ctx, j) < EITS_JOINT_FITTED))
        return;
    const eits_joint_known *known = eits_joint_places(ctx, j, macs);
    const eits_real most = EITS_JOINT_OTHER_RISE * eits_joint_excess(ctx, j);
    for (uint32_t k = 0; k < j->count; ++k)
        open[k] = known[k].other_rise < most;
    for (uint32_t k = 0; k < j->count; ++k) {
        if (!open[k] || *macs + settled / 2u > j->most)
            continue;
        if (tried++ == 0)
            eits_joint_keep(ctx, j);
        eits_joint_free_one(j, k);
        *macs += eits_joint_hold(ctx, j, 1);
        if (eits_joint_turn(ctx, j, k, EITS_JOINT_SETTLED, macs))
            ++turned;
        else
            *macs += eits_joint_restore(ctx, j, k);
    }
    if (tried == 0)
        return;
    eits_joint_free_all(j);
    if (turned > 0)
        eits_joint_descend(ctx, j, 1, R(INFINITY), macs);
    else
        eits_joint_back(ctx, j);
}
