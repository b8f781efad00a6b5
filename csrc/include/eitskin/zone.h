/* eitskin: which named zones of the skin are pressed: keys, pads, rings.
 *
 * Presses are found from the events of gesture.h, so that a host can find them from what a board
 * sent. A finger that lands in a zone or slides into it presses it. The zone is released when no
 * finger is in it any more. Zones must not overlap; eits_zones_init does not check that.
 */
#ifndef EITSKIN_ZONE_H
#define EITSKIN_ZONE_H

#include "eitskin/gesture.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Enough for a small keyboard; each zone costs 4 bytes of state. */
#define EITS_MAX_ZONES       64u
/* Each event may cause two: one zone is released and another pressed. */
#define EITS_MAX_ZONE_EVENTS (2u * EITS_MAX_EVENTS)

/* A polygon, a disc (inner_mm 0) or a ring. */
typedef struct eits_zone {
    const eits_real
        *corners_mm;  /* corners x (x, y), in either sense; the caller's memory. NULL: no polygon */
    uint32_t corners; /* at least 3; 0: no polygon */
    eits_real x_mm, y_mm, inner_mm, outer_mm; /* of a disc or ring */
} eits_zone;

/* The state. It points to the caller's zones, which must stay in place as long as it is used. */
typedef struct eits_zones {
    const eits_zone *zone;
    uint32_t count;   /* of zones */
    uint32_t dropped; /* events beyond `room`, and fingers beyond EITS_MAX_CONTACTS */
    struct {
        uint32_t id, zone; /* 0: none; zones count from 1 */
    } finger[EITS_MAX_CONTACTS];
    uint32_t presser[EITS_MAX_ZONES]; /* the finger that pressed it; 0: not pressed */
} eits_zones;

/* Begin with no zone pressed. Places are in the touches' coordinates, mm. A place on an edge that
 * two zones share is inside one of them. Errors: EITS_E_ARGUMENT (too many zones, fewer than 3
 * corners, a number that is not finite, or radii that do not ascend from 0). */
eits_status eits_zones_init(eits_zones *zones, const eits_zone *zone, uint32_t count);

/* Report the presses and releases that a frame's `count` events cause, in their order: into `out`,
 * which has room for `room`, and their number into `reported`. Those beyond `room` are counted in
 * `dropped`. Errors: EITS_E_ARGUMENT (NULL). */
eits_status eits_zones_update(eits_zones *zones, const eits_event *events, uint32_t count,
                              eits_event *out, uint32_t room, uint32_t *reported);

#ifdef __cplusplus
}
#endif
#endif
