/* eitskin: the tracker, which gives touches ids and follows them over time, after each drive of a
 * scan and in whole frames.
 *
 * A frame's rows are measured drive after drive over some 20 ms. After each drive the tracker
 * compares the rows of that drive with the values that the known touches predict. A difference is a
 * change of those touches, an outlier, a drift of the gain, or a touch that has landed. A new touch
 * is reported about 3 ms after contact, and followed with its velocity. The whole-frame solver runs
 * beside the tracker:
 *
 *     eits_fast_drive(fast, drive, volts, count, time_us);     // each drive, as it comes
 *     eits_fast_touches(fast, touches, room, &count);          // what touches the skin now
 *     ...                                                      // after a frame's last drive:
 *     eits_fast_align(fast, frame, n_rows, frame, &state);     // brought to one instant
 *     if (state & EITS_FAST_TRUSTED) {
 *         eits_reconstruct(ctx, frame, n_rows, NULL, NULL);
 *         eits_find_touches(ctx, found, EITS_MAX_TOUCHES, &n);
 *         eits_fast_report(fast, found, n, touches, &count);   // the frame's touches
 *         eits_fast_confirm(fast, found, n);                   // before the next align
 *         eits_fast_name(fast, &info);                         // a copy of the context's
 *     } else {
 *         eits_fast_report(fast, NULL, 0, touches, &count);
 *     }
 *
 * For frames whose drives are not known (half scans, scans without times of rows, models without
 * fields) call only eits_reconstruct, eits_find_touches and eits_fast_report.
 *
 * studies/results/fast-path.md has its delays and errors. */
#ifndef EITSKIN_FAST_H
#define EITSKIN_FAST_H

#include "eitskin/context.h"
#include "eitskin/touch.h"

#ifdef __cplusplus
extern "C" {
#endif

/* The maximum number of tracked touches, and of rows per drive. */
#define EITS_FAST_TOUCHES 6u
#define EITS_FAST_ROWS    32u

/* A touch at the time of the middle of the last drive. */
typedef struct eits_fast_touch {
    uint32_t id;        /* from 1; a touch keeps it as long as it is followed */
    uint32_t confirmed; /* 1: a whole frame has shown it */
    eits_real x_mm, y_mm;
    eits_real vx_mm_per_s, vy_mm_per_s;
    eits_real strength_s_per_m_mm2;
    eits_real radius_mm;                                         /* of the disc that models it */
    eits_real x_variance_mm2, xy_covariance_mm2, y_variance_mm2; /* of its place */
} eits_fast_touch;

/* Touches have one sequence of ids, which begins again after this one: a packet of a drive's
 * touches has 16 bits for an id. */
#define EITS_FAST_IDS 65535u

/* Bits that eits_fast_align sets for a frame. */
typedef enum eits_fast_frame {
    EITS_FAST_EXPLAINED = 1, /* the known touches explain all drives of the frame */
    /* the result of the whole-frame solver may be reported: the frame is explained; or its drives
     * leave little unexplained, so that noise hides how touches change; or no frame has been
     * explained for a while, so that the cause is not a touch that moves */
    EITS_FAST_TRUSTED = 2
} eits_fast_frame;

/* The state, in memory that the caller owns. */
typedef struct eits_fast eits_fast;

/* ---- What its size is made of ---- */

/* How many of the last drives are kept. Some of them may wait for an explanation. */
#define EITS_FAST_WAITING 14u

/* Numbers per touch in the state: x, y, strength, and the speeds along x and y. Numbers per touch
 * for a row's answer, which is the voltage that the touch causes in it: the answer, and its
 * derivatives by x and y. */
#define EITS_FAST_STATE_NUMBERS  5u
#define EITS_FAST_ANSWER_NUMBERS 3u

/* Numbers in the states of all touches. Their covariance is kept, too. */
#define EITS_FAST_STATES (EITS_FAST_TOUCHES * EITS_FAST_STATE_NUMBERS)

/* A hypothesis says which touches have changed or landed: touches per hypothesis, numbers that
 * describe how they move, and how many hypotheses are kept, each with its normal equations. */
#define EITS_FAST_BODIES       2u
#define EITS_FAST_BODY_NUMBERS (4u * EITS_FAST_BODIES)
#define EITS_FAST_TRIALS       12u
#define EITS_FAST_TRIAL_NUMBERS \
    (EITS_FAST_BODY_NUMBERS * (EITS_FAST_BODY_NUMBERS + 3u) / 2u + 8u * EITS_FAST_BODIES + 26u)

/* Bytes of the state without its arrays, at most: states, covariance and hypotheses; other numbers
 * of touches and drives; touches of whole frames, with 9 numbers and 6 counts each; counts and
 * flags; pointers. csrc/src/fast/fast.h asserts that the state fits. */
#define EITS_FAST_STATE                                                                            \
    EITS_ALIGN16(                                                                                  \
        (EITS_FAST_STATES * (EITS_FAST_STATES + 1u) + EITS_FAST_TRIALS * EITS_FAST_TRIAL_NUMBERS + \
         EITS_FAST_WAITING * (1u + EITS_FAST_TOUCHES * EITS_FAST_ANSWER_NUMBERS) +                 \
         17u * EITS_FAST_TOUCHES + EITS_FAST_BODIES * 164u + 96u) *                                \
            sizeof(eits_real) +                                                                    \
        EITS_MAX_TOUCHES * (sizeof(eits_touch) + 9u * sizeof(eits_real) + 24u) +                   \
        EITS_FAST_TOUCHES * sizeof(eits_fast_touch) + EITS_MAX_ELECTRODES +                        \
        (80u + 10u * EITS_FAST_TOUCHES + 6u * EITS_FAST_WAITING + 6u * EITS_FAST_TRIALS) *         \
            sizeof(uint32_t) +                                                                     \
        (36u + EITS_FAST_TOUCHES + 3u * EITS_FAST_WAITING) * sizeof(void *))

/* Bytes that are kept per drive: the place of its rows, which touches were on the skin then, and
 * their places and strengths. */
#define EITS_FAST_DRIVE (24u + EITS_FAST_TOUCHES * EITS_FAST_ANSWER_NUMBERS * sizeof(eits_real))

/* The fields are stored as f16. Those of the pixels in a square with this many pixels on a side are
 * also kept as eits_real. */
#define EITS_FAST_KEPT_SIDE 7u

/* The map of places where a touch may have landed has a cell for every second pixel along x and y.
 * Numbers in a packed triangular matrix. */
#define EITS_FAST_CELLS(nx, ny)        (((size_t)(nx) + 1u) / 2u * (((size_t)(ny) + 1u) / 2u))
#define EITS_FAST_TRIANGLE(drive_rows) ((size_t)(drive_rows) * ((size_t)(drive_rows) + 1u) / 2u)

/* All arrays except those per drive and per touch, in the order in which they lie in memory, in the
 * form ARRAY(place, element, count) of EITS_WORKSPACE_ARRAYS (sizes.h). `place` is the member of
 * eits_fast that points to the array. */
/* clang-format off */
#define EITS_FAST_ARRAYS(ARRAY, n_rows, drive_rows, n_electrodes, nx, ny)                          \
    /* the place of each row among the drives, and the pixel of each cell */                       \
    ARRAY(row, uint16_t, n_rows)                                                                   \
    ARRAY(cell, uint16_t, EITS_FAST_CELLS(nx, ny))                                                 \
    ARRAY(masked, uint8_t, n_rows)                                                                 \
    ARRAY(used, uint8_t, drive_rows)                                                               \
    ARRAY(gain, eits_real, n_rows)                                                                 \
    /* the model's error in each row */                                                            \
    ARRAY(bias, eits_real, n_rows)                                                                 \
    ARRAY(bias_variance, eits_real, n_rows)                                                        \
    ARRAY(bias_h, eits_real, n_rows)                                                               \
    ARRAY(rest, eits_real, n_rows)                                                                 \
    /* the rows of the present drive */                                                            \
    ARRAY(z, eits_real, drive_rows)                                                                \
    ARRAY(along, eits_real, drive_rows)                                                            \
    ARRAY(h, eits_real, drive_rows)                                                                \
    ARRAY(twice, eits_real, drive_rows)                                                            \
    ARRAY(learned, eits_real, drive_rows)                                                          \
    ARRAY(error, eits_real, drive_rows)                                                            \
    ARRAY(e, eits_real, drive_rows)                                                                \
    ARRAY(white, eits_real, drive_rows)                                                            \
    ARRAY(spare, eits_real, drive_rows)                                                            \
    /* their answers to each touch, covariance with the states, and covariance factors */          \
    ARRAY(answer, eits_real, EITS_FAST_TOUCHES * EITS_FAST_ANSWER_NUMBERS * (size_t)(drive_rows))  \
    ARRAY(moved, eits_real, EITS_FAST_STATES * (size_t)(drive_rows))                               \
    ARRAY(factor, eits_real, EITS_FAST_TRIANGLE(drive_rows))                                       \
    ARRAY(other_factor, eits_real, EITS_FAST_TRIANGLE(drive_rows))                                 \
    /* which pixels have fields as eits_real, and these fields */                                  \
    ARRAY(kept, uint16_t, EITS_FAST_KEPT_SIDE * EITS_FAST_KEPT_SIDE)                               \
    ARRAY(field, eits_real,                                                                        \
          EITS_FAST_KEPT_SIDE * EITS_FAST_KEPT_SIDE * (2u * (size_t)(n_electrodes) + 4u))          \
    /* scores of a new touch in each cell: of one touch, and of a second one beside it */          \
    ARRAY(score, eits_real, EITS_FAST_CELLS(nx, ny))                                               \
    ARRAY(search.pair_score, eits_real, EITS_FAST_CELLS(nx, ny))                                   \
    /* of a hypothesis in a drive: answers, derivatives, fields, residual */                       \
    ARRAY(search.ways, eits_real, EITS_FAST_BODIES * EITS_FAST_ANSWER_NUMBERS * (size_t)(drive_rows)) \
    ARRAY(search.column, eits_real, EITS_FAST_BODY_NUMBERS * (size_t)(drive_rows))                 \
    ARRAY(search.fields, eits_real, EITS_FAST_BODIES * (2u * (size_t)(n_electrodes) + 4u))               \
    ARRAY(search.rest, eits_real, drive_rows)

/* Each of the EITS_FAST_WAITING drives keeps its whitened rows, the covariance factor of its time,
 * and the known touches' answers with their derivatives. */
#define EITS_FAST_WAITING_ARRAYS(ARRAY, drive_rows)                                                \
    ARRAY(white, eits_real, drive_rows)                                                            \
    ARRAY(factor, eits_real, EITS_FAST_TRIANGLE(drive_rows))                                       \
    ARRAY(known, eits_real, EITS_FAST_TOUCHES * EITS_FAST_ANSWER_NUMBERS * (size_t)(drive_rows))

/* Each touch keeps the fields at its place. */
#define EITS_FAST_TOUCH_ARRAYS(ARRAY, n_electrodes)                                                \
    ARRAY(field, eits_real, 2u * (size_t)(n_electrodes) + 4u)
/* clang-format on */

/* Bytes of the tracker's memory, a constant expression, for a model of `n_electrodes` electrodes
 * and a grid of nx x ny pixels, whose `n_rows` rows are in `drives` drives of at most `drive_rows`
 * rows. It is 56 kB for 16 electrodes in float32. Without drives no array is needed. */
#define EITS_FAST_SIZE(n_rows, drives, drive_rows, n_electrodes, nx, ny) \
    (EITS_FAST_STATE +                                                   \
     ((drives) == 0 ? (size_t)0                                          \
                    : EITS_FAST_ARRAYS_SIZE(n_rows, drives, drive_rows, n_electrodes, nx, ny)))
#define EITS_FAST_ARRAYS_SIZE(n_rows, drives, drive_rows, n_electrodes, nx, ny)       \
    (EITS_ALIGN16((size_t)(drives) * EITS_FAST_DRIVE)                                 \
         EITS_FAST_ARRAYS(EITS_ADD_BYTES, n_rows, drive_rows, n_electrodes, nx, ny) + \
     EITS_FAST_TOUCHES * (0u EITS_FAST_TOUCH_ARRAYS(EITS_ADD_BYTES, n_electrodes)) +  \
     EITS_FAST_WAITING * (0u EITS_FAST_WAITING_ARRAYS(EITS_ADD_BYTES, drive_rows)))

/* Returns the same number for an open model. A model without fields (section FLDS), or with a drive
 * of more than EITS_FAST_ROWS rows, counts as having no drives: its touches come from whole frames
 * alone. */
size_t eits_fast_size(const eits_model *model);

/* Lay the state out in `memory` (16-byte aligned), beside a context of the same model, which must
 * stay valid. Touches have the sign of the context's options; EITS_SIGN_BOTH counts as increase.
 * Errors: EITS_E_ARGUMENT, EITS_E_WORKSPACE. */
eits_status eits_fast_init(void *memory, size_t size, const eits_context *ctx, eits_fast **fast);

/* Begin with the context's present reference, and without touches from drives. Errors:
 * EITS_E_ARGUMENT; EITS_E_NO_REFERENCE if the context has no reference; EITS_E_REFERENCE_SHORT if
 * its noise is unknown, because eits_reference_set took it from one frame. */
eits_status eits_fast_begin(eits_fast *fast);

/* eits_fast_drives returns the number of drives that can be taken: all of the protocol's, in the
 * order of their first rows, or 0 (see eits_fast_size). eits_fast_rows returns the `count` rows of
 * one drive, ascending, or NULL if there is no such drive. */
uint32_t eits_fast_drives(const eits_fast *fast);
const uint16_t *eits_fast_rows(const eits_fast *fast, uint32_t drive, uint32_t *count);

/* Take the `count` voltages of a drive, NaN for a missing one. `time_us` is the time of their
 * measurement, on a clock that may wrap. Errors: EITS_E_ARGUMENT (no such drive, or the wrong
 * count), EITS_E_NO_REFERENCE. */
eits_status eits_fast_drive(eits_fast *fast, uint32_t drive, const eits_real *volts, uint32_t count,
                            uint32_t time_us);

/* Write the touches on the skin into `touches`, which has room for `room`, in the order in which
 * they landed. `count` gets their number, at most EITS_FAST_TOUCHES. Errors: EITS_E_ARGUMENT. */
eits_status eits_fast_touches(const eits_fast *fast, eits_fast_touch *touches, uint32_t room,
                              uint32_t *count);

/* Correct the scan's rows `volts` as if all had been measured during its last drive, and write them
 * into `aligned`, which may be the same array. `state` gets bits of eits_fast_frame. Call it once
 * per frame. A frame whose touches do not change keeps its bits. Errors: EITS_E_ARGUMENT,
 * EITS_E_FRAME_LENGTH, EITS_E_NO_REFERENCE. */
eits_status eits_fast_align(eits_fast *fast, const eits_real *volts, size_t length,
                            eits_real *aligned, uint32_t *state);

/* Take the touches that the whole-frame solver found in the last aligned frame; drives may have
 * come since. A touch ends if the solver misses it in two consecutive frames, and starts if only
 * the solver finds it in two, or in one frame whose drives were not explained and that its touches
 * explain. The context must still hold what it said of that frame. Rows of electrodes that the
 * context named in the frame are left out of drives until a frame no longer names them. Errors:
 * EITS_E_ARGUMENT. */
eits_status eits_fast_confirm(eits_fast *fast, const eits_touch *found, uint32_t count);

/* Remove from `info`, a copy of the last aligned frame's info, the diagnostics that should not be
 * reported. If a touch landed, moved or lifted during the scan, only those remain that the two
 * solved frames before had as well. Otherwise all remain, CROWDED only if the frame before had it,
 * too. If the bit of an electrode's diagnostic is removed, so are the named electrodes. Saturated
 * rows are always reported. STALE_REFERENCE is set if drives found in two consecutive frames that
 * the gain had drifted by .3 %. Call it once per solved frame. Errors: EITS_E_ARGUMENT. */
eits_status eits_fast_name(eits_fast *fast, eits_info *info);

/* Forget all touches, those of whole frames, too. Ids continue to count up. Drives are rejected
 * until the next eits_fast_begin. `fast` may be NULL. */
void eits_fast_forget_all(eits_fast *fast);

/* Write a frame's touches, the strongest first, into `touches`, which has room for
 * EITS_MAX_TOUCHES. Call it once per frame, with what the solver `found` in it; NULL, with n_found
 * 0, if the frame was not solved.
 *
 * After eits_fast_align these are the touches that drives followed at that time, each with what the
 * solver found about it; its place is the mean of both, weighed by their variances. A touch that
 * the solver found and drives do not follow is reported from its second frame on. It keeps its id
 * when drives begin to follow it, or follow it no more.
 *
 * A frame that was not aligned has the touches that were found in it. A clear touch is reported at
 * once, and the second frame sets `confirmed`. A touch that explains less than 5 % of the frame, or
 * is less than 1.5 times as clear as noise, is reported from its second frame on. A touch keeps its
 * id if one of the next three frames shows it within options.follow_mm of the place to which its
 * velocity brings it. In the frames between, it is reported, with `explained` and `confidence` 0,
 * only if it was fainter than noise and had been found in four frames. Errors: EITS_E_ARGUMENT. */
eits_status eits_fast_report(eits_fast *fast, const eits_touch *found, uint32_t n_found,
                             eits_touch *touches, uint32_t *count);

#ifdef __cplusplus
}
#endif
#endif
