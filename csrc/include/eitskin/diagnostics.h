/* eitskin: what the core reports about a frame: faults, costs, and how its solve ended.
 *
 * The frame stage examines rows and electrodes before anything is solved, and leaves out those that
 * would spoil the image; solver and touch fit examine the result. A diagnostic is not an error: the
 * core makes an image of the rest of the frame. It rejects a frame only if more than
 * options.max_masked rows are left out, and then still reports the diagnostics. options.diagnostics
 * chooses which diagnostics are examined; saturated rows are left out in any case.
 * docs/reference/diagnostics.md has the rule of each.
 *
 * Written by tables/make_tables.py from tables/diagnostics.toml.
 */
#ifndef EITSKIN_DIAGNOSTICS_H
#define EITSKIN_DIAGNOSTICS_H

#include "eitskin/types.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Bits of info.diagnostics and options.diagnostics. No bit ever gets another meaning. */
typedef enum eits_diagnostic {
    /* leaves rows at or beyond saturation_v out and counts them */
    EITS_DIAGNOSTIC_SATURATED = 1,
    /* leaves all rows of the electrode out and names it */
    EITS_DIAGNOSTIC_ELECTRODE_OPEN = 2,
    /* leaves the rows of both electrodes out and names them */
    EITS_DIAGNOSTIC_BRIDGED = 4,
    /* leaves out single rows that disagree with all others, and counts them */
    EITS_DIAGNOSTIC_OUTLIER = 8,
    /* names an electrode that too many outliers share, and leaves its rows out */
    EITS_DIAGNOSTIC_ELECTRODE_NOISY = 16,
    /* images the frame, although no change of the modelled skin explains the fraction
     * model_mismatch of the data */
    EITS_DIAGNOSTIC_MODEL_MISMATCH = 32,
    /* images the frame, although it changes in a way that touches cannot */
    EITS_DIAGNOSTIC_STALE_REFERENCE = 64,
    /* eits_find_touches reports more touches than can be separated */
    EITS_DIAGNOSTIC_CROWDED = 128,
    /* images the frame with the strongest regularisation; a single uncertain touch is placed at the
     * middle of that image. The reference is further from the model's, or from its own reciprocals,
     * than that of an uneven skin */
    EITS_DIAGNOSTIC_UNLIKE_MODEL = 256
} eits_diagnostic;
#define EITS_DIAGNOSTICS_ALL 511u

/* Bits: why a row is left out of a frame; 0 for a row in use. */
typedef enum eits_row_state {
    /* masked by eits_mask_row, or left out while the reference was taken */
    EITS_ROW_MASKED = 1,
    /* its voltage is not a finite number */
    EITS_ROW_UNKNOWN = 2,
    /* it is at or beyond options.saturation_v */
    EITS_ROW_SATURATED = 4,
    /* it uses an open electrode */
    EITS_ROW_OPEN = 8,
    /* it uses an electrode of a bridged pair */
    EITS_ROW_BRIDGED = 16,
    /* it disagrees with all other rows */
    EITS_ROW_OUTLIER = 32,
    /* it uses a noisy electrode */
    EITS_ROW_NOISY = 64
} eits_row_state;

/* A row of the protocol names each electrode by one byte. */
#define EITS_MAX_ELECTRODES 256u

/* Bits of an electrode's state; 0 if nothing is wrong with it. */
typedef enum eits_electrode_state {
    EITS_ELECTRODE_OPEN = 1,
    EITS_ELECTRODE_BRIDGED = 2,
    EITS_ELECTRODE_NOISY = 4
} eits_electrode_state;

/* Why the solver stopped. */
typedef enum eits_stop {
    /* options.iterations were done */
    EITS_STOP_ITERATIONS = 0,
    /* the duality gap was small enough */
    EITS_STOP_GAP = 1,
    /* lambda_max lies below the detection threshold: no touch, the image is zero */
    EITS_STOP_BELOW_THRESHOLD = 2,
    /* lambda >= lambda_max: zero is the exact optimum; or |y| < 2^-51 (4.4e-16; in double 1e-146),
     * too small to be squared */
    EITS_STOP_ZERO = 3,
    /* the objective rose, or all went to zero, although the step was halved again and again; the
     * image is zero */
    EITS_STOP_DIVERGED = 4,
    /* the next step would have exceeded mac_limit: the image is the best one so far */
    EITS_STOP_MACS = 5,
    /* no coefficient moves any more except by rounding; only the active-set solver reports this */
    EITS_STOP_OPTIMUM = 6
} eits_stop;

/* The image that shows a frame. */
typedef enum eits_shown {
    /* the solver's image (eits_get_image): there are no touches, or they do not explain the
     * frame */
    EITS_SHOWN_SOLVER = 0,
    /* the image that eits_draw_touches draws of the touches, which explain the frame */
    EITS_SHOWN_TOUCHES = 1
} eits_shown;

/* The cost of a reconstruction, how it ended, and what was wrong with the frame. */
typedef struct eits_info {
    /* iterations of the solver */
    uint32_t iterations;
    /* why the solver stopped */
    eits_stop stop;
    /* coefficients that are not zero */
    uint32_t nonzeros;
    /* rows of the protocol that were left out of this frame */
    uint32_t masked;
    /* how often the solver halved its step because the objective rose */
    uint32_t step_halvings;
    /* number of touches; set by eits_find_touches */
    uint32_t touches;
    /* multiply-accumulates with a stored matrix, a basis vector, F or the active set's factor;
     * vector sums are not counted */
    uint64_t macs;
    /* the same for eits_find_touches */
    uint64_t touch_macs;
    /* lambda as used */
    eits_real lambda;
    /* the smallest lambda whose image is zero: max(S'y), by the option sign */
    eits_real lambda_max;
    /* the reference's lambda_noise, times a factor for the rows that are left out */
    eits_real lambda_noise;
    /* duality gap at the result, absolute; 0 if stop is BELOW_THRESHOLD, ZERO or DIVERGED, or if it
     * is MACS and not even one product with S was affordable */
    eits_real gap;
    /* gap / (|y|^2 / 2) */
    eits_real gap_rel;
    /* |y - S x| */
    eits_real residual;
    /* |y| */
    eits_real data_norm;
    /* bits of eits_diagnostic; CROWDED is set by eits_find_touches */
    uint32_t diagnostics;
    /* saturated rows, masked ones not counted */
    uint32_t saturated;
    /* rows left out as outliers */
    uint32_t outliers;
    /* fraction of |d| above noise that lies outside the model's range, 0 to 1; 0 if it was not
     * examined */
    eits_real model_mismatch;
    /* fraction of |y|^2 that the touches do not explain, or of |d|^2 if they were fitted jointly;
     * set by eits_find_touches; 0 if no touches were looked for */
    eits_real unexplained;
    /* bit e: electrode e is open, for the first 64; eits_get_electrode_states has all */
    uint64_t open_electrodes;
    /* bit e: electrode e is bridged with another one */
    uint64_t bridged_electrodes;
    /* bit e: electrode e is noisy */
    uint64_t noisy_electrodes;
    /* regularisation of the whitening of this frame, over s_1^2; 0 if the model does not state
     * it */
    eits_real regularisation;
    /* which image shows the frame; set by eits_find_touches */
    eits_shown shown;
} eits_info;

/* One touch. */
typedef struct eits_touch {
    /* number from 1 that a touch keeps from frame to frame */
    uint32_t id;
    /* centre of the touch */
    eits_real x_mm;
    eits_real y_mm;
    /* radius of the fitted disc, or of a disc with the ellipse's area */
    eits_real radius_mm;
    /* conductivity change integrated over the touch: S mm^2/m */
    eits_real strength_s_per_m_mm2;
    /* fraction of |y|^2 that would be unexplained without this touch, 0 to 1; 0 if it was not found
     * in this frame and is held from earlier ones */
    eits_real explained;
    /* its force, N; 0 if the model is not calibrated (force.h) */
    eits_real force_n;
    /* probability that this is a touch, and not a second one found for the same touch; 0 if it is
     * not known: the model has no section UNCE, or the touch is held */
    eits_real confidence;
    /* covariance of the centre in this frame, mm^2; 0 if it is not known */
    eits_real x_variance_mm2;
    eits_real xy_covariance_mm2;
    eits_real y_variance_mm2;
    /* half of the long axis, as a vector, mm, of the ellipse that the touch is found to be. Its
     * area is pi radius_mm^2, so half of the short axis is radius_mm^2 over this length. 0, 0: a
     * disc, or the data do not show a shape */
    eits_real long_x_mm;
    eits_real long_y_mm;
    /* standard deviation of radius_mm; 0 if the data do not determine the radius. Then radius_mm is
     * the one expected of touches of this strength, and the change of conductivity, which is the
     * strength over the area, is not known either */
    eits_real radius_sd_mm;
    /* 1: a whole frame has shown it; 0: so far only drives have, or a single frame
     * (eits_fast_report) */
    uint32_t confirmed;
} eits_touch;

/* A name for one bit of eits_diagnostic ("electrode open", "outlier"...), never NULL. */
const char *eits_diagnostic_text(eits_diagnostic diagnostic);

#ifdef __cplusplus
}
#endif
#endif
