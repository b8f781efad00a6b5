/* The numbers of this module that are a choice, with their reasons. Written by
 * tables/make_tables.py from tables/constants.toml. */
#ifndef EITSKIN_FAST_CONSTANTS_H
#define EITSKIN_FAST_CONSTANTS_H

#include "base/vec.h"

/* clang-format off */

/* ---- Chosen: on presses, swipes and pairs in time of seed 101 at 60 and 40 dB, and on hands in
 * time of seeds 31 and 32; the study reports on seed 202. Some stand as in the prototypes and were
 * not varied. Check: eitskin study fast-path */

/* greatest number in a drive [rows]. larger: memory; smaller: no skins of 32 electrodes */
#define EITS_FAST_MAX_ROWS 32

/* where the soft disc ends that a touch answers as [of touch_seed_radius_mm]. larger: answers near
 * the rim are smeared; smaller: they jump from pixel to pixel */
#define EITS_FAST_SOFT_RADIUS R(1.2)

/* chi^2 of a drive's rows above which they are not as expected. larger: touches come late; smaller:
 * noise starts searches */
#define EITS_FAST_NEWS R(45.0)

/* what moving a touch promises above which a change of strengths is no explanation [of chi^2].
 * larger: a touch that starts is taken for one that lifts; smaller: lifts start searches */
#define EITS_FAST_MOVES R(25.0)

/* least determinant of a touch's two slopes of unit length. as FAST_MOVES */
#define EITS_FAST_NO_SLOPE R(0.0001)

/* square of one row's deviation that may be a glitch. larger: glitches delay; smaller: light
 * touches lose a row */
#define EITS_FAST_GLITCH R(60.0)

/* the same of known touches while drives wait. larger: glitches delay touches; smaller: drives of
 * touches that start to move are lost */
#define EITS_FAST_GLITCH_WAITING R(3000.0)

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
#define EITS_FAST_SPEED_NOISE R(15.0)

/* the drive that noise is named for [s]. as the others */
#define EITS_FAST_DRIVE_S R(0.0013)

/* change of strength in such a drive [of the greatest]. larger: strengths jitter; smaller: at 40 dB
 * a touch that lifts slides to where it would be weak */
#define EITS_FAST_STRENGTH_NOISE R(0.06)

/* change of strength where rows are news [of the greatest]. as FAST_STRENGTH_NOISE */
#define EITS_FAST_STRENGTH_JUMP R(0.15)

/* the same before anything new is looked for [of the greatest]. larger: new touches near others are
 * taken for them; smaller: a lift looks like a new touch */
#define EITS_FAST_CHANGE R(1.0)

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

/* chi^2 above which the first drive that waits is left out: a touch may have landed within it.
 * larger: sudden presses are placed by halves of drives; smaller: slow ones come later */
#define EITS_FAST_SUDDEN R(400.0)

/* without news end a wait [drives]. larger: old drives are kept; smaller: light touches begin
 * again */
#define EITS_FAST_QUIET 8

/* between touches, and between a place and its rivals [mm]. larger: near fingers wait for a frame;
 * smaller: one touch becomes two */
#define EITS_FAST_APART_MM R(15.0)

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

/* without it, after which a touch goes [frames]. larger: false touches last; smaller: one bad frame
 * ends true ones */
#define EITS_FAST_LOST_FRAMES 2

/* deviation of the place of a touch that frames alone found [mm]. as FAST_BORN_MM */
#define EITS_FAST_SEED_MM R(3.0)

/* the same of its strength [of it]. as FAST_BORN_MM */
#define EITS_FAST_SEED_STRENGTH R(0.3)

/* touches that are followed. larger: memory and work grow with its square; smaller: a hand of five
 * and a wrong one do not fit */
#define EITS_FAST_MAX_TOUCHES 6

/* that wait to be explained [drives]. larger: memory and work; smaller: misses touches at 40 dB */
#define EITS_FAST_HELD 8

/* that are kept: a search of those that wait may take the rest [drives]. larger: memory; smaller:
 * long searches begin again */
#define EITS_FAST_RING 14

/* touches nearer than its root do not bend each other's field [mm^2]. as NO_DIPOLE_MM2 */
#define EITS_FAST_NO_DIPOLE_MM2 R(1e-06)

/* what the model is wrong by in each row, unless it is learned [of a touch's answer]. larger: slow
 * to move; smaller: strong touches are news in every drive */
#define EITS_FAST_MODEL_ERROR R(0.02)

/* what it is wrong by in each row beside that [of the rms of a drive's answer]. as
 * FAST_MODEL_ERROR */
#define EITS_FAST_DRIVE_ERROR R(0.01)

/* greatest share of what touches give now in what they gave when it was learned. larger: a press
 * that grows takes errors along; smaller: a stronger press is news */
#define EITS_FAST_BIAS_MOST R(1.2)

/* its deviation as far as touches no longer give what they gave [of the learned error]. as
 * FAST_BIAS_MOST */
#define EITS_FAST_BIAS_OLD R(0.2)

/* least share of what is left that is learned. larger: noise is learned; smaller: late */
#define EITS_FAST_BIAS_LEAST R(0.2)

/* age of each touch from which on errors are learned [drives]. larger: late; smaller: a wrong place
 * is learned as an error */
#define EITS_FAST_BIAS_AGE 16

/* without news before errors are learned [drives]. as FAST_BIAS_AGE */
#define EITS_FAST_BIAS_QUIET 6

/* deviation of what is left of a row from one scan to the next that is a model's error [of it].
 * larger: slow touches are learned away; smaller: errors are news for ever */
#define EITS_FAST_SAME_REST R(0.1)

/* with more news nothing is a model's error at once [of 16 drives]. as FAST_SAME_REST */
#define EITS_FAST_FEW_NEWS 5

/* change of a still touch's place in a drive [mm]. larger: places jitter; smaller: they stay
 * wrong */
#define EITS_FAST_STILL_MM R(0.03)

/* a moving touch that goes less in FAST_SLOW_DRIVES is still [mm]. larger: slow fingers stand
 * still; smaller: still ones are dragged by those that land */
#define EITS_FAST_SLOW_MM R(0.35)

/* after which that is asked [drives]. larger: still touches are dragged; smaller: as FAST_SLOW_MM
 * larger */
#define EITS_FAST_SLOW_DRIVES 10

/* a moving touch stands still once so many of the last drives, a bit each, are unexplained [bits].
 * larger: a wrong speed carries it away; smaller: a swipe lags behind a touch that lands */
#define EITS_FAST_COASTS 15

/* whose chi^2 together may be news [drives]. larger: late; smaller: noise waits */
#define EITS_FAST_SUM_DRIVES 8

/* of that above their rows; the model's error is learned below half of it. larger: slow motion is
 * seen late; smaller: noise waits */
#define EITS_FAST_SUM_MOST R(60.0)

/* by which a birth must be further from it [of a wider disc's end]. larger: a finger beside a palm
 * is refused; smaller: touches at its rim */
#define EITS_FAST_APART_WIDE R(0.7)

/* from a touch to that of a frame that confirms it; further away in two frames that agree it is put
 * there [mm]. larger: places of drives stay wrong; smaller: places of frames cut in */
#define EITS_FAST_AGREE_MM R(6.0)

/* between a touch's places in two frames from which on it moves when it is put [mm]. larger: moving
 * touches lag; smaller: still ones run away */
#define EITS_FAST_PUT_MOVES_MM R(2.0)

/* that it has gone on for since the middle of the frame's scan [frames]. the frame is taken into
 * account when the next one is complete */
#define EITS_FAST_PUT_AHEAD R(1.5)

/* deviation of its speed then [mm/s]. as FAST_MOVED_DOUBT_SPEED */
#define EITS_FAST_PUT_SPEED R(100.0)

/* between touches of two frames on end that no drive has found [mm]. larger: two wrong frames make
 * a touch; smaller: late */
#define EITS_FAST_SEED_REACH_MM R(8.0)

/* from scan to scan that a still touch which moves goes at least [mm]. larger: slow fingers lag;
 * smaller: still touches are dragged */
#define EITS_FAST_CREEPS_MM R(0.5)

/* on end in which it has gone that far [drives]. as FAST_CREEPS_MM */
#define EITS_FAST_CREEPS 16

/* end of a disc from which on it is a palm [mm]. between FAST_RHO_WIDE_MM and FAST_RHO_WIDER_MM */
#define EITS_FAST_PALM_MM R(25.0)

/* below which a frame's touch is what the solver's discs leave of the palm [of a palm's strength].
 * larger: a light finger beside a palm is missed; smaller: touches at its rim */
#define EITS_FAST_PALM_REST R(0.1)

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
