/* What the public eits_reference_* functions are made of (api/reference.c): none of these looks for
 * outliers, and none measures a frame. */
#ifndef EITSKIN_REFERENCE_H
#define EITSKIN_REFERENCE_H

#include "context/context.h"

/* Whether each row that is not masked has a finite voltage below saturation.
 * Errors: EITS_E_FRAME_LENGTH, EITS_E_FRAME_CHANNELS. */
eits_status eits_check_reference_frame(const eits_context *ctx, const eits_real *frame,
                                       size_t length);

/* Set gain, correlation and v0_rms from v0; the basis is stale then. Errors: EITS_E_FRAME_ZERO. */
eits_status eits_fit_reference(eits_context *ctx);

/* reference.row_gain, distance and reciprocity from v0 and the gain, as the options ask; the basis
 * is stale then. */
void eits_learn_row_gains(eits_context *ctx);

/* The greatest power of two up to the greatest voltage in use, within what has an inverse. */
eits_real eits_reference_unit(const eits_context *ctx, const eits_real *frame);

/* The rms over rows of the frames' deviation, so far; 0 where it is out of range. */
eits_real eits_reference_noise(const eits_context *ctx);

/* The least noise of a row, V: the option's, or what rounding leaves. */
eits_real eits_noise_floor_v(const eits_context *ctx);

/* max(S'y) of that, with all rows in use. */
eits_real eits_lambda_noise_floor(const eits_context *ctx);

/* Take one more frame into the mean and the squares; rows that were masked lose their reference. */
void eits_take_reference_frame(eits_context *ctx, const eits_real *frame);

/* The second frame waits in m2 until a third tells which of them is right where they differ; then
 * it is taken in from there. */
void eits_keep_second_frame(eits_context *ctx, const eits_real *frame);
void eits_take_second_frame(eits_context *ctx);

/* ---- places.c ---- */

/* -N'y, -M'y and minus the rest of y (model.h, eits_uncertainty). */
typedef struct eits_place_sums {
    eits_real place[EITS_MAX_PLACE_ROWS], move[EITS_MAX_PLACE_ROWS], rest[EITS_MAX_PLACE_ROWS];
} eits_place_sums;

/* Add what fold k's logarithm of its gain makes of them. */
void eits_add_log_gain(const eits_model *model, uint32_t k, eits_real log_gain,
                       eits_place_sums *sums);

/* reference.place_mm2 and shift_mm from them. */
void eits_learn_places(eits_context *ctx, const eits_place_sums *sums);

/* ---- follow.c ---- */

/* Whether frames follow one another here, and for long enough to be told from single ones: after a
 * sixteenth of the time constant. */
int eits_follows(const eits_context *ctx);

/* A frame was solved: its difference joins those at hand, until eits_follow_end says what it shows.
 */
void eits_follow_add(eits_context *ctx, const eits_real *frame);

/* Let go of the frames at hand: what comes has nothing to do with them. */
void eits_follow_break(eits_context *ctx);

/* The frame added last shows these touches, and with tentative and held ones `followed`;
 * EITS_FOLLOW_UNKNOWN: it is of no use. Returns 1 where the reference moved; adds to `macs`.
 * Overwrites frame.d and scratch. */
int eits_follow_end(eits_context *ctx, const eits_scratch *scratch, const eits_touch *touches,
                    uint32_t count, uint32_t followed, uint64_t *macs);

#endif
