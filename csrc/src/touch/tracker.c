/* Touches over time: which of this frame are those of the last, which are believed, where they are.
 *
 * A frame by itself gives places that jitter by its noise, and now and then a touch that is none.
 * Over frames two things help: a touch stays near where it was, and noise does not. So a doubtful
 * touch is tentative until it was found in track_confirm frames on end, a clear one is reported at
 * once, and one that was reported keeps its id for track_hold frames without being found.
 *
 * The filter is Kalman's (Trans. ASME, J. Basic Eng. 82 (1960) 35-45) for a place of constant
 * velocity, the same along both axes; its noise is what each touch's own strength over the frame's
 * noise makes of it. Both axes have the same variances, so three numbers, the covariance of place
 * and velocity, serve for either, and no matrix is inverted:
 *
 *     predict   p += v,  P += 2 C + V + q / 4,  C += V + q / 2,  V += q
 *     update    K = P / (P + R),  p += K (found - p),  v += C / (P + R) (found - p)
 *
 * with P, C, V place_mm2, both_mm2, speed_mm2, q the square of the velocity's change a frame and R
 * the variance of a found place. Time is counted in frames: limits and variances are in follow_mm,
 * which the caller sets for the frame rate.
 *
 * Invariants: at most EITS_MAX_TOUCHES are followed; no id is 0; whatever
 * would be no number or off the skin starts again from what was found. */
#include "touch/disc.h"

#include "base/vec.h"
#include "touch/constants.h"

enum { NONE = EITS_MAX_TOUCHES };

static eits_real square(eits_real value)
{
    return value * value;
}

/* What S'y this touch has by itself, about: the whole frame's by its fraction of the energy. */
static eits_real own_lambda(const eits_context *ctx, const eits_touch *touch)
{
    return ctx->info.lambda_max * eits_sqrt(touch->explained);
}

/* Fainter than noise: it may be there all the same when it is not found. */
static int is_faint(const eits_context *ctx, const eits_touch *touch)
{
    return own_lambda(ctx, touch) < ctx->info.lambda_noise;
}

static int is_finite(const eits_followed *f)
{
    const eits_real numbers[] = {
        f->touch.x_mm, f->touch.y_mm, f->touch.radius_mm, f->touch.strength_s_per_m_mm2,
        f->vx_mm,      f->vy_mm,      f->place_mm2,       f->both_mm2,
        f->speed_mm2};
    for (size_t k = 0; k < sizeof numbers / sizeof numbers[0]; ++k) {
        if (!eits_is_finite(numbers[k]))
            return 0;
    }
    return 1;
}

static int on_skin(const eits_context *ctx, const eits_touch *touch)
{
    const eits_disc disc = {
        .x_mm = touch->x_mm, .y_mm = touch->y_mm, .radius_mm = touch->radius_mm};
    return eits_disc_on_skin(ctx, &disc);
}

/* ---- places in time ---- */

/* The variance of a found place, mm^2. */
static eits_real place_variance(const eits_context *ctx, const eits_touch *found)
{
    const eits_real pixel = (eits_real)ctx->model->pixel_mm, own = own_lambda(ctx, found);
    /* The weaker a touch over the noise, the less sure its place: in proportion, as for the centre
     * of any noisy peak. */
    const eits_real noise = own > 0 ? ctx->info.lambda_noise / own : 0;
    return eits_fma(square(ctx->options.track_smooth * noise), square(pixel),
                    square(EITS_MIN_DEVIATION * pixel));
}

/* A new touch has no velocity yet, but one of unknown size: so the next place it is found at is
 * believed. */
static eits_followed track_start(const eits_context *ctx, const eits_touch *found)
{
    return (eits_followed){.touch = *found,
                           .place_mm2 = place_variance(ctx, found),
                           .speed_mm2 = square(EITS_FIRST_SPEED * ctx->options.follow_mm),
                           .seen = 1,
                           .faint = (uint32_t)is_faint(ctx, found)};
}

/* A frame on; a touch that would leave the skin stays where it is. */
static void predict(const eits_context *ctx, eits_followed *f)
{
    eits_followed next = *f;
    const eits_real change = square(EITS_SPEED_CHANGE * ctx->options.follow_mm);
    if (!(ctx->options.track_smooth > 0))
        return;
    next.touch.x_mm += f->vx_mm;
    next.touch.y_mm += f->vy_mm;
    /* Constant velocity, disturbed by a random change within each frame; the covariances of place
     * and velocity grow with it. */
    next.place_mm2 += eits_fma(R(2), f->both_mm2, f->speed_mm2) + R(0.25) * change;
    next.both_mm2 += eits_fma(R(0.5), change, f->speed_mm2);
    next.speed_mm2 += change;
    if (is_finite(&next) && on_skin(ctx, &next.touch))
        *f = next;
}

/* What is known of a touch, with what was found of it. Where that would be no number, or off the
 * skin, it starts again. */
static eits_followed updated(const eits_context *ctx, const eits_followed *before,
                             const eits_touch *found)
{
    eits_followed next = track_start(ctx, found);
    next.touch.id = before->touch.id;
    next.seen =
        before->seen < EITS_KNOWN_FRAMES + EITS_MAX_TRACK_FRAMES ? before->seen + 1 : before->seen;
    if (!(ctx->options.track_smooth > 0))
        return next;
    const eits_followed restarted = next;
    const eits_touch *old = &before->touch;
    const eits_real total = before->place_mm2 + next.place_mm2;
    /* Kalman's gains for a measured place: the more is known, the less a new place moves it. */
    const eits_real gain = before->place_mm2 / total, speed_gain = before->both_mm2 / total;
    const eits_real dx = found->x_mm - old->x_mm, dy = found->y_mm - old->y_mm;
    next.touch.x_mm = eits_fma(gain, dx, old->x_mm);
    next.touch.y_mm = eits_fma(gain, dy, old->y_mm);
    next.touch.radius_mm = eits_fma(gain, found->radius_mm - old->radius_mm, old->radius_mm);
    next.touch.strength_s_per_m_mm2 = eits_fma(
        gain, found->strength_s_per_m_mm2 - old->strength_s_per_m_mm2, old->strength_s_per_m_mm2);
    next.vx_mm = eits_fma(speed_gain, dx, before->vx_mm);
    next.vy_mm = eits_fma(speed_gain, dy, before->vy_mm);
    next.place_mm2 = eits_fma(-gain, before->place_mm2, before->place_mm2);
    next.both_mm2 = eits_fma(-gain, before->both_mm2, before->both_mm2);
    next.speed_mm2 = eits_fma(-speed_gain, before->both_mm2, before->speed_mm2);
    return is_finite(&next) && on_skin(ctx, &next.touch) ? next : restarted;
}

/* ---- which is which ---- */

/* Nearest pairs first, among those that were reported or among the others: owner[k] is who the
 * found touch k belongs to. */
static void pair(const eits_context *ctx, const eits_touch *found, uint32_t count, int reported,
                 uint32_t *owner)
{
    uint8_t taken[EITS_MAX_TOUCHES] = {0};
    /* Greedy, nearest first: with touches further apart than they move in a frame, it is the best
     * assignment, too. */
    for (;;) { /* at most EITS_MAX_TOUCHES pairs */
        const eits_real reach = square(reported ? ctx->options.follow_mm
                                                : EITS_TENTATIVE_REACH * ctx->options.follow_mm);
        eits_real nearest = reach;
        uint32_t from = NONE, to = NONE;
        for (uint32_t k = 0; k < count; ++k) {
            for (uint32_t l = 0; owner[k] == NONE && l < ctx->tracker.count; ++l) {
                const eits_touch *one = &ctx->tracker.followed[l].touch;
                const eits_real dx = found[k].x_mm - one->x_mm, dy = found[k].y_mm - one->y_mm;
                const eits_real squared = eits_fma(dx, dx, dy * dy);
                if (!taken[l] && (one->id != 0) == reported && squared <= nearest) {
                    nearest = squared;
                    from = l;
                    to = k;
                }
            }
        }
        if (to == NONE)
            return;
        owner[to] = from;
        taken[from] = 1;
    }
}

/* An id for a touch that may be reported now.
 *
 * A touch that is clear beyond doubt is reported at once; others once they have been seen often
 * enough that noise would not have been. */
static void name(eits_context *ctx, eits_followed *f)
{
    const int clear = own_lambda(ctx, &f->touch) >= EITS_SURE_CLEARNESS * ctx->info.lambda_noise &&
                      f->touch.explained >= EITS_SURE_FRACTION;
    if (f->touch.id != 0 || (f->seen < ctx->options.track_confirm && !clear))
        return;
    f->touch.id = ctx->tracker.next_id;
    ctx->tracker.next_id =
        ctx->tracker.next_id == UINT32_MAX ? 1 : ctx->tracker.next_id + 1; /* 0 is never an id */
}

/* Those that were found, in their order, then those that are waited for, as far as there is room.
 *
 * Those found in this frame come first and keep their places in the list; those that were not
 * are kept as far as there is room, so that a touch that flickers keeps its id. */
static void update_tracks(eits_context *ctx, const eits_touch *found, uint32_t count,
                          const uint32_t *owner)
{
    eits_followed next[EITS_MAX_TOUCHES];
    uint8_t met_again[EITS_MAX_TOUCHES] = {0};
    for (uint32_t k = 0; k < count; ++k) {
        next[k] = owner[k] == NONE ? track_start(ctx, &found[k])
                                   : updated(ctx, &ctx->tracker.followed[owner[k]], &found[k]);
        if (owner[k] != NONE)
            met_again[owner[k]] = 1;
        name(ctx, &next[k]);
    }
    for (uint32_t l = 0; l < ctx->tracker.count; ++l) {
        eits_followed *f = &ctx->tracker.followed[l];
        if (met_again[l] || f->touch.id == 0 || f->missed >= ctx->options.track_hold ||
            count == EITS_MAX_TOUCHES)
            continue;
        ++f->missed;
        /* not found: how well its place was known stays that of the last frame that showed it */
        f->touch.explained = f->touch.confidence = 0;
        next[count++] = *f;
    }
    for (uint32_t k = 0; k < count; ++k)
        ctx->tracker.followed[k] = next[k];
    ctx->tracker.count = count;
}

uint32_t eits_track(eits_context *ctx, eits_touch *touches, uint32_t count)
{
    uint32_t owner[EITS_MAX_TOUCHES], reported = 0;
    for (uint32_t k = 0; k < count; ++k) {
        touches[k].id = 0;
        owner[k] = NONE;
    }
    for (uint32_t l = 0; l < ctx->tracker.count; ++l)
        predict(ctx, &ctx->tracker.followed[l]);
    pair(ctx, touches, count, 1, owner);
    pair(ctx, touches, count, 0, owner);
    update_tracks(ctx, touches, count, owner);
    for (uint32_t l = 0; l < ctx->tracker.count; ++l) {
        const eits_followed *f = &ctx->tracker.followed[l];
        const int held =
            f->faint && f->seen >= EITS_KNOWN_FRAMES && reported < ctx->options.max_touches;
        if (f->touch.id == 0 || (f->missed > 0 && !held))
            continue;
        uint32_t place = reported++;
        for (; place > 0 && eits_fabs(f->touch.strength_s_per_m_mm2) >
                                eits_fabs(touches[place - 1].strength_s_per_m_mm2);
             --place)
            touches[place] = touches[place - 1];
        touches[place] = f->touch;
    }
    return reported;
}
