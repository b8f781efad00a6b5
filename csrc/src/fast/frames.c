/* Whole frames beside the drives: brought to one instant by the touches before they are solved, and
 * what the solver finds then confirms, ends and begins touches. */
#include "fast/fast.h"

#include "context/places.h"

/* Where touch k was, and how strong, when a drive was last measured; with no strength, as it is,
 * where it was not there. */
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

/* How far touch k went, squared, and how much it changed since any of the drives. */
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

static void align_touch(eits_fast *fast, uint32_t k, eits_real *aligned)
{
    const eits_real *now = fast->state + FAST_SIZE * k;
    const size_t rows = fast->most_rows;
    for (uint32_t n = 0; n < fast->drives; ++n) {
        const fast_drive *d = &fast->drive[n];
        eits_real spare[FAST_WAYS], *before = fast->answer + FAST_WAYS * rows;
        const eits_real *then = was(d, k, now, spare);
        /* Only the difference of two answers by the same linear model is added, so that its errors
         * largely cancel; what the touch really does to the rows stays as measured. */
        (void)eits_fast_answer(fast, n, now, fast->answer);
        (void)eits_fast_answer(fast, n, then, before);
        for (uint32_t i = 0; i < d->count; ++i) {
            const uint32_t row = fast->row[d->first + i];
            const eits_real change = now[FAST_C] * fast->answer[i] - then[FAST_C] * before[i];
            aligned[row] += change / fast->gain[row];
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
    fast->stirred = fast->glitched || fast->next_id != fast->next_aligned;
    fast->next_aligned = fast->next_id;
    for (uint32_t k = 0; k < fast->count; ++k) {
        if (has_moved(fast, k, &fast->stirred))
            align_touch(fast, k, aligned);
        fast->stirred |= !fast->known[k].on;
        fast->known[k].aligned = 1;
        eits_copy(fast->known[k].at, fast->state + FAST_SIZE * k, 2);
    }
    /* A frame with drives that nothing explains would be named faulty, or solved into touches that
     * are not there. After EITS_FAST_FRAMES such frames the fault is real, or a touch too slow to
     * be born; the solver decides. */
    int explained = fast->held_count == 0;
    for (uint32_t n = 0; n < fast->drives; ++n)
        explained &= fast->drive[n].explained;
    fast->unexplained_frames = explained ? 0 : fast->unexplained_frames + 1;
    fast->stirred |= !explained;
    fast->drifted = is_far(fast) ? fast->drifted + 1 : 0;
    *state = explained ? (uint32_t)EITS_FAST_EXPLAINED : 0u;
    if (explained || fast->unexplained_frames > EITS_FAST_FRAMES)
        *state |= (uint32_t)EITS_FAST_TRUSTED;
    fast->aligned = 1;
    return eits_fast_touches(fast, fast->followed, EITS_FAST_MAX_TOUCHES, &fast->n_followed);
}

uint32_t eits_fast_nearest(const eits_real *place, const eits_real (*found)[2],
                           const uint8_t *taken, uint32_t count)
{
    uint32_t best = count;
    eits_real least = fast_square(EITS_FAST_CONFIRM_MM);
    for (uint32_t n = 0; n < count; ++n) {
        const eits_real dx = found[n][0] - place[0], dy = found[n][1] - place[1];
        const eits_real square = dx * dx + dy * dy;
        if (!taken[n] && square < least) {
            least = square;
            best = n;
        }
    }
    return best;
}

static void mask_named(eits_fast *fast)
{
    const uint8_t *states = fast->ctx->rows.electrode;
    for (uint32_t i = 0; i < fast->model->n_rows; ++i) {
        const uint8_t *row = eits_row(fast->ctx, i);
        fast->masked[i] = (states[row[0]] | states[row[1]] | states[row[2]] | states[row[3]]) != 0;
    }
}

static int near_any(const eits_real *place, const eits_real (*others)[2], uint32_t count)
{
    for (uint32_t k = 0; k < count; ++k) {
        if (!fast_apart(place, others[k]))
            return 1;
    }
    return 0;
}

static int near_known(const eits_fast *fast, const eits_real *place)
{
    for (uint32_t k = 0; k < fast->count; ++k) {
        if (!fast_apart(place, fast->state + FAST_SIZE * k))
            return 1;
    }
    return 0;
}

/* The frames that found touch k have seen it in all their drives: the next one has it already. */
static void was_there(eits_fast *fast, uint32_t k)
{
    for (uint32_t n = 0; n < fast->drives; ++n) {
        fast->drive[n].there[k] = 1;
        eits_copy(fast->drive[n].then[k], fast->state + (size_t)FAST_SIZE * k, FAST_WAYS);
    }
}

/* Touches that two frames on end have found and no drive; `at`: where the modelled skin has them.
 */
static void seed(eits_fast *fast, const eits_touch *found, const eits_real (*at)[2],
                 const uint8_t *taken, uint32_t count)
{
    const uint32_t known = fast->seeds;
    eits_real before[EITS_FAST_MAX_TOUCHES][2];
    memcpy(before, fast->seed, sizeof before);
    fast->seeds = 0;
    for (uint32_t n = 0; n < count; ++n) {
        const eits_real c = found[n].strength_s_per_m_mm2;
        const eits_real state[FAST_SIZE] = {at[n][0], at[n][1], c, 0, 0};
        if (taken[n])
            continue;
        /* Two frames on end: in a single one, a touch that landed while it was scanned may stand at
         * a wrong place. */
        if (!near_any(state, (const eits_real(*)[2])before, known)) {
            if (fast->seeds < EITS_FAST_MAX_TOUCHES)
                eits_copy(fast->seed[fast->seeds++], state, 2);
            continue;
        }
        if (fast->count == EITS_FAST_MAX_TOUCHES || near_known(fast, state))
            continue;
        const eits_real place = fast_square(EITS_FAST_SEED_MM);
        const eits_real speed = fast_square(EITS_FAST_FIRST_SPEED);
        const eits_real variance[FAST_SIZE] = {
            place, place, fast_square(EITS_FAST_SEED_STRENGTH * c), speed, speed};
        eits_fast_add(fast, state, variance, 0);
        was_there(fast, fast->count - 1);
        fast->known[fast->count - 1].energy = 4 * EITS_FAST_FAINT;
        fast->known[fast->count - 1].confirmed = 1;
    }
}

eits_status eits_fast_confirm(eits_fast *fast, const eits_touch *found, uint32_t count)
{
    uint8_t taken[EITS_MAX_TOUCHES] = {0};
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
    for (uint32_t k = fast->count; k-- > 0;) {
        fast_known *known = &fast->known[k];
        if (!known->aligned) /* it came after that frame */
            continue;
        known->aligned = 0;
        const uint32_t n = eits_fast_nearest(known->at, (const eits_real(*)[2])at, taken, count);
        if (n < count) {
            taken[n] = 1;
            known->confirmed = 1;
            known->frames_missed = 0;
        } else if (++known->frames_missed >= EITS_FAST_LOST_FRAMES && known->on) {
            eits_fast_forget(fast, k);
        }
    }
    /* a frame with rows that are no touch's may show any */
    seed(fast, found, (const eits_real(*)[2])at, taken, fast->wild == 0 ? count : 0);
    fast->wild = 0;
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
