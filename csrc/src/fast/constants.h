/* The numbers of this module that are a choice, with their reasons. Written by
 * tables/make_tables.py from tables/constants.toml. */
#ifndef EITSKIN_FAST_CONSTANTS_H
#define EITSKIN_FAST_CONSTANTS_H

#include "base/vec.h"

/* clang-format off */

/* ---- Chosen: on presses, swipes and pairs in time of seed 101 at 60 and 40 dB, and on hands in
 * time of seeds 31 and 32; the study reports on seed 202. FAST_OFF, FAST_ON, FAST_LEAVES and
 * FAST_GROWN_ENERGY on palms and creep of hands in time, seeds 5 and 6, with palms of seed 47 in
 * view. Some stand as in the prototypes, or were chosen once, and were not varied. Check: eitskin
 * study fast-path */

/* the greatest number of rows in a drive [rows]. larger: more memory; smaller: no skins with 32
 * electrodes */
#define EITS_FAST_MAX_ROWS 32

/* a touch is modelled as a soft disc that ends at this radius [of touch_seed_radius_mm]. larger:
 * answers near the rim are smeared; smaller: they jump from pixel to pixel */
#define EITS_FAST_SOFT_RADIUS R(1.2)

/* rows of a drive with a greater chi^2 are news: they are not as expected. larger: touches come
 * late; smaller: noise starts searches */
#define EITS_FAST_NEWS R(45.0)

/* rows are news, although changes of strength explain them, if moving a touch promises a greater
 * fall [of chi^2]. larger: a touch that starts to move is taken for one that lifts; smaller: lifts
 * start searches */
#define EITS_FAST_MOVES R(25.0)

/* least determinant of a touch's two slopes, scaled to unit length. as FAST_MOVES */
#define EITS_FAST_NO_SLOPE R(0.0001)

/* one row may be an outlier if the square of its deviation exceeds this. larger: outliers delay
 * touches; smaller: light touches lose a row */
#define EITS_FAST_GLITCH R(60.0)

/* the same beside known touches while drives wait. larger: outliers delay touches; smaller: drives
 * of touches that start to move are lost */
#define EITS_FAST_GLITCH_WAITING R(3000.0)

/* a row with less cannot be caused by touches [of the reference]. larger: strong touches mask rows;
 * smaller: open electrodes look like touches */
#define EITS_FAST_DEAD R(0.2)

/* nor can one with more [of the reference]. as FAST_DEAD */
#define EITS_FAST_WILD R(3.0)

/* an electrode's rows are left out while more of them cannot be caused by touches than can, by more
 * than this [rows]. larger: an open electrode spoils more drives; smaller: one outlier masks an
 * electrode */
#define EITS_FAST_SUSPECT 2

/* that difference is counted up to this [rows]. larger: a repaired electrode stays out for longer;
 * smaller: a bad one comes and goes */
#define EITS_FAST_SUSPECT_MOST 16

/* least reference of a row that FAST_DEAD and FAST_WILD examine [of noise]. as FAST_DEAD */
#define EITS_FAST_DEAD_NOISE R(10.0)

/* a row that differs more from its reference is not a measurement [of noise]. larger: squares
 * overflow in float32; smaller: rows of little noise are lost */
#define EITS_FAST_FAR R(1000000.0)

/* rms by which a speed changes during a drive of FAST_DRIVE_S [mm/s]. larger: places jitter;
 * smaller: they lag */
#define EITS_FAST_SPEED_NOISE R(15.0)

/* duration of a drive to which these changes refer [s]. as FAST_SPEED_NOISE */
#define EITS_FAST_DRIVE_S R(0.0013)

/* rms by which a strength changes during such a drive [of the greatest]. larger: strengths jitter;
 * smaller: at 40 dB a touch that lifts slides to where it would be weak */
#define EITS_FAST_STRENGTH_NOISE R(0.06)

/* standard deviation of a sudden change of strength, tried first if rows are news [of the
 * greatest]. as FAST_STRENGTH_NOISE */
#define EITS_FAST_STRENGTH_JUMP R(0.15)

/* the same, tried next, before anything new is looked for [of the greatest]. larger: new touches
 * near others are taken for changes of these; smaller: a lift looks like a new touch */
#define EITS_FAST_CHANGE R(1.0)

/* fraction of a drive's gain drift that is taken over. larger: the drift follows noise; smaller: it
 * lags */
#define EITS_FAST_GAIN_STEP R(0.05)

/* the same if drift alone explains news. as FAST_GAIN_STEP */
#define EITS_FAST_DRIFT_STEP R(0.25)

/* greatest drift that may explain news [of the gain]. larger: weak touches in the middle are taken
 * for it; smaller: fast drift is news */
#define EITS_FAST_MAX_DRIFT R(0.01)

/* with this many touches a drift of the gain is not reported [touches]. larger: strong touches pass
 * for drift; smaller: drift is reported only after the hand has lifted */
#define EITS_FAST_HAND 3

/* a greater drift makes a frame stale [of the gain]. larger: less drift goes unreported; smaller:
 * frames of presses at 40 dB are reported */
#define EITS_FAST_DRIFTED R(0.003)

/* if it is also greater than this, which is 7 standard deviations [noise_v over v0_rms]. as
 * FAST_DRIFTED */
#define EITS_FAST_DRIFTED_NOISE R(0.3)

/* after this many such frames in a row it is reported [frames]. larger: later reports; smaller:
 * sudden presses are reported until their touch starts */
#define EITS_FAST_DRIFTED_FRAMES 2

/* the first drive that waits is left out if its chi^2 exceeds this: a touch may have landed within
 * it. larger: sudden presses are placed by halves of drives; smaller: slow ones come later */
#define EITS_FAST_SUDDEN R(400.0)

/* this many drives without news end a wait [drives]. larger: old drives are kept; smaller: light
 * touches begin again */
#define EITS_FAST_QUIET 8

/* least distance between touches, and between a place and its rivals [mm]. larger: near fingers
 * wait for a frame; smaller: one touch becomes two */
#define EITS_FAST_APART_MM R(15.0)

/* a touch with less strength is off [of the greatest strength]. larger: touches end early; smaller:
 * late */
#define EITS_FAST_OFF R(0.25)

/* a touch with more strength is on again [of the greatest strength]. as FAST_OFF */
#define EITS_FAST_ON R(0.35)

/* what a touch leaves at the lift is followed, unreported, if the touch was at least this old
 * [drives]. larger: the creep of a tap is reported as a touch; smaller: wrong places are
 * followed */
#define EITS_FAST_LEAVES 24

/* a touch that has been off for this long is forgotten [drives]. larger: an id outlasts its finger;
 * smaller: a bounce gives a new id */
#define EITS_FAST_GONE 32

/* the peak of a touch that has been off for longer fades with this time constant; its signal that
 * stays meanwhile is the skin's creep [drives]. larger: a finger that presses lightly where it had
 * pressed hard is reported late; smaller: creep is reported as a touch */
#define EITS_FAST_FORGETS R(2000.0)

/* the chi^2 that a touch explains is averaged over this many drives [drives]. as FAST_FAINT */
#define EITS_FAST_ENERGY_DRIVES R(8.0)

/* a touch that explains less is off, and one that explains more than twice as much is on again [of
 * chi^2]. larger: light touches end; smaller: places of noise */
#define EITS_FAST_FAINT R(4.0)

/* a touch that moved by less within a scan is not moved in its frame [mm]. larger: slow touches
 * stay smeared; smaller: still frames change */
#define EITS_FAST_MOVED_MM R(1.0)

/* nor one that moved or changed by less than this many standard deviations [deviations]. as
 * FAST_MOVED_MM */
#define EITS_FAST_MOVED_SD R(6.0)

/* nor one whose strength changed by less [of it]. as FAST_MOVED_MM */
#define EITS_FAST_MOVED_STRENGTH R(0.08)

/* after this many frames without an explanation the whole-frame solver's result is used all the
 * same [frames]. larger: faults are reported late; smaller: slow presses are reported as faults */
#define EITS_FAST_FRAMES 1

/* but it is used at once if no drive of the frame left more unexplained: drives are then too noisy
 * to find the touch, and what its landing smears is less than noise [chi^2]. larger: frames of a
 * landing palm have wrong touches; smaller: light touches come late */
#define EITS_FAST_LITTLE_NEWS R(100.0)

/* the tracker's model may be wrong by this much in a place, beside noise; a frame's place and the
 * tracker's are weighed by their variances [mm]. larger: places of noise jump; smaller: places of
 * the tracker's model are reported */
#define EITS_FAST_BIASED_MM R(3.0)

/* a touch ends after this many frames that do not show it [frames]. larger: false touches last;
 * smaller: one bad frame ends true ones */
#define EITS_FAST_LOST_FRAMES 2

/* a solved frame that drives do not explain decides alone where touches are if its touches leave
 * less than this [of the frame's energy]. larger: a frame in which a finger lands gives false
 * touches; smaller: touches come a frame later */
#define EITS_FAST_DECIDES_LEFT R(0.001)

/* a still touch that is further than this from where such a frame has it is put there [mm]. larger:
 * dragged touches stay; smaller: places of frames cut in */
#define EITS_FAST_DECIDES_MM R(2.0)

/* standard deviation of the place of a touch that only frames found [mm]. as FAST_BORN_MM */
#define EITS_FAST_SEED_MM R(3.0)

/* standard deviation of its strength [of it]. as FAST_BORN_MM */
#define EITS_FAST_SEED_STRENGTH R(0.3)

/* the most touches that are followed. larger: memory and work grow with its square; smaller: five
 * fingers and a wrong touch do not fit */
#define EITS_FAST_MAX_TOUCHES 6

/* the most drives that wait for an explanation [drives]. larger: more memory and work; smaller:
 * misses touches at 40 dB */
#define EITS_FAST_HELD 8

/* drives that are kept; beside those that wait there must be room for the drives that come during a
 * search [drives]. larger: more memory; smaller: long searches begin again */
#define EITS_FAST_RING 14

/* touches nearer than the root of this do not change each other's field [mm^2]. larger: near
 * touches lose their interaction; smaller: the field is infinite */
#define EITS_FAST_NO_DIPOLE_MM2 R(1e-06)

/* the model's error in each row, as far as it is not learned [of a touch's answer]. larger: touches
 * begin to move late; smaller: strong touches are news in every drive */
#define EITS_FAST_MODEL_ERROR R(0.02)

/* a further error in each row [of the rms of a drive's answer]. as FAST_MODEL_ERROR */
#define EITS_FAST_DRIVE_ERROR R(0.01)

/* the learned error is scaled with the touches' answers, at most by this factor. larger: a press
 * that grows takes errors along; smaller: a stronger press is news */
#define EITS_FAST_BIAS_MOST R(1.2)

/* standard deviation of the learned error, as far as the touches' answers have changed since [of
 * the learned error]. as FAST_BIAS_MOST */
#define EITS_FAST_BIAS_OLD R(0.2)

/* least fraction of the residual that is learned. larger: noise is learned; smaller: errors are
 * learned late */
#define EITS_FAST_BIAS_LEAST R(0.2)

/* errors are learned once each touch has this age [drives]. larger: errors are learned late;
 * smaller: a wrong place is learned as an error */
#define EITS_FAST_BIAS_AGE 16

/* and after this many drives without news [drives]. as FAST_BIAS_AGE */
#define EITS_FAST_BIAS_QUIET 6

/* a residual that changes by less from one scan to the next is an error of the model [of it].
 * larger: slow touches are learned away; smaller: errors remain news */
#define EITS_FAST_SAME_REST R(0.1)

/* with more news in the last 16 drives, no residual is learned at once [of 16 drives]. as
 * FAST_SAME_REST */
#define EITS_FAST_FEW_NEWS 5

/* rms by which the place of a still touch changes during a drive [mm]. larger: places jitter;
 * smaller: they stay wrong */
#define EITS_FAST_STILL_MM R(0.03)

/* the same while another touch slides [mm]. larger: still touches are dragged by one that slides
 * past; smaller: a touch that begins to slide beside another stays behind, and its strength moves
 * to the other */
#define EITS_FAST_BESIDE_MM R(0.3)

/* a touch that moves faster than this and is older than FAST_YOUNG slides [mm/s]. larger: as
 * FAST_BESIDE_MM smaller; smaller: still touches jitter */
#define EITS_FAST_SLIDES R(60.0)

/* a moving touch that moves by less in FAST_SLOW_DRIVES becomes still [mm]. larger: slow fingers
 * stand still; smaller: still touches are dragged by others that land */
#define EITS_FAST_SLOW_MM R(0.35)

/* this is examined after so many drives [drives]. larger: still touches are dragged; smaller: slow
 * fingers stand still */
#define EITS_FAST_SLOW_DRIVES 10

/* the last drives, one bit each: a moving touch stands still if all of them are unexplained [bits].
 * larger: a wrong speed carries it away; smaller: a swipe lags behind a touch that lands */
#define EITS_FAST_COASTS 15

/* the chi^2 of this many drives together may be news [drives]. larger: later; smaller: noise
 * waits */
#define EITS_FAST_SUM_DRIVES 8

/* it is news if it exceeds the number of rows by this; the model's error is learned below half of
 * it. larger: slow motion is seen late; smaller: noise waits */
#define EITS_FAST_SUM_MOST R(60.0)

/* a new touch must be this much further away from a wider touch [of a wider disc's end]. larger: a
 * finger beside a palm is rejected; smaller: touches at its rim */
#define EITS_FAST_APART_WIDE R(0.7)

/* a frame confirms a touch within this distance. If two frames in a row agree on a place further
 * away, the touch is moved there [mm]. larger: wrong places of drives stay; smaller: frames move
 * touches that drives had right */
#define EITS_FAST_AGREE_MM R(6.0)

/* a touch that is moved there also gets a speed if the two frames' places differ by more [mm].
 * larger: moving touches lag; smaller: still ones run away */
#define EITS_FAST_PUT_MOVES_MM R(2.0)

/* with this speed it has moved on for this long since the middle of the frame's scan [frames].
 * follows from the order of events: a frame's result is used when the next frame is complete */
#define EITS_FAST_PUT_AHEAD R(1.5)

/* standard deviation of that speed [mm/s]. as FAST_MOVED_DOUBT_SPEED */
#define EITS_FAST_PUT_SPEED R(100.0)

/* touches of two frames in a row within this distance are one touch that no drive has found [mm].
 * larger: two wrong frames make a touch; smaller: later starts */
#define EITS_FAST_SEED_REACH_MM R(8.0)

/* a still touch that moves by at least this from scan to scan [mm]. larger: slow fingers lag;
 * smaller: still touches are dragged */
#define EITS_FAST_CREEPS_MM R(0.5)

/* a moving touch that moves by less than this from scan to scan [mm]. larger: slow fingers lag;
 * smaller: still touches keep a speed, and are dragged */
#define EITS_FAST_RESTS_MM R(0.8)

/* in this many drives in a row, becomes a moving one, or a still one [drives]. as FAST_CREEPS_MM */
#define EITS_FAST_CREEPS 16

/* a soft disc that ends at this radius or further out is a palm [mm]. between FAST_RHO_WIDE_MM and
 * FAST_RHO_WIDER_MM */
#define EITS_FAST_PALM_MM R(25.0)

/* if a touch grew by more while a frame was scanned that drives do not explain, and the frame has
 * several touches about it, the frame shows the drives' touches [of its strength]. larger: a palm
 * that lands is several discs; smaller: fingers that land together come late */
#define EITS_FAST_GROWN R(0.3)

/* and if the chi^2 that it explains exceeds what is left of each drive by this factor. larger: as
 * FAST_GROWN; smaller: at 40 dB touches come late */
#define EITS_FAST_GROWN_ENERGY R(5.0)

/* a frame's touch with a greater radius is a palm [mm]. larger: a small palm is followed as a
 * finger; smaller: two fingers become a palm */
#define EITS_FAST_BROAD_MM R(17.0)

/* if it also explains more than this [of |y|^2]. larger: as FAST_BROAD_MM; smaller: a disc of a
 * palm that lands becomes the palm */
#define EITS_FAST_BROAD_SHARE R(0.8)

/* a frame's touch with less is one of the discs that the solver makes of a palm [of a palm's
 * strength]. larger: a light finger beside a palm is missed; smaller: touches at its rim */
#define EITS_FAST_PALM_REST R(0.1)

/* ---- Chosen: on tuning streams, whose seed and runs were not kept, for a whole-frame tracker that
 * smoothed places as well. Check: eitskin study hands */

/* a touch that only frames show and that explains less waits for a second frame: it may be half of
 * another [of |y|^2]. larger: light touches start late; smaller: halves are reported */
#define EITS_FAST_SURE_FRACTION R(0.05)

/* and so does one whose own S'y is less [lambda_noise]. larger: faint touches start late; smaller:
 * noise is reported at once */
#define EITS_FAST_SURE_CLEARNESS R(1.5)

/* so many frames in a row may lack a touch before its id ends [frames]. larger: another finger gets
 * its id; smaller: a faint touch loses its id */
#define EITS_FAST_SEEN_HOLD 2

/* a faint touch that was found in this many frames is reported while it is missed [frames]. larger:
 * faint touches flicker; smaller: noise is held */
#define EITS_FAST_SEEN_KNOWN 4

/* a touch that is not reported yet may move this far: noise is found anywhere, a touch near its
 * last place [of follow_mm]. larger: noise confirms noise; smaller: fast fingers start late */
#define EITS_FAST_SEEN_REACH R(0.6)

/* rms by which a velocity changes [of follow_mm a frame]. larger: places of noise turn it; smaller:
 * turns are followed late */
#define EITS_FAST_SEEN_CHANGE R(0.028)

/* rms of a new touch's velocity [of follow_mm a frame]. larger: the first two places decide it;
 * smaller: fast fingers are lost at first */
#define EITS_FAST_SEEN_SPEED R(0.12)

/* standard deviation of the place of a touch that is as clear as noise [pixels]. larger: velocities
 * follow late; smaller: noise makes velocities */
#define EITS_FAST_SEEN_NOISE R(0.66)

/* least standard deviation of a place [pixels]. larger: as FAST_SEEN_NOISE; smaller: the gain
 * follows rounding */
#define EITS_FAST_SEEN_DEVIATION R(0.01)

/* clang-format on */

#endif
