/* The numbers of this module that are a choice, with their reasons. Written by
 * tables/make_tables.py from tables/constants.toml. */
#ifndef EITSKIN_API_CONSTANTS_H
#define EITSKIN_API_CONSTANTS_H

#include "base/vec.h"

/* clang-format off */

/* ---- Chosen: two frames make a first mean, and two are compared with it. Study constants: with a
 * minimum of 8 frames, 4 exact frames are lost after tares of 4 frames; with a minimum of 2, none
 * is lost. Check: ctest --preset host -R reference */

/* noise is learned from at least this many frames [frames]. larger: short tares fail; smaller:
 * noise of one difference */
#define EITS_MIN_REFERENCE_FRAMES 4

/* ---- Chosen: exact scenes of the paper's skin at 60 dB, seeds 101 and 303: discs, ellipses,
 * squares, bars, shapes of two and three lobes, palms, light touches; nine frames of a water tank.
 * Touches leave less than 1 % of shapes that they explain, and 2 to 60 % of others. Frames that are
 * not fitted jointly (a model without sections UNCE or ROWE, log-ratio data, a reference far from
 * the model) leave more: touches leave 2 to 11 % of the tank's frames, and their image is the
 * better one in each. Check: scripts/test tests/python/acceptance/test_shown_image.py */

/* the touches' image shows the frame if touches leave less unexplained [of the data's energy].
 * larger: shapes that are no ellipses are shown as discs; smaller: touches are shown by blurred
 * images */
#define EITS_SHOWN_UNEXPLAINED R(0.02)

/* the same for frames that are not fitted jointly [of the data's energy]. as SHOWN_UNEXPLAINED */
#define EITS_SHOWN_UNTESTED R(0.15)

/* clang-format on */

#endif
