/* All touches of a frame fitted at once to its folded data by the multipole model: places, radii,
 * strengths, ellipses where the data support them, and how well each place is known.
 *
 *     F = sum over folds ((d - answers) / sigma)^2 - (its part along the drift of the gain)
 *         + sum over touches of h(log |q|) + (log(r / R) / dR)^2 + (e_1^2 + e_2^2) / dE^2
 *
 * is minimised by damped Gauss-Newton steps (fit.c). Each fold has a sigma^2 of its own: the
 * variance of its noise plus that of the multipole model's error, which is a fraction of the data
 * (metric.c). h is the lesser of two costs: that of a light touch and that of a strong one
 * (prior.c).
 * docs/design/joint-fit.md has the formulas and their sources. */
#ifndef EITSKIN_JOINT_H
#define EITSKIN_JOINT_H

#include "evidence/evidence.h"
#include "multipole/multipole.h"

/* The number of parameters of a touch. They are in the order of eits_pole_out, but the amplitude is
 * a logarithm: x, y (pixels), log radius, log |amplitude| and, for an ellipse, e1 and e2. */
enum { EITS_JOINT_DISC = 4, EITS_JOINT_ELLIPSE = 6 };

/* The touches that are being fitted. */
typedef struct eits_joint {
    eits_shape shape[EITS_MAX_TOUCHES];
    uint32_t from[EITS_MAX_TOUCHES]; /* the number of the disc from which the shape was made */
    /* numbers of the shapes that are varied, ascending; the others are held (eits_joint_hold) */
    uint32_t free[EITS_MAX_TOUCHES];
    uint64_t most;    /* settling begins no step or trial after so many multiply-accumulates */
    uint64_t further; /* the same where the shapes leave little */
    uint32_t count, free_count;
    uint32_t searches;   /* 1: the fit looks for missing touches */
    uint32_t parameters; /* of each: EITS_JOINT_DISC or EITS_JOINT_ELLIPSE */
    eits_real cost;      /* F */
    eits_real misfit;    /* the data's part of F: its first line above */
} eits_joint;

/* metric.c */

/* Make the metric: 1 / sigma of each fold (0 for a fold that is left out), and the two parts of the
 * data that no touch causes, the drift of the gain and the model's errors. Returns the
 * multiply-accumulates. */
uint64_t eits_joint_metric(eits_context *ctx);

/* The number of folds in use. */
uint32_t eits_joint_folds(const eits_context *ctx);

/* Add the products of n weighted columns with the drift and the model's errors, 1 + joint.errors
 * products per column. `columns` has the folds first ... first + count - 1 of each column, one
 * column every EITS_JOINT_BLOCK numbers. `along` has the sums, one column's every
 * EITS_JOINT_NUISANCES numbers. */
void eits_joint_add_along(const eits_context *ctx, const eits_real *columns, uint32_t n,
                          uint32_t first, uint32_t count, eits_real *along);

/* Multiply the sums of a column by L^-1 (metric.c). The product of two columns in the metric is
 * their plain product minus the product of their sums. */
void eits_joint_finish_along(eits_context *ctx, eits_real *along);

/* fit.c */

/* Compute F of the shapes as they are, and the normal equations about them, after `rounds` more
 * rounds of the fields that touches send to each other. Returns the multiply-accumulates. */
uint64_t eits_joint_evaluate(eits_context *ctx, eits_joint *j, uint32_t rounds);

/* Return how many orders the answers of the shapes have. */
const eits_poles *eits_joint_poles(const eits_joint *j);

/* Take steps until F hardly falls, falls as the linearisation predicted, or would stay above
 * `hopeless`. There are at most EITS_JOINT_STEPS steps, and none begins once `macs` exceeds j->most
 * (j->further if the shapes leave little). Adds to `macs`. Afterwards the normal equations are
 * those about *j. */
void eits_joint_descend(eits_context *ctx, eits_joint *j, uint32_t rounds, eits_real hopeless,
                        uint64_t *macs);

/* Return the F that the linearisation about *j predicts, before any field is induced between the
 * shapes. Adds to `macs`. */
eits_real eits_joint_expect(eits_context *ctx, eits_joint *j, uint64_t *macs);

/* Descend as eits_joint_descend does, from the last evaluation, which must be about *j. */
void eits_joint_continue(eits_context *ctx, eits_joint *j, eits_real hopeless, uint64_t *macs);

/* Return the limit of this frame's multiply-accumulates for settling: `most`, but at most
 * EITS_FIRST_WORK before the test and EITS_TOUCH_WORK after it. */
uint64_t eits_joint_limit(const eits_context *ctx, const eits_joint *j, uint64_t most);

/* After other shapes were tried: make the induced field and the normal equations about *j again,
 * with all shapes free. Returns the multiply-accumulates. */
uint64_t eits_joint_return_to(eits_context *ctx, eits_joint *j);

/* The first function keeps the normal equations about *j; the second takes them back after
 * something else was tried. */
void eits_joint_keep(eits_context *ctx, const eits_joint *j);
void eits_joint_back(eits_context *ctx, const eits_joint *j);

/* Strength q r^2 of a shape, with its sign. */
static inline eits_real eits_joint_strength(const eits_shape *s)
{
    return s->amplitude * s->radius * s->radius;
}

/* Let all shapes vary. */
static inline void eits_joint_free_all(eits_joint *j)
{
    j->free_count = j->count;
    for (uint32_t k = 0; k < j->count; ++k)
        j->free[k] = k;
}

/* Hold the shapes that are not free, after `rounds` more rounds of the fields that all send to each
 * other. As long as fewer than all shapes are free and the held ones stay those of *j, an
 * evaluation then computes only the answers of the free ones. joint.rest is the part of the data
 * that the held shapes leave. */
uint64_t eits_joint_hold(eits_context *ctx, const eits_joint *j, uint32_t rounds);

/* Let only shape k vary. */
static inline void eits_joint_free_one(eits_joint *j, uint32_t k)
{
    j->free_count = 1;
    j->free[0] = k;
}

/* Restore the field about shape k after another shape was tried in its place. */
uint64_t eits_joint_restore(eits_context *ctx, const eits_joint *j, uint32_t k);

/* Score `further` discs that stand behind the shapes of *j. *j is at a minimum of F, and all of its
 * shapes are free. With each disc the linearised F, with all shapes free, falls by `gain`, and the
 * disc is then `scale` times as strong. EITS_JOINT_PARAMETERS limits the number of discs.
 * Afterwards the normal equations are those about *j. */
uint64_t eits_joint_score(eits_context *ctx, eits_joint *j, uint32_t further, eits_real *gain,
                          eits_real *scale);

/* prior.c */

/* Return a disc of the expected size and of the strong kind. */
eits_shape eits_joint_usual(const eits_context *ctx, eits_real x, eits_real y, int insulates);

/* Return the priors' part of F of all shapes. */
eits_real eits_joint_priors(const eits_context *ctx, const eits_joint *j);

/* Return the prior's part of F for one shape. */
eits_real eits_joint_prior(const eits_context *ctx, const eits_shape *s, uint32_t parameters);

/* Return the distance of a shape's parameter p from the mean of its prior, and 1 / variance of that
 * prior. Both are 0 for places, which have no prior. */
eits_real eits_joint_offset(const eits_context *ctx, const eits_shape *s, uint32_t p);
eits_real eits_joint_precision(const eits_shape *s, uint32_t p);

/* eits_joint_is_light returns 1 if the shape is more likely a light touch than a strong one. The
 * other functions return a shape with the same strength q r^2: the strong one, or the one of the
 * other kind. */
int eits_joint_is_light(const eits_shape *s);
eits_shape eits_joint_as_strong(const eits_shape *s);
eits_shape eits_joint_as_other(const eits_shape *s);

/* Make each shape strong and small, or light and large, whichever is more likely by the priors
 * alone. */
void eits_joint_guess_kinds(const eits_context *ctx, eits_joint *j);

/* The change of F at the shape's present parameters, and the changes of the normal equations for
 * log |amplitude|, if the shape counts as the other kind. */
typedef struct eits_joint_change {
    eits_real cost, precision, gradient;
} eits_joint_change;

void eits_joint_other_prior(const eits_shape *s, eits_joint_change *of);

/* kinds.c: try shape k, the only free one of *j (eits_joint_hold), as the other kind. If F falls by
 * more than `fall`, *j becomes the result, and 1 is returned. Nothing is fitted if the
 * linearisation does not predict this fall. Adds to `macs`. */
int eits_joint_turn(eits_context *ctx, eits_joint *j, uint32_t k, eits_real fall, uint64_t *macs);

/* kinds.c: try each shape as the other kind if F may fall, and keep what lowers F. `settled` is the
 * number of multiply-accumulates of one descent. Adds to `macs`. Afterwards the normal equations
 * are those about *j. */
void eits_joint_choose_kinds(eits_context *ctx, eits_joint *j, uint64_t settled, uint64_t *macs);

/* settle.c: bring the shapes to the minimum of F, first as discs. They become ellipses if discs
 * leave more than noise and ellipses lower F by enough. `macs` has the work of this frame's touches
 * so far, in multiply-accumulates, and is increased. */
void eits_joint_settle(eits_context *ctx, const eits_scratch *scratch, eits_joint *j,
                       uint64_t *macs);

/* search.c: change the number of discs if they leave more than noise. `macs` as in
 * eits_joint_settle. Afterwards the normal equations are those about *j. */
void eits_joint_search(eits_context *ctx, const eits_scratch *scratch, eits_joint *j,
                       uint64_t *macs);

/* split.c: try long touches as two. `macs` as in eits_joint_settle. Afterwards the normal equations
 * are those about *j. */
void eits_joint_split(eits_context *ctx, eits_joint *j, uint64_t *macs);

/* split.c: make the shapes strong discs, and fit them with one as two that are far apart: the one
 * and the direction that promise the least F. Its cost is infinite if the work was spent before. */
void eits_joint_set_apart(eits_context *ctx, eits_joint *j, uint64_t *macs);

/* Return 1 for a light touch that is as large as two strong ones: the data hardly tell it from
 * these. */
int eits_joint_is_large(const eits_context *ctx, const eits_shape *s);

/* Return 1 if two shapes count as two touches: they are far enough apart and of similar strength.
 */
int eits_joint_are_two(const eits_shape *a, const eits_shape *b);

/* Return the degrees of freedom: the number of folds in use, minus 1 for the drift and 4 per touch,
 * but at least EITS_JOINT_MIN_FREEDOM.
 */
eits_real eits_joint_freedom(const eits_context *ctx, const eits_joint *j);

/* Return the excess: the misfit over its expectation by sigma, at least 1. */
eits_real eits_joint_excess(const eits_context *ctx, const eits_joint *j);

/* Return the knowledge about shapes 0 ... j->count - 1, which is kept in ctx->joint.known. It is
 * computed only if the normal equations have changed, and these must be those about *j. Adds to
 * `macs`. */
const eits_joint_known *eits_joint_places(eits_context *ctx, const eits_joint *j, uint64_t *macs);

/* merge.c: shapes of one sign that are so near that they may be parts of one touch form a group.
 * Each group becomes one ellipse with the group's area, strength and extent. A crowd stays as it
 * is. Returns by how much the number of shapes has fallen. */
uint32_t eits_joint_merge(eits_joint *j);

/* Return 1 if two shapes of one sign are nearer than `radii` times the sum of their radii. */
int eits_joint_near(const eits_shape *a, const eits_shape *b, eits_real radii);

/* report.c */

/* Return the part of the data's energy that the shapes leave beyond noise and the model's errors.
 */
eits_real eits_joint_left(const eits_context *ctx, const eits_joint *j);

/* Return 1 if the shapes explain the frame. */
int eits_joint_explains(const eits_context *ctx, const eits_joint *j);

/* If the shapes need no test, make them the frame's touches, with the certainty that F gives, and
 * return 1. The fit began with `begun` shapes, which stand for `begun` + `fewer` discs. */
int eits_joint_take_if_clear(eits_context *ctx, const eits_joint *j, uint32_t fewer, uint32_t begun,
                             eits_fit *f);

/* Make the shapes the frame's touches without that condition. */
void eits_joint_take(eits_context *ctx, const eits_joint *j, eits_fit *f);

/* Give the places and sizes of the shapes to the touches that the test left. */
void eits_joint_refine(eits_context *ctx, const eits_joint *j, eits_fit *f);

/* begin.c */

/* Return 1 if frames are fitted jointly: the option is on, the model has the sections that this
 * needs, and the reference is that of a skin which the model describes. */
int eits_can_fit_jointly(const eits_context *ctx);

/* Before the test: fit the discs of `f` jointly, in *j. If they explain the frame, if each is
 * needed, and if no two may be one, no test is needed: *f becomes the result, as if tested, and 1
 * is returned. Otherwise *f stays as it is. Without fields in the model, with the option off, or
 * with an instrument that is far from the model, nothing is done, and j->count is 0. */
int eits_fit_clearly(eits_context *ctx, const eits_scratch *scratch, eits_fit *f, eits_joint *j);

/* Return 1 if the shapes leave so little of the data that their number is probably right. */
int eits_joint_is_likely(const eits_context *ctx, const eits_joint *j);

/* Make the shapes the discs of `f`. */
void eits_joint_give(const eits_context *ctx, const eits_joint *j, eits_fit *f);

/* After the test: fit the remaining touches jointly; *j is from eits_fit_clearly. The touches stay
 * as they are if the joint fit leaves too much of the data, or if the skin has drifted and the fit
 * leaves more than noise, because the metric does not include drift of the skin. */
void eits_fit_jointly(eits_context *ctx, const eits_scratch *scratch, eits_fit *f, eits_joint *j);

#endif
