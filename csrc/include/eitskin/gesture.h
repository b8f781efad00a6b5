/* eitskin: events from touches in time: down, move, up, tap, double tap, hold, swipe, pinch,
 * spread, rotate.
 *
 * Each frame's tracked touches go in, in the frame's time; what happened comes out. The caller owns
 * the state, a plain struct; nothing is allocated. Sums have one order and no fma, so that a board,
 * a host and the numpy reference give the same bits. docs/guide/gestures.md says what makes each
 * gesture, zone.h which named zones are pressed.
 */
#ifndef EITSKIN_GESTURE_H
#define EITSKIN_GESTURE_H

#include "eitskin/diagnostics.h"
#include "eitskin/gesture_events.h"
#include "eitskin/options.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Fingers that are followed, those that have just lifted among them. */
#define EITS_MAX_CONTACTS 32u
/* A frame gives at most so many events: two of each finger, three of two fingers. */
#define EITS_MAX_EVENTS   67u
/* Places of a finger that its speed is taken from. */
#define EITS_TRAIL        8u

/* A finger from landing to lifting; of the library's own use. */
typedef struct eits_contact {
    uint32_t state;    /* 0: none; 1 new, not told, 2 down, 3 lifted */
    uint32_t id;       /* that events name */
    uint32_t touch_id; /* that the tracker gave it last */
    uint32_t flags;    /* csrc/src/gesture/contacts.h names them */
    uint32_t born_us, seen_us;
    uint32_t trail_count; /* the newest at (trail_count - 1) % EITS_TRAIL */
    uint32_t trail_us[EITS_TRAIL];
    eits_real trail_x_mm[EITS_TRAIL], trail_y_mm[EITS_TRAIL];
    eits_real x_mm, y_mm;           /* where it is */
    eits_real seen_x_mm, seen_y_mm; /* where it was last found, letting go or not */
    /* S/m mm2, smoothed, without its sign; and what part of the data the touch explains */
    eits_real strength, explained;
    eits_real start_x_mm, start_y_mm; /* where it landed */
    eits_real told_x_mm, told_y_mm;   /* where it was last told to be */
    eits_real farthest_mm;            /* from where it landed */
} eits_contact;

/* Two fingers that may do something together; of the library's own use. */
typedef struct eits_finger_pair {
    uint32_t on, first, second; /* places among the contacts */
    uint32_t first_id, second_id;
    uint32_t kind; /* eits_event_kind; 0: nothing yet */
    /* their distance when both were down, and how far they have turned since, counterclockwise */
    eits_real base_mm, turned_deg;
    eits_real dx_mm, dy_mm;      /* from the first to the second, when both were last seen */
    eits_real extreme_mm;        /* least distance of a pinch, greatest of a spread */
    eits_real told_mm, told_deg; /* as last reported */
} eits_finger_pair;

/* The whole state, 5,540 bytes in float32; a copy of it goes on by itself. Read it, leave changing
 * it to the functions below. */
typedef struct eits_gestures {
    eits_gesture_options options;
    eits_contact contact[EITS_MAX_CONTACTS];
    eits_finger_pair pair;
    uint32_t time_us, begun; /* of the last frame */
    uint32_t tapped, tap_us; /* 1: there was a tap, and when it ended */
    eits_real tap_x_mm, tap_y_mm;
    uint32_t dropped; /* events that found no room, and touches that no contact was left for */
} eits_gestures;

/* The usual options. Errors: EITS_E_ARGUMENT. */
eits_status eits_gestures_usual(eits_gesture_options *options);

/* Begin, no finger down; NULL: the usual options. Errors: EITS_E_ARGUMENT (a length or fraction is
 * below 0 or no number; the state is as before). */
eits_status eits_gestures_init(eits_gestures *gestures, const eits_gesture_options *options);

/* The touches of a frame, as eits_find_touches gives them with tracking on, at `time_us`, a clock
 * that may wrap. `told` events are written to `events`, which has `room`; more are counted in
 * `dropped`. A touch whose place or strength is no number is passed over. A frame of the same time
 * as the last gives nothing; after a long gap, or where time goes back, all fingers have lifted and
 * nothing is made of them. Frames that the core rejected are not given.
 * Errors: EITS_E_ARGUMENT (count above EITS_MAX_TOUCHES, a NULL). */
eits_status eits_gestures_update(eits_gestures *gestures, const eits_touch *touches, uint32_t count,
                                 uint32_t time_us, eits_event *events, uint32_t room,
                                 uint32_t *told);

#ifdef __cplusplus
}
#endif
#endif
