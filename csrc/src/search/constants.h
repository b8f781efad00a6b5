/* The numbers of this module that are a choice, with their reasons. Written by
 * tables/make_tables.py from tables/constants.toml. */
#ifndef EITSKIN_SEARCH_CONSTANTS_H
#define EITSKIN_SEARCH_CONSTANTS_H

#include "base/vec.h"

/* clang-format off */

/* ---- Chosen: on hands in time of seeds 11 and 12 in the prototype; FAST_ANSWERS, FAST_SEARCHED,
 * FAST_STABLE, FAST_CLEAR_ERROR and FAST_SPEED_MOST on seeds 31 and 32 with the limit of work.
 * Check: eitskin study hands */

/* if more of the last 32 drives are unexplained, no new touch is looked for [drives]. larger:
 * faults make touches; smaller: slow touches wait for a whole frame */
#define EITS_FAST_UNEXPLAINED 20

/* damping of a Gauss-Newton step [of the diagonal]. larger: slow convergence; smaller: steps run
 * away */
#define EITS_FAST_DAMPING R(0.001)

/* the longest step of a place [mm]. as FAST_DAMPING */
#define EITS_FAST_MAX_STEP_MM R(6.0)

/* a step that does not help is shortened by this factor. as FAST_DAMPING */
#define EITS_FAST_SHORTER R(0.25)

/* a shorter step ends the refinement of a hypothesis [mm]. larger: places are rough; smaller: more
 * work */
#define EITS_FAST_SETTLED_MM R(0.05)

/* least pivot of the normal equations, scaled to a unit diagonal. larger: places that the rows
 * determine are rejected; smaller: places of noise are believed */
#define EITS_FAST_SINGULAR R(1e-06)

/* a new touch must explain at least this much. larger: misses light touches; smaller: noise becomes
 * touches */
#define EITS_FAST_BIRTH R(45.0)

/* beside noise, a new touch may leave an rms of at most this [of the signal]. larger: two touches
 * start as one between them; smaller: a touch that the model does not fit exactly never starts */
#define EITS_FAST_BIRTH_ERROR R(0.05)

/* if a change of known touches leaves at most this rms beside noise, nothing else is looked for [of
 * the signal]. larger: a touch that lands passes for the move of another; smaller: more work */
#define EITS_FAST_CLEAR_ERROR R(0.02)

/* the residual counts as noise up to this distance above the mean of noise [deviations]. larger: a
 * second touch is looked for late; smaller: it is looked for in vain */
#define EITS_FAST_LEFT_SD R(2.0)

/* greatest standard deviation of a new touch's place [mm]. larger: wrong first places; smaller:
 * later starts */
#define EITS_FAST_SPREAD_MM R(1.8)

/* the same of two touches that take the place of a young one. On pairs of hands in time, seed 7
 * [mm]. larger: wrong places; smaller: one touch stays between two fingers */
#define EITS_FAST_SPLIT_SPREAD_MM R(8.0)

/* a new touch must explain more than at the best rival place by this [of what it explains]. larger:
 * later starts; smaller: false touches */
#define EITS_FAST_AMBIGUOUS R(0.05)

/* added to the standard deviation of a new place [mm]. larger: jitter; smaller: wrong places
 * stay */
#define EITS_FAST_BORN_MM R(0.5)

/* added to the standard deviation of a new strength [of it]. as FAST_BORN_MM */
#define EITS_FAST_BORN_STRENGTH R(0.1)

/* a search explains at most this many of the drives that wait, the last ones [drives]. larger: more
 * work and delay; smaller: more noise */
#define EITS_FAST_SEARCHED 6

/* a touch neither starts with a greater speed nor changes to one [mm/s]. larger: two touches pass
 * for one that jumps; smaller: fast swipes are lost */
#define EITS_FAST_SPEED_MOST R(1500.0)

/* the work that a drive may spend on a search [answers of a place in a drive]. larger: single
 * drives take longer; smaller: searches take more drives */
#define EITS_FAST_ANSWERS 33

/* that work is less by this for each known touch, which needs work of its own [answers]. as
 * FAST_ANSWERS */
#define EITS_FAST_TOUCH_ANSWERS 6

/* the cost of adding a drive to the map [answers]. larger: fewer pieces of a search per drive;
 * smaller: single drives take longer than FAST_ANSWERS says */
#define EITS_FAST_MAP_ANSWERS 4

/* the map is made of the newest drives that wait, at most this many [drives]. larger: more work;
 * smaller: fits start far from the best place */
#define EITS_FAST_MAP_DRIVES 3

/* fraction of the map that stays when a drive is added. larger: the map shows where a touch was;
 * smaller: it shows noise */
#define EITS_FAST_MAP_KEPT R(0.85)

/* pairs and touches in motion are fitted to at most this many of the last drives [drives]. larger:
 * more work; smaller: more noise */
#define EITS_FAST_SHORT_DRIVES 5

/* a new touch beside moves is fitted to at most this many of the last drives [drives]. as
 * FAST_SHORT_DRIVES */
#define EITS_FAST_LAST_DRIVES 6

/* a known touch within this distance may be the new touch instead [mm]. larger: more work; smaller:
 * dragged touches give false ones */
#define EITS_FAST_NEAR_MM R(60.0)

/* radius of the wider soft disc that a touch may turn out to be [mm]. half-way between a finger and
 * a palm */
#define EITS_FAST_RHO_WIDE_MM R(20.0)

/* radius of the soft disc of a palm, which is a disc of 22 mm [mm]. larger: a forearm; smaller:
 * palms get touches at their rim */
#define EITS_FAST_RHO_WIDER_MM R(31.0)

/* until this age a touch may turn out to be wider [drives]. larger: a pressing finger becomes a
 * palm; smaller: a palm that comes slowly stays small */
#define EITS_FAST_WIDENS 150

/* prior deviation of the speed of a still touch that moves [mm/s]. larger: new touches are taken
 * for moves; smaller: swipes are taken for new touches */
#define EITS_FAST_MOVE_SPEED R(700.0)

/* prior deviation of the change of speed of a moving touch [mm/s]. as FAST_MOVE_SPEED */
#define EITS_FAST_TURN_SPEED R(200.0)

/* prior deviation of a place when a move began [mm]. as FAST_MOVE_SPEED */
#define EITS_FAST_MOVE_MM R(1.5)

/* each further touch that moves must explain this much [of chi^2]. larger: two fingers that slide
 * are seen late; smaller: still touches move along */
#define EITS_FAST_MOVES_EACH R(20.0)

/* a sudden change of a known strength by this has a cost of 1 [of the greatest]. larger: new
 * touches are taken for lifts; smaller: lifts are taken for new touches */
#define EITS_FAST_CHANGES R(0.3)

/* greatest cost of such a change in a drive [of chi^2]. as FAST_CHANGES */
#define EITS_FAST_CHANGE_MOST R(4.0)

/* a new touch must beat each move and replacement by this [of chi^2]. larger: later starts;
 * smaller: false touches */
#define EITS_FAST_BIRTH_MARGIN R(30.0)

/* and by at least this [of what it explains]. as FAST_BIRTH_MARGIN */
#define EITS_FAST_BIRTH_SHARE R(0.1)

/* a new touch may cost at most this much more than the cheapest one [of chi^2]. larger: false
 * touches; smaller: later starts */
#define EITS_FAST_RIVAL R(10.0)

/* cost of one known touch that becomes two, beside that of its parameters [of chi^2]. as
 * FAST_BIRTH_MARGIN */
#define EITS_FAST_SPLIT_COST R(14.0)

/* a new touch starts after this many decisions for the same one [decisions]. larger: later starts;
 * smaller: false touches */
#define EITS_FAST_STABLE 2

/* the same for two touches at once, and beside a young touch [decisions]. as FAST_STABLE */
#define EITS_FAST_STABLE_CROWD 3

/* one decision is enough if it explains at least this many drives and nothing is left to explain
 * [drives]. larger: later starts while further fingers land; smaller: false touches */
#define EITS_FAST_STABLE_DRIVES 4

/* two decisions with places within this distance are for the same touch [mm]. as FAST_STABLE */
#define EITS_FAST_STABLE_MM R(4.0)

/* a touch below this age may have been two touches [drives]. larger: later starts; smaller: one
 * touch stays between two fingers */
#define EITS_FAST_YOUNG 48

/* a change of known touches must explain at least this much [of chi^2]. larger: slow moves come
 * late; smaller: noise moves touches */
#define EITS_FAST_MOVE_LEAST R(100.0)

/* a change that explains at least this much is clear [of chi^2]. as FAST_MOVE_LEAST */
#define EITS_FAST_MOVE_CLEAR R(300.0)

/* in few drives a change must beat each new touch by this, later by half of it [of chi^2]. larger:
 * touches wait; smaller: known touches are dragged to new ones */
#define EITS_FAST_MOVE_MARGIN R(20.0)

/* a clear change must beat each new touch by this [of chi^2]. as FAST_MOVE_MARGIN */
#define EITS_FAST_MOVE_TIE R(-5.0)

/* another change that costs at most this much more is a rival [of chi^2]. as FAST_MOVE_MARGIN */
#define EITS_FAST_UNCLEAR R(12.0)

/* a touch that moved by less has not moved [mm]. larger: slow moves begin late; smaller: noise
 * moves touches */
#define EITS_FAST_MOVED_LEAST_MM R(0.4)

/* added to the standard deviation of a place that has moved [mm]. as FAST_BORN_MM */
#define EITS_FAST_MOVED_DOUBT_MM R(0.3)

/* and to that of its speed [mm/s]. as FAST_BORN_MM */
#define EITS_FAST_MOVED_DOUBT_SPEED R(40.0)

/* added to the standard deviation of the speed of a touch that starts in motion [mm/s]. as
 * FAST_BORN_MM */
#define EITS_FAST_BORN_SPEED R(60.0)

/* standard deviation of the speed of a new touch if no other touch is known [mm/s]. larger: it is
 * dragged by another that lands beside it; smaller: swipes are lost */
#define EITS_FAST_FIRST_SPEED R(150.0)

/* the same of one whose signal grows from near noise. On pairs and sliding fingers of hands in
 * time, seeds 7 and 311 [mm/s]. as FAST_FIRST_SPEED */
#define EITS_FAST_FIRST_SLOW R(40.0)

/* a new touch may move if its strength grows by less than this factor in the drives from which it
 * starts. larger: it is dragged by another that lands beside it; smaller: swipes are lost */
#define EITS_FAST_GROWS R(1.3)

/* least speed of a touch that starts in motion [mm/s]. larger: swipes begin late; smaller: noise
 * moves new touches */
#define EITS_FAST_SWIFT_SPEED R(60.0)

/* least speed of a known touch that turns out to be faster than assumed [mm/s]. as
 * FAST_SWIFT_SPEED */
#define EITS_FAST_SWERVE_SPEED R(100.0)

/* a known touch that turns out to be further away than this is assumed to move [mm]. larger: swipes
 * lag behind; smaller: a touch that was born at a wrong place runs away */
#define EITS_FAST_JUMPED_MM R(5.0)

/* two touches at once are tried at this distance on either side of one place [mm]. half of the
 * distance of near fingers */
#define EITS_FAST_HALF_PAIR_MM R(13.0)

/* the places of two pairs within this distance are the same pair, not a rival [mm]. larger: false
 * pairs; smaller: a pair is its own rival */
#define EITS_FAST_SAME_PAIR_MM R(10.0)

/* clang-format on */

#endif
