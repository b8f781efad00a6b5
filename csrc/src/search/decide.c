/* This file decides which hypothesis is acted on. A cost is in chi^2: what the hypothesis leaves,
 * and a price for each number that was free. A wrong touch is worse than a late one, so that a
 * birth must beat each move and change of known touches by a margin, explain the drives to noise,
 * leave no rival, and come out twice unless it explains several drives clearly; whatever is not
 * clear waits for more drives. */
#include "search/search.h"

static const eits_real HUGE_COST = R(1e30);

eits_real eits_cost_of_birth(const fast_trial *trial)
{
    return trial->left + 2 * (eits_real)(trial->fresh * trial->count) + 4 + trial->change;
}

/* ---- births ---- */

/* New touches are apart from each other and from touches that are on and stay. */
static int is_apart(const eits_fast *fast, const fast_trial *trial)
{
    const uint32_t first = trial->bodies - trial->fresh;
    for (uint32_t i = first; i < trial->bodies; ++i) {
        const eits_real *place = trial->body[i].p;
        for (uint32_t k = 0; k < fast->count; ++k) {
            if (fast->known[k].on && k != trial->gone &&
                !(fast_distance2(place, fast->state + FAST_SIZE * k) >
                  fast_square(fast_room_mm(fast, k))))
                return 0;
        }
    }
    return trial->fresh < 2 || fast_apart(trial->body[first].p, trial->body[first + 1].p);
}

int eits_is_believed(const eits_fast *fast, const fast_trial *trial)
{
    eits_real covariance[FAST_FIT][FAST_FIT];
    const eits_real doubt = eits_doubt(fast, trial);
    /* where one touch stands between two fingers, rough places are better than its own */
    const eits_real most =
        trial->gone != FAST_NONE ? EITS_FAST_SPLIT_SPREAD_MM : EITS_FAST_SPREAD_MM;
    if (fast->count + trial->fresh - (trial->gone != FAST_NONE) > EITS_FAST_MAX_TOUCHES ||
        !eits_trial_covariance(trial, covariance))
        return 0;
    uint32_t at = 0;
    for (uint32_t i = 0; i < trial->bodies; at += trial->body[i++].numbers) {
        const uint32_t which = i + trial->fresh - trial->bodies;
        const eits_real spread = covariance[at][at] + covariance[at + 1][at + 1];
        if (trial->body[i].known == FAST_NONE && (!(trial->own[which] > EITS_FAST_BIRTH * doubt) ||
                                                  !(doubt * spread < fast_square(most))))
            return 0;
    }
    const eits_real clear = EITS_FAST_AMBIGUOUS * trial->own[trial->fresh - 1];
    return eits_is_noise(fast, trial, trial->fresh) &&
           trial->lead > eits_larger(clear, EITS_FAST_BIRTH) && is_apart(fast, trial);
}

/* A cost as if its trial explained all drives of the search. */
static eits_real rate(const eits_fast *fast, const fast_trial *trial)
{
    return trial->cost * (eits_real)fast->search.count / (eits_real)trial->count;
}

/* Costs of the births; those without the first drive or in motion differ from the simple one by
 * what they leave, since its other costs hold for all drives. */
static void cost_births(eits_fast *fast)
{
    fast_trial *trial = fast->search.trial, *one = &trial[FAST_ONE];
    one->cost = eits_cost_of_birth(one);
    trial[FAST_LATE].cost = one->cost - one->left + trial[FAST_LATE].left;
    trial[FAST_SWIFT].cost = one->cost - one->left + trial[FAST_SWIFT].left;
    trial[FAST_PAIR].cost = eits_cost_of_birth(&trial[FAST_PAIR]);
    trial[FAST_SPLIT].cost =
        trial[FAST_SPLIT].left + 4 * (eits_real)trial[FAST_SPLIT].count + EITS_FAST_SPLIT_COST;
    trial[FAST_BOTH].cost = trial[FAST_BOTH].left + 2 * (eits_real)trial[FAST_BOTH].count + 4 +
                            4 * (eits_real)fast->count;
}

/* Whether a birth beside moves leaves enough less of the drives than the moves alone. */
static int beats_its_moves(const eits_fast *fast, const fast_trial *both)
{
    const eits_real share = EITS_FAST_BIRTH_SHARE * (both->all - both->left);
    return fast->search.alone - both->left >
           eits_larger(EITS_FAST_BIRTH_MARGIN, share) + 2 * (eits_real)both->count;
}

static int may_be_born(eits_fast *fast, fast_which which)
{
    const fast_trial *trial = &fast->search.trial[which];
    if (!trial->exists || !eits_is_believed(fast, trial))
        return 0;
    return which != FAST_BOTH || beats_its_moves(fast, trial);
}

static int near_last(const fast_search *s, const eits_real *place, eits_real reach)
{
    for (uint32_t n = 0; n < s->last_count; ++n) {
        if (fast_distance2(place, s->last[n]) < fast_square(reach))
            return 1;
    }
    return 0;
}

/* Whether this birth has come out as often as it must. */
static int is_stable(eits_fast *fast, const fast_trial *trial)
{
    fast_search *s = &fast->search;
    const uint32_t first = trial->bodies - trial->fresh;
    const fast_body *body = &trial->body[first];
    const eits_real speed = trial->fresh == 1 && body->numbers == 4
                                ? eits_sqrt(fast_square(body->p[2]) + fast_square(body->p[3]))
                                : 0;
    const eits_real reach = EITS_FAST_STABLE_MM + speed * 2 * EITS_FAST_DRIVE_S;
    int crowd = trial->fresh > 1,
        same = s->last_count == trial->fresh && s->decisions - s->last_at <= 2;
    for (uint32_t k = 0; k < fast->count; ++k)
        crowd |= fast->known[k].age < EITS_FAST_YOUNG;
    for (uint32_t i = 0; i < trial->fresh; ++i)
        same = same && near_last(s, body[i].p, reach);
    s->last_times = same ? s->last_times + 1 : 1;
    s->last_count = trial->fresh;
    s->last_at = s->decisions;
    for (uint32_t i = 0; i < trial->fresh; ++i)
        eits_copy(s->last[i], body[i].p, 2);
    /* the first touch has no rival that is known already, and is awaited the most */
    const int first_of_all = fast->count == 0 && trial->fresh == 1;
    uint32_t need = crowd ? EITS_FAST_STABLE_CROWD : EITS_FAST_STABLE;
    if (eits_is_clear(fast, trial, trial->fresh))
        need = first_of_all || trial->count >= EITS_FAST_STABLE_DRIVES ? 1 : EITS_FAST_STABLE;
    if (s->last_times < need)
        return 0;
    s->last_count = 0;
    return 1;
}

static void give_birth(eits_fast *fast, fast_which which)
{
    const fast_trial *trial = &fast->search.trial[which];
    if (which == FAST_BOTH)
        eits_apply_move(fast, trial);
    eits_apply_birth(fast, trial);
}

/* ---- changes of known touches ---- */

/* A move or a replacement, the cheapest that leaves noise and explains much; FAST_WHICH: none. */
static fast_which best_change(const eits_fast *fast)
{
    const fast_which changes[2] = {FAST_MOVE, FAST_REPLACE};
    fast_which best = FAST_WHICH;
    for (uint32_t n = 0; n < 2; ++n) {
        const fast_trial *trial = &fast->search.trial[changes[n]];
        const eits_real least = EITS_FAST_MOVE_LEAST + 2 * (eits_real)fast->search.count;
        if (trial->exists && trial->all - trial->left > least &&
            eits_is_noise(fast, trial, trial->fresh) &&
            (best == FAST_WHICH || trial->cost < fast->search.trial[best].cost))
            best = changes[n];
    }
    return best;
}

/* Another one leaves noise as well, and costs hardly more. */
static int has_rival(const eits_fast *fast, fast_which best)
{
    const fast_which other = best == FAST_MOVE ? FAST_REPLACE : FAST_MOVE;
    const fast_trial *rival = &fast->search.trial[other], *trial = &fast->search.trial[best];
    return rival->exists && eits_is_noise(fast, rival, rival->fresh) &&
           rival->cost < trial->cost + EITS_FAST_UNCLEAR;
}

static int change_known(eits_fast *fast, eits_real best_birth, eits_real best_other)
{
    const fast_which best = best_change(fast);
    if (best == FAST_WHICH)
        return 0;
    const fast_trial *trial = &fast->search.trial[best];
    const eits_real gain = trial->all - trial->left;
    const int little = gain < EITS_FAST_MOVE_CLEAR;
    eits_real margin = little ? EITS_FAST_MOVE_MARGIN / 2 : EITS_FAST_MOVE_TIE;
    if (fast->search.count < 4)
        margin = EITS_FAST_MOVE_MARGIN;
    if ((little && has_rival(fast, best)) || !(best_birth - trial->cost > margin) ||
        !(trial->cost < best_other + 1))
        return 0;
    if (best == FAST_MOVE)
        eits_apply_move(fast, trial);
    else
        eits_apply_replace(fast, trial);
    return 1;
}

/* ---- the decision ---- */

/* The cheapest birth of all, and of those that are believed. */
static fast_which best_birth(eits_fast *fast, eits_real *least)
{
    const fast_which births[] = {FAST_ONE, FAST_LATE, FAST_SWIFT, FAST_PAIR, FAST_SPLIT, FAST_BOTH};
    fast_which best = FAST_WHICH;
    *least = HUGE_COST;
    for (uint32_t n = 0; n < sizeof births / sizeof births[0]; ++n) {
        const fast_trial *trial = &fast->search.trial[births[n]];
        if (!trial->exists)
            continue;
        *least = rate(fast, trial) < *least ? rate(fast, trial) : *least;
        if ((best == FAST_WHICH || rate(fast, trial) < rate(fast, &fast->search.trial[best])) &&
            may_be_born(fast, births[n]))
            best = births[n];
    }
    return best;
}

static eits_real cost_of(const eits_fast *fast, fast_which which)
{
    const fast_trial *trial = &fast->search.trial[which];
    return trial->exists ? trial->cost : HUGE_COST;
}

int eits_decide(eits_fast *fast)
{
    fast_trial *trial = fast->search.trial;
    const eits_real drives = (eits_real)fast->search.count;
    if (!trial[FAST_ONE].exists)
        return 0;
    cost_births(fast);
    trial[FAST_MOVE].cost =
        trial[FAST_MOVE].left + trial[FAST_MOVE].change + 4 * (eits_real)trial[FAST_MOVE].bodies;
    const fast_trial *instead = &trial[FAST_REPLACE];
    if (instead->exists && search_rests(fast, instead->gone) &&
        instead->rho2 == fast->known[instead->gone].rho2)
        trial[FAST_REPLACE].exists = 0;
    if (trial[FAST_REPLACE].exists)
        trial[FAST_REPLACE].cost += 6 + (fast_is_palm(trial[FAST_REPLACE].rho2) ? 0 : 2 * drives);
    eits_real least;
    const fast_which birth = best_birth(fast, &least);
    const eits_real move = cost_of(fast, FAST_MOVE), replace = cost_of(fast, FAST_REPLACE);
    const eits_real other = move < replace ? move : replace;
    if (birth != FAST_WHICH) {
        const fast_trial *born = &trial[birth];
        const eits_real share = EITS_FAST_BIRTH_SHARE * (born->all - born->left);
        if (rate(fast, born) < least + EITS_FAST_RIVAL &&
            other - rate(fast, born) > eits_larger(EITS_FAST_BIRTH_MARGIN, share)) {
            if (!is_stable(fast, born))
                return 0;
            give_birth(fast, birth);
            return 1;
        }
    }
    return change_known(fast, least, other);
}
