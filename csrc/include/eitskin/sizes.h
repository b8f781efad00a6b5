/* eitskin: how much memory a context needs, and which arrays it consists of.
 *
 * A workspace holds a context and its arrays. The arrays are listed once, below: eits_init lays
 * them out by that list, and EITS_WORKSPACE_SIZE adds them up by it, so the two cannot disagree.
 * The size is a constant expression if its arguments are constant, so that a program without a heap
 * can declare the workspace as a static array. All other programs call eits_workspace_size
 * (context.h).
 */
#ifndef EITSKIN_SIZES_H
#define EITSKIN_SIZES_H

#include "eitskin/diagnostics.h"
#include "eitskin/model.h"
#include "eitskin/options.h"

#ifdef __cplusplus
extern "C" {
#endif

/* ---- Units ---- */

/* Each array starts at a multiple of 16 bytes. */
#define EITS_ALIGN16(bytes) (((size_t)(bytes) + 15u) & ~(size_t)15u)
#define EITS_REALS(count)   EITS_ALIGN16((size_t)(count) * sizeof(eits_real))

/* Bytes of a line of the processor's cache. Panels start at a multiple of it, so that none of their
 * vectors lies across two lines. */
#define EITS_LINE 64u

/* ---- Counts ---- */

/* rank, rounded up to a multiple of the eight lanes in which sums are made (csrc/src/base/vec.h).
 */
#define EITS_STRIDE(rank) (((size_t)(rank) + 7u) & ~(size_t)7u)

/* Numbers of an upper triangle of rank x rank whose rows begin at multiples of eight columns. */
#define EITS_PADDED_TRIANGLE(rank) (EITS_STRIDE(rank) * (EITS_STRIDE(rank) + 8u) / 2u)

/* Entries of a list that holds either pixels or folded rows. */
#define EITS_LIST(n_pixels, n_folded) ((size_t)((n_pixels) > (n_folded) ? (n_pixels) : (n_folded)))

/* The maximum number of columns of S that are kept unpacked as floats. A working set or a disc has
 * fewer. */
#define EITS_MAX_CACHED 256u
#define EITS_CACHED(n_pixels) \
    ((size_t)((n_pixels) < EITS_MAX_CACHED ? (n_pixels) : EITS_MAX_CACHED))

/* The maximum number of columns in the touch test: eight touches with eight parameters each, or
 * sixteen touches with four each. */
#define EITS_EVIDENCE_COLUMNS 64u

/* The maximum number of parameters of all touches in the joint fit (twelve discs or eight
 * ellipses), and the number of folds whose columns it keeps at a time. */
#define EITS_JOINT_PARAMETERS 48u
#define EITS_JOINT_BLOCK      112u

/* The number of directions of the data that no touch causes: the drift of the gain, and the model's
 * errors. */
#define EITS_JOINT_NUISANCES (1u + 32u)

/* Numbers in the lower triangle of the joint fit's normal equations. */
#define EITS_JOINT_TRIANGLE (EITS_JOINT_PARAMETERS * (EITS_JOINT_PARAMETERS + 1u) / 2u)

/* Complex numbers of one touch in the multipole model: EITS_POLE_TERMS of each electrode's field,
 * and EITS_POLE_SENT that it sends to others (csrc/src/multipole/multipole.h). The polynomial of a
 * place inside the skin is fitted to EITS_POLE_POINTS pixels. */
#define EITS_POLE_TERMS                6u
#define EITS_POLE_POINTS               21u
#define EITS_POLE_SENT                 3u
#define EITS_POLE_FIELD(n_electrodes)  (2u * EITS_POLE_TERMS * (size_t)(n_electrodes))
#define EITS_POLE_SOURCE(n_electrodes) (2u * EITS_POLE_SENT * (size_t)(n_electrodes))

/* The count of an array that only the joint fit needs: 0 for a model without fields. */
#define EITS_JOINT_IF(n_electrodes, count) ((n_electrodes) > 0 ? (count) : 0u)

/* Columns of a panel: S in panels has that many columns side by side, row after row, so that a
 * product S'v fills vector registers without gathering. */
#define EITS_PANEL 32u
#define EITS_PANEL_COLUMNS(n_pixels) \
    (((size_t)(n_pixels) + EITS_PANEL - 1u) / EITS_PANEL * EITS_PANEL)

/* ---- The arrays of a workspace ---- */

/* Every array: ARRAY(place, element, count), in the order in which they lie in memory. `place` is
 * the member of the context that points to it; csrc/src/context/context.h says what is in it.
 * n_cells is nx * ny; n_electrodes is 0 for a model without fields. */
/* clang-format off */
#define EITS_WORKSPACE_ARRAYS(ARRAY, n_rows, n_folded, rank, n_pixels, n_cells, n_electrodes)      \
    /* for each cell of the image, its pixel */                                                    \
    ARRAY(cell, uint16_t, n_cells)                                                                 \
    /* scratch: vectors that solvers, fit and test borrow from each other in turn */               \
    ARRAY(scratch.value, eits_real, EITS_LIST(n_pixels, n_folded))                                 \
    ARRAY(scratch.index, uint32_t, EITS_LIST(n_pixels, n_folded))                                  \
    ARRAY(scratch.row[0], eits_real, EITS_STRIDE(rank))                                            \
    ARRAY(scratch.row[1], eits_real, EITS_STRIDE(rank))                                            \
    ARRAY(scratch.row[2], eits_real, EITS_STRIDE(rank))                                            \
    ARRAY(scratch.row[3], eits_real, EITS_STRIDE(rank))                                            \
    ARRAY(scratch.row[4], eits_real, EITS_STRIDE(rank))                                            \
    ARRAY(scratch.row[5], eits_real, EITS_STRIDE(rank))                                            \
    ARRAY(scratch.row[6], eits_real, EITS_STRIDE(rank))                                            \
    ARRAY(scratch.row[7], eits_real, EITS_STRIDE(rank))                                            \
    ARRAY(scratch.pixel[0], eits_real, n_pixels)                                                   \
    ARRAY(scratch.pixel[1], eits_real, n_pixels)                                                   \
    ARRAY(scratch.pixel[2], eits_real, n_pixels)                                                   \
    /* the active set's factor, or the evidence's matrix: never both */                            \
    ARRAY(scratch.square, eits_real, (size_t)(rank) * EITS_STRIDE(rank))                           \
    /* the reference, a number per row of the protocol */                                          \
    ARRAY(reference.v0, eits_real, n_rows)                                                         \
    ARRAY(reference.m2, eits_real, n_rows)                                                         \
    ARRAY(reference.row_gain, eits_real, n_rows)                                                   \
    ARRAY(rows.masked, uint8_t, n_rows)                                                            \
    ARRAY(rows.unusable, uint8_t, n_rows)                                                          \
    /* a frame, a number per folded row, and reduced */                                            \
    ARRAY(frame.sides, uint8_t, n_folded)                                                          \
    ARRAY(frame.kept_sides, uint8_t, n_folded)                                                     \
    ARRAY(frame.d, eits_real, n_folded)                                                            \
    ARRAY(frame.reciprocity_error, eits_real, n_folded)                                            \
    ARRAY(frame.y, eits_real, EITS_STRIDE(rank))                                                   \
    ARRAY(frame.y_log, eits_real, EITS_STRIDE(rank))                                               \
    ARRAY(projection.gain_drift, eits_real, n_folded)                                              \
    /* up to rank directions, or one direction and the whitening's two triangles: never both */    \
    ARRAY(projection.basis, eits_real, EITS_STRIDE(rank) + 2u * EITS_PADDED_TRIANGLE(rank))        \
    ARRAY(whitening.row_scale, eits_real, EITS_STRIDE(rank))                                       \
    ARRAY(whitening.row_strength, eits_real, EITS_STRIDE(rank))                                    \
    ARRAY(range.off_range, eits_real, n_folded)                                                    \
    ARRAY(range.inverse, eits_real, EITS_STRIDE(rank))                                             \
    ARRAY(range.shrink, eits_real, EITS_STRIDE(rank))                                              \
    /* coefficients and image, which outlive the frame, and the working set */                     \
    ARRAY(solver.x, eits_real, n_pixels)                                                           \
    ARRAY(solver.image, eits_real, n_pixels)                                                       \
    ARRAY(solver.working, uint32_t, n_pixels)                                                      \
    ARRAY(solver.working_slot, uint32_t, EITS_CACHED(n_pixels))                                    \
    /* the touch fit: what the skin answers to each disc */                                        \
    ARRAY(touch.y_separate, eits_real, EITS_STRIDE(rank))                                          \
    ARRAY(touch.atoms, eits_real, EITS_MAX_TOUCHES * EITS_STRIDE(rank))                            \
    /* the touch test: the errors' factor, and a column per parameter of a touch */                \
    ARRAY(evidence.factor, eits_real, (size_t)(rank) * EITS_STRIDE(rank))                          \
    ARRAY(evidence.column, eits_real, EITS_EVIDENCE_COLUMNS * EITS_STRIDE(rank))                   \
    ARRAY(evidence.data, eits_real, EITS_STRIDE(rank))                                             \
    ARRAY(evidence.left, eits_real, EITS_STRIDE(rank))                                             \
    ARRAY(evidence.gain_drift, eits_real, EITS_STRIDE(rank))                                       \
    /* the multipole model: polynomials of the fields, and what touches send to each other */      \
    ARRAY(multipole.home, eits_real, EITS_MAX_TOUCHES * EITS_POLE_FIELD(n_electrodes))             \
    ARRAY(multipole.own, eits_real, EITS_MAX_TOUCHES * EITS_POLE_FIELD(n_electrodes))              \
    ARRAY(multipole.induced, eits_real, EITS_MAX_TOUCHES * EITS_POLE_FIELD(n_electrodes))          \
    ARRAY(multipole.sent, eits_real, EITS_MAX_TOUCHES * EITS_POLE_SOURCE(n_electrodes))            \
    ARRAY(multipole.work, eits_real, 2u * EITS_POLE_FIELD(n_electrodes))                           \
    /* the joint fit: a metric, columns of one block of folds, and the normal equations */         \
    ARRAY(joint.weight, eits_real, EITS_JOINT_IF(n_electrodes, n_folded))                           \
    ARRAY(joint.drift, eits_real, EITS_JOINT_IF(n_electrodes, n_folded))                            \
    ARRAY(joint.rest, eits_real, EITS_JOINT_IF(n_electrodes, n_folded))                             \
    ARRAY(joint.column, eits_real, EITS_JOINT_IF(n_electrodes, EITS_JOINT_PARAMETERS * EITS_JOINT_BLOCK)) \
    ARRAY(joint.along, eits_real, EITS_JOINT_IF(n_electrodes, EITS_JOINT_PARAMETERS * EITS_JOINT_NUISANCES)) \
    ARRAY(joint.nuisance, eits_real, EITS_JOINT_IF(n_electrodes, EITS_JOINT_NUISANCES * (EITS_JOINT_NUISANCES + 1u) / 2u)) \
    ARRAY(joint.normal, eits_real, EITS_JOINT_IF(n_electrodes, EITS_JOINT_TRIANGLE))               \
    ARRAY(joint.factor, eits_real, EITS_JOINT_IF(n_electrodes, EITS_JOINT_TRIANGLE))               \
    ARRAY(joint.kept, eits_real, EITS_JOINT_IF(n_electrodes, EITS_JOINT_TRIANGLE))                 \
    /* columns of S as floats, and which they are */                                               \
    ARRAY(columns.data, float, EITS_CACHED(n_pixels) * EITS_STRIDE(rank))                          \
    ARRAY(columns.slot, uint16_t, n_pixels)                                                        \
    ARRAY(columns.column, uint16_t, EITS_CACHED(n_pixels))                                         \
    ARRAY(columns.wanted, uint8_t, EITS_CACHED(n_pixels))

/* The additional arrays of a prepared context: S, and the columns of the working set, in panels. */
#define EITS_PREPARED_ARRAYS(ARRAY, rank, n_pixels)                                                \
    ARRAY(columns.panels, eits_real, EITS_PANEL_COLUMNS(n_pixels) * (size_t)(rank))                \
    ARRAY(solver.working_panels, eits_real, EITS_PANEL_COLUMNS(n_pixels) * (size_t)(rank))
/* clang-format on */

/* Arguments for ARRAY in the lists above. One adds up the bytes of the arrays, the other the bytes
 * of the pointers to them. */
#define EITS_ADD_BYTES(place, element, count)   +EITS_ALIGN16((size_t)(count) * sizeof(element))
#define EITS_ADD_POINTER(place, element, count) +sizeof(void *)

/* ---- The context itself ---- */

/* Bytes of pointers: one to each array above, and 14 more, to the model and its S, to the kernels,
 * and to the arrays that the solvers and the whitening borrow. */
#define EITS_CONTEXT_POINTERS                                                 \
    (14u * sizeof(void *) EITS_WORKSPACE_ARRAYS(EITS_ADD_POINTER, , , , , , ) \
               EITS_PREPARED_ARRAYS(EITS_ADD_POINTER, , ))

/* Bytes of single numbers: 23 reals of reference and whitening, the coefficients of the shift of
 * places along x and y, 35 counts and flags, and padding, because each of 13 parts ends at a
 * multiple of eight bytes. */
#define EITS_CONTEXT_NUMBERS \
    ((23u + 2u * EITS_MAX_MOVE_TERMS) * sizeof(eits_real) + (35u + 13u) * sizeof(uint32_t))

/* Bytes of numbers for the joint fit. The multipole model keeps a pixel and a mirror per touch, and
 * the weights of the pixels around a pixel inside the skin. The joint fit keeps its gradient and
 * the part of its budget that it has spent. */
#define EITS_JOINT_NUMBERS                                                      \
    (EITS_MAX_TOUCHES * (4u * sizeof(eits_real) + sizeof(uint32_t)) +           \
     2u * EITS_POLE_TERMS * EITS_POLE_POINTS * sizeof(eits_real) +              \
     (EITS_JOINT_PARAMETERS + 1u) * sizeof(eits_real) + 2u * sizeof(uint32_t) + \
     2u * sizeof(uint64_t) + 10u * EITS_MAX_TOUCHES * sizeof(eits_real))

/* Bytes of the context, at the workspace's start. csrc/src/api/setup.c asserts that it fits, and
 * that little is left over. */
#define EITS_CONTEXT_SIZE                                                            \
    EITS_ALIGN16(sizeof(eits_options) + sizeof(eits_info) + EITS_MAX_ELECTRODES +    \
                 2u * EITS_MAX_TOUCHES * sizeof(eits_real) + EITS_CONTEXT_POINTERS + \
                 EITS_CONTEXT_NUMBERS + EITS_JOINT_NUMBERS)

/* Bytes of a workspace; n_cells is nx * ny; n_electrodes is 0 for a model without fields (section
 * FLDS), whose touches are not fitted jointly. `prepared` is 1 to keep S and the working set's
 * columns in panels as well, which is faster on hosts, else 0. */
#define EITS_WORKSPACE_SIZE(n_rows, n_folded, rank, n_pixels, n_cells, n_electrodes, prepared) \
    (EITS_CONTEXT_SIZE EITS_WORKSPACE_ARRAYS(EITS_ADD_BYTES, n_rows, n_folded, rank, n_pixels, \
                                             n_cells, n_electrodes) +                          \
     ((prepared) ? EITS_LINE - 16u EITS_PREPARED_ARRAYS(EITS_ADD_BYTES, rank, n_pixels) : 0u))

#ifdef __cplusplus
}
#endif
#endif
