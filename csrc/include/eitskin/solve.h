/* eitskin: sparse images from the stored reduced Jacobian.
 *
 *     minimise  |y - S x|^2 / 2 + lambda |x|_1     over x >= 0, x <= 0 or all x
 *
 * FISTA: Beck and Teboulle, SIAM J. Imaging Sci. 2 (2009) 183-202, doi 10.1137/080716542. The rows
 * of S are whitened and its columns scaled beforehand, so that the step is known and few iterations
 * do (docs/reference/eitm-format.md, "Reduction").
 *
 * EITS_SOLVER_WORKING_SET runs the same iterations on those columns that are not zero or would
 * move, and looks at all of them now and then, and for the gap at the end: a sixth of the work. Its
 * image after a number of iterations is FISTA's but for what columns outside would have done since
 * the last look; its optimum is the same.
 *
 * EITS_SOLVER_ACTIVE_SET finds the optimum itself, by Newton's steps on a few columns that come and
 * go. An iteration is a look at every column, and few are needed. The support never exceeds the
 * number of directions that the data have. If the factor of these columns fails numerically, FISTA
 * continues for the iterations that are left, and the gap reports how far it came. The optimum is
 * not the best image: it is sparser than a touch (studies/results/benchmarks.md).
 *
 * With mac_limit > 0 each solver stops with the best so far (FISTA: the last so far) where the next
 * step, and the gap after it, would take info.macs beyond the limit. The frame stage's MACs count
 * but are always spent; where S'y is not to be had for the rest, the image is zero.
 *
 * A warm start goes on where the last frame ended. Held touches are then iterated ever further:
 * their image is sharper from frame to frame, and a mask threshold that was chosen for cold starts
 * fits it less and less. Where each frame's image is to mean the same, start cold.
 */
#ifndef EITSKIN_SOLVE_H
#define EITSKIN_SOLVE_H

#include "eitskin/context.h"

#ifdef __cplusplus
extern "C" {
#endif

/* One frame to an image: frame stage, detection threshold, solver. `image` (n_pixels, S/m) and
 * `info` may be NULL; the context has both as well. On an error the image is cleared, never NaN.
 * Errors: those of eits_frame_stage, EITS_E_NOT_FINITE. */
eits_status eits_reconstruct(eits_context *ctx, const eits_real *frame, size_t length,
                             eits_real *image, eits_info *info);

/* The solver alone on reduced data `y` (rank numbers), or with NULL on those that eits_frame_stage
 * left. Fills in coefficients, image and info; masked rows and the frame stage's MACs are then not
 * in it. Errors: EITS_E_ARGUMENT, EITS_E_NOT_FINITE. */
eits_status eits_solve(eits_context *ctx, const eits_real *y);

/* Checksums that the section SUMS of a model has: six of a frame each, two of four scenes each. */
#define EITS_SELF_TEST_SUMS     8
/* Counts up with every change of what the core's bits are: sums of another revision are not
 * compared. */
#define EITS_SELF_TEST_REVISION 2u

/* Run the model's golden frame with default options: the image must have the bits that the model
 * states (float32), or be within `*difference` of it, relative to its peak (reported in either
 * width). In float32 a model's checksums are compared too. The context must be fresh from
 * eits_init; its reference is the golden reference afterwards. Errors as eits_reconstruct;
 * EITS_E_ARITHMETIC where the image is right and a checksum is not. */
eits_status eits_self_test(eits_context *ctx, eits_real *difference);

/* The checksums for this model, as the float32 core has them: of image, touches and numbers of six
 * frames made of the golden two, with each solver, a lost electrode, noise, a learned reference,
 * and of two sets of four scenes of one to four touches. The context must be fresh from eits_init.
 * Errors: those of eits_reference_set; EITS_E_ARITHMETIC in float64. */
eits_status eits_self_test_sums(eits_context *ctx, uint32_t sums[EITS_SELF_TEST_SUMS]);

#ifdef __cplusplus
}
#endif
#endif
