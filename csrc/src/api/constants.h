/* The numbers of this module that are a choice, with their reasons. Written by
 * tables/make_tables.py from tables/constants.toml. */
#ifndef EITSKIN_API_CONSTANTS_H
#define EITSKIN_API_CONSTANTS_H

#include "base/vec.h"

/* clang-format off */

/* ---- Chosen: two frames for a first mean, two to compare with it. Study constants: a least number
 * of 8 loses 4 exact frames after tares of 4 frames, one of 2 loses none. Check: ctest --preset
 * host -R reference */

/* noise is learned from at least this many frames [frames]. larger: short tares fail; smaller:
 * noise of one difference */
#define EITS_MIN_REFERENCE_FRAMES 4

/* ---- Chosen: exact scenes of the paper's skin at 60 dB, seeds 101 and 303: discs, ellipses,
 * squares, bars, shapes of two and three lobes, palms, light touches; nine frames of a water tank.
 * Touches leave less than 1 % of shapes that they explain, and 2 to 60 % of others. Frames that are
 * not fitted jointly (a model without sections UNCE or ROWE, log-ratio data, a reference far from
 * the model) leave more: of the tank's frames touches leave 2 to 11 %, and their picture is the
 * better one in each. Check: scripts/test tests/python/acceptance/test_shown_image.py */

/* what touches may leave unexplained where their picture shows the frame [of the data's energy].
 * larger: shapes that are no ellipses are shown as discs; smaller: blurred images of touches */
#define EITS_SHOWN_UNEXPLAINED R(0.02)

/* the same where frames are not fitted jointly [of the data's energy]. as SHOWN_UNEXPLAINED */
#define EITS_SHOWN_UNTESTED R(0.15)

/* clang-format on */

#endif
