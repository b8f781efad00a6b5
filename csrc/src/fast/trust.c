/* Whether to believe the solver's touches of a frame, or those that drives follow. */
#include "fast/fast.h"

#include "fast/constants.h"

int eits_fast_decides(const eits_fast *fast)
{
    const eits_info *info = &fast->ctx->info;
    return fast->unexplained_frames > EITS_FAST_FRAMES &&
           info->unexplained < EITS_FAST_DECIDES_LEFT &&
           (info->diagnostics & ~(uint32_t)EITS_DIAGNOSTIC_CROWDED) == 0;
}

uint32_t eits_fast_whole_palm(const eits_fast *fast, const eits_touch *found,
                              const eits_real (*at)[2], uint32_t count, const eits_real *place)
{
    const eits_real room = fast_room_of_mm(fast, FAST_PALM_MM2);
    uint32_t n = 0;
    while (n < count && !(fast_is_whole_palm(fast, &found[n]) &&
                          fast_distance2(at[n], place) < fast_square(room)))
        ++n;
    return n;
}

uint32_t eits_fast_between(const eits_fast *fast, const eits_real (*places)[2], uint32_t count,
                           const eits_real *found)
{
    uint32_t near = 0;
    for (uint32_t k = 0; k < count && fast->frame_explained; ++k) {
        const eits_real far2 = fast_distance2(places[k], found);
        if (far2 < fast_square(EITS_FAST_AGREE_MM))
            return 0;
        near |= (uint32_t)(far2 < fast_square(EITS_FAST_APART_MM)) << k;
    }
    return (near & (near - 1)) != 0 ? near : 0;
}

/* Return 1 if the solver found two touches or more within a palm's reach of one that drives follow.
 */
static int is_several(const eits_fast *fast, const eits_touch *found, uint32_t count)
{
    const eits_real room2 = fast_square(fast_room_of_mm(fast, FAST_PALM_MM2));
    uint32_t most = 0;
    for (uint32_t k = 0; k < fast->n_followed; ++k) {
        const eits_real place[2] = {fast->followed[k].x_mm, fast->followed[k].y_mm};
        uint32_t near = 0;
        for (uint32_t n = 0; n < count; ++n)
            near +=
                fast_distance2(place, (const eits_real[2]){found[n].x_mm, found[n].y_mm}) < room2;
        most = near > most ? near : most;
    }
    return most > 1;
}

int eits_fast_is_smeared(const eits_fast *fast, const eits_touch *found, uint32_t count)
{
    int smeared = fast->smeared && !eits_fast_decides(fast) &&
                  (fast->smeared != FAST_GROWS || is_several(fast, found, count));
    for (uint32_t n = 0; n < count; ++n)
        smeared &= !fast_is_whole_palm(fast, &found[n]);
    return smeared;
}
