/* eitskin: one reconstruction context in memory that the caller owns.
 *
 * All that is needed, errors apart (each call returns an eits_status):
 *
 *     static _Alignas(16) uint8_t workspace[140 * 1024]; // or eits_workspace_size(&model, 0) bytes
 *     eits_model model;                                  // a view of the blob, which stays
 *     eits_context *ctx;                                 // points into the workspace
 *     eits_touch touches[EITS_MAX_TOUCHES];
 *     uint32_t count;
 *
 *     eits_model_open(&model, blob, blob_size);
 *     eits_init(workspace, sizeof workspace, &model, &ctx);
 *     eits_reference_begin(ctx, 16);                     // nothing touches the skin meanwhile
 *     for (int k = 0; k < 16; ++k)
 *         eits_reference_add(ctx, measure(), model.n_rows);
 *     eits_reference_finish(ctx);
 *     for (;;) {
 *         eits_reconstruct(ctx, measure(), model.n_rows, NULL, NULL);
 *         eits_find_touches(ctx, touches, EITS_MAX_TOUCHES, &count);
 *     }
 *
 * `measure` stands for whatever gives n_rows voltages in the order of the model's protocol.
 * eits_find_touches may be left out. Contexts fraction
 * nothing; one context is used by one thread at a time.
 */
#ifndef EITSKIN_CONTEXT_H
#define EITSKIN_CONTEXT_H

#include "eitskin/diagnostics.h"
#include "eitskin/model.h"
#include "eitskin/types.h"

#ifdef __cplusplus
extern "C" {
#endif

#define EITS_MAX_TOUCHES      16
#define EITS_MAX_TRACK_FRAMES 1000u

/* Which conductivity changes are looked for. */
typedef enum eits_sign {
    EITS_SIGN_INCREASE = 0, /* x >= 0: touches by something that conducts better */
    EITS_SIGN_DECREASE = 1, /* x <= 0 */
    EITS_SIGN_BOTH = 2
} eits_sign;

/* What the touch fit does beyond fitting discs to the image's peaks. */
typedef enum eits_touch_fit {
    /* first to v0 log(v / v0), which strong touches bend less; models of differences */
    EITS_TOUCH_FIT_LOG_DATA = 1,
    /* discs that are one touch are merged, those that are two are split; where data are
     * linear or corrected for interaction, for what bends them looks like more touches */
    EITS_TOUCH_FIT_SPLIT_MERGE = 2,
    /* what touches do to each other's field is taken out of the data; models of differences with
     * fields */
    EITS_TOUCH_FIT_INTERACTION = 4
} eits_touch_fit;
#define EITS_TOUCH_FIT_ALL 7u

typedef struct eits_options {
    uint32_t iterations; /* at most so many; exactly so many where gap_rel is 0 */
    /* iterations between checks of the gap and of divergence, and until the working set is
     * chosen anew; at least 1 */
    uint32_t gap_every;
    uint32_t max_touches; /* at most EITS_MAX_TOUCHES */
    uint32_t max_masked;  /* a frame with more unusable rows than this is refused */
    eits_sign sign;
    eits_solver solver;
    /* 1: start from the last frame's coefficients, momentum reset; see solve.h for what it does */
    uint32_t warm_start;
    /* 1: ignore changes along the reference frame, that is drift of the gain */
    uint32_t project_reference;
    eits_real lambda_abs; /* > 0: this lambda, in the units of S'y; 0: by the rule below */
    /* lambda = max(lambda_rel lambda_max, lambda_noise_factor lambda_noise) */
    eits_real lambda_rel;
    eits_real lambda_noise_factor;
    eits_real detection_factor; /* no touch where lambda_max < detection_factor lambda_noise; 0: no
                                   threshold */
    eits_real gap_rel;          /* > 0: stop once gap <= gap_rel |y|^2 / 2 */
    eits_real saturation_v;     /* > 0: a channel at or beyond +-saturation_v is unusable */
    /* a local maximum below this fraction of the greatest starts no touch */
    eits_real touch_threshold;
    /* a touch that explains less than this fraction of |y|^2 beside the others is dropped */
    eits_real touch_min_fraction;
    eits_real touch_min_radius_mm, touch_max_radius_mm, touch_seed_radius_mm;
    /* expected conductivity change under a touch: tells radius from strength; 0: unknown */
    eits_real touch_change_s_per_m;
    /* how much the radius so told counts against the data, relative to the touch's energy */
    eits_real touch_radius_weight;
    /* sweeps of the off-grid fit over all touches; 0: peaks with their strengths only */
    uint32_t touch_sweeps;
    /* a touch that moved at most so far since the last frame keeps its id */
    eits_real follow_mm;
    /* > 0: stop where the next step and the gap after it would take info.macs beyond this; see
     * solve.h */
    uint32_t mac_limit;
    /* bits of eits_diagnostic that are looked for; EITS_DIAGNOSTICS_ALL by default */
    uint32_t diagnostics;
    uint32_t touch_fit; /* bits of eits_touch_fit; EITS_TOUCH_FIT_ALL by default */
    /* 1: once more than one touch is found, eits_find_touches solves again with their interaction
     * taken out of the data; image and info are then the second image's. Not with a mac_limit */
    uint32_t second_pass;
    /* a doubtful touch is told of once it was found in so many frames on end; 0, 1: at once */
    uint32_t track_confirm;
    /* a touch that is not found keeps its id for so many frames, and is told of if it was faint
     * before */
    uint32_t track_hold;
    /* > 0: follow places, radii and strengths in time; how uncertain the place of a touch is
     * whose S'y is as great as noise gives, in pixels */
    eits_real track_smooth;
    /* > 0: the whitening's regularisation is at least this times noise_v / v0_rms, where both are
     * known */
    eits_real regularisation_noise_factor;
} eits_options;

/* Why the solver stopped. */
typedef enum eits_stop {
    EITS_STOP_ITERATIONS = 0, /* the given number of iterations was done */
    EITS_STOP_GAP = 1,        /* the duality gap was small enough */
    EITS_STOP_BELOW_THRESHOLD =
        2, /* lambda_max lies within the noise: no touch, the image is zero */
    /* lambda >= lambda_max: zero is the exact optimum; or |y| < 2^-51 (4.4e-16; double: 1e-146),
     * whose square says nothing */
    EITS_STOP_ZERO = 3,
    /* the objective rose, or all went to zero, although the step was halved again and again; the
     * image is zero */
    EITS_STOP_DIVERGED = 4,
    /* the next step would have passed mac_limit: the image is the best until then */
    EITS_STOP_MACS = 5,
    /* no coefficient moves any more but by rounding: coordinate descent and active set */
    EITS_STOP_OPTIMUM = 6
} eits_stop;

/* What a reconstruction cost and how it ended. */
typedef struct eits_info {
    uint32_t iterations;
    eits_stop stop;
    uint32_t nonzeros; /* coefficients that are not zero */
    uint32_t masked;   /* protocol rows that were left out of this frame */
    uint32_t step_halvings;
    uint32_t touches; /* set by eits_find_touches */
    /* multiply-accumulates with a stored matrix, a basis vector, F or the active set's factor;
     * vector sums not counted */
    uint64_t macs;
    uint64_t touch_macs; /* the same for eits_find_touches */
    eits_real lambda;
    eits_real lambda_max;
    eits_real lambda_noise; /* the reference's, times what rows left out add */
    /* duality gap at the result, absolute; 0 where stop is BELOW_THRESHOLD, ZERO or DIVERGED, and
     * where MACS came before anything was known */
    eits_real gap;
    eits_real gap_rel;    /* gap / (|y|^2 / 2) */
    eits_real residual;   /* |y - S x| */
    eits_real data_norm;  /* |y| */
    uint32_t diagnostics; /* bits of eits_diagnostic; CROWDED is set by eits_find_touches */
    uint32_t saturated;   /* rows, masked ones apart */
    uint32_t outliers;    /* rows left out as outliers */
    /* fraction of |d| beyond noise that the model's range cannot give, 0 to 1; 0 where it was not
     * judged */
    eits_real model_mismatch;
    /* fraction of |y|^2 that the touches leave, set by eits_find_touches; 0 where none were looked
     * for */
    eits_real unexplained;
    /* bit e: electrode e, of the first 64; eits_get_electrode_states has all */
    uint64_t open_electrodes, bridged_electrodes, noisy_electrodes;
    /* of the whitening, over s_1^2, as this frame was reduced; 0 where the model does not tell */
    eits_real regularisation;
} eits_info;

typedef struct eits_touch {
    uint32_t id; /* counts up from 1; follows a finger from frame to frame */
    eits_real x_mm, y_mm;
    eits_real radius_mm;
    eits_real strength_s_per_m_mm2; /* conductivity change integrated over the touch: S/m mm^2 */
    /* fraction of |y|^2 that leaving this touch out would leave unexplained: 0 to 1; 0 where it was
     * not found in this frame and is held */
    eits_real confidence;
    /* how hard it presses, N; 0 where the model is not calibrated (force.h) */
    eits_real force_n;
} eits_touch;

/* The reference and its noise, as eits_get_reference gives them (frame.h takes it). */
typedef struct eits_reference_info {
    /* n_rows: mean of the reference frames, V; NaN for a row that was masked in any of them. In the
     * context: as long as the context, until the next reference */
    const eits_real *v0;
    uint32_t count;   /* reference frames that are in v0 */
    uint32_t ready;   /* 1: frames can be measured against it; 0: there is none, or not yet */
    eits_real v0_rms; /* rms of v0 over the rows in use, V */
    /* model volts per measured volt: rms(v_ref) / rms(v0), negative where correlation is */
    eits_real gain;
    /* of v0 with v_ref on the folded rows: near 1 where skin, order and sign are right */
    eits_real correlation;
    eits_real noise_v; /* rms over rows of the reference frames' deviation, V; 0 if unknown */
    /* greatest max(S'y) seen in reference frames, as with all rows in use; 0 if unknown */
    eits_real lambda_noise;
    uint32_t outliers; /* readings of reference frames that were left out */
} eits_reference_info;

/* One reconstruction: model, options, reference, image, touches. It lies in its workspace and is
 * reached by functions alone. */
typedef struct eits_context eits_context;

/* ---- Sizes, all constant expressions where their arguments are ---- */

/* Columns of a panel: S in panels has that many columns side by side, row after row, so that a
 * product S'v fills vector registers without gathering. */
#define EITS_PANEL 32u
#define EITS_PANEL_COLUMNS(n_pixels) \
    (((size_t)(n_pixels) + EITS_PANEL - 1u) / EITS_PANEL * EITS_PANEL)

/* Columns of S that are kept unpacked as floats: more than a working set or a disc has. */
#define EITS_MAX_CACHED 256u
#define EITS_CACHED(n_pixels) \
    ((size_t)((n_pixels) < EITS_MAX_CACHED ? (n_pixels) : EITS_MAX_CACHED))

/* Bytes of a line of the processor's cache: panels start at a multiple, where no vector of theirs
 * lies across two lines. */
#define EITS_LINE 64u

/* Each array starts at a multiple of 16 bytes. */
#define EITS_ALIGN16(bytes) (((size_t)(bytes) + 15u) & ~(size_t)15u)
#define EITS_REALS(count)   EITS_ALIGN16((size_t)(count) * sizeof(eits_real))

/* rank, rounded up to the eight lanes in which sums are made (base/vec.h). */
#define EITS_STRIDE(rank) (((size_t)(rank) + 7u) & ~(size_t)7u)

/* A list of pixels or of folded rows. */
#define EITS_LIST(n_pixels, n_folded) ((size_t)((n_pixels) > (n_folded) ? (n_pixels) : (n_folded)))

/* Numbers of an upper triangle whose rows begin at multiples of eight columns. */
#define EITS_PADDED_TRIANGLE(rank) (EITS_STRIDE(rank) * (EITS_STRIDE(rank) + 8u) / 2u)

/* Bytes of the context itself, at the workspace's start; what is not arrays. Pointers and numbers
 * of whatever width; a little is left over. */
#define EITS_CONTEXT_SIZE EITS_ALIGN16(624u + 58u * sizeof(void *) + 252u * sizeof(eits_real))

/* Bytes of workspace; a constant expression. n_cells is nx * ny; `prepared` is 1 to keep panel-wise
 * copies of S and of the working set (hosts), else 0. */
#define EITS_WORKSPACE_SIZE(n_rows, n_folded, rank, n_pixels, n_cells, prepared)                   \
    (EITS_CONTEXT_SIZE + 2 * EITS_REALS(n_rows) + 2 * EITS_ALIGN16(n_rows) +                       \
     2 * EITS_ALIGN16(n_folded) + 4 * EITS_REALS(n_folded) +                                       \
     (24 + EITS_STRIDE(rank) + (size_t)(rank) + EITS_MAX_TOUCHES) *                                \
         EITS_REALS(EITS_STRIDE(rank)) +                                                           \
     5 * EITS_REALS(n_pixels) + EITS_REALS(EITS_LIST(n_pixels, n_folded)) +                        \
     EITS_ALIGN16(EITS_LIST(n_pixels, n_folded) * 4u) + EITS_ALIGN16((size_t)(n_pixels) * 4u) +    \
     EITS_ALIGN16((size_t)(n_cells) * 2u) +                                                        \
     EITS_ALIGN16(EITS_CACHED(n_pixels) * EITS_STRIDE(rank) * 4u) +                                \
     EITS_ALIGN16((size_t)(n_pixels) * 2u) + EITS_ALIGN16(EITS_CACHED(n_pixels) * 2u) +            \
     EITS_ALIGN16(EITS_CACHED(n_pixels)) + EITS_ALIGN16(EITS_CACHED(n_pixels) * 4u) +              \
     ((prepared) ? 2 * EITS_REALS(EITS_PANEL_COLUMNS(n_pixels) * (size_t)(rank)) + EITS_LINE - 16u \
                 : 0u))

/* The same number for an open model, as a function. Returns 0 for a null model. */
size_t eits_workspace_size(const eits_model *model, int prepared);

/* The model's defaults as options. Errors: EITS_E_ARGUMENT. */
eits_status eits_options_default(const eits_model *model, eits_options *options);

/* Change `options` to what suits frames that follow one another, 48 or 96 a second
 * (docs/guide/tracking.md): the detection threshold a quarter lower, and the touches that come of
 * it followed in time, so that those of noise are not told of. A frame by itself then misses faint
 * touches: each needs those before it. Errors: EITS_E_ARGUMENT. */
eits_status eits_options_track(eits_options *options);

/* Lay out a context in `workspace` (16-byte aligned, the caller's as long as the context is used;
 * so is `model`) and set the model's default options; *ctx then points into it. With room for it
 * (see `prepared` above) S is also copied into panels, which is faster where memory is plentiful
 * and gives the same bits. Errors: EITS_E_ARGUMENT, EITS_E_WORKSPACE (smaller than
 * eits_workspace_size(model, 0), or not aligned); *ctx is untouched then. */
eits_status eits_init(void *workspace, size_t size, const eits_model *model, eits_context **ctx);

/* Replace the options. Errors: EITS_E_ARGUMENT for one that is out of range or not finite; then
 * nothing is changed. */
eits_status eits_set_options(eits_context *ctx, const eits_options *options);

/* Use the portable matrix products (1) or the fastest that this processor has (0, the default).
 * Same bits. */
eits_status eits_use_portable_kernels(eits_context *ctx, int portable);

/* Forget the warm start and the touches that were followed. */
void eits_forget(eits_context *ctx);

/* ---- What a context knows ----
 *
 * Pointers into the context: valid as long as it is, not to be written to. What they point to
 * changes with the next frame. `ctx` must not be NULL here, unless an error is stated. */

const eits_model *eits_get_model(const eits_context *ctx);
const eits_options *eits_get_options(const eits_context *ctx);

/* Of the last frame; each stage has filled in its fields. */
const eits_info *eits_get_info(const eits_context *ctx);

/* The last image, n_pixels, S/m; and its coefficients, image over column weight. */
const eits_real *eits_get_image(const eits_context *ctx);
const eits_real *eits_get_coefficients(const eits_context *ctx);

/* The last frame's reduced data y as the solver saw them, projected: EITS_STRIDE(rank) numbers. */
const eits_real *eits_get_reduced_data(const eits_context *ctx);

/* Why each of the n_rows rows was left out of the last frame, bits of eits_row_state; 0: in use. */
const uint8_t *eits_get_row_states(const eits_context *ctx);

/* What the last frame showed of each electrode, bits of eits_electrode_state: n_electrodes. */
const uint8_t *eits_get_electrode_states(const eits_context *ctx);

/* 1 where row `row` is masked by eits_mask_row. Row numbers are not checked. */
int eits_is_masked(const eits_context *ctx, uint32_t row);

/* Errors: EITS_E_ARGUMENT. */
eits_status eits_get_reference(const eits_context *ctx, eits_reference_info *reference);

/* "portable", "avx2"... of the kernels in use. */
const char *eits_kernels_name(const eits_context *ctx);

/* ---- Put by, and taken up again ---- */

/* Bytes of eits_save: what is learned from reference frames, masked rows, options and the next
 * touch's id. */
#define EITS_SAVED_SIZE(n_rows)                                                               \
    (EITS_ALIGN16(sizeof(eits_options) + 16u + 5u * sizeof(eits_real)) + EITS_REALS(n_rows) + \
     EITS_ALIGN16(n_rows))

/* The same number for an open model, as a function. Returns 0 for a null model. */
size_t eits_saved_size(const eits_model *model);

/* Copy that into `memory` (16-byte aligned): to go back to when a new reference comes to nothing,
 * or to go on with in a context that is laid out again for the same model. Reference frames that
 * have been added but not finished are not in it. Errors: EITS_E_ARGUMENT; EITS_E_WORKSPACE where
 * `size` is less than eits_saved_size or `memory` not aligned. */
eits_status eits_save(const eits_context *ctx, void *memory, size_t size);

/* Be as when it was saved; the warm start and followed touches are forgotten. `memory` must be
 * eits_save's, from a context of the same model. Errors: as eits_save. */
eits_status eits_restore(eits_context *ctx, const void *memory, size_t size);

#ifdef __cplusplus
}
#endif
#endif
