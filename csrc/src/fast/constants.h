/* The numbers of this module that are a choice, with their reasons. Written by
 * tables/make_tables.py from tables/constants.toml. */
#ifndef EITSKIN_FAST_CONSTANTS_H
#define EITSKIN_FAST_CONSTANTS_H

#include "base/vec.h"

/* clang-format off */

/* ---- Chosen: on presses, swipes and pairs in time of seed 101 at 60 and 40 dB; the study reports
 * on seed 202. Some stand as in the first prototype and were not varied. Check: eitskin study
 * fast-path */

/* touches that are followed. larger: memory and work grow with its square; smaller: a hand of five
 * does not fit */
#define EITS_FAST_MAX_TOUCHES 5

/* greatest number in a drive [rows]. larger: memory; smaller: no skins of 32 electrodes */
#define EITS_FAST_MAX_ROWS 32

/* where the soft disc ends that a touch answers as [of touch_seed_radius_mm]. larger: answers near
 * the rim are smeared; smaller: they jump from pixel to pixel */
#define EITS_FAST_SOFT_RADIUS R(1.2)

/* what the model is wrong by in each row [of a touch's answer]. larger: slow to move; smaller:
 * strong touches are news in every drive */
#define EITS_FAST_MODEL_ERROR R(0.03)

/* chi^2 of a drive's rows above which they are not as expected. larger: touches come late; smaller:
 * noise starts searches */
#define EITS_FAST_NEWS R(45.0)

/* square of one row's deviation that may be a glitch. larger: glitches delay; smaller: light
 * touches lose a row */
#define EITS_FAST_GLITCH R(60.0)

/* a row with less is wild [of the reference]. larger: strong touches kill rows; smaller: open
 * electrodes look like touches */
#define EITS_FAST_DEAD R(0.2)

/* and one with more [of the reference]. as FAST_DEAD */
#define EITS_FAST_WILD R(3.0)

/* wild less not wild, above which an electrode's are left out [rows]. larger: an open electrode
 * spoils more drives; smaller: one glitch takes an electrode */
#define EITS_FAST_SUSPECT 2

/* that are counted [rows]. larger: an electrode that is well again is out for longer; smaller:
 * comes and goes */
#define EITS_FAST_SUSPECT_MOST 16

/* least reference of such a row [of noise]. as FAST_DEAD */
#define EITS_FAST_DEAD_NOISE R(10.0)

/* a row that is further from its reference is no measurement [of noise]. larger: squares overflow
 * in float32; smaller: rows of little noise are lost */
#define EITS_FAST_FAR R(1000000.0)

/* change of speed in a drive of FAST_DRIVE_S [mm/s]. larger: places jitter; smaller: they lag */
#define EITS_FAST_SPEED_NOISE R(40.0)

/* the drive that noise is named for [s]. as the others */
#define EITS_FAST_DRIVE_S R(0.0013)

/* of a new touch [mm/s]. as FAST_SPEED_NOISE */
#define EITS_FAST_FIRST_SPEED R(150.0)

/* change of strength in such a drive [of the greatest]. larger: strengths jitter; smaller: at 40 dB
 * a touch that lifts slides to where it would be weak */
#define EITS_FAST_STRENGTH_NOISE R(0.06)

/* change of strength where rows are news [of the greatest]. as FAST_STRENGTH_NOISE */
#define EITS_FAST_STRENGTH_JUMP R(0.15)

/* the same before anything new is looked for [of the greatest]. larger: new touches near others are
 * taken for them; smaller: a lift looks like a new touch */
#define EITS_FAST_CHANGE R(1.0)

/* change of place with it, where nothing waits [mm]. as FAST_CHANGE */
#define EITS_FAST_CHANGE_MM R(3.0)

/* of what a drive says of the gain's drift that is believed. larger: drift follows noise; smaller:
 * it lags */
#define EITS_FAST_GAIN_STEP R(0.05)

/* the same where drift alone explains news. as FAST_GAIN_STEP */
#define EITS_FAST_DRIFT_STEP R(0.25)

/* greatest drift that news may be [of the gain]. larger: weak touches in the middle are taken for
 * it; smaller: fast drift is news */
#define EITS_FAST_MAX_DRIFT R(0.01)

/* with so many a drift of the gain is not named [touches]. larger: strong touches pass for drift;
 * smaller: drift is named after the hand has lifted */
#define EITS_FAST_HAND 3

/* drift of which frames are named stale [of the gain]. larger: less is not named; smaller: so are
 * frames of presses at 40 dB */
#define EITS_FAST_DRIFTED R(0.003)

/* and at least so much; 7 deviations [noise_v over v0_rms]. as FAST_DRIFTED */
#define EITS_FAST_DRIFTED_NOISE R(0.3)

/* on end, from which on it is named [frames]. larger: late; smaller: sudden presses are named until
 * they are born */
#define EITS_FAST_DRIFTED_FRAMES 2

/* that wait to be explained [drives]. larger: memory and work; smaller: misses touches at 40 dB */
#define EITS_FAST_HELD 9

/* chi^2 above which the first drive that waits is left out: a touch may have landed within it.
 * larger: sudden presses are placed by halves of drives; smaller: slow ones come later */
#define EITS_FAST_SUDDEN R(400.0)

/* after which a wait begins again [drives]. larger: the map keeps what has passed; smaller: slow
 * touches begin again */
#define EITS_FAST_MAX_WAIT 24

/* without news end a wait [drives]. larger: old drives are kept; smaller: light touches begin
 * again */
#define EITS_FAST_QUIET 8

/* of the last 32; with more nothing is born [drives]. larger: faults make touches; smaller: slow
 * touches wait for a frame */
#define EITS_FAST_UNEXPLAINED 20

/* of the map that a search begins at [places]. larger: work; smaller: no rival to be compared
 * with */
#define EITS_FAST_STARTS 2

/* of a search, at most [steps]. larger: work; smaller: places lag */
#define EITS_FAST_STEPS 5

/* answered for by the steps of a search: bounds its work [drives]. as FAST_STEPS */
#define EITS_FAST_ANSWERS 12

/* that two touches at once are looked for in [drives]. larger: work; smaller: pairs come late */
#define EITS_FAST_PAIR_HELD 3

/* the map beside a first touch is made of [drives]. larger: work; smaller: misses the second */
#define EITS_FAST_PAIR_DRIVES 1

/* between touches, and between a place and its rivals [mm]. larger: near fingers wait for a frame;
 * smaller: one touch becomes two */
#define EITS_FAST_APART_MM R(15.0)

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

/* below it a touch is off [of the greatest strength]. larger: touches end early; smaller: late */
#define EITS_FAST_OFF R(0.15)

/* above it is on again [of the greatest strength]. as FAST_OFF */
#define EITS_FAST_ON R(0.25)

/* off until it is forgotten [drives]. larger: an id outlasts its finger; smaller: a bounce gives a
 * new one */
#define EITS_FAST_GONE 32

/* over which what a touch explains is averaged [drives]. as FAST_FAINT */
#define EITS_FAST_ENERGY_DRIVES R(8.0)

/* below it a touch is off, and on again above twice as much [of chi^2]. larger: light touches go;
 * smaller: places of noise */
#define EITS_FAST_FAINT R(4.0)

/* a touch that went less within a scan stays as it is in a frame [mm]. larger: slow touches are
 * left smeared; smaller: still frames change */
#define EITS_FAST_MOVED_MM R(1.0)

/* the same by how sure its place and strength are [deviations]. as FAST_MOVED_MM */
#define EITS_FAST_MOVED_SD R(6.0)

/* the same for its strength [of it]. as FAST_MOVED_MM */
#define EITS_FAST_MOVED_STRENGTH R(0.08)

/* without an explanation, after which the whole-frame solver is believed all the same [frames].
 * larger: faults are named late; smaller: slow presses name faults */
#define EITS_FAST_FRAMES 1

/* from a touch to that of a frame that confirms it [mm]. as FAST_APART_MM */
#define EITS_FAST_CONFIRM_MM R(15.0)

/* without it, after which a touch goes [frames]. larger: false touches last; smaller: one bad frame
 * ends true ones */
#define EITS_FAST_LOST_FRAMES 2

/* deviation of the place of a touch that frames alone found [mm]. as FAST_BORN_MM */
#define EITS_FAST_SEED_MM R(3.0)

/* the same of its strength [of it]. as FAST_BORN_MM */
#define EITS_FAST_SEED_STRENGTH R(0.3)

/* ---- Chosen: on tuning streams, whose seed and runs were not kept, for a whole-frame tracker that
 * smoothed places as well. Check: eitskin study hands */

/* a touch of frames alone that explains less waits for a second one: it may be half of another [of
 * |y|^2]. larger: light touches start late; smaller: halves are reported */
#define EITS_FAST_SURE_FRACTION R(0.05)

/* and one whose own S'y is less [lambda_noise]. larger: faint touches start late; smaller: noise is
 * reported at once */
#define EITS_FAST_SURE_CLEARNESS R(1.5)

/* that may lack a touch before its id ends [frames]. larger: another finger gets its id; smaller: a
 * faint touch loses its id */
#define EITS_FAST_SEEN_HOLD 2

/* a faint touch found so often is reported while it is missed [frames]. larger: faint touches
 * flicker; smaller: noise is held */
#define EITS_FAST_SEEN_KNOWN 4

/* how far a touch that is not reported yet may move: noise is found anywhere, a touch beside itself
 * [of follow_mm]. larger: noise confirms noise; smaller: fast fingers start late */
#define EITS_FAST_SEEN_REACH R(0.6)

/* rms by which a velocity changes [of follow_mm a frame]. larger: places of noise turn it; smaller:
 * turns are followed late */
#define EITS_FAST_SEEN_CHANGE R(0.028)

/* rms of a new touch's velocity [of follow_mm a frame]. larger: the first two places decide it;
 * smaller: fast fingers are lost at first */
#define EITS_FAST_SEEN_SPEED R(0.12)

/* deviation of the place of a touch that is as clear as noise [pixels]. larger: velocities follow
 * late; smaller: noise makes velocities */
#define EITS_FAST_SEEN_NOISE R(0.66)

/* no place is better known than this [pixels]. larger: as FAST_SEEN_NOISE; smaller: a gain of
 * rounding */
#define EITS_FAST_SEEN_DEVIATION R(0.01)

/* clang-format on */

#endif
