/* The numbers of this module that are a choice, with their reasons. Written by
 * tables/make_tables.py from tables/constants.toml. */
#ifndef EITSKIN_GESTURE_CONSTANTS_H
#define EITSKIN_GESTURE_CONSTANTS_H

#include "base/vec.h"

/* clang-format off */

/* ---- Chosen: on random sessions of role tuning, seeds 101 and 102, at 60 and 40 dB; judged on
 * others (studies/results/gestures.md). Check: eitskin bench gestures */

/* a finger has lifted if it is not found for this long [us]. larger: lifts, taps and swipes are
 * reported a frame later; smaller: a lost frame at 96 frames a second ends a touch */
#define EITS_LOST_US 20000

/* the place of a finger is uncertain if its standard deviation was larger than this when it was
 * last found [mm]. larger: light fingers lift and land again in noise; smaller: as VAGUE_LOST
 * larger */
#define EITS_VAGUE_MM R(2.0)

/* such a finger has lifted if it is not found for this long [lost_us]. larger: lifts of light
 * fingers in noise are reported late; smaller: single frames end them */
#define EITS_VAGUE_LOST 3

/* a finger that is found again within this time, and near, is the same [us]. larger: a fast double
 * tap is one; smaller: a lost frame makes two */
#define EITS_REJOIN_US 45000

/* a finger that is found again within this distance is the same [mm]. larger: other fingers join;
 * smaller: fast ones are cut */
#define EITS_REJOIN_MM R(25.0)

/* a touch is reported once it has lasted this long: one frame at 48 per second, two at 96 [us].
 * larger: down is reported late; smaller: the scan in which a finger lands shows it at another
 * place, or shows two */
#define EITS_SETTLE_US 20000

/* a doubtful touch is reported once it has lasted this long [us]. larger: second fingers come late;
 * smaller: halves of a touch become fingers */
#define EITS_DOUBT_US 60000

/* a touch that appears within this distance of another is doubtful [mm]. larger: second fingers
 * come late; smaller: halves become fingers */
#define EITS_SPLIT_MM R(28.0)

/* a touch of less strength is doubtful [of another's]. larger: light second fingers come late;
 * smaller: ghosts of strong touches become fingers */
#define EITS_FAINT R(0.06)

/* a finger with less strength is lifting, and its place is not updated [of its last strength].
 * larger: places stand still; smaller: drags end with a jump, as swipes */
#define EITS_FIRM R(0.8)

/* a touch that explains less is lifting: if the tracker then holds it, it has lifted [of what it
 * last explained]. larger: faint touches flicker; smaller: their lifts are reported late */
#define EITS_GOING R(0.8)

/* a shorter tap must be clear [us]. larger: quick taps are missed; smaller: ghosts of landing
 * fingers tap */
#define EITS_SHORT_US 15000

/* a touch that explains at least this much is clear [of the data]. larger: quick taps are missed;
 * smaller: ghosts tap */
#define EITS_TAP_CLEAR R(0.4)

/* a tap lasts at most this long [us]. larger: short presses become taps; smaller: slow taps are
 * missed */
#define EITS_TAP_US 280000

/* the next tap of a double tap begins within this time of the first one's end [us]. larger: two
 * single taps become one double; smaller: slow double taps are two */
#define EITS_DOUBLE_US 300000

/* two taps within this distance are a double tap [mm]. larger: taps of neighbouring keys pair;
 * smaller: careless double taps are missed */
#define EITS_DOUBLE_MM R(15.0)

/* a hold is reported after this time [us]. larger: reported late; smaller: long presses become
 * holds */
#define EITS_HOLD_US 500000

/* a tap or hold stays within this distance of its first place [mm]. larger: short swipes become
 * taps; smaller: rolling fingers and noise spoil taps */
#define EITS_STILL_MM R(10.0)

/* a swipe lasts at most this long [us]. larger: strokes become swipes; smaller: slow swipes are
 * missed */
#define EITS_SWIPE_US 1000000

/* a swipe has at least this length [mm]. larger: short ones are missed; smaller: slips become
 * swipes */
#define EITS_SWIPE_MM R(18.0)

/* a swipe has at least this speed at its end [mm/s]. larger: slow ones are missed; smaller: drags
 * that end at rest become swipes */
#define EITS_SWIPE_MM_PER_S R(80.0)

/* the speed of a swipe is taken over this time [us]. larger: rests are missed; smaller: noise
 * decides */
#define EITS_SPEED_US 130000

/* a swipe ends at least this far from its first place [of the farthest]. larger: arcs are missed;
 * smaller: strokes there and back become swipes */
#define EITS_SWIPE_STRAIGHT R(0.8)

/* two fingers pinch, spread or turn once they have moved this far in total [mm]. larger: small ones
 * are missed; smaller: fingers that rest wobble */
#define EITS_PAIR_MM R(15.0)

/* and further by this part of the variance of their places, of then and now, added as squares.
 * larger: gestures of light fingers are missed; smaller: noise makes gestures */
#define EITS_PAIR_NOISE R(2.0)

/* ---- Chosen: by hand, a matter of taste: MOVE_MM and ZONE_STAY_MM say how finely a finger is
 * reported. The others are guards; none changes a gesture at half and at double (study constants).
 * Check: ctest --preset host -R gesture */

/* a MOVE or CHANGE event reports at least this step [mm]. larger: coarse; smaller: noise is
 * reported */
#define EITS_MOVE_MM R(1.0)

/* a touch further away is ignored [mm]. larger: squares overflow; smaller: large skins */
#define EITS_MAX_PLACE_MM R(1000000.0)

/* the distance of two fingers counts as at least this [mm]. larger: changes the ratio of fingers
 * that meet; smaller: ratios without limit */
#define EITS_MIN_APART_MM R(0.1)

/* a finger stays in its zone until it is this far outside [mm]. larger: slides are reported late;
 * smaller: a finger on a border presses again and again */
#define EITS_ZONE_STAY_MM R(2.0)

/* all fingers lift without a gesture if no frame comes for longer or time goes back [us]. larger:
 * what lay between two streams becomes a gesture; smaller: slow boards have none */
#define EITS_LONGEST_GAP_US 1000000

/* clang-format on */

#endif
