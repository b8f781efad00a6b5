/* A drive's rows: believed, put down to something else than touches, or held until a touch explains
 * them. The order of the questions is that of their cost, and of how often they are answered. */
#include "fast/fast.h"

#include "context/places.h"
#include "search/search.h"

/* A row that no touch can have changed so: it is dead, turned over, or far above its reference. */
static int is_wild(const eits_fast *fast, eits_real v, eits_real v0)
{
    const eits_real square = fast_square(v0);
    return eits_fabs(v0) > EITS_FAST_DEAD_NOISE * fast->noise_v &&
           (v * v0 < EITS_FAST_DEAD * square || v * v0 > EITS_FAST_WILD * square);
}

/* An electrode is suspect while more of its rows are wild than are not. */
static void suspect(eits_fast *fast, const uint8_t *row, int wild)
{
    for (uint32_t k = 2; k < 4; ++k) {
        uint8_t *of = &fast->suspect[row[k]];
        if (wild)
            *of = *of < EITS_FAST_SUSPECT_MOST ? (uint8_t)(*of + 1) : *of;
        else
            *of = *of > 0 ? (uint8_t)(*of - 1) : 0;
    }
}

/* Rows that are measured; `wild` ones are an electrode's doing, or where it is most of them the
 * drive's. Rows of an electrode that is suspect are out as well. */
static void choose_rows(eits_fast *fast, const fast_drive *d, const eits_real *volts)
{
    const eits_real *v0 = fast->ctx->reference.v0;
    uint8_t wild[EITS_FAST_MAX_ROWS];
    uint32_t wild_rows = 0;
    for (uint32_t i = 0; i < d->count; ++i) {
        const uint32_t row = fast->row[d->first + i];
        fast->used[i] = eits_is_finite(volts[i]) && eits_is_finite(v0[row]) && !fast->masked[row];
        wild[i] = fast->used[i] && is_wild(fast, volts[i], v0[row]);
        wild_rows += wild[i];
    }
    fast->wild += wild_rows;
    for (uint32_t i = 0; i < d->count; ++i) {
        const uint8_t *row = eits_row(fast->ctx, fast->row[d->first + i]);
        if (fast->used[i] && 2 * wild_rows <= d->count)
            suspect(fast, row, wild[i]);
    }
    for (uint32_t i = 0; i < d->count; ++i) {
        const uint8_t *row = eits_row(fast->ctx, fast->row[d->first + i]);
        if (wild[i] || fast->suspect[row[2]] > EITS_FAST_SUSPECT ||
            fast->suspect[row[3]] > EITS_FAST_SUSPECT)
            fast->used[i] = 0;
    }
}

/* z of the drive's rows in the model's volts, where they are used, and the direction in which a
 * drift of the gain moves them; how many are used. */
static uint32_t take_rows(eits_fast *fast, const fast_drive *d, const eits_real *volts)
{
    const eits_real *v0 = fast->ctx->reference.v0;
    uint32_t used = 0;
    choose_rows(fast, d, volts);
    for (uint32_t i = 0; i < d->count; ++i) {
        const uint32_t row = fast->row[d->first + i];
        int use = fast->used[i];
        const eits_real change = volts[i] - (1 + fast->drift) * v0[row];
        const eits_real z = use ? fast->sign * fast->gain[row] * change : R(0);
        use = use && eits_fabs(z) < EITS_FAST_FAR * fast->sigma;
        fast->used[i] = (uint8_t)use;
        fast->z[i] = use ? z : 0;
        fast->along[i] = use ? fast->sign * fast->gain[row] * v0[row] : 0;
        used += (uint32_t)use;
    }
    return used;
}

/* Without one row that is a glitch, known touches explain the others. */
static int is_glitch(eits_fast *fast, uint32_t rows)
{
    uint32_t worst = 0;
    eits_real greatest = 0;
    for (uint32_t i = 0; i < rows; ++i) {
        const eits_real *line = fast_line(fast->factor, i);
        const eits_real own = fast_square(fast->e[i]) / fast_dot(line, line, i + 1);
        if (own > greatest) {
            greatest = own;
            worst = i;
        }
    }
    /* While drives wait, a known touch that starts to move may change one row by far the most. */
    const int waits = fast->held_count > 0 && fast->count > 0;
    const eits_real least = waits ? EITS_FAST_GLITCH_WAITING : EITS_FAST_GLITCH;
    if (!(greatest > least) || fast->glitched)
        return 0;
    /* One row, and not twice on end: a second such drive is a faulty electrode or a touch beside
     * it, and taking rows out drive by drive would hide either. */
    eits_real *unit = fast->spare;
    eits_zero(unit, rows);
    unit[worst] = 1;
    fast_whiten(fast->factor, unit, rows);
    const eits_real size = fast_dot(unit, fast->white, rows) / fast_dot(unit, unit, rows);
    /* chi^2 of the others: what is whitened, less its part along the row. Taken out number by
     * number, since a glitch is up to a million times the noise and its square has no digits left
     * for theirs. */
    eits_real left = 0;
    for (uint32_t i = 0; i < rows; ++i)
        left += fast_square(fast->white[i] - size * unit[i]);
    if (!(left < EITS_FAST_NEWS))
        return 0;
    fast->used[worst] = 0;
    (void)eits_fast_innovate(fast, rows);
    return 1;
}

/* Without a small drift of the gain they do. */
static int is_drift(eits_fast *fast, uint32_t rows)
{
    eits_real *drift = fast->spare;
    eits_copy(drift, fast->along, rows);
    fast_whiten(fast->factor, drift, rows);
    const eits_real energy = fast_dot(drift, drift, rows);
    if (!(energy > 0))
        return 0;
    const eits_real size = fast_dot(drift, fast->white, rows) / energy;
    /* A drift is along v0 and small. A touch in the middle of the skin answers almost alike, but
     * stronger than EITS_FAST_MAX_DRIFT. */
    const eits_real left = fast_dot(fast->white, fast->white, rows) - size * size * energy;
    if (!(left < EITS_FAST_NEWS && eits_fabs(size) < EITS_FAST_MAX_DRIFT))
        return 0;
    fast_axpy(fast->white, -size, drift, rows);
    fast->drift += EITS_FAST_DRIFT_STEP * size;
    return 1;
}

/* Return by how much chi^2 would fall, as linearised, if the one touch moved that promises most. */
static eits_real promise_of_moves(eits_fast *fast, uint32_t rows)
{
    eits_real most = 0, *x = fast->spare, *y = fast->other_factor;
    for (uint32_t k = 0; k < fast->count; ++k) {
        const eits_real *answer = fast->answer + FAST_WAYS * (size_t)fast->most_rows * k;
        if (!fast->known[k].on)
            continue;
        for (uint32_t i = 0; i < rows; ++i) {
            x[i] = fast->used[i] ? answer[fast->most_rows + i] : 0;
            y[i] = fast->used[i] ? answer[2 * (size_t)fast->most_rows + i] : 0;
        }
        fast_whiten(fast->factor, x, rows);
        fast_whiten(fast->factor, y, rows);
        const eits_real along_x = fast_dot(x, fast->white, rows), xx = fast_dot(x, x, rows);
        const eits_real along_y = fast_dot(y, fast->white, rows), yy = fast_dot(y, y, rows);
        const eits_real xy = fast_dot(x, y, rows), det = xx * yy - xy * xy;
        if (!(det > EITS_FAST_NO_SLOPE * xx * yy))
            continue;
        const eits_real promise =
            (yy * along_x * along_x - 2 * xy * along_x * along_y + xx * along_y * along_y) / det;
        most = promise > most ? promise : most;
    }
    return most;
}

/* Whether the touches explain the rows as they are whitened now. Those that moving a touch explains
 * clearly better are news. */
static int is_explained(eits_fast *fast, uint32_t rows, eits_real chi2)
{
    return chi2 < EITS_FAST_NEWS && promise_of_moves(fast, rows) < EITS_FAST_MOVES;
}

/* Let known strengths change at once, in two steps. *chi2 becomes what is left then; return whether
 * that explains the rows. If it does not, the touches stay as sure as they were. Places are never
 * loosened, because a known touch would move towards one that lands. */
static int with_changes(eits_fast *fast, uint32_t rows, eits_real *chi2)
{
    const eits_real strength[2] = {EITS_FAST_STRENGTH_JUMP, EITS_FAST_CHANGE};
    eits_real kept[EITS_FAST_MAX_TOUCHES];
    for (uint32_t k = 0; k < fast->count; ++k)
        kept[k] = fast->p[FAST_SIZE * k + FAST_C][FAST_SIZE * k + FAST_C];
    eits_real before = 0;
    int explained = 0;
    for (uint32_t how = 0; how < 2 && fast->count > 0 && !explained; ++how) {
        const eits_real share2 = fast_square(strength[how]);
        *chi2 = eits_fast_loosen(fast, rows, share2 - before);
        before = share2;
        explained = is_explained(fast, rows, *chi2);
    }
    for (uint32_t k = 0; k < fast->count && !explained; ++k)
        fast->p[FAST_SIZE * k + FAST_C][FAST_SIZE * k + FAST_C] = kept[k];
    return explained;
}

/* chi^2 of the last drives beyond what noise leaves of their rows. */
static eits_real excess(const eits_fast *fast)
{
    eits_real sum = 0;
    for (uint32_t n = 0; n < fast->chi2_count; ++n)
        sum += fast->chi2[n];
    return sum;
}

static void add_chi2(eits_fast *fast, eits_real chi2, uint32_t rows)
{
    if (fast->chi2_count == EITS_FAST_SUM_DRIVES) {
        for (uint32_t n = 1; n < EITS_FAST_SUM_DRIVES; ++n)
            fast->chi2[n - 1] = fast->chi2[n];
        --fast->chi2_count;
    }
    const eits_real most = chi2 < EITS_FAST_NEWS ? chi2 : EITS_FAST_NEWS;
    fast->chi2[fast->chi2_count++] = most - (eits_real)rows;
}

/* What touches explain of the rows, averaged; and a little of what is left along v0 is drift of the
 * gain, unless a touch `jumped`. */
static void learn_gain(eits_fast *fast, uint32_t rows, int jumped)
{
    for (uint32_t k = 0; k < fast->count; ++k) {
        const eits_real *g = fast->answer + FAST_WAYS * (size_t)fast->most_rows * k;
        const eits_real c = fast->state[FAST_SIZE * k + FAST_C];
        const eits_real energy = fast_square(c / fast->sigma) * fast_dot(g, g, rows);
        fast->known[k].energy += (energy - fast->known[k].energy) / EITS_FAST_ENERGY_DRIVES;
    }
    const eits_real energy = fast_dot(fast->along, fast->along, rows);
    if (energy > 0 && !jumped)
        fast->drift += EITS_FAST_GAIN_STEP * fast_dot(fast->along, fast->e, rows) / energy;
}

/* The model's error is learned where nothing happens: all touches have been there for a scan,
 * nothing waits, and the last drives were as expected. */
static int may_learn(const eits_fast *fast)
{
    for (uint32_t k = 0; k < fast->count; ++k) {
        if (fast->known[k].age <= EITS_FAST_BIAS_AGE)
            return 0;
    }
    return fast->count > 0 && fast->held_count == 0 && fast->quiet > EITS_FAST_BIAS_QUIET &&
           excess(fast) < EITS_FAST_SUM_MOST / 2;
}

/* The rows are as the known touches explain them. */
static void believe(eits_fast *fast, uint32_t drive, int jumped)
{
    const uint32_t rows = fast->drive[drive].count;
    learn_gain(fast, rows, jumped);
    const int learns = !jumped && may_learn(fast);
    eits_fast_update(fast, rows);
    if (learns)
        eits_fast_learn(fast, drive);
    if (fast->count == 0)
        eits_fast_forget_errors(fast, drive);
}

/* Rows that some explanation by known touches or none fits are believed; others are news, and wait
 * for the search. Returns whether they are accounted for. */
static int take_news(eits_fast *fast, uint32_t drive, uint32_t used, eits_real chi2, int news,
                     int jumped)
{
    fast->newsy = fast->newsy << 1 | (uint32_t)news;
    if (news && fast->count > 0 && eits_fast_is_known_error(fast, drive, chi2))
        return 1;
    add_chi2(fast, chi2, used);
    const int slow = fast->chi2_count == EITS_FAST_SUM_DRIVES && excess(fast) > EITS_FAST_SUM_MOST;
    eits_fast_keep(fast, drive, used, news);
    if (slow && !news) {
        fast->quiet = 0;
        if (fast->held_count == 0)
            eits_fast_hold_all(fast);
    }
    if (news) {
        fast->news = eits_larger(fast->news, chi2);
        return eits_search(fast);
    }
    if (fast->quiet >= EITS_FAST_QUIET)
        fast->held_count = fast->search.active = 0;
    if ((slow || fast->search.active) && eits_search(fast))
        return 1;
    believe(fast, drive, jumped);
    return 1;
}

/* Believe the rows, or wait; whether they are accounted for. */
static int look(eits_fast *fast, uint32_t drive, const eits_real *volts)
{
    const fast_drive *d = &fast->drive[drive];
    const uint32_t rows = d->count, used = take_rows(fast, d, volts);
    eits_fast_expect(fast, drive);
    eits_real chi2 = eits_fast_innovate(fast, rows);
    const int calm = chi2 < EITS_FAST_NEWS;
    int news = 0;
    if (calm) {
        fast->glitched = 0;
    } else {
        fast->glitched = (uint32_t)is_glitch(fast, rows);
        if (fast->glitched || (fast->count == 0 && is_drift(fast, rows))) {
            eits_fast_update(fast, rows);
            return 1;
        }
        news = !with_changes(fast, rows, &chi2);
    }
    return take_news(fast, drive, used, chi2, news, !calm);
}

/* A touch that moves but has stayed in place for some drives is still, and so is one that lay near
 * where the same drive had it a scan before, in as many drives on end as make a still touch move.
 * `then` is where that was, NULL if it was not there. The model's error differs from drive to drive
 * and moves a still touch to and fro within a scan. Its speed alone would not tell: it follows
 * noise. */
static void slow_down(eits_fast *fast, uint32_t k, const eits_real *then)
{
    fast_known *known = &fast->known[k];
    const eits_real *place = fast->state + FAST_SIZE * k;
    if (!known->moving || fast->held_count > 0)
        return;
    const int same = then != NULL && fast_distance2(then, place) < fast_square(EITS_FAST_RESTS_MM);
    known->creeps = same ? known->creeps + 1 : 0;
    if (known->creeps > EITS_FAST_CREEPS) {
        eits_fast_still(fast, k);
        return;
    }
    if (known->slow == 0)
        eits_copy(known->anchor, place, 2);
    if (++known->slow <= EITS_FAST_SLOW_DRIVES)
        return;
    known->slow = 0;
    if (fast_distance2(known->anchor, place) < fast_square(EITS_FAST_SLOW_MM))
        eits_fast_still(fast, k);
}

/* A still touch that goes the same way from scan to scan moves: it lags behind a finger that is too
 * slow to be news. It is compared with where the same drive had it, since the model's error shifts
 * it alike in each scan. `then` is where that was. */
static void speed_up(eits_fast *fast, uint32_t k, const eits_real *then)
{
    fast_known *known = &fast->known[k];
    eits_real *state = fast->state + FAST_SIZE * k;
    const eits_real by[2] = {state[FAST_X] - then[FAST_X], state[FAST_Y] - then[FAST_Y]};
    const eits_real far2 = by[0] * by[0] + by[1] * by[1];
    const int same = by[0] * known->anchor[0] + by[1] * known->anchor[1] > far2 / 2;
    const int goes = fast->held_count == 0 && far2 > fast_square(EITS_FAST_CREEPS_MM);
    known->creeps = goes ? (known->creeps > 0 && same ? known->creeps + 1 : 1) : 0;
    if (known->creeps <= 1)
        eits_copy(known->anchor, by, 2);
    if (known->creeps < EITS_FAST_CREEPS || !(fast->frame_s > 0))
        return;
    known->moving = 1;
    known->slow = known->creeps = 0;
    for (uint32_t axis = 0; axis < 2; ++axis) {
        const uint32_t speed = FAST_SIZE * k + FAST_VX + axis;
        state[FAST_VX + axis] = by[axis] / fast->frame_s;
        fast->p[speed][speed] = fast_square(EITS_FAST_SPEED_NOISE);
    }
}

/* Whether a touch that lifted may have left a part of its signal, which fades in seconds because
 * the skin creeps. Such a touch is still followed, as one that is off, so that what it left is not
 * found as a new touch. If the signal has not faded when the peak is forgotten, a finger presses
 * lightly. A touch that no frame has shown, or that was hardly there, may have been a wrong place.
 */
static int leaves_rest(const eits_fast *fast, uint32_t k)
{
    const fast_known *known = &fast->known[k];
    for (uint32_t n = 0; n < fast->count; ++n) {
        if (n != k && fast_is_palm(fast->known[n].rho2) &&
            fast_distance2(fast->state + FAST_SIZE * n, fast->state + FAST_SIZE * k) <
                fast_square(fast_room_mm(fast, n)))
            return 0;
    }
    return known->confirmed && known->age >= EITS_FAST_LEAVES && known->energy >= EITS_FAST_FAINT &&
           fast->count < EITS_FAST_MAX_TOUCHES;
}

/* Which touches are on, and which have gone. */
static void update_known(eits_fast *fast, const fast_drive *d, uint32_t there)
{
    for (uint32_t k = fast->count; k-- > 0;) {
        fast_known *known = &fast->known[k];
        eits_real *state = fast->state + FAST_SIZE * k;
        const eits_real strength = state[FAST_C];
        known->peak = strength > known->peak ? strength : known->peak;
        /* Two limits, so that a touch near one does not come and go. While it is off it keeps its
         * id: a finger that bounces is the same finger. */
        if (!(strength >= EITS_FAST_OFF * known->peak && known->energy >= EITS_FAST_FAINT))
            known->on = 0;
        else if (strength > EITS_FAST_ON * known->peak && known->energy > 2 * EITS_FAST_FAINT)
            eits_fast_put_on(fast, k);
        known->off_drives = known->on ? 0 : known->off_drives + 1;
        if (known->off_drives > EITS_FAST_GONE)
            known->peak -= known->peak / EITS_FAST_FORGETS;
        slow_down(fast, k, (there >> k & 1u) != 0 ? d->then[k] : NULL);
        if (!known->moving && known->on && (there >> k & 1u) != 0)
            speed_up(fast, k, d->then[k]);
        const int gone = known->off_drives > EITS_FAST_GONE && !leaves_rest(fast, k);
        if (gone || !eits_fast_on_skin(fast, state, known->rho2) ||
            !eits_all_finite(state, FAST_SIZE))
            eits_fast_drop(fast, k);
        else if (!known->on && known->moving)
            eits_fast_still(fast, k);
    }
}

/* A touch that has left the skin by its speed. */
static void forget_off_skin(eits_fast *fast)
{
    for (uint32_t k = fast->count; k-- > 0;) {
        ++fast->known[k].age;
        if (!eits_fast_on_skin(fast, fast->state + FAST_SIZE * k, fast->known[k].rho2))
            eits_fast_drop(fast, k);
    }
}

eits_status eits_fast_drive(eits_fast *fast, uint32_t drive, const eits_real *volts, uint32_t count,
                            uint32_t time_us)
{
    if (fast == NULL || volts == NULL || drive >= fast->drives || count != fast->drive[drive].count)
        return EITS_E_ARGUMENT;
    if (!fast->begun)
        return EITS_E_NO_REFERENCE;
    fast_drive *d = &fast->drive[drive];
    /* Unsigned, so that the clock may wrap after 71 minutes; one that goes back is taken as no time
     * at all. */
    const uint32_t gone_us = time_us - fast->time_us;
    if (fast->timed && gone_us > 0 && gone_us < UINT32_MAX / 2)
        eits_fast_predict(fast, (eits_real)gone_us * R(1e-6));
    fast->time_us = time_us;
    fast->timed = 1;
    ++fast->drive_count;
    forget_off_skin(fast);
    uint32_t there = 0; /* the touches that the drive had when it was last measured */
    for (uint32_t k = 0; k < EITS_FAST_MAX_TOUCHES; ++k) {
        there |= (uint32_t)(d->there[k] != 0) << k;
        d->there[k] = 0;
    }
    const int explained = look(fast, drive, volts);
    d->explained = (uint8_t)explained;
    fast->unexplained = fast->unexplained << 1 | (uint32_t)!explained;
    update_known(fast, d, there);
    for (uint32_t k = 0; k < fast->count; ++k) {
        d->there[k] = 1;
        eits_copy(d->then[k], fast->state + FAST_SIZE * k, FAST_WAYS);
    }
    return EITS_OK;
}

eits_status eits_fast_touches(const eits_fast *fast, eits_fast_touch *touches, uint32_t room,
                              uint32_t *count)
{
    if (fast == NULL || touches == NULL || count == NULL)
        return EITS_E_ARGUMENT;
    *count = 0;
    for (uint32_t k = 0; k < fast->count && *count < room; ++k) {
        const fast_known *known = &fast->known[k];
        const uint32_t first = FAST_SIZE * k;
        const eits_real *state = fast->state + first;
        eits_real at[2] = {state[FAST_X], state[FAST_Y]};
        eits_place_on_skin(fast->ctx, at);
        if (known->on)
            touches[(*count)++] =
                (eits_fast_touch){.id = known->id,
                                  .confirmed = known->confirmed,
                                  .x_mm = at[0],
                                  .y_mm = at[1],
                                  .vx_mm_per_s = state[FAST_VX],
                                  .vy_mm_per_s = state[FAST_VY],
                                  .strength_s_per_m_mm2 = fast->sign * state[FAST_C],
                                  .radius_mm = eits_sqrt(known->rho2) / EITS_FAST_SOFT_RADIUS,
                                  .x_variance_mm2 = fast->p[first + FAST_X][first + FAST_X],
                                  .xy_covariance_mm2 = fast->p[first + FAST_Y][first + FAST_X],
                                  .y_variance_mm2 = fast->p[first + FAST_Y][first + FAST_Y]};
    }
    return EITS_OK;
}
