/* Pieces of a search: one new touch or two, still or in motion, alone, in place of a young one, or
 * while known ones move. */
#include "search/search.h"

static int one_is_not_enough(const eits_fast *fast)
{
    return search_one(fast)->exists && !eits_is_noise(fast, search_one(fast), 1) &&
           fast->search.count > 2 && !eits_search_changed(fast, FAST_MOVE) &&
           !eits_search_changed(fast, FAST_REPLACE);
}

/* Beside one new touch, searches look by turns for two new ones and for anything else. A search
 * looks again for what the last one would have acted on. */
static int odd(const eits_fast *fast)
{
    const fast_search *s = &fast->search;
    const int again = s->last_count > 0 && s->last_at == s->decisions;
    return again ? s->last_count == 1 : (s->decisions & 1u) != 0;
}

/* ---- one new touch ---- */

static uint32_t cost_of_one(const eits_fast *fast)
{
    return fast->search.count;
}

static uint32_t cost_of_rival(const eits_fast *fast)
{
    return search_one(fast)->exists && !eits_search_clear(fast) ? fast->search.count : 0;
}

/* The last searches may have come to a better place near there. */
static void warmer(const eits_fast *fast, eits_real *place)
{
    const fast_search *s = &fast->search;
    for (uint32_t n = 0; n < s->warm_count && s->decisions - s->warm_at <= 2; ++n) {
        if (!fast_apart(s->warm[n], place)) {
            eits_copy(place, s->warm[n], 2);
            return;
        }
    }
}

static void start(eits_fast *fast, const eits_real *place, uint32_t count, uint32_t steps,
                  fast_trial *trial)
{
    eits_trial_begin(fast, trial, count);
    eits_trial_add_new(trial, place, 0);
    (void)eits_trial_say(fast, trial);
    eits_trial_refine(fast, trial, steps);
}

static void swap(eits_fast *fast, fast_which a, fast_which b)
{
    fast_trial *next = &fast->search.next;
    *next = *search_trial(fast, a);
    *search_trial(fast, a) = *search_trial(fast, b);
    *search_trial(fast, b) = *next;
}

static int all_rest(const eits_fast *fast)
{
    for (uint32_t k = 0; k < fast->count; ++k) {
        if (!search_rests(fast, k))
            return 0;
    }
    return fast->count > 0;
}

/* Beside touches that rest, what explained the drives of the last search is looked at first: the
 * map's peak may lie elsewhere, and known touches would seem to have moved. */
static void look_for_one(eits_fast *fast)
{
    fast_search *s = &fast->search;
    eits_real from[2];
    if (!eits_fast_peak(fast, fast->score, NULL, 0, s->peak))
        return;
    if (s->warm_explains && s->decisions - s->warm_at <= 1 && all_rest(fast))
        eits_copy(s->peak, s->warm[0], 2);
    eits_copy(from, s->peak, 2);
    warmer(fast, from);
    start(fast, from, s->count, 2, search_trial(fast, FAST_ONE));
}

static void end_one(eits_fast *fast)
{
    fast_trial *one = search_trial(fast, FAST_ONE);
    one->lead = one->all - one->left;
}

/* The next peak of the map is its rival, and takes its place if it explains more. */
static void look_for_rival(eits_fast *fast)
{
    fast_search *s = &fast->search;
    eits_real from[2];
    if (eits_fast_peak(fast, fast->score, (const eits_real(*)[2])s->peak, 1, from)) {
        warmer(fast, from);
        start(fast, from, s->count, 1, search_trial(fast, FAST_RIVAL));
    }
}

static void end_rival(eits_fast *fast)
{
    fast_search *s = &fast->search;
    fast_trial *one = search_trial(fast, FAST_ONE), *rival = search_trial(fast, FAST_RIVAL);
    if (rival->exists && rival->left < one->left)
        swap(fast, FAST_ONE, FAST_RIVAL);
    s->warm_count = 0;
    for (uint32_t n = 0; n < 2; ++n) {
        if (s->trial[FAST_ONE + n].exists)
            eits_copy(s->warm[s->warm_count++], s->trial[FAST_ONE + n].body[0].p, 2);
    }
    s->warm_at = s->decisions;
    s->warm_explains = (uint32_t)eits_is_noise(fast, one, 1);
    one->lead = one->all - one->left;
    if (rival->exists && fast_apart(rival->body[0].p, one->body[0].p) &&
        rival->left - one->left < one->lead)
        one->lead = rival->left - one->left;
}

/* More steps where it leaves more than noise and they may help. */
static uint32_t cost_of_more(const eits_fast *fast)
{
    return one_is_not_enough(fast) ? fast->search.count : 0;
}

static void ask_for_more(eits_fast *fast)
{
    fast->search.before = search_one(fast)->left;
    eits_trial_refine(fast, search_trial(fast, FAST_ONE), 2);
}

static void end_more(eits_fast *fast)
{
    fast_trial *one = search_trial(fast, FAST_ONE);
    one->lead += fast->search.before - one->left;
    eits_copy(fast->search.warm[0], one->body[0].p, 2);
}

/* ---- one new touch, otherwise ---- */

static uint32_t cost_of_late(const eits_fast *fast)
{
    uint32_t k;
    return one_is_not_enough(fast) && odd(fast) && !eits_search_near(fast, &k)
               ? fast->search.count - 1
               : 0;
}

/* The first drive may have been measured while the touch landed. */
static void look_for_late(eits_fast *fast)
{
    start(fast, search_one(fast)->body[0].p, fast->search.count - 1, 3,
          search_trial(fast, FAST_LATE));
}

static void end_late(eits_fast *fast)
{
    fast_trial *trial = search_trial(fast, FAST_LATE);
    trial->lead = trial->all - trial->left;
    if (search_one(fast)->lead < trial->lead)
        trial->lead = search_one(fast)->lead;
}

static uint32_t cost_of_swift(const eits_fast *fast)
{
    return one_is_not_enough(fast) && odd(fast) ? search_last(fast, EITS_FAST_SHORT_DRIVES) : 0;
}

static void look_for_swift(eits_fast *fast)
{
    fast_trial *trial = search_trial(fast, FAST_SWIFT);
    eits_trial_begin(fast, trial, EITS_FAST_SHORT_DRIVES);
    eits_trial_add_new(trial, search_one(fast)->body[0].p, 1);
    (void)eits_trial_say(fast, trial);
    eits_trial_refine(fast, trial, 4);
}

static void end_swift(eits_fast *fast)
{
    fast_trial *trial = search_trial(fast, FAST_SWIFT);
    eits_real covariance[FAST_FIT][FAST_FIT];
    if (!trial->exists || !eits_trial_covariance(trial, covariance)) {
        trial->exists = 0;
        return;
    }
    const eits_real *p = trial->body[0].p;
    const eits_real speed2 = fast_square(p[2]) + fast_square(p[3]);
    const eits_real doubt = 9 * (covariance[2][2] + covariance[3][3]);
    trial->exists = speed2 > eits_larger(doubt, fast_square(EITS_FAST_SWIFT_SPEED)) &&
                    speed2 < fast_square(EITS_FAST_SPEED_MOST);
    trial->lead = trial->all - trial->left;
    if (search_one(fast)->lead < trial->lead)
        trial->lead = search_one(fast)->lead;
}

/* ---- two new touches ---- */

static uint32_t cost_of_beside(const eits_fast *fast)
{
    return one_is_not_enough(fast) && !odd(fast) ? EITS_FAST_MAP_ANSWERS + 1 : 0;
}

/* The map beside the best one, of the last drive. */
static void map_beside(eits_fast *fast)
{
    const fast_held *held = fast->ring[fast->search.from + fast->search.count - 1];
    const eits_real *place = search_one(fast)->body[0].p;
    fast_sight sight = {.field = fast->search.fields};
    fast_disc *disc = &fast->search.disc[0];
    eits_zero(fast->search.pair_score, fast->cells);
    if (!eits_fast_gather(fast, place, fast->rho2, disc))
        return;
    eits_fast_look(fast, place, fast->rho2, disc, &sight);
    eits_trial_answer(fast, held, disc, &sight, FAST_NONE, fast->search.ways);
    eits_fast_map(fast, held, fast->search.ways, fast->search.pair_score);
    fast->search.spent += EITS_FAST_MAP_ANSWERS + 1;
}

static uint32_t cost_of_pair(const eits_fast *fast)
{
    return one_is_not_enough(fast) && !odd(fast) ? 2 * search_last(fast, EITS_FAST_SHORT_DRIVES)
                                                 : 0;
}

/* Two places as they are; kept as the pair, or as its rival, if they explain more. */
static void try_pair(eits_fast *fast, const eits_real *a, const eits_real *b)
{
    fast_trial *trial = &fast->search.scratch;
    fast_trial *best = search_trial(fast, FAST_PAIR), *rival = search_trial(fast, FAST_PAIR_RIVAL);
    eits_trial_begin(fast, trial, EITS_FAST_SHORT_DRIVES);
    eits_trial_add_new(trial, a, 0);
    eits_trial_add_new(trial, b, 0);
    if (!eits_trial_say(fast, trial))
        return;
    if (!best->exists || trial->left < best->left) {
        *rival = *best;
        *best = *trial;
    } else if (!rival->exists || trial->left < rival->left) {
        *rival = *trial;
    }
}

/* The best one, with the peak of the map beside it. */
static void try_beside(eits_fast *fast)
{
    const eits_real *first = search_one(fast)->body[0].p;
    eits_real second[2];
    if (eits_fast_peak(fast, fast->search.pair_score, (const eits_real(*)[2])first, 1, second))
        try_pair(fast, first, second);
}

/* The places that the last search for a pair came to serve for a while. */
static int pair_is_known(const eits_fast *fast)
{
    return fast->search.pair_known && fast->search.decisions - fast->search.pair_at <= 3;
}

/* One at each side of the best one. */
static void try_about(eits_fast *fast, eits_real x_mm, eits_real y_mm)
{
    const eits_real *middle = search_one(fast)->body[0].p;
    const eits_real a[2] = {middle[0] + x_mm, middle[1] + y_mm};
    const eits_real b[2] = {middle[0] - x_mm, middle[1] - y_mm};
    try_pair(fast, a, b);
}

static void try_along_x(eits_fast *fast)
{
    if (pair_is_known(fast))
        try_pair(fast, fast->search.pair[0], fast->search.pair[1]);
    else
        try_about(fast, EITS_FAST_HALF_PAIR_MM, 0);
}

static uint32_t cost_along_y(const eits_fast *fast)
{
    return pair_is_known(fast) ? 0 : cost_of_pair(fast);
}

static void try_along_y(eits_fast *fast)
{
    try_about(fast, 0, EITS_FAST_HALF_PAIR_MM);
}

/* The same pair, in either order. */
static int same_pair(const fast_trial *a, const fast_trial *b)
{
    const eits_real near = fast_square(EITS_FAST_SAME_PAIR_MM);
    for (uint32_t turn = 0; turn < 2; ++turn) {
        if (fast_distance2(a->body[0].p, b->body[turn].p) < near &&
            fast_distance2(a->body[1].p, b->body[1 - turn].p) < near)
            return 1;
    }
    return 0;
}

static void refine_pair(eits_fast *fast)
{
    eits_trial_refine(fast, search_trial(fast, FAST_PAIR), 3);
}

static void end_pair(eits_fast *fast)
{
    fast_search *s = &fast->search;
    fast_trial *best = search_trial(fast, FAST_PAIR), *rival = search_trial(fast, FAST_PAIR_RIVAL);
    if (!best->exists)
        return;
    for (uint32_t n = 0; n < 2; ++n)
        eits_copy(s->pair[n], best->body[n].p, 2);
    s->pair_known = 1;
    s->pair_at = s->decisions;
    best->lead = best->all - best->left;
    if (rival->exists && !same_pair(best, rival) && rival->left - best->left < best->lead)
        best->lead = rival->left - best->left;
}

static int explains(const eits_fast *fast, fast_which which)
{
    const fast_trial *trial = &fast->search.trial[which];
    return trial->exists && eits_is_noise(fast, trial, trial->fresh);
}

/* The two places that the last split found are used again in the next three decisions. */
static int split_is_known(const eits_fast *fast)
{
    const fast_search *s = &fast->search;
    return s->split_at > 0 && s->decisions + 1 - s->split_at <= 3 &&
           s->trial[FAST_SPLIT].gone < fast->count;
}

/* The young touch that may be two. */
static int may_be_two(const eits_fast *fast, uint32_t *k)
{
    const int found = eits_search_near(fast, k);
    if (split_is_known(fast))
        *k = fast->search.trial[FAST_SPLIT].gone;
    else if (!found)
        return 0;
    return fast->known[*k].age < EITS_FAST_YOUNG;
}

/* A young touch that was two: it goes, and two come. One touch beside it explains two fingers well
 * at a wrong place, and is not believed then. */
static uint32_t cost_of_split(const eits_fast *fast)
{
    uint32_t k;
    return search_one(fast)->exists && fast->search.count > 2 && !explains(fast, FAST_MOVE) &&
                   !explains(fast, FAST_REPLACE) && !eits_is_believed(fast, search_one(fast)) &&
                   may_be_two(fast, &k)
               ? 2 * search_last(fast, EITS_FAST_SHORT_DRIVES)
               : 0;
}

/* The two begin where the last search left them, or on either side of the known touch, towards
 * where another one would explain most. */
static void look_for_split(eits_fast *fast)
{
    fast_trial *trial = search_trial(fast, FAST_SPLIT);
    const eits_real *other = search_one(fast)->body[0].p;
    uint32_t k;
    if (!may_be_two(fast, &k))
        return;
    const eits_real *known = fast->state + FAST_SIZE * k;
    eits_real place[2][2];
    const eits_real apart2 = fast_distance2(known, other),
                    by = apart2 > 0 ? EITS_FAST_HALF_PAIR_MM / eits_sqrt(apart2) : 0;
    for (uint32_t axis = 0; axis < 2; ++axis) {
        const eits_real away = by * (other[axis] - known[axis]);
        place[0][axis] = split_is_known(fast) ? trial->body[0].p[axis] : known[axis] - away;
        place[1][axis] = split_is_known(fast) ? trial->body[1].p[axis] : known[axis] + away;
    }
    eits_trial_begin(fast, trial, EITS_FAST_SHORT_DRIVES);
    eits_trial_add_new(trial, place[0], 0);
    eits_trial_add_new(trial, place[1], 0);
    trial->gone = (uint8_t)k;
    (void)eits_trial_say(fast, trial);
    eits_trial_refine(fast, trial, 3);
}

static void end_split(eits_fast *fast)
{
    fast_trial *trial = search_trial(fast, FAST_SPLIT);
    const fast_trial *one = search_one(fast);
    trial->lead = trial->all;
    if (trial->exists && trial->left * (eits_real)one->count < one->left * (eits_real)trial->count)
        fast->search.split_at = fast->search.decisions + 1;
}

/* ---- a new touch while others move, and moves by the last drives alone ---- */

static uint32_t cost_of_both(const eits_fast *fast)
{
    const fast_trial *move = &fast->search.trial[FAST_MOVE];
    return one_is_not_enough(fast) && odd(fast) && move->exists && move->bodies == 1
               ? 2 * search_last(fast, EITS_FAST_LAST_DRIVES)
               : 0;
}

static void look_for_both(eits_fast *fast)
{
    const fast_trial *move = search_trial(fast, FAST_MOVE);
    fast_trial *trial = search_trial(fast, FAST_BOTH);
    eits_trial_begin(fast, trial, EITS_FAST_LAST_DRIVES);
    for (uint32_t i = 0; i < move->bodies; ++i) {
        eits_trial_add_known(fast, trial, move->body[i].known);
        eits_copy(trial->body[i].p, move->body[i].p, 4);
    }
    eits_trial_add_new(trial, search_one(fast)->body[0].p, 0);
    (void)eits_trial_say(fast, trial);
    eits_trial_refine(fast, trial, 2);
}

static void end_both(eits_fast *fast)
{
    fast_trial *trial = search_trial(fast, FAST_BOTH);
    trial->lead = trial->all;
    fast->search.alone = -1;
}

static uint32_t cost_of_alone(const eits_fast *fast)
{
    const fast_trial *both = &fast->search.trial[FAST_BOTH];
    return both->exists ? both->count : 0;
}

/* Fit the moves alone to the same drives, for comparison. */
static void look_alone(eits_fast *fast)
{
    fast_trial *alone = &fast->search.scratch;
    *alone = *search_trial(fast, FAST_BOTH);
    --alone->bodies;
    alone->fresh = 0;
    (void)eits_trial_say(fast, alone);
    eits_trial_refine(fast, alone, 2);
}

static void end_alone(eits_fast *fast)
{
    const fast_trial *alone = &fast->search.scratch;
    fast->search.alone = alone->exists ? alone->left : -1;
}

const search_piece eits_piece_one = {cost_of_one, look_for_one, end_one};
const search_piece eits_piece_rival = {cost_of_rival, look_for_rival, end_rival};
const search_piece eits_piece_more = {cost_of_more, ask_for_more, end_more};
const search_piece eits_pieces_birth[10] = {
    {cost_of_late, look_for_late, end_late}, {cost_of_swift, look_for_swift, end_swift},
    {cost_of_beside, map_beside, NULL},      {cost_of_pair, try_beside, NULL},
    {cost_of_pair, try_along_x, NULL},       {cost_along_y, try_along_y, NULL},
    {cost_of_pair, refine_pair, end_pair},   {cost_of_split, look_for_split, end_split},
    {cost_of_both, look_for_both, end_both}, {cost_of_alone, look_alone, end_alone},
};
