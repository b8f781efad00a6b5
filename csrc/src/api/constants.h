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

/* clang-format on */

#endif
