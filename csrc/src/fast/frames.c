/* Whole frames beside the drives: brought to one instant by the touches before they are solved, and
 * what the solver finds then confirms, ends and begins touches. */
#include "fast/fast.h"

#include "context/places.h"

/* The place and strength of touch k when a drive was last measured. Where the touch was not there
 * yet, its place is that of now and its strength is zero. */
static const eits_real *was(const fast_drive *d, uint32_t k, const eits_real *now,
                            eits_real spare[FAST_WAYS])
{
    /* No touch yet when that drive was measured: it gives nothing to the frame there, and the frame
     * gets the whole touch. */
    if (d->there[k])
        return d->then[k];
    spare[FAST_X] = now[FAST_X];
    spare[FAST_Y] = now[FAST_Y];
    spare[FAST_C] = 0;
    return spare;
}

/* The square of the greatest distance that touch k went since any of the drives, and the greatest
 * change of its strength. */
static void went(const eits_fast *fast, uint32_t k, eits_real *square, eits_real *change)
{
    const eits_real *now = fast->state + FAST_SIZE * k;
    *square = *change = 0;
    for (uint32_t n = 0; n < fast->drives; ++n) {
        eits_real spare[FAST_WAYS];
        const eits_real *then = was(&fast->drive[n], k, now, spare);
        const eits_real dx = then[FAST_X] - now[FAST_X], dy = then[FAST_Y] - now[FAST_Y];
        const eits_real far = dx * dx + dy * dy, much = eits_fabs(then[FAST_C] - now[FAST_C]);
        *square = far > *square ? far : *square;
        *change = much > *change ? much : *change;
    }
}

/* Whether touch k went far, or changed much, since any of the drives: for sure, so that the frame
 * is aligned; `perhaps`, by limits that its noise may pass. */
static int has_moved(const eits_fast *fast, uint32_t k, uint32_t *perhaps)
{
    const uint32_t at = FAST_SIZE * k;
    const eits_real place = eits_sqrt(fast->p[at][at] + fast->p[at + 1][at + 1]);
    const eits_real strength = eits_sqrt(fast->p[at + FAST_C][at + FAST_C]);
    /* A still touch keeps the frame's bits: what the filter's own noise moves is below these
     * limits, and a frame that nothing has changed in is solved as it was measured. */
    eits_real far = EITS_FAST_MOVED_SD * place, much = EITS_FAST_MOVED_SD * strength;
    const eits_real least = EITS_FAST_MOVED_STRENGTH * eits_fabs(fast->state[at + FAST_C]);
    eits_real square, change;
    went(fast, k, &square, &change);
    *perhaps |= square > fast_square(EITS_FAST_MOVED_MM) || change > least;
    far = far > EITS_FAST_MOVED_MM ? far : EITS_FAST_MOVED_MM;
    much = much > least ? much : least;
    return square > far * far || change > much;
}

/* Return 1 if touch k grew by much since any of the drives, and explains far more of them than what
 * is left. */
static int has_grown(const eits_fast *fast, uint32_t k)
{
    eits_real square, change;
    went(fast, k, &square, &change);
    return change > EITS_FAST_GROWN * fast->state[FAST_SIZE * k + FAST_C] &&
           fast->known[k].energy > EITS_FAST_GROWN_ENERGY * fast->news;
}

static void align_touch(eits_fast *fast, uint32_t k, eits_real *aligned)
{
    const eits_real *now = fast->state + FAST_SIZE * k;
    const size_t rows = fast->most_rows;
    fast_disc *disc = fast->search.disc;
    const eits_real rho2 = fast->known[k].rho2;
    if (!eits_fast_gather(fast, now, rho2, &disc[0]))
        return;
    for (uint32_t n = 0; n < fast->drives; ++n) {
        const fast_drive *d = &fast->drive[n];
        eits_real spare[FAST_WAYS], *before = fast->answer + FAST_WAYS * rows;
        const eits_real *then = was(d, k, now, spare);
        if (!eits_fast_gather(fast, then, rho2, &disc[1]))
            continue;
        /* Only the difference of two answers by the same linear model is added, so that its errors
         * largely cancel; what the touch really does to the rows stays as measured. */
        eits_fast_answer(fast, n, &disc[0], fast->answer);
        eits_fast_answer(fast, n, &disc[1], before);
        for (uint32_t i = 0; i < d->count; ++i) {
            const uint32_t row = fast->row[d->first + i];
            const eits_real change = now[FAST_C] * fast->answer[i] - then[FAST_C] * before[i];
            aligned[row] += fast->sign * change / fast->gain[row];
        }
    }
}

/* The gain is far from what it was at the tare, by more than noise makes of it. Under a hand this
 * is not known: what the model does not explain of several strong touches looks like drift. */
static int is_far(const eits_fast *fast)
{
    const eits_real drift = eits_fabs(fast->drift);
    return fast->count < EITS_FAST_HAND && drift > EITS_FAST_DRIFTED &&
           drift * fast->ctx->reference.v0_rms > EITS_FAST_DRIFTED_NOISE * fast->noise_v;
}

eits_status eits_fast_align(eits_fast *fast, const eits_real *volts, size_t length,
                            eits_real *aligned, uint32_t *state)
{
    if (fast == NULL || volts == NULL || aligned == NULL || state == NULL)
        return EITS_E_ARGUMENT;
    if (length != fast->model->n_rows)
        return EITS_E_FRAME_LENGTH;
    if (!fast->begun)
        return EITS_E_NO_REFERENCE;
    eits_copy(aligned, volts, length);
    if (fast->fresh)
        fast->named = fast->named_before = fast->drifted = 0;
    fast->fresh = 0;
    fast->frame_s = fast_between_s(fast->aligned_us, fast->time_us);
    fast->aligned_us = fast->time_us;
    fast->stirred = fast->glitched || fast->born;
    fast->born = 0;
    /* A frame with drives that nothing explains would be named faulty, or solved into touches that
     * are not there. After EITS_FAST_FRAMES such frames the fault is real, or a touch too slow to
     * be born; the solver decides. It does at once where it has named an electrode: without its
     * contact the rows beside it change by more than noise, and the fault would come and go. */
    int explained = fast->held_count == 0;
    for (uint32_t n = 0; n < fast->drives; ++n)
        explained &= fast->drive[n].explained;
    const int at_once = fast->news < EITS_FAST_LITTLE_NEWS || fast->faulty;
    int grows = 0;
    fast->n_off = fast->smeared = 0;
    for (uint32_t k = 0; k < fast->count; ++k) {
        /* Tracks that do not explain the drives cannot bring them to one instant. */
        uint32_t perhaps = 0;
        if (has_moved(fast, k, &perhaps) && explained)
            align_touch(fast, k, aligned);
        fast->stirred |= perhaps;
        if (perhaps && !explained && !at_once)
            fast->smeared = FAST_CHANGED;
        grows |= has_grown(fast, k);
        fast->stirred |= !fast->known[k].on;
        fast->known[k].aligned = 1;
        eits_copy(fast->known[k].at, fast->state + FAST_SIZE * k, 2);
        if (!fast->known[k].on) {
            fast->off_left[fast->n_off] = EITS_FAST_ON * fast->known[k].peak;
            eits_copy(fast->off_at[fast->n_off], fast->known[k].at, 2);
            eits_place_on_skin(fast->ctx, fast->off_at[fast->n_off++]);
        }
    }
    if (grows && !explained && at_once && !fast->faulty)
        fast->smeared = FAST_GROWS;
    fast->frame_explained = (uint32_t)explained;
    fast->unexplained_frames = explained ? 0 : fast->unexplained_frames + 1;
    fast->stirred |= !explained;
    fast->drifted = is_far(fast) ? fast->drifted + 1 : 0;
    *state = explained ? (uint32_t)EITS_FAST_EXPLAINED : 0u;
    if (explained || at_once || fast->unexplained_frames > EITS_FAST_FRAMES)
        *state |= (uint32_t)EITS_FAST_TRUSTED;
    fast->aligned = 1;
    fast->news = 0;
    eits_fast_expect_touches(fast);
    return eits_fast_touches(fast, fast->followed, EITS_FAST_MAX_TOUCHES, &fast->n_followed);
}

/* Pairs of touches that were aligned and of those found, the nearest first, each within the room
 * that the wider of the two takes; owner[n]: the touch of found n, or FAST_NONE. */
static void match(const eits_fast *fast, const eits_touch *touches, const eits_real (*found)[2],
                  uint32_t count, uint8_t *owner)
{
    uint32_t taken = 0;
    memset(owner, FAST_NONE, count);
    for (;;) { /* at most a pair for each touch */
        eits_real nearest = -1;
        uint32_t from = 0, to = 0;
        for (uint32_t k = 0; k < fast->count; ++k) {
            for (uint32_t n = 0; n < count; ++n) {
                const eits_real far = fast_distance2(fast->known[k].at, found[n]);
                const eits_real room = fast_room_of_mm(fast, fast_is_whole_palm(fast, &touches[n])
                                                                 ? FAST_PALM_MM2
                                                                 : fast->known[k].rho2);
                if (fast->known[k].aligned && (taken >> k & 1u) == 0 && owner[n] == FAST_NONE &&
                    far < fast_square(room) && (nearest < 0 || far < nearest)) {
                    nearest = far;
                    from = k;
                    to = n;
                }
            }
        }
        if (nearest < 0)
            return;
        owner[to] = (uint8_t)from;
        taken |= 1u << from;
    }
}

static void mask_named(eits_fast *fast)
{
    const uint8_t *states = fast->ctx->rows.electrode;
    fast->faulty = 0;
    for (uint32_t i = 0; i < fast->model->n_rows && fast->drives > 0; ++i) {
        const uint8_t *row = eits_row(fast->ctx, i);
        fast->masked[i] = (states[row[0]] | states[row[1]] | states[row[2]] | states[row[3]]) != 0;
        fast->faulty |= fast->masked[i];
    }
}

static int near_any(const eits_real *place, const eits_real (*others)[2], uint32_t count)
{
    for (uint32_t k = 0; k < count; ++k) {
        if (fast_distance2(place, others[k]) < fast_square(EITS_FAST_SEED_REACH_MM))
            return 1;
    }
    return 0;
}

static int near_known(const eits_fast *fast, const eits_real *place)
{
    for (uint32_t k = 0; k < fast->count; ++k) {
        if (fast_distance2(place, fast->state + FAST_SIZE * k) < fast_square(fast_room_mm(fast, k)))
            return 1;
    }
    return 0;
}

/* A touch as a frame has it: still, and known in all drives as it is, since the frame has seen it
 * in all of them. */
static void set_by_frame(eits_fast *fast, uint32_t k, const eits_real *place, eits_real c)
{
    const eits_real deviation[FAST_SIZE] = {EITS_FAST_SEED_MM, EITS_FAST_SEED_MM,
                                            EITS_FAST_SEED_STRENGTH * c, 0, 0};
    eits_real covariance[FAST_SIZE][FAST_SIZE] = {{0}};
    eits_real *state = fast->state + (size_t)FAST_SIZE * k;
    for (uint32_t i = 0; i < FAST_SIZE; ++i)
        covariance[i][i] = fast_square(deviation[i]);
    eits_copy(state, place, 2);
    state[FAST_C] = c;
    state[FAST_VX] = state[FAST_VY] = 0;
    eits_fast_set_covariance(fast, k, covariance);
    fast->known[k].moving = fast->known[k].slow = fast->known[k].age = 0;
    fast->known[k].confirmed = 1;
    for (uint32_t n = 0; n < fast->drives; ++n) {
        fast->drive[n].there[k] = 1;
        eits_copy(fast->drive[n].then[k], state, FAST_WAYS);
    }
    eits_fast_empty_ring(fast);
}

/* Touches that two frames on end have found and no drive; `at`: where the modelled skin has them.
 */
static void seed(eits_fast *fast, const eits_touch *found, const eits_real (*at)[2],
                 const uint8_t *owner, uint32_t count, int decides)
{
    const uint32_t known = fast->seeds;
    eits_real before[EITS_FAST_MAX_TOUCHES][2];
    memcpy(before, fast->seed, sizeof before);
    fast->seeds = 0;
    for (uint32_t n = 0; n < count; ++n) {
        const eits_real c = fast->sign * found[n].strength_s_per_m_mm2;
        eits_real none[FAST_SIZE][FAST_SIZE] = {{0}};
        const eits_real state[FAST_SIZE] = {at[n][0], at[n][1], c, 0, 0};
        if (owner[n] != FAST_NONE || !(c > 0) || fast_is_rest(fast, at[n], c))
            continue;
        /* Two frames on end, unless one decides: in a single one, a touch that landed while it was
         * scanned may stand at a wrong place. */
        if ((!decides && !near_any(state, (const eits_real(*)[2])before, known)) ||
            fast->count == EITS_FAST_MAX_TOUCHES || near_known(fast, state)) {
            if (fast->seeds < EITS_FAST_MAX_TOUCHES)
                eits_copy(fast->seed[fast->seeds++], state, 2);
            continue;
        }
        eits_fast_add(fast, state, none, 4 * EITS_FAST_FAINT,
                      fast_is_whole_palm(fast, &found[n]) ? FAST_PALM_MM2 : fast->rho2);
        set_by_frame(fast, fast->count - 1, state, c);
    }
}

/* A touch is put where it must be by now by two frames on end, the first of which had it at
 * `before`: they also tell how it moves, from the middle of one scan to that of the next. */
static void put(eits_fast *fast, uint32_t k, const eits_real *before, const eits_real *place,
                eits_real c)
{
    fast_known *known = &fast->known[k];
    const eits_real by[2] = {place[0] - before[0], place[1] - before[1]};
    const eits_real far2 = by[0] * by[0] + by[1] * by[1];
    const eits_real took_s = fast_between_s(known->place_us, fast->aligned_us);
    const int moves = took_s > 0 && far2 > fast_square(EITS_FAST_PUT_MOVES_MM) &&
                      far2 < fast_square(EITS_FAST_APART_MM);
    eits_real now[2] = {place[0], place[1]}, speed[2] = {0, 0};
    for (uint32_t axis = 0; axis < 2 && moves; ++axis) {
        speed[axis] = by[axis] / took_s;
        now[axis] += EITS_FAST_PUT_AHEAD * fast->frame_s * speed[axis];
    }
    set_by_frame(fast, k, eits_fast_on_skin(fast, now, known->rho2) ? now : place, c);
    if (!moves)
        return;
    const uint32_t at = FAST_SIZE * k;
    known->moving = 1;
    for (uint32_t axis = 0; axis < 2; ++axis) {
        fast->state[at + FAST_VX + axis] = speed[axis];
        fast->p[at + FAST_VX + axis][at + FAST_VX + axis] = fast_square(EITS_FAST_PUT_SPEED);
    }
}

/* A touch that two frames on end show elsewhere is put there. If drives explain a frame, a touch
 * that moves is theirs; if they do not, it may have gone on between the two frames, and the first
 * of them may still have agreed. One frame that decides puts a touch as a still one; where the
 * frame before decided too, a touch that is elsewhere again moves. A touch that turns out to be a
 * `palm` is put as one. */
static void correct(eits_fast *fast, uint32_t k, const eits_real *place, eits_real c, int palm)
{
    fast_known *known = &fast->known[k];
    const fast_last before = known->last;
    const eits_real by = fast_distance2(place, known->place);
    const eits_real reach = fast->frame_explained ? EITS_FAST_AGREE_MM : EITS_FAST_APART_MM;
    const int may_be_lost = known->moving || fast->unexplained_frames >= EITS_FAST_LOST_FRAMES;
    const int lost = may_be_lost && !fast->frame_explained && before == FAST_AGREED;
    const int again = (before == FAST_ELSEWHERE || lost) && by < fast_square(reach);
    const eits_real far2 = fast_distance2(place, known->at);
    known->frames_missed = 0;
    known->last = far2 < fast_square(EITS_FAST_AGREE_MM) ? FAST_AGREED : FAST_ELSEWHERE;
    if (known->last == FAST_AGREED)
        known->confirmed = 1;
    if (palm && !fast_is_palm(known->rho2)) {
        known->rho2 = FAST_PALM_MM2;
        set_by_frame(fast, k, place, c);
    } else if (!fast_is_palm(known->rho2)) {
        const int elsewhere = known->last == FAST_ELSEWHERE;
        const int goes = elsewhere && fast->decided && (known->moving || before == FAST_ELSEWHERE);
        const eits_real most = known->moving ? EITS_FAST_AGREE_MM : EITS_FAST_DECIDES_MM;
        if (eits_fast_decides(fast) && !goes && far2 > fast_square(most))
            set_by_frame(fast, k, place, c);
        else if (elsewhere && again && !(known->moving && fast->frame_explained))
            put(fast, k, known->place, place, c);
    }
    eits_copy(known->place, place, 2);
    known->place_us = fast->aligned_us;
}

/* Two fingers that landed at once and were taken for a palm: a frame that drives explain shows two
 * touches on it that are apart. The palm becomes the first of them. Returns whether it did. While
 * a palm lands, frames may show several discs of it. */
static int take_back(eits_fast *fast, uint32_t k, const eits_touch *found, const eits_real (*at)[2],
                     uint32_t count)
{
    fast_known *known = &fast->known[k];
    uint32_t on[2] = {0, 0}, near = 0;
    if (!fast_is_palm(known->rho2) || known->age < EITS_FAST_YOUNG || !fast->frame_explained)
        return 0;
    for (uint32_t n = 0; n < count; ++n) {
        if (fast_distance2(at[n], known->at) < fast_square(fast_room_mm(fast, k)))
            on[near++ & 1u] = n;
    }
    const eits_touch *a = &found[on[0]], *b = &found[on[1]];
    if (near != 2 ||
        !(fast_distance2(at[on[0]], at[on[1]]) > fast_square(a->radius_mm + b->radius_mm)))
        return 0;
    known->rho2 = fast->rho2;
    eits_copy(known->at, at[on[0]], 2);
    set_by_frame(fast, k, at[on[0]], fast->sign * a->strength_s_per_m_mm2);
    return 1;
}

eits_status eits_fast_confirm(eits_fast *fast, const eits_touch *found, uint32_t count)
{
    uint8_t owner[EITS_MAX_TOUCHES];
    /* The comparison is with where touches were when the frame was aligned: a swipe at 600 mm/s is
     * 6 mm further after a solve of 10 ms. */
    if (fast == NULL || (found == NULL && count > 0) || count > EITS_MAX_TOUCHES)
        return EITS_E_ARGUMENT;
    eits_real at[EITS_MAX_TOUCHES][2];
    for (uint32_t n = 0; n < count; ++n) {
        at[n][0] = found[n].x_mm;
        at[n][1] = found[n].y_mm;
        eits_place_in_model(fast->ctx, at[n]);
    }
    mask_named(fast);
    int decides = eits_fast_decides(fast);
    for (uint32_t k = 0; k < fast->count; ++k)
        decides |= take_back(fast, k, found, (const eits_real(*)[2])at, count);
    match(fast, found, (const eits_real(*)[2])at, count, owner);
    const int smeared = fast->smeared == FAST_GROWS && eits_fast_is_smeared(fast, found, count);
    uint32_t seen = 0;
    eits_real places[EITS_FAST_MAX_TOUCHES][2];
    for (uint32_t k = 0; k < fast->count; ++k)
        eits_copy(places[k],
                  fast->known[k].aligned ? fast->known[k].at : fast->state + FAST_SIZE * k, 2);
    for (uint32_t n = 0; n < count; ++n) {
        if (owner[n] == FAST_NONE || smeared)
            continue;
        const uint32_t between =
            eits_fast_between(fast, (const eits_real(*)[2])places, fast->count, at[n]);
        seen |= 1u << owner[n] | between;
        if (between != 0)
            continue;
        correct(fast, owner[n], at[n], fast->sign * found[n].strength_s_per_m_mm2,
                fast_is_whole_palm(fast, &found[n]));
    }
    for (uint32_t k = fast->count; k-- > 0;) {
        fast_known *known = &fast->known[k];
        if (!known->aligned || (seen >> k & 1u) != 0 || !known->on || smeared)
            continue;
        known->last = FAST_NOT_SEEN;
        if (++known->frames_missed >= EITS_FAST_LOST_FRAMES ||
            eits_fast_whole_palm(fast, found, (const eits_real(*)[2])at, count, known->at) < count)
            eits_fast_drop(fast, k);
    }
    for (uint32_t k = 0; k < fast->count; ++k)
        fast->known[k].aligned = 0;
    /* a frame with rows that are no touch's may show any */
    seed(fast, found, (const eits_real(*)[2])at, owner, fast->wild == 0 && !smeared ? count : 0,
         decides);
    fast->wild = 0;
    fast->decided = (uint32_t)eits_fast_decides(fast);
    return EITS_OK;
}

eits_status eits_fast_name(eits_fast *fast, eits_info *info)
{
    if (fast == NULL || info == NULL)
        return EITS_E_ARGUMENT;
    /* A contact in a drive's last rows is an outlier to the solver, and what the alignment leaves
     * of a rise or a lift may look like a second touch: neither is there in the next frame, as a
     * fault is. */
    const uint32_t now = info->diagnostics, crowded = EITS_DIAGNOSTIC_CROWDED;
    const uint32_t twice = now & fast->named, thrice = twice & fast->named_before;
    info->diagnostics = fast->stirred ? thrice | (now & EITS_DIAGNOSTIC_SATURATED)
                                      : (now & ~crowded) | (twice & crowded);
    /* Drives follow the drift and the solver ignores it: neither would say so otherwise. A press's
     * contact passes for drift until a touch is born, so once is not enough. */
    if (fast->drifted >= EITS_FAST_DRIFTED_FRAMES)
        info->diagnostics |= fast->ctx->options.diagnostics & EITS_DIAGNOSTIC_STALE_REFERENCE;
    fast->named_before = fast->named;
    fast->named = now;
    if (!(info->diagnostics & EITS_DIAGNOSTIC_ELECTRODE_OPEN))
        info->open_electrodes = 0;
    if (!(info->diagnostics & EITS_DIAGNOSTIC_BRIDGED))
        info->bridged_electrodes = 0;
    if (!(info->diagnostics & EITS_DIAGNOSTIC_ELECTRODE_NOISY))
        info->noisy_electrodes = 0;
    return EITS_OK;
}
