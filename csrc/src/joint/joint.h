/* All touches of a frame fitted at once to its folded data by the multipole model: places, radii,
 * strengths, ellipses where the data support them, and how well each place is known.
 *
 *     F = sum over folds ((d - answers) / sigma)^2 - (what the gain's drift explains of it)
 *         + sum over touches of h(log |q|) + (log(r / R) / dR)^2 + (e_1^2 + e_2^2) / dE^2
 *
 * is minimised by damped Gauss-Newton steps (fit.c). sigma^2 is the variance of a fold's noise and
 * of the multipole model's own error, which is a fraction of the data (metric.c). h is
 * the less of what a light touch and of what any other costs (prior.c). */
#ifndef EITSKIN_JOINT_H
#define EITSKIN_JOINT_H

#include "evidence/evidence.h"
#include "multipole/multipole.h"

/* Parameters of a touch in the order of eits_pole_out, but for the amplitude's logarithm: x, y
 * (pixels), log radius, log |amplitude| and, for an ellipse, e1 and e2. */
enum { EITS_JOINT_DISC = 4, EITS_JOINT_ELLIPSE = 6 };

/* Touches under the fit. */
typedef struct eits_joint {
    eits_shape shape[EITS_MAX_TOUCHES];
    uint32_t from[EITS_MAX_TOUCHES]; /* which of the fit's discs it was or was part of */
    /* those that are varied, by ascending number; the others are held (eits_joint_hold) */
    uint32_t free[EITS_MAX_TOUCHES];
    uint64_t most;    /* multiply-accumulates of settling after which no step or trial is begun */
    uint64_t further; /* the same where the shapes leave little */
    uint32_t count, free_count;
    uint32_t searches;   /* 1: missing touches are sought */
    uint32_t parameters; /* of each: EITS_JOINT_DISC or EITS_JOINT_ELLIPSE */
    eits_real cost;      /* F */
    eits_real misfit;    /* its first line: the data's part */
    eits_real left;      /* the same as if the model had no errors: what is left of the data */
} eits_joint;

/* metric.c */

/* Set 1 / sigma of each fold, 0 where it is left out, and what no touch causes in that metric: the
 * drift of the gain, and the model's errors. Returns the multiply-accumulates. */
uint64_t eits_joint_metric(eits_context *ctx);

/* Folds in use. */
uint32_t eits_joint_folds(const eits_context *ctx);

/* |W d|^2 less its part along the drift. */
eits_real eits_joint_data(const eits_context *ctx);

/* Add the products of n weighted columns with what no touch causes, to 1 + joint.errors numbers of
 * each: `columns` has their folds first ... first + count - 1, EITS_JOINT_BLOCK numbers apart, and
 * `along` the sums, EITS_JOINT_NUISANCES apart. */
void eits_joint_add_along(const eits_context *ctx, const eits_real *columns, uint32_t n,
                          uint32_t first, uint32_t count, eits_real *along);

/* L^-1 of these sums: a product of two columns loses the product of their numbers. */
void eits_joint_finish_along(eits_context *ctx, eits_real *along);

/* fit.c */

/* F of the shapes as they are, after `rounds` more of what they send each other, and the normal
 * equations about them. Returns the multiply-accumulates. */
uint64_t eits_joint_evaluate(eits_context *ctx, eits_joint *j, uint32_t rounds);

/* Steps until F hardly falls, or falls as the linearisation said, or would stay above `hopeless`;
 * at most EITS_JOINT_STEPS, and none that would take the work of this frame above EITS_JOINT_WORK.
 * Adds to `macs`. The normal equations are those about *j then. */
void eits_joint_descend(eits_context *ctx, eits_joint *j, uint32_t rounds, eits_real hopeless,
                        uint64_t *macs);

/* Return the F that the linearisation about *j predicts, where nothing is induced yet. Adds to
 * `macs`. */
eits_real eits_joint_expect(eits_context *ctx, eits_joint *j, uint64_t *macs);

/* The same from an evaluation about *j, which is the last that was made. */
void eits_joint_continue(eits_context *ctx, eits_joint *j, eits_real hopeless, uint64_t *macs);

/* The multiply-accumulates after which settling begins no step: `most`, or what the frame's touches
 * have left of EITS_JOINT_FRAME_WORK; before the test, EITS_JOINT_AGAIN of that are kept. */
uint64_t eits_joint_limit(const eits_context *ctx, const eits_joint *j, uint64_t most);

/* Make the induced field and the normal equations about shapes that were settled before others were
 * tried, all of them free. Returns the multiply-accumulates. */
uint64_t eits_joint_return_to(eits_context *ctx, eits_joint *j);

/* Keep the normal equations about *j, and take them back, where something else was tried. */
void eits_joint_keep(eits_context *ctx, const eits_joint *j);
void eits_joint_back(eits_context *ctx, const eits_joint *j);

/* Strength q r^2 of a shape, with its sign. */
static inline eits_real eits_joint_strength(const eits_shape *s)
{
    return s->amplitude * s->radius * s->radius;
}

/* All shapes are varied. */
void eits_joint_free_all(eits_joint *j);

/* Hold the shapes that are not free, after `rounds` more of what all send each other: evaluations
 * about shapes that are otherwise those of *j, with fewer than all free, then make the answers of
 * the free ones alone. What the others leave of the data is in joint.rest. */
uint64_t eits_joint_hold(eits_context *ctx, const eits_joint *j, uint32_t rounds);

/* Shape k alone is free. */
void eits_joint_free_one(eits_joint *j, uint32_t k);

/* The field about shape k as it was, after another shape was tried in its place. */
uint64_t eits_joint_restore(eits_context *ctx, const eits_joint *j, uint32_t k);

/* Score `further` discs that stand behind the shapes of *j, which is at a minimum of F and has all
 * of them free: by how much F falls with each, and how many times as strong it is then, as
 * linearised, all shapes free. Their number is limited by EITS_JOINT_PARAMETERS. The normal
 * equations are those about *j then. */
uint64_t eits_joint_score(eits_context *ctx, eits_joint *j, uint32_t further, eits_real *gain,
                          eits_real *scale);

/* prior.c */

/* A disc of the expected size, of the strong kind. */
eits_shape eits_joint_usual(const eits_context *ctx, eits_real x, eits_real y, int insulates);

/* The prior's part of F for one shape. */
eits_real eits_joint_prior(const eits_context *ctx, const eits_shape *s, uint32_t parameters);

/* The distance of a shape's parameter p from the mean of its prior, and 1 / variance of that prior.
 * Both are 0 for places, which have no prior. */
eits_real eits_joint_offset(const eits_context *ctx, const eits_shape *s, uint32_t p);
eits_real eits_joint_precision(const eits_shape *s, uint32_t p);

/* Whether the shape is likelier a light touch than a strong one; and the shape of its strength q
 * r^2 that is strong, or of the kind that it is not. */
int eits_joint_is_light(const eits_shape *s);
eits_shape eits_joint_as_strong(const eits_shape *s);
eits_shape eits_joint_as_other(const eits_shape *s);

/* Each shape becomes strong and small, or light and large, whichever is the likelier by the priors
 * alone. */
void eits_joint_guess_kinds(const eits_context *ctx, eits_joint *j);

/* The changes of F where the shape stands, and of its normal equations for log |amplitude|, if the
 * shape counts as the other kind. */
typedef struct eits_joint_change {
    eits_real cost, precision, gradient;
} eits_joint_change;

void eits_joint_other_prior(const eits_shape *s, eits_joint_change *of);

/* kinds.c: shape k, the only free one of *j (eits_joint_hold), as the other kind: *j becomes that
 * and 1 is returned where F falls by more than `fall`. Nothing is fitted where the linearisation
 * does not promise it. Adds to `macs`. */
int eits_joint_turn(eits_context *ctx, eits_joint *j, uint32_t k, eits_real fall, uint64_t *macs);

/* kinds.c: try each shape as the other kind where F may fall so; what lowers F stands. `settled` is
 * what one descent takes. Adds to `macs`. The normal equations are those about *j then. */
void eits_joint_choose_kinds(eits_context *ctx, eits_joint *j, uint64_t settled, uint64_t *macs);

/* settle.c: to the minimum of F: as discs, and as ellipses where discs leave more than noise and
 * ellipses lower F by enough. Returns the multiply-accumulates. */
uint64_t eits_joint_settle(eits_context *ctx, const eits_scratch *scratch, eits_joint *j);

/* search.c: change the number of discs where they leave more than noise. `spent` is the frame's
 * work so far; returns what was added. The normal equations are those about *j then. */
uint64_t eits_joint_search(eits_context *ctx, const eits_scratch *scratch, eits_joint *j,
                           uint64_t spent);

/* split.c: try what is long as two. `spent` is the frame's work so far; returns what was added. The
 * normal equations are those about *j then. */
uint64_t eits_joint_split(eits_context *ctx, eits_joint *j, uint64_t spent);

/* Whether two shapes count as two touches: they are far enough apart and of similar strength. */
int eits_joint_are_two(const eits_shape *a, const eits_shape *b);

/* Numbers that the data have beside what the shapes take. */
eits_real eits_joint_freedom(const eits_context *ctx, const eits_joint *j);

/* How much worse the data fit than sigma says, at least 1. */
eits_real eits_joint_excess(const eits_context *ctx, const eits_joint *j);

/* What the normal equations where the touches are tell of a touch, all other parameters free. */
typedef struct eits_joint_known {
    eits_real place[3];   /* covariance of x and y, pixels^2: xx, xy, yy */
    eits_real shape;      /* how far e1 and e2 are from 0, in variances; 0 for a disc */
    eits_real rise;       /* of F where its amplitude is 0 and the others make up for it */
    eits_real log_radius; /* variance */
    /* if it were of the other kind: the rise of F, and where x, y and log radius would be */
    eits_real other_rise, other_step[3];
} eits_joint_known;

/* known[0 ... j->count - 1]; the normal equations are those about *j. */
uint64_t eits_joint_places(eits_context *ctx, const eits_joint *j, eits_joint_known *known);

/* merge.c: every group of shapes of one sign, each so near to another of it that they may be parts
 * of one, becomes one ellipse of the group's area, strength and extent. A crowd stays as it is.
 * Returns how many are fewer. */
uint32_t eits_joint_merge(eits_joint *j);

/* Whether two shapes of one sign are nearer than so many sums of their radii. */
int eits_joint_near(const eits_shape *a, const eits_shape *b, eits_real radii);

/* report.c */

/* The part of the data's energy that the shapes leave beyond noise and the model's errors. */
eits_real eits_joint_left(const eits_context *ctx, const eits_joint *j);

/* Whether the shapes explain the frame. */
int eits_joint_explains(const eits_context *ctx, const eits_joint *j);

/* If the shapes need no test, they become the frame's touches, as sure as F says, and 1 is
 * returned. They were `begun` shapes, which stand for `fewer` more discs. */
int eits_joint_take_if_clear(eits_context *ctx, const eits_joint *j, uint32_t fewer, uint32_t begun,
                             eits_fit *f);

/* The same without that condition. */
void eits_joint_take(eits_context *ctx, const eits_joint *j, eits_fit *f);

/* The shapes give the touches that the test left their places and sizes. */
void eits_joint_refine(eits_context *ctx, const eits_joint *j, eits_fit *f);

/* begin.c */

/* Whether frames are fitted jointly: the option is on, the model has what that takes, and the
 * reference is of a skin that the model describes. */
int eits_can_fit_jointly(const eits_context *ctx);

/* Before the test: fit the discs of `f` jointly, in *j. Where they explain the frame, each is
 * needed and no two may be one, no test is needed: *f becomes the result, as if tested, and 1 is
 * returned. Else *f stays as it is. Does nothing where the model has no fields, where the option is
 * off, and on an instrument that is far from the model; j->count is 0 then. */
int eits_fit_clearly(eits_context *ctx, const eits_scratch *scratch, eits_fit *f, eits_joint *j);

/* Whether the shapes leave so little that their number is likely right. */
int eits_joint_is_likely(const eits_context *ctx, const eits_joint *j);

/* The shapes as the discs of `f`. */
void eits_joint_give(const eits_context *ctx, const eits_joint *j, eits_fit *f);

/* After the test: the same for the touches that it left; *j is from eits_fit_clearly. Touches stay
 * as they are where the joint fit leaves too much of the data, and on a sheet that has drifted, of
 * which the metric does not know. */
void eits_fit_jointly(eits_context *ctx, const eits_scratch *scratch, eits_fit *f, eits_joint *j);

#endif
