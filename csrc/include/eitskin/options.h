/* eitskin: the options of a reconstruction.
 *
 * eits_options_default returns a model's own options. eits_set_options (context.h) checks options
 * against the table below and applies them.
 *
 * Written by tables/make_tables.py from tables/options.toml.
 */
#ifndef EITSKIN_OPTIONS_H
#define EITSKIN_OPTIONS_H

#include "eitskin/diagnostics.h"
#include "eitskin/model.h"

#ifdef __cplusplus
extern "C" {
#endif

#define EITS_MAX_TOUCHES 16

/* The sign of the conductivity changes that the image may have. */
typedef enum eits_sign {
    /* x >= 0: touches by something that conducts better */
    EITS_SIGN_INCREASE = 0,
    /* x <= 0: touches by something that conducts worse */
    EITS_SIGN_DECREASE = 1,
    /* any x: touches of both kinds */
    EITS_SIGN_BOTH = 2
} eits_sign;

/* The method that finds the image; all minimise the same objective (solve.h). */
typedef enum eits_solver {
    /* FISTA on all columns in every iteration */
    EITS_SOLVER_FISTA = 0,
    /* FISTA on the columns that may differ from zero. They are chosen again after gap_every
     * iterations, then at growing intervals; with gap_rel > 0, always after gap_every */
    EITS_SOLVER_WORKING_SET = 1,
    /* Newton's steps to the optimum of a few columns, then more columns; an iteration is such a
     * round. The number 2 is reserved: it was coordinate descent in earlier versions, and is
     * rejected */
    EITS_SOLVER_ACTIVE_SET = 3
} eits_solver;

/* Bits: what the touch fit does beyond fitting discs to the image's peaks. */
typedef enum eits_touch_fit {
    /* first fit v0 log(v / v0), in which strong touches are more nearly linear; for models of
     * difference data */
    EITS_TOUCH_FIT_LOG_DATA = 1,
    /* merge discs that are one touch and split those that are two. Only with LOG_DATA or
     * INTERACTION, because uncorrected non-linearity looks like additional touches */
    EITS_TOUCH_FIT_SPLIT_MERGE = 2,
    /* take the interaction of touches (each changes the field at the others) out of the data; for
     * models of difference data with fields */
    EITS_TOUCH_FIT_INTERACTION = 4,
    /* fit all touches at once by multipoles: places, radii and ellipses; for models with fields,
     * model errors and row errors, and with touch_test */
    EITS_TOUCH_FIT_JOINT = 32
} eits_touch_fit;
#define EITS_TOUCH_FIT_ALL 39u

/* The options. Lambdas are in the units of S'y. docs/reference/options.md lists default values and
 * ranges. */
typedef struct eits_options {
    /* the maximum number of iterations; FISTA runs exactly this many if gap_rel is 0 */
    uint32_t iterations;
    /* iterations between checks of the duality gap and of divergence, and before the working set is
     * chosen again */
    uint32_t gap_every;
    /* the maximum number of touches that are reported; the default is the model's */
    uint32_t max_touches;
    /* the core rejects a frame in which more rows cannot be used; by default half of the rows */
    uint32_t max_masked;
    /* the change that is looked for: increase (conducting touches), decrease or both */
    eits_sign sign;
    /* the method: fista, working-set or active-set (solve.h) */
    eits_solver solver;
    /* 1: start from the last frame's coefficients, with the momentum reset (solve.h) */
    uint32_t warm_start;
    /* 1: ignore changes along the reference frame, that is, drift of the gain; the default is 1, in
     * taught models 0 */
    uint32_t project_reference;
    /* > 0: lambda itself; 0: lambda is the greater of lambda_rel lambda_max and lambda_noise_factor
     * lambda_noise */
    eits_real lambda_abs;
    /* lambda is at least this fraction of lambda_max, unless lambda_abs is given */
    eits_real lambda_rel;
    /* lambda is at least this multiple of lambda_noise, unless lambda_abs is given */
    eits_real lambda_noise_factor;
    /* a frame has no touch if lambda_max < detection_factor lambda_noise; 0: no threshold */
    eits_real detection_factor;
    /* > 0: stop once the duality gap <= gap_rel |y|^2 / 2 */
    eits_real gap_rel;
    /* > 0: a row at or beyond +-saturation_v, V, is left out; 0: no row is saturated */
    eits_real saturation_v;
    /* a local maximum of the image below this fraction of the greatest one starts no touch */
    eits_real touch_threshold;
    /* a touch that explains less than this fraction of |y|^2 beside the others is dropped */
    eits_real touch_min_fraction;
    /* the least radius of a touch */
    eits_real touch_min_radius_mm;
    /* the greatest radius of a touch */
    eits_real touch_max_radius_mm;
    /* the radius from which a fit starts, between the other two */
    eits_real touch_seed_radius_mm;
    /* expected conductivity change under a touch, which separates radius from strength; 0:
     * unknown */
    eits_real touch_change_s_per_m;
    /* weight, against the data, of the radius that touch_change_s_per_m implies, relative to the
     * touch's own energy */
    eits_real touch_radius_weight;
    /* sweeps of the off-grid fit over all touches; 0: peaks with their strengths only */
    uint32_t touch_sweeps;
    /* a touch keeps its id if the next frame shows it within this distance of the place to which
     * its velocity brings it */
    eits_real follow_mm;
    /* > 0: stop with the best image so far before info.macs exceeds this (solve.h); 0: no limit */
    uint32_t mac_limit;
    /* the diagnostics that are examined, one bit each */
    uint32_t diagnostics;
    /* 1: discs start where they explain most of the data, one after the other, and each is placed
     * again beside the others; 0: they start at the image's peaks. The default is 0, in taught
     * models 1 */
    uint32_t touch_seek;
    /* parts of the touch fit, one bit each; by default all that the model does not leave out */
    uint32_t touch_fit;
    /* 1: if more than one touch is found, eits_find_touches solves the frame again with their
     * interaction taken out of the data; image and info are then those of the second solve. Ignored
     * with a mac_limit */
    uint32_t second_pass;
    /* the whitening's regularisation is at least this times noise_v / v0_rms, if both are known; 0:
     * it is the model's */
    eits_real regularisation_noise_factor;
    /* 1: each row's data are multiplied by the gain that makes its reference equal to the model's.
     * Needs a model with section UNCE; not done if the reference shows that the instrument differs
     * rather than the skin */
    uint32_t row_gains;
    /* 1: a touch that the model's own errors could have caused is not reported, and close touches
     * that could be one become one. Needs a model with section UNCE */
    uint32_t touch_test;
    /* the most columns that the touch test may compute per frame (about 6 kMAC each at rank 64)
     * after a first look at each touch. When they are used up, the touches found so far are
     * reported as crowded; 0: no limit but the frame's budget (TEST_WORK) */
    uint32_t test_columns;
    /* > 0: reference tracking: while nothing touches the skin, the reference follows it with this
     * time constant, in frames; 0: the reference stays as it was taken. The default is 0, in taught
     * models 512. Works only if eits_find_touches is called for each frame, and not in a batch */
    uint32_t reference_frames;
    /* the noise of a row is at least this, V; for a converter, its step over the square root of
     * 12 */
    eits_real noise_floor_v;
} eits_options;

/* One option: where it lies in eits_options, and its range. */
typedef struct eits_option {
    const char *name;
    size_t offset, size;
    /* 1: a uint32_t, or an enum of `size` bytes; 0: an eits_real */
    uint32_t whole;
    eits_real least, greatest;
} eits_option;

/* All options, `count` of them, in the order of eits_options: to read and set them by name. */
const eits_option *eits_option_table(uint32_t *count);

/* The model's default options. Errors: EITS_E_ARGUMENT. */
eits_status eits_options_default(const eits_model *model, eits_options *options);

/* Change `options` for a stream of frames whose touches eits_fast_report follows
 * (docs/guide/tracking.md): the detection threshold is lowered by a quarter, since touches from
 * noise are not found in a second frame. Errors: EITS_E_ARGUMENT. */
eits_status eits_options_track(eits_options *options);

#ifdef __cplusplus
}
#endif
#endif
