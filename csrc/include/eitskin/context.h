/* eitskin: one reconstruction context in memory that the caller owns.
 *
 * A whole program, without its error handling (each call returns an eits_status):
 *
 *     // large enough for the shipped model; other models: eits_workspace_size(&model, 0) bytes
 *     static _Alignas(16) uint8_t workspace[272 * 1024];
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
 * `measure` stands for the caller's function that returns n_rows voltages in the order of the
 * model's protocol. Calling eits_find_touches is optional. Contexts share nothing. One thread at a
 * time may use a context.
 */
#ifndef EITSKIN_CONTEXT_H
#define EITSKIN_CONTEXT_H

#include "eitskin/options.h"
#include "eitskin/sizes.h"

#ifdef __cplusplus
extern "C" {
#endif

/* The reference and its noise, as eits_get_reference reports them. The functions of frame.h take a
 * reference. */
typedef struct eits_reference_info {
    /* n_rows numbers: mean of the reference frames, V; NaN for a row that was masked in any of
     * them. They lie in the context and change with the next reference */
    const eits_real *v0;
    uint32_t count;   /* number of reference frames whose mean is v0 */
    uint32_t ready;   /* 1: frames can be compared with it; 0: there is no complete reference */
    eits_real v0_rms; /* rms of v0 over the rows in use, V */
    /* model volts per measured volt: rms(v_ref) / rms(v0), with the sign of `correlation` */
    eits_real gain;
    /* correlation of v0 with v_ref on the folded rows: near 1 if skin, row order and sign are right
     */
    eits_real correlation;
    eits_real noise_v; /* rms over rows of the reference frames' deviation, V; 0 if unknown */
    /* the greatest max(S'y) of a reference frame, for all rows in use; 0 if unknown */
    eits_real lambda_noise;
    uint32_t outliers; /* readings of reference frames that were left out */
} eits_reference_info;

/* One reconstruction: model, options, reference, image, touches. It lies in its workspace; programs
 * reach it through functions only. */
typedef struct eits_context eits_context;

/* Bytes of workspace for an open model, as EITS_WORKSPACE_SIZE (sizes.h) counts them. `prepared` is
 * 1 to keep S and the working set's columns in panels as well, which is faster on hosts, else 0.
 * Returns 0 for a null model. */
size_t eits_workspace_size(const eits_model *model, int prepared);

/* Lay out a context in `workspace` and set the model's default options; *ctx then points into it.
 * `workspace` starts at a multiple of 16 bytes; it and `model` must stay as long as the context is
 * used. If `size` is at least eits_workspace_size(model, 1), S is also copied into panels, which is
 * faster and gives the same bits. Errors: EITS_E_ARGUMENT, EITS_E_WORKSPACE (smaller than
 * eits_workspace_size(model, 0), or not aligned), EITS_E_MODEL_VALUE (a matrix of section UNCE is
 * no covariance); *ctx is then unchanged. EITS_E_ARITHMETIC: the library was compiled in a way that
 * changes bits; the context works, but its results are only close to those of other builds. */
eits_status eits_init(void *workspace, size_t size, const eits_model *model, eits_context **ctx);

/* Replace the options. Errors: EITS_E_ARGUMENT if one is out of range or not finite; then none is
 * changed. */
eits_status eits_set_options(eits_context *ctx, const eits_options *options);

/* Use the portable matrix products (1), or the fastest that this processor has (0, the default).
 * Both give the same bits. */
eits_status eits_use_portable_kernels(eits_context *ctx, int portable);

/* Forget the warm start and the tracked touches. */
void eits_forget(eits_context *ctx);

/* ---- What a context knows ----
 *
 * These functions return pointers into the context, valid as long as the context is. Do not write
 * through them; their content changes with the next frame. `ctx` must not be NULL, unless an error
 * is stated. */

const eits_model *eits_get_model(const eits_context *ctx);
const eits_options *eits_get_options(const eits_context *ctx);

/* Info of the last frame; each stage has filled in its own fields. */
const eits_info *eits_get_info(const eits_context *ctx);

/* The last image (n_pixels, S/m), and its coefficients: image over column weight. */
const eits_real *eits_get_image(const eits_context *ctx);
const eits_real *eits_get_coefficients(const eits_context *ctx);

/* The last frame's reduced data y as the solver used them, after projection: EITS_STRIDE(rank)
 * numbers. */
const eits_real *eits_get_reduced_data(const eits_context *ctx);

/* Why each of the n_rows rows was left out of the last frame, bits of eits_row_state; 0: in use. */
const uint8_t *eits_get_row_states(const eits_context *ctx);

/* The state of each of the n_electrodes electrodes in the last frame, bits of eits_electrode_state.
 */
const uint8_t *eits_get_electrode_states(const eits_context *ctx);

/* 1 where row `row` is masked by eits_mask_row. Row numbers are not checked. */
int eits_is_masked(const eits_context *ctx, uint32_t row);

/* Errors: EITS_E_ARGUMENT. */
eits_status eits_get_reference(const eits_context *ctx, eits_reference_info *reference);

/* The name of the kernels in use: "portable", "avx2"... */
const char *eits_kernels_name(const eits_context *ctx);

/* ---- Save and restore ---- */

/* Bytes that eits_save writes: the reference and its noise, masked rows, options and the next
 * touch's id. */
#define EITS_SAVED_SIZE(n_rows)                                                               \
    (EITS_ALIGN16(sizeof(eits_options) + 16u + 5u * sizeof(eits_real)) + EITS_REALS(n_rows) + \
     EITS_ALIGN16(n_rows))

/* The same number for an open model, as a function. Returns 0 for a null model. */
size_t eits_saved_size(const eits_model *model);

/* Save these into `memory` (16-byte aligned), to return to if a new reference fails, or to continue
 * in a context that is laid out again for the same model. Reference frames that were added but not
 * finished are not saved. Errors: EITS_E_ARGUMENT; EITS_E_WORKSPACE if `size` is less than
 * eits_saved_size or `memory` is not aligned. */
eits_status eits_save(const eits_context *ctx, void *memory, size_t size);

/* Return to the saved state; the warm start and tracked touches are forgotten. `memory` must be
 * from eits_save in the same program, for the same model. Errors: as eits_save. */
eits_status eits_restore(eits_context *ctx, const void *memory, size_t size);

#ifdef __cplusplus
}
#endif
#endif
