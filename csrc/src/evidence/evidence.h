/* Which of the fitted discs are touches, given what the model itself may be wrong by.
 *
 * Data y of n discs are y = sum of their answers + e, e normal with covariance
 *
 *     Sigma = N + SHARE |d|^2 E (+ D)
 *
 * N the noise, E and D the model's own errors (eits_uncertainty), |d| the folded data's size: an
 * uneven sheet or a finger that is no disc errs in proportion to what it answers. With
 *
 *     F = min |R'^-1 (y - answers)|^2 + priors of radii and shapes,    Sigma = R'R
 *
 * minus twice the log-likelihood of the best n discs, a disc is kept where F rises by more than a
 * threshold without it: a likelihood-ratio test. */
#ifndef EITSKIN_EVIDENCE_H
#define EITSKIN_EVIDENCE_H

#include "touch/disc_fit.h"

/* What a disc's parameters are, in this order: strength (relative), x, y (pixels), radius (over
 * the fitted one), two of an ellipse's edge and two of its dipole. */
enum { EITS_PLACE_PARAMETERS = 4, EITS_EDGE_PARAMETERS = 6, EITS_SHAPE_PARAMETERS = 8 };

/* One answer to how many touches there are. */
typedef struct eits_answer {
    eits_disc disc[EITS_MAX_TOUCHES];
    eits_real radius_mm[EITS_MAX_TOUCHES]; /* about which the prior holds the radius */
    /* how much of each edge and dipole term there is */
    eits_real shape[EITS_MAX_TOUCHES][EITS_SHAPE_PARAMETERS - EITS_PLACE_PARAMETERS];
    uint32_t count;
    uint32_t parameters; /* of each disc */
    eits_real misfit;    /* F */
} eits_answer;

/* covariance.c */

/* R for this frame, in evidence.factor; 0 where there is none: the model does not say what it may
 * be wrong by, or nobody wants to know. *log_determinant is that of Sigma; `drift`: with D. */
int eits_factor_covariance(eits_context *ctx, const eits_scratch *scratch, int drift,
                           eits_real *log_determinant, uint64_t *macs);

/* v = R'^-1 v (stride numbers), the gain's drift taken out. */
uint64_t eits_whiten_errors(const eits_context *ctx, eits_real *v);

/* shape.c */

/* How many parameters each of `count` discs gets. */
uint32_t eits_shape_parameters(const eits_context *ctx, uint32_t count);

/* How much of a parameter's column disc k has. */
eits_real eits_shape_part(const eits_answer *answer, uint32_t k, uint32_t parameter);

/* evidence.column of disc k of the answer, R'^-1 applied, each times the disc's change; and
 * evidence.left less what the disc answers. */
uint64_t eits_shape_columns(eits_context *ctx, const eits_scratch *scratch,
                            const eits_answer *answer, uint32_t k);

/* left (stride numbers) = what the answer's discs, with their shapes, leave of the data. Uses
 * scratch->row[2] and [3]; what a linearisation made stays. */
uint64_t eits_shape_residual(eits_context *ctx, const eits_scratch *scratch,
                             const eits_answer *answer, eits_real *left);

/* The answer without disc k, the others as they are. */
void eits_leave_out(eits_answer *answer, uint32_t k);

/* likelihood.c */

/* What one linearisation of F about an answer tells. */
typedef struct eits_likelihood {
    eits_real here;  /* F of the discs as they are */
    eits_real least; /* at the linearisation's minimum */
    uint32_t count;  /* parameters of all discs */
    /* 1: of the answer in question, and the last that was made: scratch->square has the inverse of
     * its matrix, evidence.column and evidence.left are its */
    int at_hand;
    eits_real step[EITS_EVIDENCE_COLUMNS];
} eits_likelihood;

/* Whether so many more columns may be made in this frame; where not, evidence.spent is set. Who
 * linearises asks before, and leaves enough to linearise what is taken at last. */
int eits_may_make(eits_context *ctx, uint32_t columns);

/* The same of what is tried at last: within all that options.test_columns allows. */
int eits_may_make_later(eits_context *ctx, uint32_t columns);

/* Linearise F about the answer: evidence.column, evidence.left and scratch->square. */
uint64_t eits_linearise(eits_context *ctx, const eits_scratch *scratch, const eits_answer *answer,
                        eits_likelihood *out);

/* What F rises by without disc k, by the linearisation. */
eits_real eits_linear_rise(const eits_scratch *scratch, const eits_answer *answer,
                           const eits_likelihood *likelihood, uint32_t k);

/* Leave disc k out of the answer and of its linearisation, which becomes that of the others where
 * they are. */
uint64_t eits_linear_drop(eits_context *ctx, const eits_scratch *scratch, eits_answer *answer,
                          eits_likelihood *likelihood, uint32_t k);

/* Gauss and Newton's steps, a few at most, until F is `enough` or hardly falls, or a linearisation
 * says that it will not come below `hopeless`; sets
 * answer->misfit. `likelihood` is made unless it is available; afterwards it is, or it may be made.
 * Where not even the first may be, the misfit is beyond all others. */
uint64_t eits_refit(eits_context *ctx, const eits_scratch *scratch, eits_answer *answer,
                    eits_likelihood *likelihood, eits_real enough, eits_real hopeless);

/* touch_test.c */

/* Drop discs of `f` that the model's errors could have made; sets what is known of each
 * that stays. */
void eits_test_touches(eits_context *ctx, const eits_scratch *scratch, eits_fit *f);

/* pair.c */

/* Logarithm of the odds that disc k is two touches side by side, by the shape that the
 * linearisation gives it; -1 where that has none. */
eits_real eits_pair_score(const eits_scratch *scratch, const eits_answer *answer,
                          const eits_likelihood *likelihood, uint32_t k);

/* The unit vector along which disc k's edge bulges, by the linearisation: two in its place would
 * lie on that line. 0, 0 where the disc has no shape. */
void eits_pair_line(const eits_answer *answer, const eits_likelihood *likelihood, uint32_t k,
                    eits_real line[2]);

/* `two`: the answer with two discs on the line in the place of disc k, to be fitted; the second is
 * its last. 0 where there is no room for them. */
int eits_split_disc(const eits_context *ctx, const eits_answer *one, uint32_t k,
                    const eits_real line[2], eits_answer *two);

/* confidence.c */

/* What the test's numbers have meant on scenes with a truth: f->confidence, and f->place_mm2 as
 * wide as places err; zeros where discs were not tested. */
void eits_rate_touches(const eits_context *ctx, eits_fit *f);

/* The variance of a place along each axis, mm^2, that no touch's own data tell: `least` pixels^2,
 * and what is left after the correction by the reference. */
eits_real eits_variance_of_all(const eits_context *ctx, eits_real least);

/* The share of discs of such a rise that were touches. */
eits_real eits_confidence(eits_real rise);

/* f->place_mm2 of discs that were not tested, by the fit's normal equations, where the model says
 * how far to trust them. */
void eits_place_touches(eits_context *ctx, const eits_scratch *scratch, eits_fit *f);

/* Sets CROWDED where a disc may be two touches, or none, or the test was cut short. */
void eits_check_count(eits_context *ctx, const eits_fit *f);

#endif
