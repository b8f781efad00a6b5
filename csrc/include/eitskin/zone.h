/* eitskin: which named zones of the skin are pressed: keys, pads, rings.
 *
 * Made from the events of gesture.h, so that a host can do it with what a board sent. A finger that
 * lands or slides into a zone presses it; it is released when no finger is in it any more. Zones do
 * not cross: who makes them sees to that.
 */
#ifndef EITSKIN_ZONE_H
#define EITSKIN_ZONE_H

#include "eitskin/gesture.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Keys of a small keyboard; each costs 4 bytes of state. */
#define EITS_MAX_ZONES       64u
/* Two of each event: out of one zone and into another. */
#define EITS_MAX_ZONE_EVENTS (2u * EITS_MAX_EVENTS)

/* A polygon, a disc (inner_mm 0) or a ring. */
typedef struct eits_zone {
    const eits_real
        *corners_mm;  /* the caller's: corners x (x, y), either way round; no polygon: NULL */
    uint32_t corners; /* at least 3; no polygon: 0 */
    eits_real x_mm, y_mm, inner_mm, outer_mm; /* of a disc or ring */
} eits_zone;

/* State; the zones stay the caller's, and must stay where they are as long as it is used. */
typedef struct eits_zones {
    const eits_zone *zone;
    uint32_t count, dropped; /* events that found no room, fingers that no place was left for */
    struct {
        uint32_t id, zone; /* 0: none; zones count from 1 */
    } finger[EITS_MAX_CONTACTS];
    uint32_t presser[EITS_MAX_ZONES]; /* the finger that pressed it; 0: not pressed */
} eits_zones;

/* Begin, nothing pressed. Places are those of touches, in mm; corners on the edge count as inside
 * for one of two zones that share it. Errors: EITS_E_ARGUMENT (too many zones, fewer than 3
 * corners, a number that is none, radii that do not ascend from 0). */
eits_status eits_zones_init(eits_zones *zones, const eits_zone *zone, uint32_t count);

/* What a frame's `events` press and release, in their order. `told` are written to `out`, which has
 * `room`; more are counted in `dropped`. Errors: EITS_E_ARGUMENT (a NULL). */
eits_status eits_zones_update(eits_zones *zones, const eits_event *events, uint32_t count,
                              eits_event *out, uint32_t room, uint32_t *told);

#ifdef __cplusplus
}
#endif
#endif
