/* The search for an explanation of drives that the known touches do not explain. These drives wait.
 * Hypotheses are fitted to them, and one is carried out when it beats the others by a margin
 * (decide.c).
 *
 * A search has a fixed set of drives and a list of pieces of work (list.c). A piece looks at one
 * hypothesis, and may ask for steps that make it better. Each drive does looks and steps as long as
 * the next one fits into the work that a drive may spend; the next drive continues. So the work per
 * drive is bounded by construction, and a search takes more drives if there is more to compare. */
#ifndef EITSKIN_SEARCH_H
#define EITSKIN_SEARCH_H

#include "fast/fast.h"
#include "search/constants.h"

/* One piece of a search. `cost` returns the greatest cost of its look, or 0 if the piece is not
 * needed; the unit is one answer of one place in one drive. `look` looks at the hypothesis. `end`
 * runs after the steps that the look asked for; it may be NULL. */
typedef struct search_piece {
    uint32_t (*cost)(const eits_fast *fast);
    void (*look)(eits_fast *fast);
    void (*end)(eits_fast *fast);
} search_piece;

/* list.c: continue the search for an explanation of the drives that wait. Returns 1 if a hypothesis
 * was carried out. */
int eits_search(eits_fast *fast);

/* Return drive n of the drives that a trial explains. */
static inline const fast_held *search_drive(const eits_fast *fast, const fast_trial *trial,
                                            uint32_t n)
{
    return fast->ring[fast->search.from + trial->from + n];
}

static inline fast_trial *search_trial(eits_fast *fast, fast_which which)
{
    return &fast->search.trial[which];
}

static inline const fast_trial *search_one(const eits_fast *fast)
{
    return &fast->search.trial[FAST_ONE];
}

/* Return the number of drives of a search, but at most `most`: the last ones are meant. */
static inline uint32_t search_last(const eits_fast *fast, uint32_t most)
{
    return fast->search.count < most ? fast->search.count : most;
}

/* Whether a known touch has been in place for long. A finger that rests neither jumps nor begins to
 * slide as fast as a swipe, but a finger that lands beside it can look like that. */
static inline int search_rests(const eits_fast *fast, uint32_t k)
{
    const fast_known *known = &fast->known[k];
    return known->on && !known->moving && known->age > EITS_FAST_YOUNG &&
           !fast_is_palm(known->rho2);
}

/* Return the cost of a look at `bodies` of the trial, in answers. If the known touches are where
 * they were, their answers are in the ring already, and only the equations are computed. */
static inline uint32_t search_cost(const fast_trial *trial, uint32_t bodies)
{
    const uint32_t answers = bodies * trial->count;
    return trial->as_known ? (answers + 5) / 6 : answers;
}

/* ---- known.c, births.c: pieces ---- */

extern const search_piece eits_piece_move, eits_piece_one, eits_piece_rival, eits_piece_more;
/* in order: changes of known touches, which follow the move, and new touches, which follow the
 * simple ones */
extern const search_piece eits_pieces_change[4], eits_pieces_birth[10];
/* Find the known touch, *k, that may be the best new touch instead. Returns 0 if none is near. */
int eits_search_near(const eits_fast *fast, uint32_t *k);
/* Return 1 if a change of known touches leaves only noise and costs clearly less than a new touch.
 * Then no other new touch is looked for, which saves work. */
int eits_search_changed(const eits_fast *fast, fast_which which);

/* Return 1 if the move alone is clear: no other change needs to be looked for. */
int eits_search_clear(const eits_fast *fast);

/* ---- fit.c ---- */

/* Begin a trial about the last `count` drives of the search, without bodies. */
void eits_trial_begin(const eits_fast *fast, fast_trial *trial, uint32_t count);
void eits_trial_add_new(fast_trial *trial, const eits_real *place, int moves);
void eits_trial_add_known(const eits_fast *fast, fast_trial *trial, uint32_t k);
/* Return the time in which nothing was explained before the first drive of the trial, s. */
eits_real eits_waited_s(const eits_fast *fast, const fast_trial *trial);
/* Compute how the trial explains its drives. Returns 0 if a place is off the skin. */
int eits_trial_say(eits_fast *fast, fast_trial *trial);
/* Ask for up to `steps` damped Gauss-Newton steps from the trial's present parameters, for which
 * eits_trial_say must have been called. */
void eits_trial_refine(eits_fast *fast, fast_trial *trial, uint32_t steps);
/* Compute the next of these steps; it is kept if it leaves less. */
void eits_trial_take_step(eits_fast *fast);
/* Compute the place of body `i` at the trial's last drive, without its speed. */
void eits_trial_place(const eits_fast *fast, const fast_trial *trial, uint32_t i, eits_real *place);
/* Compute the whitened answer of a touch in a drive and its slopes, including the interaction with
 * all known touches except `without`. */
void eits_trial_answer(eits_fast *fast, const fast_held *held, const fast_disc *disc,
                       const fast_sight *sight, uint32_t without, eits_real *out);

/* ---- equations.c ---- */

/* Return the number of parameters of all of a trial's bodies. */
uint32_t eits_trial_numbers(const fast_trial *trial);
/* Compute the step that solves the normal equations, at most EITS_FAST_MAX_STEP_MM for a place.
 * Returns the greatest step of a place, or a number below 0 if the equations are singular. */
eits_real eits_trial_step(const fast_trial *trial, eits_real shorter, eits_real *step);
/* Return the fall of chi^2 that the normal equations promise, b'h^-1 b; 0 if they are singular. */
eits_real eits_trial_promise(const fast_trial *trial);
/* Compute the inverse of the normal equations. Returns 0 if they are singular. */
int eits_trial_covariance(const fast_trial *trial, eits_real covariance[FAST_FIT][FAST_FIT]);
/* ---- decide.c ---- */

/* Return 1 if the trial, with `fresh` new touches, leaves no more than noise. */
int eits_is_noise(const eits_fast *fast, const fast_trial *trial, uint32_t fresh);
/* The same with a tighter bound: no other hypothesis needs to be looked for. */
int eits_is_clear(const eits_fast *fast, const fast_trial *trial, uint32_t fresh);
/* Return 1 if new touches of the trial are beyond doubt, compared with noise and with rivals. */
int eits_is_believed(const eits_fast *fast, const fast_trial *trial);
/* Return the cost of a new touch, in chi^2. */
eits_real eits_cost_of_birth(const fast_trial *trial);
/* Carry out the best hypothesis, or wait. Returns 1 if one was carried out. */
int eits_decide(eits_fast *fast);

/* ---- apply.c ---- */

void eits_apply_move(eits_fast *fast, const fast_trial *trial);
void eits_apply_replace(eits_fast *fast, const fast_trial *trial);
void eits_apply_birth(eits_fast *fast, const fast_trial *trial);
/* Return the chi^2 that the trial leaves per degree of freedom, at least 1. The variances of a fit,
 * and the gain that a new touch needs, are multiplied by it. */
eits_real eits_doubt(const eits_fast *fast, const fast_trial *trial);

#endif
