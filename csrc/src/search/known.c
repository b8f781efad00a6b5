/* Pieces of a search: known touches have moved, or one is elsewhere, faster or wider than was
 * thought. */
#include "search/search.h"

static int any_on(const eits_fast *fast)
{
    for (uint32_t k = 0; k < fast->count; ++k) {
        if (fast->known[k].on)
            return 1;
    }
    return 0;
}

/* The known touch that the best new one may be instead: the nearest. One that has just lifted may
 * be on again, somewhat elsewhere. */
int eits_search_near(const eits_fast *fast, uint32_t *k)
{
    const eits_real *place = search_one(fast)->body[0].p;
    eits_real least = fast_square(EITS_FAST_NEAR_MM);
    *k = EITS_FAST_MAX_TOUCHES;
    for (uint32_t n = 0; n < fast->count; ++n) {
        const eits_real far = fast_distance2(fast->state + FAST_SIZE * n, place);
        if (far < least) {
            least = far;
            *k = n;
        }
    }
    return *k < EITS_FAST_MAX_TOUCHES;
}

int eits_search_changed(const eits_fast *fast, fast_which which)
{
    const fast_trial *trial = &fast->search.trial[which];
    return trial->exists && eits_is_clear(fast, trial, trial->fresh) &&
           eits_cost_of_birth(search_one(fast)) - trial->left > 2 * EITS_FAST_MOVE_MARGIN;
}

int eits_search_clear(const eits_fast *fast)
{
    const fast_trial *move = &fast->search.trial[FAST_MOVE];
    return eits_search_changed(fast, FAST_MOVE) &&
           move->all - move->left > EITS_FAST_MOVE_CLEAR / 2;
}

/* ---- known touches move ---- */

/* A known touch by itself as it was: what moving it promises. */
static eits_real promise_of(eits_fast *fast, uint32_t k, uint32_t count)
{
    fast_trial *trial = &fast->search.scratch;
    eits_trial_begin(fast, trial, count);
    eits_trial_add_known(fast, trial, k);
    trial->as_known = 1;
    return eits_trial_say(fast, trial) ? eits_trial_promise(trial) : 0;
}

/* The touches that have moved as far as their slopes tell: the one that promises most, and the next
 * if the two together promise clearly more. */
static void choose_moves(eits_fast *fast, uint32_t count, fast_trial *trial)
{
    uint32_t first = EITS_FAST_MAX_TOUCHES, second = EITS_FAST_MAX_TOUCHES;
    eits_real most = 0, next = 0;
    trial->exists = 0;
    for (uint32_t k = 0; k < fast->count; ++k) {
        const eits_real promise = fast->known[k].on ? promise_of(fast, k, count) : 0;
        if (promise > most) {
            second = first;
            next = most;
            first = k;
            most = promise;
        } else if (promise > next) {
            second = k;
            next = promise;
        }
    }
    if (first == EITS_FAST_MAX_TOUCHES)
        return;
    eits_trial_begin(fast, trial, count);
    eits_trial_add_known(fast, trial, first);
    trial->as_known = 1;
    if (second == EITS_FAST_MAX_TOUCHES || !(next > EITS_FAST_MOVES_EACH)) {
        (void)eits_trial_say(fast, trial);
        return;
    }
    fast_trial *both = &fast->search.scratch;
    (void)eits_trial_say(fast, trial);
    *both = *trial;
    eits_trial_add_known(fast, both, second);
    if (eits_trial_say(fast, both) && eits_trial_promise(both) > most + EITS_FAST_MOVES_EACH)
        *trial = *both;
}

static uint32_t cost_of_move(const eits_fast *fast)
{
    return any_on(fast) ? 4 + fast->count : 0;
}

static void look_at_moves(eits_fast *fast)
{
    fast_trial *trial = search_trial(fast, FAST_MOVE);
    choose_moves(fast, fast->search.count, trial);
    eits_trial_refine(fast, trial, 2);
}

/* A finger moves at most at EITS_FAST_SPEED_MOST; a faster one is something else. */
static void end_moves(eits_fast *fast)
{
    fast_trial *trial = search_trial(fast, FAST_MOVE);
    for (uint32_t i = 0; trial->exists && i < trial->bodies; ++i) {
        const eits_real *by = trial->body[i].p + 2;
        const eits_real *speed = fast->state + FAST_SIZE * trial->body[i].known + FAST_VX;
        const eits_real x = speed[0] + by[0], y = speed[1] + by[1];
        if (!(x * x + y * y < fast_square(EITS_FAST_SPEED_MOST)))
            trial->exists = 0;
    }
}

/* ---- a known one is elsewhere, faster or wider ---- */

static uint32_t cost_of_replace(const eits_fast *fast)
{
    uint32_t k;
    return search_one(fast)->exists && !eits_search_clear(fast) && eits_search_near(fast, &k)
               ? 1 + fast->search.count / 6
               : 0;
}

/* A new touch in place of a known one, from `place` on; with `speed`, one that moves. */
static void look_instead(eits_fast *fast, uint32_t k, const eits_real *place, eits_real rho2,
                         const eits_real *speed)
{
    fast_trial *trial = &fast->search.scratch;
    eits_trial_begin(fast, trial, fast->search.count);
    eits_trial_add_new(trial, place, speed != NULL);
    if (speed != NULL)
        eits_copy(trial->body[0].p + 2, speed, 2);
    trial->gone = (uint8_t)k;
    trial->rho2 = rho2;
    trial->as_known = speed == NULL && rho2 == fast->known[k].rho2;
    (void)eits_trial_say(fast, trial);
    eits_trial_refine(fast, trial, 2);
}

/* It has come to a place that is near enough. */
static int is_near(const eits_fast *fast, int moves)
{
    const fast_trial *trial = &fast->search.scratch;
    if (!trial->exists)
        return 0;
    const eits_real far =
        fast_distance2(trial->body[0].p, fast->state + (size_t)FAST_SIZE * trial->gone);
    const eits_real most = (moves ? 2 : 1) * EITS_FAST_APART_MM;
    return far < fast_square(most);
}

/* Whether a touch is so far from where it was that it has moved there: a finger that swipes is
 * found so, if its drives were left unexplained for a while. A touch that has just landed may have
 * been at a wrong place, as that of a palm that still rises. */
static int has_jumped(const eits_fast *fast, const fast_trial *trial)
{
    const uint32_t k = trial->gone;
    const fast_known *known = &fast->known[k];
    return (known->moving || known->age > EITS_FAST_YOUNG / 2) && trial->rho2 == known->rho2 &&
           fast_distance2(trial->body[0].p, fast->state + (size_t)FAST_SIZE * k) >
               fast_square(EITS_FAST_JUMPED_MM);
}

/* Strengths that jump from what they were cost; so do another width, a speed, and a jump without a
 * speed. */
static eits_real cost_of_instead(const eits_fast *fast, const fast_trial *trial)
{
    const fast_known *known = &fast->known[trial->gone];
    const eits_real wider = trial->rho2 != known->rho2 ? R(4) : R(0);
    const int moves = trial->body[0].numbers == 4;
    eits_real cost = trial->left + wider + (moves != has_jumped(fast, trial) ? R(6) : R(0));
    for (uint32_t n = 0; n < trial->count; ++n) {
        const eits_real before = search_drive(fast, trial, n)->state[trial->gone][FAST_C];
        const eits_real change =
            (trial->strength[n][0] - before) / (EITS_FAST_CHANGES * known->peak);
        const eits_real each = fast_square(change);
        cost += each < EITS_FAST_CHANGE_MOST ? each : EITS_FAST_CHANGE_MOST;
    }
    return cost;
}

static void keep_better(eits_fast *fast, fast_trial *trial)
{
    fast_trial *best = search_trial(fast, FAST_REPLACE);
    trial->cost = cost_of_instead(fast, trial);
    if (!best->exists || trial->cost < best->cost)
        *best = *trial;
}

static void look_for_place(eits_fast *fast)
{
    uint32_t k;
    if (eits_search_near(fast, &k))
        look_instead(fast, k, fast->state + FAST_SIZE * k, fast->known[k].rho2, NULL);
}

static void end_instead(eits_fast *fast)
{
    if (is_near(fast, 0))
        keep_better(fast, &fast->search.scratch);
}

static uint32_t cost_of_swerve(const eits_fast *fast)
{
    const int wanted = fast->search.trial[FAST_REPLACE].exists && fast->search.count > 2 &&
                       !eits_search_clear(fast);
    return wanted ? fast->search.count : 0;
}

/* A touch that has jumped starts with the speed that brought it there from where drives were last
 * explained. */
static void look_for_swerve(eits_fast *fast)
{
    const fast_trial *still = search_trial(fast, FAST_REPLACE);
    const uint32_t k = still->gone;
    const eits_real *to = still->body[0].p, *from = fast->state + (size_t)FAST_SIZE * k;
    const eits_real took_s =
        eits_waited_s(fast, still) + (eits_real)still->count * EITS_FAST_DRIVE_S;
    eits_real speed[2] = {0, 0};
    for (uint32_t axis = 0; axis < 2 && has_jumped(fast, still); ++axis)
        speed[axis] = (to[axis] - from[axis]) / took_s;
    look_instead(fast, k, to, fast->known[k].rho2, speed);
}

static void end_swerve(eits_fast *fast)
{
    fast_trial *trial = &fast->search.scratch;
    const fast_trial *still = search_trial(fast, FAST_REPLACE);
    eits_real covariance[FAST_FIT][FAST_FIT];
    if (!is_near(fast, 1) || !eits_trial_covariance(trial, covariance))
        return;
    const eits_real *p = trial->body[0].p;
    const eits_real speed2 = fast_square(p[2]) + fast_square(p[3]);
    const int jumped = has_jumped(fast, still);
    const eits_real doubt = jumped ? 0 : 9 * (covariance[2][2] + covariance[3][3]);
    if ((jumped || trial->left + 6 < still->left) &&
        speed2 > eits_larger(doubt, fast_square(EITS_FAST_SWERVE_SPEED)) &&
        speed2 < fast_square(EITS_FAST_SPEED_MOST))
        keep_better(fast, trial);
}

static uint32_t cost_of_wider(const eits_fast *fast)
{
    uint32_t k;
    return fast->search.count > 4 && search_one(fast)->exists && !eits_search_clear(fast) &&
                   eits_search_near(fast, &k) && fast->known[k].age < EITS_FAST_WIDENS
               ? fast->search.count
               : 0;
}

static void try_wider(eits_fast *fast, eits_real rho)
{
    uint32_t k;
    fast->search.scratch.exists = 0;
    if (eits_search_near(fast, &k) && fast_square(rho) != fast->known[k].rho2)
        look_instead(fast, k, fast->state + FAST_SIZE * k, fast_square(rho), NULL);
}

static void try_wide(eits_fast *fast)
{
    try_wider(fast, EITS_FAST_RHO_WIDE_MM);
}

static void try_widest(eits_fast *fast)
{
    try_wider(fast, EITS_FAST_RHO_WIDER_MM);
}

const search_piece eits_piece_move = {cost_of_move, look_at_moves, end_moves};
const search_piece eits_pieces_change[4] = {
    {cost_of_replace, look_for_place, end_instead},
    {cost_of_swerve, look_for_swerve, end_swerve},
    {cost_of_wider, try_wide, end_instead},
    {cost_of_wider, try_widest, end_instead},
};
