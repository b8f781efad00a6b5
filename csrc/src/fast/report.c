/* A frame's touches: those that drives follow, with what the whole-frame solver finds of them. */
#include "fast/fast.h"

/* The places of touches, mm. */
static void places_of(const eits_touch *touches, uint32_t count, eits_real (*at)[2])
{
    for (uint32_t n = 0; n < count; ++n) {
        at[n][0] = touches[n].x_mm;
        at[n][1] = touches[n].y_mm;
    }
}

/* A touch that the solver has not found in this frame: what drives know of it. */
static eits_touch alone(const eits_fast_touch *t)
{
    return (eits_touch){.id = t->id,
                        .x_mm = t->x_mm,
                        .y_mm = t->y_mm,
                        .radius_mm = t->radius_mm,
                        .strength_s_per_m_mm2 = t->strength_s_per_m_mm2,
                        .x_variance_mm2 = t->x_variance_mm2,
                        .xy_covariance_mm2 = t->xy_covariance_mm2,
                        .y_variance_mm2 = t->y_variance_mm2,
                        .confirmed = t->confirmed};
}

/* Sort by strength, the strongest first; touches of equal strength keep their order. */
static void sort(eits_touch *touches, uint32_t count)
{
    for (uint32_t k = 1; k < count; ++k) {
        const eits_touch moved = touches[k];
        uint32_t at = k;
        for (; at > 0 && eits_fabs(touches[at - 1].strength_s_per_m_mm2) <
                             eits_fabs(moved.strength_s_per_m_mm2);
             --at)
            touches[at] = touches[at - 1];
        touches[at] = moved;
    }
}

eits_status eits_fast_report(const eits_fast_touch *tracked, uint32_t n_tracked,
                             const eits_touch *found, uint32_t n_found, const eits_touch *before,
                             uint32_t n_before, eits_touch *touches, uint32_t *count)
{
    uint8_t taken[EITS_MAX_TOUCHES] = {0}, used[EITS_MAX_TOUCHES] = {0};
    if (touches == NULL || count == NULL || n_tracked > EITS_FAST_TOUCHES ||
        n_found > EITS_MAX_TOUCHES || n_before > EITS_MAX_TOUCHES)
        return EITS_E_ARGUMENT;
    eits_real here[EITS_MAX_TOUCHES][2], there[EITS_MAX_TOUCHES][2];
    places_of(found, n_found, here);
    places_of(before, n_before, there);
    *count = 0;
    for (uint32_t k = 0; k < n_tracked; ++k) {
        const eits_fast_touch *t = &tracked[k];
        const eits_real place[2] = {t->x_mm, t->y_mm};
        const uint32_t n = eits_fast_nearest(place, (const eits_real(*)[2])here, taken, n_found);
        touches[*count] = alone(t);
        if (n < n_found) {
            taken[n] = 1;
            touches[*count] = found[n];
            touches[*count].id = t->id;
            touches[*count].confirmed = 1;
        }
        ++*count;
    }
    /* A touch that drives do not follow, such as the sixth, is reported where the frame before
     * showed it, too: a single frame may show a touch that landed while it was scanned aside. */
    for (uint32_t n = 0; n < n_found && *count < EITS_MAX_TOUCHES; ++n) {
        const uint32_t last =
            taken[n] ? n_before
                     : eits_fast_nearest(here[n], (const eits_real(*)[2])there, used, n_before);
        if (last == n_before)
            continue;
        used[last] = 1;
        touches[*count] = found[n];
        touches[*count].id += EITS_FAST_FRAME_IDS;
        touches[*count].confirmed = 1;
        ++*count;
    }
    sort(touches, *count);
    return EITS_OK;
}
