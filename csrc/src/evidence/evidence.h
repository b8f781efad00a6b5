/* The touch test: which of the fitted discs are touches, given the model's own errors.
 *
 * The data of n discs are y = sum of their answers + e, where e is normal with the covariance
 *
 *     Sigma = N + SHARE |d|^2 E (+ D)
 *
 * N is the noise, E and D are the model's own errors (eits_uncertainty), and |d| is the size of the
 * folded data: the error of an uneven skin, or of a finger that is not a disc, is proportional to
 * its answer. With
 *
 *     F = min |R'^-1 (y - answers)|^2 + priors of radii and shapes,    Sigma = R'R
 *
 * which is minus twice the log-likelihood of the best n discs, a disc is kept if F rises by more
 * than a threshold without it. This is a likelihood-ratio test. */
#ifndef EITSKIN_EVIDENCE_H
#define EITSKIN_EVIDENCE_H

#include "touch/disc_fit.h"

/* The parameters of a disc, in this order: strength (relative change), x, y (pixels), radius (over
 * the fitted one), two for an ellipse's edge and two for its dipole. */
enum { EITS_PLACE_PARAMETERS = 4, EITS_EDGE_PARAMETERS = 6, EITS_SHAPE_PARAMETERS = 8 };

/* One hypothesis about the number of touches, with their parameters. */
typedef struct eits_answer {
    eits_disc disc[EITS_MAX_TOUCHES];
    eits_real radius_mm[EITS_MAX_TOUCHES]; /* middle of the radius's prior */
    /* coefficients of the edge and dipole terms */
    eits_real shape[EITS_MAX_TOUCHES][EITS_SHAPE_PARAMETERS - EITS_PLACE_PARAMETERS];
    uint32_t count;
    uint32_t parameters; /* of each disc */
    eits_real misfit;    /* F */
} eits_answer;

/* covariance.c */

/* Compute R for this frame, in evidence.factor; `drift` is 1 to include D. *log_determinant gets
 * that of Sigma. Returns 0, without R, if the model does not state its errors or the test is
 * switched off. */
int eits_factor_covariance(eits_context *ctx, const eits_scratch *scratch, int drift,
                           eits_real *log_determinant, uint64_t *macs);

/* v = R'^-1 v (stride numbers), without its part along the gain's drift. Returns the
 * multiply-accumulates. */
uint64_t eits_whiten_errors(const eits_context *ctx, eits_real *v);

/* shape.c */

/* Return the number of parameters that each of `count` discs gets. */
uint32_t eits_shape_parameters(const eits_context *ctx, uint32_t count);

/* Return the coefficient with which a parameter's column enters the answer of disc k. */
eits_real eits_shape_part(const eits_answer *answer, uint32_t k, uint32_t parameter);

/* Compute the columns of disc k in evidence.column, multiplied by R'^-1 and by the disc's change,
 * and subtract the disc's answer from evidence.left. */
uint64_t eits_shape_columns(eits_context *ctx, const eits_scratch *scratch,
                            const eits_answer *answer, uint32_t k);

/* left (stride numbers) = the data minus the answers of the discs with their shapes. Uses
 * scratch->row[2] and [3]; a linearisation stays valid. */
uint64_t eits_shape_residual(eits_context *ctx, const eits_scratch *scratch,
                             const eits_answer *answer, eits_real *left);

/* Remove disc k from the answer; the others stay as they are. */
void eits_leave_out(eits_answer *answer, uint32_t k);

/* likelihood.c */

/* The result of one linearisation of F about an answer. */
typedef struct eits_likelihood {
    eits_real here;  /* F of the discs as they are */
    eits_real least; /* F at the linearisation's minimum */
    uint32_t count;  /* parameters of all discs */
    /* 1: this linearisation is about the answer in question and is the last one that was made:
     * scratch->square has the inverse of its matrix, and evidence.column and evidence.left belong
     * to it */
    int at_hand;
    eits_real step[EITS_EVIDENCE_COLUMNS];
} eits_likelihood;

/* Return 1 if `columns` more columns may be computed in this frame; otherwise set evidence.spent
 * and return 0. Check this before each linearisation, and keep enough of the budget to linearise
 * the final answer. */
int eits_may_make(eits_context *ctx, uint32_t columns);

/* Linearise F about the answer: fills in evidence.column, evidence.left and scratch->square. */
uint64_t eits_linearise(eits_context *ctx, const eits_scratch *scratch, const eits_answer *answer,
                        eits_likelihood *out);

/* Return the rise of F without disc k, by the linearisation. */
eits_real eits_linear_rise(const eits_scratch *scratch, const eits_answer *answer,
                           const eits_likelihood *likelihood, uint32_t k);

/* Remove disc k from the answer and from its linearisation, which then is about the other discs as
 * they are. */
uint64_t eits_linear_drop(eits_context *ctx, const eits_scratch *scratch, eits_answer *answer,
                          eits_likelihood *likelihood, uint32_t k);

/* Take a few Gauss-Newton steps, until F is at most `enough`, F hardly falls, or a linearisation
 * predicts that F stays above `hopeless`; sets answer->misfit. If `likelihood` is not available, it
 * is computed first. Afterwards it is available, or the budget has room to compute it. If the
 * budget has no room even for the first linearisation, the misfit is infinite. */
uint64_t eits_refit(eits_context *ctx, const eits_scratch *scratch, eits_answer *answer,
                    eits_likelihood *likelihood, eits_real enough, eits_real hopeless);

/* touch_test.c */

/* Drop the discs of `f` that the model's errors could have caused. Sets rise, place, pair score and
 * the other results of the test for each disc that stays. */
void eits_test_touches(eits_context *ctx, const eits_scratch *scratch, eits_fit *f);

/* pair.c */

/* Return the logarithm of the odds that disc k is two touches side by side, by the shape that the
 * linearisation gives it; -1 if the linearisation has no shapes. */
eits_real eits_pair_score(const eits_scratch *scratch, const eits_answer *answer,
                          const eits_likelihood *likelihood, uint32_t k);

/* The unit vector along which the edge of disc k bulges, by the linearisation. Two discs in its
 * place would lie on that line. It is 0, 0 if the disc has no shape. */
void eits_pair_line(const eits_answer *answer, const eits_likelihood *likelihood, uint32_t k,
                    eits_real line[2]);

/* Fill in `two`: the answer with two discs on the line in the place of disc k, as a start of their
 * fit; the second is the last disc. Returns 0 if there is no room for them. */
int eits_split_disc(const eits_context *ctx, const eits_answer *one, uint32_t k,
                    const eits_real line[2], eits_answer *two);

/* confidence.c */

/* Set f->confidence and f->place_mm2 from the results of the test, by factors that were fitted on
 * scenes with a known truth. Both are 0 if the discs were not tested. */
void eits_rate_touches(const eits_context *ctx, eits_fit *f);

/* Return the variance of a place along each axis, mm^2, that the data of a touch do not show:
 * `least` pixels^2, plus the error that remains after the correction by the reference. */
eits_real eits_variance_of_all(const eits_context *ctx, eits_real least);

/* Return the fraction of discs with this rise that were true touches (logistic regression). */
eits_real eits_confidence(eits_real rise);

/* Set f->place_mm2 of discs that were not tested, by the fit's normal equations, if the model
 * states a factor for them. */
void eits_place_touches(eits_context *ctx, const eits_scratch *scratch, eits_fit *f);

/* Set CROWDED if a disc may be two touches or none, or if the test was cut short. */
void eits_check_count(eits_context *ctx, const eits_fit *f);

#endif
