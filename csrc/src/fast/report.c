/* A frame's touches: those that drives follow, with what the whole-frame solver found of them, and
 * those that frames alone show, which are followed from frame to frame. All have one sequence of
 * ids. A board's drives go on while a frame is solved, and a host takes the same drives after that
 * frame; so that both give the same ids, a frame that is reported gives only ids that were kept for
 * it when it was aligned.
 *
 * A touch that frames alone show goes on by its velocity for one frame, and is what is found
 * nearest to there. The filter is Kalman's (Trans. ASME, J. Basic Eng. 82 (1960) 35-45) for a place
 * of constant velocity, with the same variances along both axes, so that no matrix is inverted:
 *
 *     predict   p += v,  P += 2 C + V + q / 4,  C += V + q / 2,  V += q
 *     update    K = P / (P + R),  p += K (found - p),  v += C / (P + R) (found - p)
 *
 * with P, C, V place_mm2, both_mm2, speed_mm2, q the square of the velocity's change in a frame and
 * R the variance of a found place. Time is counted in frames, since frames may come without times;
 * limits and variances are in follow_mm, which the caller sets for the frame rate. The filter only
 * decides which touch is which: what is reported lies where the solver found it. */
#include "fast/fast.h"

#include "context/places.h"
#include "eitskin/force.h"

enum { NONE = EITS_MAX_TOUCHES };

/* ---- touches that frames alone show ---- */

/* lambda_max of a frame that had this touch alone, about: the frame's by its fraction of the
 * energy. */
static eits_real own_lambda(const eits_fast *fast, const eits_touch *touch)
{
    return fast->ctx->info.lambda_max * eits_sqrt(touch->explained);
}

/* The variance of a found place, mm^2: the weaker a touch over the noise, the less certain is the
 * centre of its peak. */
static eits_real place_variance(const eits_fast *fast, const eits_touch *found)
{
    const eits_real pixel = (eits_real)fast->model->pixel_mm, own = own_lambda(fast, found);
    const eits_real noise = own > 0 ? fast->ctx->info.lambda_noise / own : 0;
    return fast_square(pixel) *
           (fast_square(EITS_FAST_SEEN_NOISE * noise) + fast_square(EITS_FAST_SEEN_DEVIATION));
}

/* A new touch has a velocity of unknown size: the place at which it is found next decides. */
static fast_seen start(const eits_fast *fast, const eits_touch *found)
{
    const eits_real speed = EITS_FAST_SEEN_SPEED * fast->ctx->options.follow_mm;
    return (fast_seen){.touch = *found,
                       .at = {found->x_mm, found->y_mm},
                       .place_mm2 = place_variance(fast, found),
                       .speed_mm2 = fast_square(speed)};
}

/* One frame later. */
static void predict(const eits_fast *fast, fast_seen *s)
{
    const eits_real change = fast_square(EITS_FAST_SEEN_CHANGE * fast->ctx->options.follow_mm);
    fast_axpy(s->at, 1, s->speed, 2);
    s->place_mm2 += 2 * s->both_mm2 + s->speed_mm2 + change / 4;
    s->both_mm2 += s->speed_mm2 + change / 2;
    s->speed_mm2 += change;
}

static int is_finite(const fast_seen *s)
{
    const eits_real variance[3] = {s->place_mm2, s->both_mm2, s->speed_mm2};
    return eits_all_finite(s->at, 2) && eits_all_finite(s->speed, 2) &&
           eits_all_finite(variance, 3);
}

/* Return the state of a touch, corrected by what was found of it. It starts again if a number of
 * the state is not finite. */
static fast_seen updated(const eits_fast *fast, const fast_seen *before, const eits_touch *found)
{
    const fast_seen begun = start(fast, found);
    fast_seen next = *before;
    const eits_real total = before->place_mm2 + begun.place_mm2;
    const eits_real gain = before->place_mm2 / total, speed_gain = before->both_mm2 / total;
    const eits_real off[2] = {found->x_mm - before->at[0], found->y_mm - before->at[1]};
    fast_axpy(next.at, gain, off, 2);
    fast_axpy(next.speed, speed_gain, off, 2);
    next.place_mm2 -= gain * before->place_mm2;
    next.both_mm2 -= gain * before->both_mm2;
    next.speed_mm2 -= speed_gain * before->both_mm2;
    if (!is_finite(&next))
        next = begun;
    next.touch = *found;
    next.id = before->id;
    next.kept_id = before->kept_id;
    next.seen = before->seen;
    next.followed = before->followed > 0 ? before->followed - 1 : 0;
    return next;
}

/* Nearest pairs first, among those that frames have reported or among the others: owner[n] is the
 * touch that `found` n is. */
static void pair(const eits_fast *fast, const eits_touch *found, uint32_t count, int reported,
                 uint32_t *owner)
{
    uint8_t taken[EITS_MAX_TOUCHES] = {0};
    const eits_real follow_mm = fast->ctx->options.follow_mm;
    const eits_real reach = fast_square(reported ? follow_mm : EITS_FAST_SEEN_REACH * follow_mm);
    for (;;) { /* at most EITS_MAX_TOUCHES pairs */
        eits_real nearest = reach;
        uint32_t from = NONE, to = NONE;
        for (uint32_t n = 0; n < count; ++n) {
            for (uint32_t l = 0; owner[n] == NONE && l < fast->n_seen; ++l) {
                const fast_seen *s = &fast->seen[l];
                const eits_real dx = found[n].x_mm - s->at[0], dy = found[n].y_mm - s->at[1];
                const eits_real square = dx * dx + dy * dy;
                if (!taken[l] && (s->id != 0 && s->followed == 0) == reported &&
                    square <= nearest) {
                    nearest = square;
                    from = l;
                    to = n;
                }
            }
        }
        if (to == NONE)
            return;
        owner[to] = from;
        taken[from] = 1;
    }
}

static uint32_t next_id(eits_fast *fast)
{
    const uint32_t id = fast->next_id;
    fast->next_id = id % EITS_FAST_IDS + 1;
    return id;
}

/* Count one more frame that shows the touch, and give it an id where it may be reported: at once if
 * it is clear, and no drive could have found it; else with the second frame. In a frame whose
 * drives are followed, a touch that landed while it was scanned may stand at a wrong place. */
static void name(eits_fast *fast, fast_seen *s, int drives)
{
    const eits_info *info = &fast->ctx->info;
    const int clear =
        own_lambda(fast, &s->touch) >= EITS_FAST_SURE_CLEARNESS * info->lambda_noise &&
        s->touch.explained >= EITS_FAST_SURE_FRACTION;
    const int sure = !drives && (clear || !(info->lambda_noise > 0));
    s->missed = 0;
    s->faint = own_lambda(fast, &s->touch) < info->lambda_noise;
    s->seen += s->seen < EITS_FAST_SEEN_KNOWN;
    if (s->id != 0 || (s->seen < 2 && !sure))
        return;
    fast->kept_used |= s->kept_id;
    s->id = s->kept_id != 0 ? s->kept_id : next_id(fast);
}

/* Follow the `count` found touches that no drives follow. Those that were found come first, in
 * their order; then those that may come back, as far as there is room. */
static void follow(eits_fast *fast, const eits_touch *found, uint32_t count, int drives)
{
    uint32_t owner[EITS_MAX_TOUCHES];
    uint8_t met[EITS_MAX_TOUCHES] = {0};
    fast_seen next[EITS_MAX_TOUCHES];
    for (uint32_t l = 0; l < fast->n_seen; ++l)
        predict(fast, &fast->seen[l]);
    for (uint32_t n = 0; n < count; ++n)
        owner[n] = NONE;
    pair(fast, found, count, 1, owner);
    pair(fast, found, count, 0, owner);
    for (uint32_t n = 0; n < count; ++n) {
        if (owner[n] != NONE)
            met[owner[n]] = 1;
        next[n] = owner[n] == NONE ? start(fast, &found[n])
                                   : updated(fast, &fast->seen[owner[n]], &found[n]);
        name(fast, &next[n], drives);
    }
    for (uint32_t l = 0; l < fast->n_seen && count < EITS_MAX_TOUCHES; ++l) {
        fast_seen *s = &fast->seen[l];
        if (met[l] || s->id == 0 || s->missed == EITS_FAST_SEEN_HOLD)
            continue;
        ++s->missed;
        next[count++] = *s;
    }
    memcpy(fast->seen, next, count * sizeof next[0]);
    fast->n_seen = count;
}

void eits_fast_forget_all(eits_fast *fast)
{
    if (fast == NULL)
        return;
    fast->n_seen = fast->n_followed = fast->begun = fast->aligned = 0;
}

/* The nearest to `place`, mm, of those found that no touch has taken, within EITS_FAST_APART_MM;
 * `count` where there is none. */
static uint32_t nearest(const eits_real *place, const eits_real (*found)[2], const uint8_t *taken,
                        uint32_t count)
{
    uint32_t best = count;
    eits_real least = fast_square(EITS_FAST_APART_MM);
    for (uint32_t n = 0; n < count; ++n) {
        const eits_real square = fast_distance2(found[n], place);
        if (!taken[n] && square < least) {
            least = square;
            best = n;
        }
    }
    return best;
}

/* ---- touches that drives may find ---- */

static void expect(eits_fast *fast, uint32_t id, eits_real x_mm, eits_real y_mm)
{
    const uint32_t n = fast->n_expected++;
    fast->expected_id[n] = id;
    fast->expected_at[n][0] = x_mm;
    fast->expected_at[n][1] = y_mm;
    fast->expected_found[n] = 0;
}

static int is_known(const eits_fast *fast, uint32_t id)
{
    int known = 0;
    for (uint32_t k = 0; k < fast->count; ++k)
        known |= fast->known[k].id == id;
    return known;
}

void eits_fast_expect_touches(eits_fast *fast)
{
    if (!fast->kept_used && fast->next_id == fast->kept_until)
        fast->next_id = fast->kept_from; /* none of the last ids was given */
    fast->kept_from = fast->next_id;
    fast->kept_used = fast->n_expected = 0;
    for (uint32_t k = 0; k < fast->n_seen; ++k) {
        fast_seen *s = &fast->seen[k];
        if (s->followed > 0 || s->missed > 0 || is_known(fast, s->id))
            continue;
        s->kept_id = s->id != 0 ? s->id : next_id(fast);
        expect(fast, s->kept_id, s->touch.x_mm, s->touch.y_mm);
    }
    fast->kept_until = fast->next_id;
}

void eits_fast_expect_again(eits_fast *fast)
{
    fast->n_expected = 0;
    for (uint32_t k = 0; k < fast->n_followed; ++k)
        expect(fast, fast->followed[k].id, fast->followed[k].x_mm, fast->followed[k].y_mm);
}

uint32_t eits_fast_id_at(eits_fast *fast, const eits_real *place)
{
    eits_real at[2] = {place[0], place[1]};
    eits_place_on_skin(fast->ctx, at);
    const uint32_t n = nearest(at, (const eits_real(*)[2])fast->expected_at, fast->expected_found,
                               fast->n_expected);
    if (n == fast->n_expected)
        return next_id(fast);
    fast->expected_found[n] = 1;
    fast->kept_used = 1;
    return fast->expected_id[n];
}

/* ---- the report ---- */

/* A touch that the solver has not found in this frame: what drives know of it. */
static eits_touch alone(const eits_fast *fast, const eits_fast_touch *t)
{
    return (eits_touch){.id = t->id,
                        .x_mm = t->x_mm,
                        .y_mm = t->y_mm,
                        .radius_mm = t->radius_mm,
                        .strength_s_per_m_mm2 = t->strength_s_per_m_mm2,
                        .force_n =
                            eits_force_n(fast->model, t->x_mm, t->y_mm, t->strength_s_per_m_mm2),
                        .x_variance_mm2 = t->x_variance_mm2,
                        .xy_covariance_mm2 = t->xy_covariance_mm2,
                        .y_variance_mm2 = t->y_variance_mm2,
                        .confirmed = t->confirmed};
}

/* Place a touch that drives follow and the solver found between the two, by their variances.
 * Without much noise the frame's place is by far the more certain one. */
static void weigh_places(const eits_fast_touch *followed, eits_touch *found)
{
    const eits_real of_frame = (found->x_variance_mm2 + found->y_variance_mm2) / 2;
    const eits_real of_drives = (followed->x_variance_mm2 + followed->y_variance_mm2) / 2 +
                                fast_square(EITS_FAST_BIASED_MM);
    const eits_real off[2] = {followed->x_mm - found->x_mm, followed->y_mm - found->y_mm};
    const eits_real total = of_frame + of_drives;
    if (!(off[0] * off[0] + off[1] * off[1] < 9 * total))
        return; /* the touch was followed to a wrong place */
    found->x_mm += of_frame / total * off[0];
    found->y_mm += of_frame / total * off[1];
}

/* The touches that drives followed when the frame was aligned; returns their number. Those found
 * that are one of them are taken, and those that a lifted touch has left: these are weak. A
 * stronger one is a finger, whose touch noise has ended. Several of them on a palm that was found
 * whole are one. */
static uint32_t report_followed(const eits_fast *fast, const eits_touch *found, uint32_t count,
                                int smeared, uint8_t *taken, eits_touch *touches)
{
    eits_real at[EITS_MAX_TOUCHES][2], followed[EITS_FAST_MAX_TOUCHES][2];
    for (uint32_t n = 0; n < count; ++n) {
        at[n][0] = found[n].x_mm;
        at[n][1] = found[n].y_mm;
    }
    for (uint32_t k = 0; k < fast->n_followed; ++k) {
        followed[k][0] = fast->followed[k].x_mm;
        followed[k][1] = fast->followed[k].y_mm;
    }
    uint32_t reported = 0;
    for (uint32_t k = 0; k < fast->n_followed; ++k) {
        const eits_fast_touch *t = &fast->followed[k];
        const eits_real place[2] = {t->x_mm, t->y_mm};
        const eits_real(*places)[2] = (const eits_real(*)[2])at;
        uint32_t n = eits_fast_whole_palm(fast, found, places, count, place);
        if (n == count)
            n = nearest(place, places, taken, count);
        else if (taken[n])
            continue;
        const int agrees =
            n < count && fast_distance2(at[n], place) < fast_square(EITS_FAST_AGREE_MM);
        /* where the two differ, the frame's place is the better one; but of a palm it has discs,
         * and of a touch that slides a place between those that it had during the scan */
        const int palm = fast_is_palm(fast_square(EITS_FAST_SOFT_RADIUS * t->radius_mm));
        const int between = n < count && eits_fast_between(fast, (const eits_real(*)[2])followed,
                                                           fast->n_followed, at[n]) != 0;
        const eits_real speed2 = fast_square(t->vx_mm_per_s) + fast_square(t->vy_mm_per_s);
        const int slides = fast->frame_explained && speed2 > fast_square(EITS_FAST_SLIDES);
        const int shown = !smeared && (agrees || (n < count && !palm && !between && !slides));
        eits_touch *touch = &touches[reported++];
        *touch = shown ? found[n] : alone(fast, t);
        if (shown)
            weigh_places(t, touch);
        if (smeared && n < count) {
            touch->explained = found[n].explained;
            touch->confidence = found[n].confidence;
        }
        touch->id = t->id;
        touch->confirmed = agrees || t->confirmed;
        if (n < count)
            taken[n] = 1;
    }
    for (uint32_t k = 0; k < fast->n_off; ++k) {
        const uint32_t n = nearest(fast->off_at[k], (const eits_real(*)[2])at, taken, count);
        if (n < count && eits_fabs(found[n].strength_s_per_m_mm2) < fast->off_left[k])
            taken[n] = 1;
    }
    return reported;
}

/* Touches that drives follow, `touches` of this frame, are followed from frame to frame as well, in
 * case drives lose them. Two frames must then show one before it is reported: what a lift leaves
 * of a frame is not there in the next. */
static void keep_followed(eits_fast *fast, const eits_touch *touches, uint32_t count)
{
    for (uint32_t k = 0; k < count && fast->n_seen < EITS_MAX_TOUCHES; ++k) {
        fast_seen *s = &fast->seen[fast->n_seen++];
        *s = start(fast, &touches[k]);
        s->id = touches[k].id;
        s->seen = EITS_FAST_SEEN_KNOWN;
        s->followed = 2;
    }
}

static void forget_followed(eits_fast *fast)
{
    uint32_t kept = 0;
    for (uint32_t l = 0; l < fast->n_seen; ++l) {
        int followed = 0;
        for (uint32_t k = 0; k < fast->n_followed; ++k)
            followed |= fast->followed[k].id == fast->seen[l].id;
        if (!followed)
            fast->seen[kept++] = fast->seen[l];
    }
    fast->n_seen = kept;
}

/* Add those that frames alone show. One that this frame lacks is reported if it was well known and
 * fainter than noise when it was last found: a clear touch has lifted. */
static void report_seen(const eits_fast *fast, int drives, eits_touch *touches, uint32_t *count)
{
    for (uint32_t k = 0; k < fast->n_seen && *count < EITS_MAX_TOUCHES; ++k) {
        const fast_seen *s = &fast->seen[k];
        const int held = !drives && s->faint && s->seen == EITS_FAST_SEEN_KNOWN &&
                         *count < fast->ctx->options.max_touches;
        if (s->id == 0 || (drives && s->followed > 0) || (s->missed > 0 && !held))
            continue;
        eits_touch *t = &touches[(*count)++];
        *t = s->touch;
        t->id = s->id;
        t->confirmed = s->seen > 1;
        if (s->missed > 0)
            t->explained = t->confidence = 0;
    }
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

/* Whether the solver found it because of a palm that drives followed when the frame was aligned:
 * what they follow now depends on when the frame is reported. */
static int is_rest(const eits_fast *fast, const eits_touch *found)
{
    const eits_real place[2] = {found->x_mm, found->y_mm};
    for (uint32_t k = 0; k < fast->n_followed; ++k) {
        const eits_fast_touch *t = &fast->followed[k];
        const eits_real palm[FAST_WAYS] = {t->x_mm, t->y_mm, t->strength_s_per_m_mm2};
        const eits_real rho2 = fast_square(EITS_FAST_SOFT_RADIUS * t->radius_mm);
        if (fast_is_rest_of(fast, rho2, palm, place, found->strength_s_per_m_mm2))
            return 1;
    }
    return 0;
}

eits_status eits_fast_report(eits_fast *fast, const eits_touch *found, uint32_t n_found,
                             eits_touch *touches, uint32_t *count)
{
    uint8_t taken[EITS_MAX_TOUCHES] = {0};
    eits_touch rest[EITS_MAX_TOUCHES];
    uint32_t n_rest = 0;
    if (fast == NULL || touches == NULL || count == NULL || n_found > EITS_MAX_TOUCHES ||
        (found == NULL && n_found > 0))
        return EITS_E_ARGUMENT;
    const int drives = fast->aligned != 0;
    fast->aligned = *count = 0;
    const int smeared = drives && eits_fast_is_smeared(fast, found, n_found);
    uint32_t followed = 0;
    if (drives) {
        forget_followed(fast);
        followed = *count = report_followed(fast, found, n_found, smeared, taken, touches);
    }
    if (found != NULL && !smeared) {
        for (uint32_t n = 0; n < n_found; ++n) {
            if (!taken[n] && !(drives && is_rest(fast, &found[n])))
                rest[n_rest++] = found[n];
        }
        follow(fast, rest, n_rest, drives);
        report_seen(fast, drives, touches, count);
    }
    if (drives)
        keep_followed(fast, touches, followed);
    sort(touches, *count);
    return EITS_OK;
}
