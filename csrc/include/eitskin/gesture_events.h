/* eitskin: events from touches in time: their kinds, and the content of an event.
 *
 * gesture.h makes events from tracked touches; zone.h makes presses of named zones from events.
 * Numbers never get another meaning.
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
    /* a finger moved by move_mm or more since it was last reported */
    EITS_EVENT_MOVE = 2,
    /* a finger lifted */
    EITS_EVENT_UP = 3,
    /* a finger landed and lifted at one place within a short time */
    EITS_EVENT_TAP = 4,
    /* a second tap at the same place, soon after the first; reported in place of its TAP */
    EITS_EVENT_DOUBLE_TAP = 5,
    /* a finger has stayed at one place for a long time */
    EITS_EVENT_HOLD = 6,
    /* a finger moved straight, and lifted while it moved */
    EITS_EVENT_SWIPE = 7,
    /* two fingers approach each other */
    EITS_EVENT_PINCH = 8,
    /* two fingers move apart */
    EITS_EVENT_SPREAD = 9,
    /* two fingers turn around each other */
    EITS_EVENT_ROTATE = 10,
    /* a finger is in a named zone; in a ring, the event also reports where */
    EITS_EVENT_PRESS = 11,
    /* no finger is in the zone any more */
    EITS_EVENT_RELEASE = 12
} eits_event_kind;

/* The phase of a gesture that an event reports. */
typedef enum eits_event_phase {
    /* the whole gesture, in one event */
    EITS_PHASE_ONCE = 0,
    /* the gesture was recognised, and continues */
    EITS_PHASE_BEGIN = 1,
    /* it continues, with another value */
    EITS_PHASE_CHANGE = 2,
    /* it ended: one of its fingers lifted */
    EITS_PHASE_END = 3
} eits_event_phase;

/* One event. Fields that do not belong to its kind are 0. */
typedef struct eits_event {
    /* eits_event_kind */
    uint32_t kind;
    /* eits_event_phase */
    uint32_t phase;
    /* id that the touch had when it landed */
    uint32_t first_id;
    /* id of the second of two fingers; 0 for gestures of one finger */
    uint32_t second_id;
    /* for PRESS and RELEASE, the zone's place in the list, from 1; else 0 */
    uint32_t zone;
    /* time of the frame that shows it, on the clock of the caller */
    uint32_t time_us;
    /* place of the event; for TAP, DOUBLE_TAP and HOLD where the finger landed, for two fingers
     * their middle */
    eits_real x_mm;
    eits_real y_mm;
    /* direction of a swipe, 0 to 360: 0 along x, 90 along y */
    eits_real direction_deg;
    /* SWIPE: length in mm; PINCH, SPREAD: distance of the fingers over that at the beginning;
     * ROTATE: degrees, positive from x to y; PRESS in a ring: the turn from x, 0 to 1 */
    eits_real value;
} eits_event;

/* Limits of the gestures. eits_gestures_default fills them in; tables/constants.toml has the
 * reasons. */
typedef struct eits_gesture_options {
    /* a finger that is not found for this long has lifted */
    uint32_t lost_us;
    /* a finger that is found again within this time, and within rejoin_mm, is the same one */
    uint32_t rejoin_us;
    /* a touch is reported once it has lasted this long; its place at that time is where it
     * landed */
    uint32_t settle_us;
    /* an uncertain touch is reported once it has lasted this long */
    uint32_t doubt_us;
    /* a tap shorter than this is reported only if its touch is clear */
    uint32_t short_us;
    /* longest time of a tap */
    uint32_t tap_us;
    /* longest time from the end of a tap to the beginning of the second one */
    uint32_t double_us;
    /* a hold is reported after this time */
    uint32_t hold_us;
    /* longest time of a swipe */
    uint32_t swipe_us;
    /* the time before its end over which a swipe's speed is measured */
    uint32_t speed_us;
    /* see rejoin_us */
    eits_real rejoin_mm;
    /* smallest step that a MOVE or a CHANGE reports */
    eits_real move_mm;
    /* greatest distance of a tap or hold from where it landed */
    eits_real still_mm;
    /* greatest distance between the two taps of a double tap */
    eits_real double_mm;
    /* shortest swipe */
    eits_real swipe_mm;
    /* lowest speed at the end of a swipe */
    eits_real swipe_mm_per_s;
    /* two fingers pinch, spread or turn once they have moved this far in total */
    eits_real pair_mm;
    /* a touch that appears this near to another one is uncertain */
    eits_real split_mm;
    /* a touch with less than this fraction of another's strength is uncertain, too */
    eits_real faint;
    /* a finger with less than this fraction of its last strength is letting go */
    eits_real firm;
    /* a touch that explains at least this fraction of the data is clear */
    eits_real clear;
} eits_gesture_options;

#ifdef __cplusplus
}
#endif
#endif
