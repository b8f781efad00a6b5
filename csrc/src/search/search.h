/* Drives that no known touch explains wait. Hypotheses are fitted to them, and one is acted on when
 * it beats the others by a margin (decide.c).
 *
 * A search has a fixed set of drives and a list of pieces of work (list.c). A piece looks at one
 * hypothesis, and may ask for steps that make it better. A drive does looks and steps as long as
 * the next one fits into what the drive may spend, and the next drive goes on. So the work of a
 * drive is bounded by construction, and a search takes the longer the more there is to compare. */
#ifndef EITSKIN_SEARCH_H
#define EITSKIN_SEARCH_H

#include "fast/fast.h"
#include "search/constants.h"

/* One piece of a search: what its look costs at most, in answers of a place in a drive, 0 where it
 * is not wanted; the look; and what is done after the steps that it asked for, NULL for nothing. */
typedef struct search_piece {
    uint32_t (*cost)(const eits_fast *fast);
    void (*look)(eits_fast *fast);
    void (*end)(eits_fast *fast);
} search_piece;

/* list.c: go on with the search for an explanation of what waits; 1 where one was acted on. */
int eits_search(eits_fast *fast);

/* Drive n of those that a trial explains. */
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

/* The last drives of a search, at most `most`. */
static inline uint32_t search_last(const eits_fast *fast, uint32_t most)
{
    return fast->search.count < most ? fast->search.count : most;
}

/* Answers that a look at `bodies` of the trial costs. Where known touches are as they were, their
 * answers stand in the ring, and equations alone are made. */
static inline uint32_t search_cost(const fast_trial *trial, uint32_t bodies)
{
    const uint32_t answers = bodies * trial->count;
    return trial->as_known ? (answers + 5) / 6 : answers;
}

/* ---- known.c, births.c: pieces ---- */

extern const search_piece eits_piece_move, eits_piece_one, eits_piece_rival, eits_piece_more;
/* changes of known touches after a move, and births after the simple ones, in their order */
extern const search_piece eits_pieces_change[4], eits_pieces_birth[10];
/* The known touch that the best new one may be instead; 0: none is near. */
int eits_search_near(const eits_fast *fast, uint32_t *k);
/* Whether a change of known touches leaves only noise and costs clearly less than a birth. No other
 * birth is looked for then, which saves work. */
int eits_search_changed(const eits_fast *fast, fast_which which);

/* The move alone is clear: no other change needs to be looked for. */
int eits_search_clear(const eits_fast *fast);

/* ---- fit.c ---- */

/* A trial about the last `count` drives of the search, without bodies. */
void eits_trial_begin(const eits_fast *fast, fast_trial *trial, uint32_t count);
void eits_trial_add_new(fast_trial *trial, const eits_real *place, int moves);
void eits_trial_add_known(const eits_fast *fast, fast_trial *trial, uint32_t k);
/* How the trial explains its drives; 0 where a place is off the skin. */
int eits_trial_say(eits_fast *fast, fast_trial *trial);
/* Asks for up to `steps` damped Gauss-Newton steps from where it is, said before. */
void eits_trial_refine(eits_fast *fast, fast_trial *trial, uint32_t steps);
/* The next of them; it is taken if it leaves less. */
void eits_trial_take_step(eits_fast *fast);
/* The place of body `i`, without speed, at the trial's last drive. */
void eits_trial_place(const eits_fast *fast, const fast_trial *trial, uint32_t i, eits_real *place);
/* The whitened answer of a touch in a drive, with slopes and what known touches but `without` do to
 * it. */
void eits_trial_answer(eits_fast *fast, const fast_held *held, const fast_disc *disc,
                       const fast_sight *sight, uint32_t without, eits_real *out);

/* ---- equations.c ---- */

/* How many numbers move a trial's bodies. */
uint32_t eits_trial_numbers(const fast_trial *trial);
/* The step that the normal equations ask for, at most EITS_FAST_MAX_STEP_MM for a place; its
 * length in places, or below 0 where they are singular. */
eits_real eits_trial_step(const fast_trial *trial, eits_real shorter, eits_real *step);
/* Return the fall of chi^2 that the normal equations promise, b'h^-1 b; 0 if they are singular. */
eits_real eits_trial_promise(const fast_trial *trial);
/* The inverse of the normal equations; 0 where they are singular. */
int eits_trial_covariance(const fast_trial *trial, eits_real covariance[FAST_FIT][FAST_FIT]);
/* ---- decide.c ---- */

/* Whether one new touch leaves no more than noise. */
int eits_is_noise(const eits_fast *fast, const fast_trial *trial, uint32_t fresh);
/* The same by a narrower bound: nothing else needs to be looked for. */
int eits_is_clear(const eits_fast *fast, const fast_trial *trial, uint32_t fresh);
/* Return the price of a birth, in chi^2. */
eits_real eits_cost_of_birth(const fast_trial *trial);
/* Act on the best hypothesis, or wait; 1 where one was acted on. */
int eits_decide(eits_fast *fast);

/* ---- apply.c ---- */

void eits_apply_move(eits_fast *fast, const fast_trial *trial);
void eits_apply_replace(eits_fast *fast, const fast_trial *trial);
void eits_apply_birth(eits_fast *fast, const fast_trial *trial);
/* Return what is left of chi^2 for each degree of freedom, at least 1. The variances of a fit, and
 * the gain that a birth needs, are multiplied by it. */
eits_real eits_doubt(const eits_fast *fast, const fast_trial *trial);

#endif
