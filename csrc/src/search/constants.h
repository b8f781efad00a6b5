/* The numbers of this module that are a choice, with their reasons. Written by
 * tables/make_tables.py from tables/constants.toml. */
#ifndef EITSKIN_SEARCH_CONSTANTS_H
#define EITSKIN_SEARCH_CONSTANTS_H

#include "base/vec.h"

/* clang-format off */

/* ---- Chosen: on hands in time of seeds 11 and 12 in the prototype; FAST_ANSWERS, FAST_SEARCHED,
 * FAST_STABLE, FAST_CLEAR_ERROR and FAST_SPEED_MOST on seeds 31 and 32 with the limit of work.
 * Check: eitskin study hands */

/* of the last 32; with more nothing is born [drives]. larger: faults make touches; smaller: slow
 * touches wait for a frame */
#define EITS_FAST_UNEXPLAINED 20

/* of a step [of the diagonal]. larger: slow; smaller: steps run away */
#define EITS_FAST_DAMPING R(0.001)

/* longest step [mm]. as FAST_DAMPING */
#define EITS_FAST_MAX_STEP_MM R(6.0)

/* a step that does not help is made so much shorter. as FAST_DAMPING */
#define EITS_FAST_SHORTER R(0.25)

/* a shorter step ends a search [mm]. larger: places are rough; smaller: work */
#define EITS_FAST_SETTLED_MM R(0.05)

/* least pivot of normal equations of unit diagonal. larger: places that rows tell are refused;
 * smaller: places that noise tells are believed */
#define EITS_FAST_SINGULAR R(1e-06)

/* what a touch must explain of chi^2. larger: misses light touches; smaller: noise is born */
#define EITS_FAST_BIRTH R(45.0)

/* rms of what it may leave beside noise [of the signal]. larger: two touches are born as one
 * between them; smaller: none that the model does not fit */
#define EITS_FAST_BIRTH_ERROR R(0.05)

/* the same of a change of known touches after which nothing else is looked for [of the signal].
 * larger: a touch that lands passes for the move of another; smaller: work */
#define EITS_FAST_CLEAR_ERROR R(0.02)

/* of that noise, above its mean [deviations]. as FAST_BIRTH_ERROR; larger: a second touch is looked
 * for late, smaller: in vain */
#define EITS_FAST_LEFT_SD R(2.0)

/* greatest deviation of its place [mm]. larger: wrong first places; smaller: late */
#define EITS_FAST_SPREAD_MM R(1.8)

/* lead over the best rival place [of what it explains]. larger: late; smaller: false touches */
#define EITS_FAST_AMBIGUOUS R(0.05)

/* added to the deviation of a new place [mm]. larger: jitter; smaller: wrong places stay */
#define EITS_FAST_BORN_MM R(0.5)

/* added to the deviation of a new strength [of it]. as FAST_BORN_MM */
#define EITS_FAST_BORN_STRENGTH R(0.1)

/* of those that wait, the last, that a search explains [drives]. larger: work and delay; smaller:
 * noise */
#define EITS_FAST_SEARCHED 6

/* above which no touch is born in motion or changes its speed [mm/s]. larger: two touches pass for
 * one that jumps; smaller: fast swipes are lost */
#define EITS_FAST_SPEED_MOST R(1500.0)

/* that a drive with a search may spend [answers of a place in a drive]. larger: drives take longer;
 * smaller: searches do */
#define EITS_FAST_ANSWERS 32

/* fewer for each known touch, which take their own work [answers]. as FAST_ANSWERS */
#define EITS_FAST_TOUCH_ANSWERS 5

/* what the map of a drive costs [answers]. larger: fewer pieces of a search in a drive */
#define EITS_FAST_MAP_ANSWERS 4

/* that wait, the newest, of which the map is made [drives]. larger: more work; smaller: starts far
 * from the best place */
#define EITS_FAST_MAP_DRIVES 3

/* share of the map that stays when a drive is added. larger: where a touch was; smaller: noise */
#define EITS_FAST_MAP_KEPT R(0.85)

/* by which pairs and touches in motion are judged [drives]. larger: work; smaller: noise */
#define EITS_FAST_SHORT_DRIVES 5

/* by which a birth among moves is judged [drives]. as FAST_SHORT_DRIVES */
#define EITS_FAST_LAST_DRIVES 6

/* from a new place to a known touch that may be there instead [mm]. larger: work; smaller: dragged
 * touches give false ones */
#define EITS_FAST_NEAR_MM R(60.0)

/* end of a wider disc that a touch may prove to have [mm]. the middle between a finger and a
 * palm */
#define EITS_FAST_RHO_WIDE_MM R(20.0)

/* and of a palm's: a disc of 22 mm [mm]. larger: a forearm; smaller: palms get touches at their
 * rim */
#define EITS_FAST_RHO_WIDER_MM R(31.0)

/* age up to which a touch may prove to be wider [drives]. larger: a pressing finger becomes a palm;
 * smaller: a palm that comes slowly stays small */
#define EITS_FAST_WIDENS 150

/* prior of the speed of a still touch that moves [mm/s]. larger: births are taken for moves;
 * smaller: swipes for births */
#define EITS_FAST_MOVE_SPEED R(700.0)

/* prior of the change of speed of a moving touch [mm/s]. as FAST_MOVE_SPEED */
#define EITS_FAST_TURN_SPEED R(200.0)

/* prior of a place's error when a move began [mm]. as FAST_MOVE_SPEED */
#define EITS_FAST_MOVE_MM R(1.5)

/* that each further touch that moves must explain [of chi^2]. larger: two that slide are seen late;
 * smaller: still ones move along */
#define EITS_FAST_MOVES_EACH R(20.0)

/* change of a known strength at once that is a cost of 1 [of the greatest]. larger: births are
 * taken for lifts; smaller: lifts for births */
#define EITS_FAST_CHANGES R(0.3)

/* greatest such cost in a drive [of chi^2]. as FAST_CHANGES */
#define EITS_FAST_CHANGE_MOST R(4.0)

/* by which a birth must beat each move and replacement [of chi^2]. larger: late; smaller: false
 * touches */
#define EITS_FAST_BIRTH_MARGIN R(30.0)

/* and at least by so much [of what it explains]. as FAST_BIRTH_MARGIN */
#define EITS_FAST_BIRTH_SHARE R(0.1)

/* that a birth may cost more than the best one [of chi^2]. larger: false touches; smaller: late */
#define EITS_FAST_RIVAL R(10.0)

/* of one known touch that becomes two, beside the numbers [of chi^2]. as FAST_BIRTH_MARGIN */
#define EITS_FAST_SPLIT_COST R(14.0)

/* that must come to the same birth [decisions]. larger: late; smaller: false touches */
#define EITS_FAST_STABLE 2

/* the same for two at once, and beside a young touch [decisions]. as FAST_STABLE */
#define EITS_FAST_STABLE_CROWD 3

/* between the places of the same birth [mm]. as FAST_STABLE */
#define EITS_FAST_STABLE_MM R(4.0)

/* age below which a touch may have been two [drives]. larger: late; smaller: one between two
 * fingers stays */
#define EITS_FAST_YOUNG 48

/* that a change of known touches must explain [of chi^2]. larger: slow moves come late; smaller:
 * noise moves touches */
#define EITS_FAST_MOVE_LEAST R(100.0)

/* from which on it is clear [of chi^2]. as FAST_MOVE_LEAST */
#define EITS_FAST_MOVE_CLEAR R(300.0)

/* by which a change must beat each birth in few drives; half of it later [of chi^2]. larger:
 * touches wait; smaller: known touches are dragged to new ones */
#define EITS_FAST_MOVE_MARGIN R(20.0)

/* the same where it is clear [of chi^2]. as FAST_MOVE_MARGIN */
#define EITS_FAST_MOVE_TIE R(-5.0)

/* within which another change is a rival [of chi^2]. as FAST_MOVE_MARGIN */
#define EITS_FAST_UNCLEAR R(12.0)

/* below which nothing has moved [mm]. larger: slow moves begin late; smaller: noise moves
 * touches */
#define EITS_FAST_MOVED_LEAST_MM R(0.4)

/* added to the deviation of a place that has moved [mm]. as FAST_BORN_MM */
#define EITS_FAST_MOVED_DOUBT_MM R(0.3)

/* and of its speed [mm/s]. as FAST_BORN_MM */
#define EITS_FAST_MOVED_DOUBT_SPEED R(40.0)

/* added to the deviation of the speed of a touch born in motion [mm/s]. as FAST_BORN_MM */
#define EITS_FAST_BORN_SPEED R(60.0)

/* deviation of the speed of a new touch where no other is known [mm/s]. larger: it is dragged by
 * one that lands beside it; smaller: swipes are lost */
#define EITS_FAST_FIRST_SPEED R(150.0)

/* growth of a new touch in the drives that it is born from, below which it may move. larger: it is
 * dragged by one that lands beside it; smaller: swipes are lost */
#define EITS_FAST_GROWS R(1.3)

/* least speed of a touch that is born in motion [mm/s]. larger: swipes begin late; smaller: noise
 * moves new touches */
#define EITS_FAST_SWIFT_SPEED R(60.0)

/* the same of a known one that is faster than was thought [mm/s]. as FAST_SWIFT_SPEED */
#define EITS_FAST_SWERVE_SPEED R(100.0)

/* to either side of one place, where two at once are tried [mm]. half of what near fingers are
 * apart */
#define EITS_FAST_HALF_PAIR_MM R(13.0)

/* between the places of a pair and its rival that are the same [mm]. larger: false pairs; smaller:
 * a pair is its own rival */
#define EITS_FAST_SAME_PAIR_MM R(10.0)

/* clang-format on */

#endif
