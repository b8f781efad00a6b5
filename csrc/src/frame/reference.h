/* The steps of the public eits_reference_* functions (api/reference.c). Outliers are searched for
 * elsewhere (diagnostics/reference_outliers.c). */
#ifndef EITSKIN_REFERENCE_H
#define EITSKIN_REFERENCE_H

#include "context/context.h"

/* Check that each row that is not masked has a finite voltage below saturation. Errors:
 * EITS_E_FRAME_LENGTH, EITS_E_FRAME_ROWS. */
eits_status eits_check_reference_frame(const eits_context *ctx, const eits_real *frame,
                                       size_t length);

/* Set gain, correlation and v0_rms from v0; the basis is stale then. Errors: EITS_E_FRAME_ZERO. */
eits_status eits_fit_reference(eits_context *ctx);

/* Learn reference.row_gain, distance and reciprocity from v0 and the gain, as the options ask; the
 * basis is stale then. */
void eits_learn_row_gains(eits_context *ctx);

/* Returns the greatest power of two up to the greatest voltage in use, limited to numbers that have
 * an inverse. */
eits_real eits_reference_unit(const eits_context *ctx, const eits_real *frame);

/* Returns the rms over rows of the deviation of the frames so far, V; 0 if it is out of range. */
eits_real eits_reference_noise(const eits_context *ctx);

/* Returns the minimum noise of a row, V: the option's, or the noise of rounding. */
eits_real eits_noise_floor_v(const eits_context *ctx);

/* Returns max(S'y) for noise of that size, with all rows in use. */
eits_real eits_lambda_noise_floor(const eits_context *ctx);

/* Take one more frame into the mean and the squares; rows that were masked lose their reference. */
void eits_take_reference_frame(eits_context *ctx, const eits_real *frame);

/* The second frame waits in m2 until a third one decides which of the two is right where they
 * differ; then it is taken from there into the mean. */
void eits_keep_second_frame(eits_context *ctx, const eits_real *frame);
void eits_take_second_frame(eits_context *ctx);

/* Compare a further reference frame with the mean so far; add to reference.still. */
void eits_compare_stillness(eits_context *ctx, const eits_real *frame);

/* Returns 1 if the frames that were compared differ as by a touch that landed, moved or lifted. */
int eits_reference_moved(const eits_context *ctx);

/* ---- places.c ---- */

/* -N'y, -M'y and minus the rest of y (model.h, eits_uncertainty). */
typedef struct eits_place_sums {
    eits_real place[EITS_MAX_PLACE_ROWS], move[EITS_MAX_PLACE_ROWS], rest[EITS_MAX_PLACE_ROWS];
    eits_real joint[EITS_MAX_PLACE_ROWS]; /* move's for touches that are fitted jointly */
} eits_place_sums;

/* Add to these sums the share of the logarithm of fold k's gain. */
void eits_add_log_gain(const eits_model *model, uint32_t k, eits_real log_gain,
                       eits_place_sums *sums);

/* Learn reference.place_mm2 and shift_mm from these sums. */
void eits_learn_places(eits_context *ctx, const eits_place_sums *sums);

/* ---- reference_tracking.c ---- */

/* Returns 1 if the reference has been tracked for long enough that its drift can be judged: after a
 * sixteenth of the time constant. A reference from a single frame is never tracked. */
int eits_tracks_reference(const eits_context *ctx);

/* A frame was solved: add its difference from the reference to the mean under way.
 * eits_reference_tracking_end then says which touches it had. */
void eits_reference_tracking_add(eits_context *ctx, const eits_real *frame);

/* Drop the mean under way: the frames to come have nothing to do with it. */
void eits_reference_tracking_break(eits_context *ctx);

/* The frame added last has the `count` touches; not `known`: the frame cannot be used. Returns 1 if
 * the reference moved; adds to `macs`. Overwrites frame.d and scratch. */
int eits_reference_tracking_end(eits_context *ctx, const eits_scratch *scratch,
                                const eits_touch *touches, uint32_t count, int known,
                                uint64_t *macs);

#endif
