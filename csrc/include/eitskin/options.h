/* eitskin: what a reconstruction can be asked for.
 *
 * eits_options_default gives a model's own; eits_set_options (context.h) checks them against
 * the table below and puts them in force.
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

#define EITS_MAX_TOUCHES      16
#define EITS_MAX_TRACK_FRAMES 1000u

/* Which conductivity changes are looked for. */
typedef enum eits_sign {
    /* x >= 0: touches by something that conducts better */
    EITS_SIGN_INCREASE = 0,
    /* x <= 0 */
    EITS_SIGN_DECREASE = 1,
    /* all x */
    EITS_SIGN_BOTH = 2
} eits_sign;

/* How an image is found; each minimises the same objective (solve.h). */
typedef enum eits_solver {
    /* every column in every iteration */
    EITS_SOLVER_FISTA = 0,
    /* FISTA on the columns that may differ from zero. They are chosen again after gap_every
     * iterations, then ever more rarely, or always so often where gap_rel asks for a gap */
    EITS_SOLVER_WORKING_SET = 1,
    /* to the optimum of the columns chosen, then more columns; an iteration is such a round. The
     * number 2 is reserved: earlier versions had coordinate descent there, and it is rejected */
    EITS_SOLVER_ACTIVE_SET = 3
} eits_solver;

/* Bits: what the touch fit does beyond fitting discs to the image's peaks. */
typedef enum eits_touch_fit {
    /* first fit v0 log(v / v0), in which strong touches are nearer to linear; for models of
     * difference data */
    EITS_TOUCH_FIT_LOG_DATA = 1,
    /* merge discs that are one touch and split those that are two; only where the data are log data
     * or corrected for interaction, for what is not linear looks like more touches */
    EITS_TOUCH_FIT_SPLIT_MERGE = 2,
    /* take what touches do to each other's field out of the data; for models of difference data
     * with fields */
    EITS_TOUCH_FIT_INTERACTION = 4
} eits_touch_fit;
#define EITS_TOUCH_FIT_ALL 7u

/* The options. Lambdas are in the units of S'y. docs/reference/options.md lists usual values and
 * ranges. */
typedef struct eits_options {
    /* the most iterations; exactly so many where gap_rel is 0 */
    uint32_t iterations;
    /* iterations between checks of the duality gap and of divergence, and until the working set is
     * chosen again */
    uint32_t gap_every;
    /* the most touches that are reported; the model's number by default */
    uint32_t max_touches;
    /* the core rejects a frame with more unusable rows; half of the rows by default */
    uint32_t max_masked;
    /* the change that is looked for: increase (conducting touches), decrease or both */
    eits_sign sign;
    /* fista, working-set or active-set (solve.h) */
    eits_solver solver;
    /* 1: start from the last frame's coefficients, momentum reset (solve.h) */
    uint32_t warm_start;
    /* 1: ignore changes along the reference frame, that is drift of the gain; 0 by default in
     * taught models */
    uint32_t project_reference;
    /* > 0: this lambda; 0: the greater of those that lambda_rel and lambda_noise_factor give */
    eits_real lambda_abs;
    /* lambda, where lambda_abs is 0, is at least this fraction of lambda_max */
    eits_real lambda_rel;
    /* and at least this multiple of lambda_noise */
    eits_real lambda_noise_factor;
    /* no touch where lambda_max < detection_factor lambda_noise; 0: no such threshold */
    eits_real detection_factor;
    /* > 0: stop once the duality gap <= gap_rel |y|^2 / 2 */
    eits_real gap_rel;
    /* > 0: a channel at or beyond +-saturation_v is unusable, V */
    eits_real saturation_v;
    /* a local maximum below this fraction of the greatest starts no touch */
    eits_real touch_threshold;
    /* a touch that explains less than this fraction of |y|^2 beside the others is dropped */
    eits_real touch_min_fraction;
    /* the least radius of a touch */
    eits_real touch_min_radius_mm;
    /* the greatest */
    eits_real touch_max_radius_mm;
    /* the radius that a fit starts from, between the two */
    eits_real touch_seed_radius_mm;
    /* expected conductivity change under a touch, which separates radius from strength; 0:
     * unknown */
    eits_real touch_change_s_per_m;
    /* weight of the radius so expected against the data, relative to the touch's own energy */
    eits_real touch_radius_weight;
    /* sweeps of the off-grid fit over all touches; 0: peaks with their strengths only */
    uint32_t touch_sweeps;
    /* a touch that moved at most so far since the last frame keeps its id */
    eits_real follow_mm;
    /* > 0: stop with the best so far before info.macs goes beyond this (solve.h) */
    uint32_t mac_limit;
    /* the diagnostics that are looked for, a bit each */
    uint32_t diagnostics;
    /* 1: discs start where the data answer most, one after the other, each sought again beside the
     * others, and not at the image's peaks; the default in taught models */
    uint32_t touch_seek;
    /* parts of the touch fit, a bit each; all but those that the model leaves out by default */
    uint32_t touch_fit;
    /* 1: where more than one touch is found, eits_find_touches solves again with their interaction
     * taken out of the data; image and info are then the second solve's. Not with a mac_limit */
    uint32_t second_pass;
    /* a tentative touch is reported once it was found in so many frames in a row; 0, 1: at once */
    uint32_t track_confirm;
    /* a touch that is not found keeps its id for so many frames, and is still reported if it was
     * faint before */
    uint32_t track_hold;
    /* > 0: follow places, radii and strengths in time; how uncertain the place of a touch is whose
     * S'y is as great as that of noise, in pixels */
    eits_real track_smooth;
    /* the whitening's regularisation is at least this times noise_v / v0_rms, where both are known;
     * 0: as the model has it */
    eits_real regularisation_noise_factor;
    /* 1: where the model says what it may be wrong by, each row's data are multiplied by what makes
     * its reference the model's, unless the reference says that the instrument differs and not the
     * skin */
    uint32_t row_gains;
    /* 1: where the model says what it may be wrong by, a touch that such errors could have made is
     * not reported, and near ones that could be one touch become one */
    uint32_t touch_test;
    /* columns that the test of touches may make a frame (about 6 kMAC each at rank 64) beyond a
     * first look at each touch; then what stands is reported as crowded; 0: any number */
    uint32_t test_columns;
    /* > 0: between touches the reference follows the untouched skin, with this time constant in
     * frames; 0: it stays as it was taken, the default but in taught models. After
     * eits_find_touches alone, and not in a batch */
    uint32_t reference_frames;
    /* the noise of a row is at least this, V: of a converter its step over the root of 12 */
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

/* The model's defaults as options. Errors: EITS_E_ARGUMENT. */
eits_status eits_options_default(const eits_model *model, eits_options *options);

/* Change `options` to what suits frames that follow one another, 48 or 96 a second
 * (docs/guide/tracking.md): the detection threshold a quarter lower, and touches followed in time,
 * so that those of noise are not reported. A frame by itself then misses faint touches: each needs
 * those before it. Errors: EITS_E_ARGUMENT. */
eits_status eits_options_track(eits_options *options);

#ifdef __cplusplus
}
#endif
#endif
