/* eitskin: events from touches in time: their kinds, and what one says.
 *
 * gesture.h makes them from tracked touches, zone.h from events and named zones. Numbers never get
 * another meaning.
 *
 * Written by tables/make_tables.py from tables/gestures.toml.
 */
#ifndef EITSKIN_GESTURE_EVENTS_H
#define EITSKIN_GESTURE_EVENTS_H

#include "eitskin/types.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Kinds of events. */
typedef enum eits_event_kind {
    /* a finger landed */
    EITS_EVENT_DOWN = 1,
    /* it moved by move_mm or more since it was last reported */
    EITS_EVENT_MOVE = 2,
    /* it lifted */
    EITS_EVENT_UP = 3,
    /* down and up at one place within a short time */
    EITS_EVENT_TAP = 4,
    /* a second tap at the same place soon after the first, in place of its TAP */
    EITS_EVENT_DOUBLE_TAP = 5,
    /* it has been down at one place for a long time */
    EITS_EVENT_HOLD = 6,
    /* it moved straight and lifted while it moved */
    EITS_EVENT_SWIPE = 7,
    /* two fingers come near one another */
    EITS_EVENT_PINCH = 8,
    /* two fingers go apart */
    EITS_EVENT_SPREAD = 9,
    /* two fingers turn about one another */
    EITS_EVENT_ROTATE = 10,
    /* a finger is in a named zone; of a ring it also says where */
    EITS_EVENT_PRESS = 11,
    /* no finger is in the zone any more */
    EITS_EVENT_RELEASE = 12
} eits_event_kind;

/* The phase of a gesture that an event reports. */
typedef enum eits_event_phase {
    /* all of it */
    EITS_PHASE_ONCE = 0,
    /* it was recognised and goes on */
    EITS_PHASE_BEGIN = 1,
    /* it goes on with another value */
    EITS_PHASE_CHANGE = 2,
    /* a finger of it lifted */
    EITS_PHASE_END = 3
} eits_event_phase;

/* One event. What does not belong to its kind is 0. */
typedef struct eits_event {
    /* eits_event_kind */
    uint32_t kind;
    /* eits_event_phase */
    uint32_t phase;
    /* of the touch, as it was when it landed */
    uint32_t first_id;
    /* of two fingers the second; else 0 */
    uint32_t second_id;
    /* of PRESS and RELEASE: the zone's place in the list, from 1; else 0 */
    uint32_t zone;
    /* of the frame that shows it, on the clock that the caller gave */
    uint32_t time_us;
    /* where: of a tap and hold where it landed, of two fingers their middle */
    eits_real x_mm;
    eits_real y_mm;
    /* of a swipe, 0 to 360: 0 along x, 90 along y */
    eits_real direction_deg;
    /* SWIPE: mm; PINCH, SPREAD: distance over that at the beginning; ROTATE: degrees, from x to y
     * above 0; PRESS in a ring: turn from x, 0 to 1 */
    eits_real value;
} eits_event;

/* Limits of the gestures. eits_gestures_default fills it in; tables/constants.toml has the
 * reasons. */
typedef struct eits_gesture_options {
    /* a finger that is not found for so long has lifted */
    uint32_t lost_us;
    /* one that is found again within so long, and near, is the same */
    uint32_t rejoin_us;
    /* a touch is reported once it has lasted so long: where it is then is where it landed */
    uint32_t settle_us;
    /* a doubtful touch is reported once it has lasted so long */
    uint32_t doubt_us;
    /* a shorter tap must be clear */
    uint32_t short_us;
    /* a tap lasts at most so long */
    uint32_t tap_us;
    /* from a tap's end to the next one's beginning, at most */
    uint32_t double_us;
    /* a hold is reported after so long */
    uint32_t hold_us;
    /* a swipe lasts at most so long */
    uint32_t swipe_us;
    /* its speed at the end is that of the last so many */
    uint32_t speed_us;
    /* see rejoin_us */
    eits_real rejoin_mm;
    /* least step that a MOVE or a CHANGE reports */
    eits_real move_mm;
    /* a tap or hold stays within so far of where it landed */
    eits_real still_mm;
    /* two taps are a double tap within so far */
    eits_real double_mm;
    /* least length of a swipe */
    eits_real swipe_mm;
    /* least speed at its end */
    eits_real swipe_mm_per_s;
    /* two fingers pinch, spread or turn once they have moved so far in all */
    eits_real pair_mm;
    /* a touch that appears so near another is doubtful */
    eits_real split_mm;
    /* so is one of less than this fraction of another's strength */
    eits_real faint;
    /* with less than this fraction of its last strength a finger is letting go */
    eits_real firm;
    /* a touch that explains so much of the data is clear */
    eits_real clear;
} eits_gesture_options;

#ifdef __cplusplus
}
#endif
#endif
