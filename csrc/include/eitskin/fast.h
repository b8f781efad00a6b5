/* eitskin: touches after each drive of a scan, before the frame is whole.
 *
 * A frame's rows are measured drive after drive over some 20 ms. After each drive its rows are
 * compared with what the known touches predict; what is unexpected is a change of those, a glitch,
 * a drift of the gain, or a touch that has landed. It is reported about 3 ms after contact, and
 * followed with its velocity. Beside it the whole-frame solver stays as it is:
 *
 *     eits_fast_drive(fast, drive, volts, count, time_us);     // each drive, as it comes
 *     eits_fast_touches(fast, touches, room, &count);          // what touches the skin now
 *     ...                                                      // after a frame's last drive:
 *     eits_fast_align(fast, frame, n_rows, frame, &state);     // brought to one instant
 *     if (state & EITS_FAST_TRUSTED) {
 *         eits_reconstruct(ctx, frame, n_rows, NULL, NULL);
 *         eits_find_touches(ctx, found, EITS_MAX_TOUCHES, &n);
 *         eits_fast_confirm(fast, found, n);
 *         eits_fast_name(fast, &info);                         // a copy of the context's
 *     }
 *
 * What its numbers are and how far they are off: studies/results/fast-path.md.
 */
#ifndef EITSKIN_FAST_H
#define EITSKIN_FAST_H

#include "eitskin/context.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Touches that are followed at most; and rows of a drive. */
#define EITS_FAST_TOUCHES 5u
#define EITS_FAST_ROWS    32u

/* A touch, as of the middle of the last drive. */
typedef struct eits_fast_touch {
    uint32_t id;        /* from 1, as long as it is followed; apart from those of eits_touch */
    uint32_t confirmed; /* 1: a whole frame has shown it */
    eits_real x_mm, y_mm;
    eits_real vx_mm_per_s, vy_mm_per_s;
    eits_real strength_s_per_m_mm2;
} eits_fast_touch;

/* Bits: what eits_fast_align says of a frame. */
typedef enum eits_fast_frame {
    EITS_FAST_EXPLAINED = 1, /* all its drives are accounted for by touches */
    /* what the whole-frame solver says of it may be reported: it is explained, or frames have not
     * been for a while, and something else is wrong */
    EITS_FAST_TRUSTED = 2
} eits_fast_frame;

/* The state, in memory that the caller owns. */
typedef struct eits_fast eits_fast;

/* ---- What its size is made of ---- */

/* Drives that may wait for an explanation. */
#define EITS_FAST_WAITING 9u

/* Numbers of a touch's state: x, y, strength and two speeds; and of a row's answer to a touch: the
 * answer, and its derivatives by x and y. */
#define EITS_FAST_STATE_NUMBERS  5u
#define EITS_FAST_ANSWER_NUMBERS 3u

/* All touches' states; with their covariance. */
#define EITS_FAST_STATES (EITS_FAST_TOUCHES * EITS_FAST_STATE_NUMBERS)

/* What one drive contributes to one fit, 22 numbers: each waiting drive has two, and each of three
 * fits has one per waiting drive and 30 numbers of its own. */
#define EITS_FAST_FIT_NUMBERS ((2u + 3u) * EITS_FAST_WAITING * 22u + 3u * 30u)

/* Bytes of the state without its arrays: states, covariance and fits; 28 numbers and 5 per touch
 * beside these; counts and flags; pointers. csrc/src/fast/fast.h asserts that it fits. */
#define EITS_FAST_STATE                                                                      \
    EITS_ALIGN16((EITS_FAST_STATES * (EITS_FAST_STATES + 1u) + EITS_FAST_FIT_NUMBERS + 28u + \
                  5u * EITS_FAST_TOUCHES) *                                                  \
                     sizeof(eits_real) +                                                     \
                 EITS_MAX_ELECTRODES + 112u * sizeof(uint32_t) + 40u * sizeof(void *))

/* Bytes of what is kept of a drive: where its rows are and which touches were there, and their
 * places and strengths. */
#define EITS_FAST_DRIVE (16u + EITS_FAST_TOUCHES * EITS_FAST_ANSWER_NUMBERS * sizeof(eits_real))

/* Every second pixel along x and y is a cell of the map; and the numbers of a packed triangle. */
#define EITS_FAST_CELLS(nx, ny)        (((size_t)(nx) + 1u) / 2u * (((size_t)(ny) + 1u) / 2u))
#define EITS_FAST_TRIANGLE(drive_rows) ((size_t)(drive_rows) * ((size_t)(drive_rows) + 1u) / 2u)

/* Every array but the drives and what each waiting drive keeps: ARRAY(place, element, count), in
 * the order in which they lie in memory, as EITS_WORKSPACE_ARRAYS (sizes.h). `place` is the member
 * of eits_fast that points to it. */
/* clang-format off */
#define EITS_FAST_ARRAYS(ARRAY, n_rows, drive_rows, nx, ny)                                        \
    /* which row is where, and which pixels are cells */                                           \
    ARRAY(row, uint16_t, n_rows)                                                                   \
    ARRAY(cell, uint16_t, EITS_FAST_CELLS(nx, ny))                                                 \
    ARRAY(masked, uint8_t, n_rows)                                                                 \
    ARRAY(used, uint8_t, drive_rows)                                                               \
    ARRAY(gain, eits_real, n_rows)                                                                 \
    /* the rows of the present drive */                                                            \
    ARRAY(z, eits_real, drive_rows)                                                                \
    ARRAY(along, eits_real, drive_rows)                                                            \
    ARRAY(e, eits_real, drive_rows)                                                                \
    ARRAY(white, eits_real, drive_rows)                                                            \
    ARRAY(spare, eits_real, drive_rows)                                                            \
    /* their answers to each touch; their covariance with the states; the factor of their own */   \
    ARRAY(answer, eits_real, EITS_FAST_TOUCHES * EITS_FAST_ANSWER_NUMBERS * (size_t)(drive_rows))  \
    ARRAY(moved, eits_real, EITS_FAST_STATES * (size_t)(drive_rows))                               \
    ARRAY(factor, eits_real, EITS_FAST_TRIANGLE(drive_rows))                                       \
    /* the maps of what a new touch in a cell would explain: the first, and a second beside it */  \
    ARRAY(score, eits_real, EITS_FAST_CELLS(nx, ny))                                               \
    ARRAY(pair_score, eits_real, EITS_FAST_CELLS(nx, ny))

/* What each of the EITS_FAST_WAITING drives keeps: its whitened rows, and the factor of then. */
#define EITS_FAST_WAITING_ARRAYS(ARRAY, drive_rows)                                                \
    ARRAY(white, eits_real, drive_rows)                                                            \
    ARRAY(factor, eits_real, EITS_FAST_TRIANGLE(drive_rows))
/* clang-format on */

/* Bytes of its memory, a constant expression: of a model with `n_rows` rows in `drives` drives, the
 * longest of `drive_rows`, and a grid of nx x ny pixels. 20 kB for 16 electrodes in float32. */
#define EITS_FAST_SIZE(n_rows, drives, drive_rows, nx, ny)              \
    (EITS_FAST_STATE +                                                  \
     EITS_ALIGN16((size_t)(drives) * EITS_FAST_DRIVE)                   \
         EITS_FAST_ARRAYS(EITS_ADD_BYTES, n_rows, drive_rows, nx, ny) + \
     EITS_FAST_WAITING * (0u EITS_FAST_WAITING_ARRAYS(EITS_ADD_BYTES, drive_rows)))

/* The same number for an open model; 0 where it has no fields (section FLDS), or a drive more than
 * EITS_FAST_ROWS rows. */
size_t eits_fast_size(const eits_model *model);

/* Lay it out in `memory` (16-byte aligned), beside a context of the same model, which must stay.
 * Touches have the sign of the context's options; EITS_SIGN_BOTH counts as increase.
 * Errors: EITS_E_ARGUMENT, EITS_E_WORKSPACE. */
eits_status eits_fast_init(void *memory, size_t size, const eits_context *ctx, eits_fast **fast);

/* Begin without touches, with the reference of the context, as it is now.
 * Errors: EITS_E_ARGUMENT; EITS_E_NO_REFERENCE where it has none, or one without noise. */
eits_status eits_fast_begin(eits_fast *fast);

/* Drives of the protocol, in the order of their first rows; and the rows of one, ascending, NULL
 * where there is no such drive. */
uint32_t eits_fast_drives(const eits_fast *fast);
const uint16_t *eits_fast_rows(const eits_fast *fast, uint32_t drive, uint32_t *count);

/* The `count` voltages of a drive, NaN where there is none, measured about `time_us`, a clock that
 * may wrap. Errors: EITS_E_ARGUMENT (no such drive, another count), EITS_E_NO_REFERENCE. */
eits_status eits_fast_drive(eits_fast *fast, uint32_t drive, const eits_real *volts, uint32_t count,
                            uint32_t time_us);

/* What touches the skin into `touches`, which has `room`, in the order in which they came; `count`
 * gets their number, at most EITS_FAST_TOUCHES. Errors: EITS_E_ARGUMENT. */
eits_status eits_fast_touches(const eits_fast *fast, eits_fast_touch *touches, uint32_t room,
                              uint32_t *count);

/* The scan's rows `volts`, as if all had been measured with its last drive, into `aligned`, which
 * may be the same; `state` gets bits of eits_fast_frame. Once a frame. Frames of touches that stay
 * as they are keep their bits. Errors: EITS_E_ARGUMENT, EITS_E_FRAME_LENGTH, EITS_E_NO_REFERENCE.
 */
eits_status eits_fast_align(eits_fast *fast, const eits_real *volts, size_t length,
                            eits_real *aligned, uint32_t *state);

/* What the whole-frame solver found in that frame; drives may have come since. A touch that it does
 * not find in two frames on end goes; what it alone finds in two comes. Rows of electrodes that the
 * context named in it are left out of drives until it names them no more. Errors: EITS_E_ARGUMENT.
 */
eits_status eits_fast_confirm(eits_fast *fast, const eits_touch *found, uint32_t count);

/* The diagnostics in `info`, a copy of the last aligned frame's, that may be reported: where a
 * touch landed, moved or lifted in its scan, only what the two solved frames before had as well;
 * elsewhere all but CROWDED, which the one before must have had. Electrodes go with their bit;
 * saturated rows are always reported. STALE_REFERENCE comes where drives found the gain drifted by
 * .3 % in two frames on end. Once a solved frame. Errors: EITS_E_ARGUMENT. */
eits_status eits_fast_name(eits_fast *fast, eits_info *info);

#ifdef __cplusplus
}
#endif
#endif
