/* eitskin: events from touches in time: down, move, up, tap, double tap, hold, swipe, pinch,
 * spread, rotate.
 *
 * Call eits_gestures_update with the tracked touches of each frame and the frame's time; it reports
 * the events. The caller owns the state, a plain struct; nothing is allocated. Sums have one order
 * and no fma, so that boards and hosts give the same bits. docs/guide/gestures.md defines each
 * gesture; zone.h reports presses of named zones.
 */
#ifndef EITSKIN_GESTURE_H
#define EITSKIN_GESTURE_H

#include "eitskin/diagnostics.h"
#include "eitskin/gesture_events.h"
#include "eitskin/options.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Fingers that are tracked at the same time, including those that have just lifted. */
#define EITS_MAX_CONTACTS 32u
/* The most events of one frame: two per finger, and three of a pair of fingers. */
#define EITS_MAX_EVENTS   67u
/* Past places of a finger that are kept, to find its speed. */
#define EITS_TRAIL        8u

/* A finger from landing to lifting; for use inside the library. */
typedef struct eits_contact {
    uint32_t state;    /* 0: none; 1: new, not reported yet; 2: down; 3: lifted */
    uint32_t id;       /* by which events name it */
    uint32_t touch_id; /* the id of its touch in the last frame */
    uint32_t flags;    /* csrc/src/gesture/contacts.h names them */
    uint32_t born_us, seen_us;
    uint32_t trail_count; /* the newest at (trail_count - 1) % EITS_TRAIL */
    uint32_t trail_us[EITS_TRAIL];
    eits_real trail_x_mm[EITS_TRAIL], trail_y_mm[EITS_TRAIL];
    eits_real x_mm, y_mm;           /* where it is */
    eits_real seen_x_mm, seen_y_mm; /* where it was last found, letting go or not */
    /* strength in S mm2/m, smoothed, without its sign; fraction of the data that it explains */
    eits_real strength, explained;
    eits_real variance_mm2;           /* of its place when it was last found, x and y together */
    eits_real start_x_mm, start_y_mm; /* where it landed */
    eits_real reported_x_mm, reported_y_mm; /* the place that was last reported */
    eits_real farthest_mm;                  /* its greatest distance from where it landed */
} eits_contact;

/* Two fingers that may make a gesture together; for use inside the library. */
typedef struct eits_finger_pair {
    uint32_t on, first, second; /* places among the contacts */
    uint32_t first_id, second_id;
    uint32_t kind; /* eits_event_kind; 0: nothing yet */
    /* their distance when both were down, and how far they have turned since, counterclockwise */
    eits_real base_mm, turned_deg;
    eits_real base_mm2;     /* variance of that distance */
    eits_real dx_mm, dy_mm; /* from the first to the second, when both were last seen */
    eits_real extreme_mm;   /* least distance of a pinch, greatest of a spread */
    eits_real reported_mm, reported_deg; /* as last reported */
} eits_finger_pair;

/* The whole state, 5,672 bytes in float32. It has no pointers, so a copy works on its own. Programs
 * may read it; only the functions below change it. */
typedef struct eits_gestures {
    eits_gesture_options options;
    eits_contact contact[EITS_MAX_CONTACTS];
    eits_finger_pair pair;
    uint32_t time_us, begun; /* of the last frame */
    uint32_t tapped, tap_us; /* 1: there was a tap, and when it ended */
    eits_real tap_x_mm, tap_y_mm;
    uint32_t dropped; /* events beyond `room`, and touches beyond EITS_MAX_CONTACTS */
} eits_gestures;

/* The default options. Errors: EITS_E_ARGUMENT. */
eits_status eits_gestures_default(eits_gesture_options *options);

/* Begin with no finger down; `options` NULL stands for the default ones. Errors: EITS_E_ARGUMENT if
 * a length or fraction is below 0 or not finite; the state is then unchanged. */
eits_status eits_gestures_init(eits_gestures *gestures, const eits_gesture_options *options);

/* Take the `count` touches of a frame, as eits_find_touches reports them with tracking on, measured
 * at `time_us`, a clock that may wrap. Writes the frame's events to `events`, which has room for
 * `room`, and their number to `reported`; events beyond `room` are counted in `dropped`. Do not
 * call it for a frame that the core rejected. A touch whose place or strength is not finite is
 * ignored. A frame with the time of the last one gives no events. After a long gap, or if time goes
 * back, all fingers count as lifted, without a gesture. Errors: EITS_E_ARGUMENT (count above
 * EITS_MAX_TOUCHES, or NULL). */
eits_status eits_gestures_update(eits_gestures *gestures, const eits_touch *touches, uint32_t count,
                                 uint32_t time_us, eits_event *events, uint32_t room,
                                 uint32_t *reported);

#ifdef __cplusplus
}
#endif
#endif
