/* The numbers of this module that are a choice, with their reasons. Written by
 * tables/make_tables.py from tables/constants.toml. */
#ifndef EITSKIN_MODEL_CONSTANTS_H
#define EITSKIN_MODEL_CONSTANTS_H

#include "base/vec.h"

/* clang-format off */

/* ---- Chosen: by hand, a matter of taste: only forces change at half and at double (study
 * constants). Check: ctest --preset host -R force */

/* a calibration's gain by place is kept within this factor of 1. larger: a polynomial that runs
 * away beyond its places gives absurd forces; smaller: cuts off gains that were measured */
#define EITS_MAX_GAIN R(4.0)

/* ---- Chosen: by hand, a matter of taste: ten seconds at 50 frames per second. Check: ctest
 * --preset host -R reference_tracking */

/* reference_frames of a model that asks for it [frames]. larger: drift shows as touches; smaller:
 * slow touches are followed */
#define EITS_REFERENCE_TRACKING_FRAMES 512

/* ---- Chosen: on tuning streams (seed 100001), together with the confirmation of faint touches by
 * a second frame: no other threshold had more exact frames at 40 dB. Check: eitskin study hands */

/* the detection threshold of streams [of detection_factor]. larger: misses faint touches; smaller:
 * lets noise in, more than confirmation takes out */
#define EITS_TRACK_DETECTION R(0.75)

/* ---- Chosen: guards against sections that are wrong: at half and at double every model of the
 * study constants opens alike, but none with FORM_MAX_NORM below 1. Check: ctest --preset host -R
 * model_values */

/* the numbers of a row of section WHIT may differ by this much from each other and from P
 * [relative]. larger: a wrong section is believed; smaller: rounding makes a good model fail */
#define EITS_FORM_TOLERANCE 1e-3f

/* the same for (s^2 + mu s_1^2) |P_i|^2, which is 1: S is rounded to 8 bits at worst. as
 * FORM_TOLERANCE */
#define EITS_FORM_WEIGHT_TOLERANCE 1e-2f

/* greatest |S_1|^2 of section WHIT, 1 by construction. as FORM_TOLERANCE */
#define EITS_FORM_MAX_NORM 1.01f

/* clang-format on */

#endif
