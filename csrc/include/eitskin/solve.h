/* eitskin: sparse images from the stored reduced Jacobian.
 *
 *     minimise  |y - S x|^2 / 2 + lambda |x|_1     over x >= 0, x <= 0 or all x
 *
 * EITS_SOLVER_FISTA: Beck and Teboulle, SIAM J. Imaging Sci. 2 (2009) 183-202, doi
 * 10.1137/080716542. The rows of S are whitened and its columns scaled when the model is built, so
 * that the step is known and few iterations suffice (docs/reference/eitm-format.md, "Reduction").
 *
 * EITS_SOLVER_WORKING_SET runs the same iterations on the columns that are not zero or would move.
 * It looks at all columns at growing intervals, and for the gap at the end: a sixth of the work.
 * Its optimum is FISTA's. Before that its image differs from FISTA's only by what the columns
 * outside the set would have done since the last look.
 *
 * EITS_SOLVER_ACTIVE_SET finds the optimum itself, by Newton's steps on a few columns that come and
 * go. An iteration is a look at every column, and few are needed. The support never exceeds the
 * number of directions that the data have. If the factor of these columns fails numerically, FISTA
 * continues for the iterations that are left, and the gap reports how far it came. The optimum is
 * not the best image: it is sparser than a touch (studies/results/benchmarks.md).
 *
 * With mac_limit > 0 a solver stops when the next step, and the gap after it, would take info.macs
 * beyond the limit. It then returns the best image so far (FISTA: the last one). The frame stage's
 * multiply-accumulates count, but are always spent. If the rest is not enough for S'y, the image is
 * zero.
 *
 * A warm start continues from the last frame's coefficients. The image of a touch that stays is
 * then iterated further in each frame and becomes sharper, and a mask threshold that was chosen for
 * cold starts fits it less and less. Start cold if the images of all frames must be comparable.
 */
#ifndef EITSKIN_SOLVE_H
#define EITSKIN_SOLVE_H

#include "eitskin/context.h"

#ifdef __cplusplus
extern "C" {
#endif

/* From one frame to an image: frame stage, detection threshold, solver. `image` (n_pixels, S/m) and
 * `info` may be NULL; the context keeps both as well. On an error the image is zero, never NaN.
 * Errors: those of eits_frame_stage, EITS_E_NOT_FINITE. */
eits_status eits_reconstruct(eits_context *ctx, const eits_real *frame, size_t length,
                             eits_real *image, eits_info *info);

/* The solver alone, on reduced data `y` (rank numbers), or with NULL on those that eits_frame_stage
 * left. Fills in coefficients, image and info, without the frame stage's numbers (masked rows,
 * multiply-accumulates). Errors: EITS_E_ARGUMENT, EITS_E_NOT_FINITE. */
eits_status eits_solve(eits_context *ctx, const eits_real *y);

/* Checksums in a model's section SUMS: six of one frame each, two of four scenes each. */
#define EITS_SELF_TEST_SUMS     8
/* Counts up whenever the core's results change in any bit. Sums of another revision are not
 * compared. */
#define EITS_SELF_TEST_REVISION 2u

/* Solve the model's golden frame with default options, and compare the image with the one that the
 * model states. `*difference` gets the greatest deviation relative to the image's peak: 0 in
 * float32, where the bits must be equal, and rounding in float64. In float32 the model's checksums
 * are compared too. The context must be fresh from eits_init; afterwards its reference is the
 * golden reference. Errors: as eits_reconstruct; EITS_E_ARITHMETIC if the image is right and a
 * checksum is wrong. */
eits_status eits_self_test(eits_context *ctx, eits_real *difference);

/* The checksums of this model as the float32 core computes them. Six are of image, touches and info
 * of a frame made from the golden frames: with each solver, a lost electrode, noise, a learned
 * reference. Two are of four scenes each, of one to four touches. The context must be fresh from
 * eits_init. Errors: those of eits_reference_set; EITS_E_ARITHMETIC in float64. */
eits_status eits_self_test_sums(eits_context *ctx, uint32_t sums[EITS_SELF_TEST_SUMS]);

#ifdef __cplusplus
}
#endif
#endif
