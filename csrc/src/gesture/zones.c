/* Presses of zones: where each finger is, with a border that a finger at rest does not cross. */
#include "eitskin/zone.h"
#include "gesture/contacts.h"
#include "gesture/plane.h"

/* Outside, if only just: a place on the border that is not inside may not have the distance 0,
 * which means inside. */
static eits_real some(eits_real distance)
{
    return distance > R(1e-6) ? distance : R(1e-6);
}

/* Places are bounded, so that squares of distances stay finite in float32. */
static int is_zone(const eits_zone *z)
{
    if (z->corners_mm == NULL)
        return z->corners == 0 && eits_is_place(z->x_mm, z->y_mm) && z->inner_mm >= 0 &&
               z->outer_mm > z->inner_mm && z->outer_mm <= EITS_MAX_PLACE_MM;
    for (uint32_t k = 0; k < z->corners; ++k) {
        if (!eits_is_place(z->corners_mm[2 * (size_t)k], z->corners_mm[2 * (size_t)k + 1]))
            return 0;
    }
    return z->corners >= 3;
}

eits_status eits_zones_init(eits_zones *zones, const eits_zone *zone, uint32_t count)
{
    if (zones == NULL || count > EITS_MAX_ZONES || (zone == NULL && count > 0))
        return EITS_E_ARGUMENT;
    for (uint32_t k = 0; k < count; ++k) {
        if (!is_zone(&zone[k]))
            return EITS_E_ARGUMENT;
    }
    memset(zones, 0, sizeof *zones);
    /* in place: the corners stay the caller's, and cost no memory here */
    zones->zone = zone;
    zones->count = count;
    return EITS_OK;
}

/* ---- where a place lies ---- */

/* From (x, y) to the nearest point of the segment. */
static eits_real distance_to_edge(const eits_real *from, const eits_real *to, eits_real x,
                                  eits_real y)
{
    const eits_real ex = to[0] - from[0], ey = to[1] - from[1];
    const eits_real along = (x - from[0]) * ex + (y - from[1]) * ey, square = ex * ex + ey * ey;
    eits_real part = square > 0 ? along / square : 0;
    /* beyond either end the end itself is nearest; a segment without length is its first point */
    part = part > 0 ? (part < 1 ? part : 1) : 0;
    return eits_distance(x - (from[0] + part * ex), y - (from[1] + part * ey));
}

/* How far outside the polygon; 0 inside. A place on an edge that two polygons share is in one of
 * them: edges are taken from their lower end, whichever way round they are listed. */
static eits_real outside_polygon(const eits_zone *z, eits_real x, eits_real y)
{
    eits_real nearest = -1;
    int inside = 0;
    for (uint32_t k = 0; k < z->corners; ++k) {
        const eits_real *from = z->corners_mm + 2 * (size_t)k;
        const eits_real *to = z->corners_mm + 2 * (size_t)((k + 1) % z->corners);
        const eits_real *low = from[1] <= to[1] ? from : to, *high = low == from ? to : from;
        if ((low[1] > y) != (high[1] > y) &&
            x < (high[0] - low[0]) * (y - low[1]) / (high[1] - low[1]) + low[0])
            inside = !inside;
        const eits_real distance = distance_to_edge(low, high, x, y);
        nearest = nearest < 0 || distance < nearest ? distance : nearest;
    }
    return inside ? 0 : some(nearest);
}

/* 0 inside; a place on a ring's inner border is in it, one on the outer border is not. */
static eits_real outside(const eits_zone *z, eits_real x, eits_real y)
{
    if (z->corners_mm != NULL)
        return outside_polygon(z, x, y);
    const eits_real from = eits_distance(x - z->x_mm, y - z->y_mm);
    if (from >= z->outer_mm)
        return some(from - z->outer_mm);
    return from < z->inner_mm ? some(z->inner_mm - from) : 0;
}

/* The zone, from 1, that a finger is in, where it was in `before`; 0: in none. */
static uint32_t zone_at(const eits_zones *zones, uint32_t before, eits_real x, eits_real y)
{
    /* A finger at a border moves by the noise of its place: without this it would press and release
     * a key with every frame. */
    if (before != 0 && outside(&zones->zone[before - 1], x, y) <= EITS_ZONE_STAY_MM)
        return before;
    for (uint32_t k = 0; k < zones->count; ++k) {
        if (!(outside(&zones->zone[k], x, y) > 0))
            return k + 1;
    }
    return 0;
}

/* ---- fingers ---- */

/* The finger's place, else an empty one, else EITS_MAX_CONTACTS, which the caller counts as
 * dropped: no finger that is down loses its place to another. */
static uint32_t finger_of(eits_zones *zones, uint32_t id)
{
    uint32_t empty = EITS_MAX_CONTACTS;
    for (uint32_t k = 0; k < EITS_MAX_CONTACTS; ++k) {
        if (zones->finger[k].id == id)
            return k;
        if (zones->finger[k].id == 0 && empty == EITS_MAX_CONTACTS)
            empty = k;
    }
    return empty;
}

/* An event of a zone is the finger's own event with the zone's name. On a ring it says where as
 * well, as part of a turn counterclockwise from x, for dials. */
static void report_zone(const eits_zones *zones, const eits_event *cause, uint32_t kind,
                        uint32_t phase, uint32_t zone, event_list *out)
{
    eits_event event = *cause;
    const eits_zone *z = &zones->zone[zone - 1];
    event.kind = kind;
    event.phase = phase;
    event.zone = zone;
    event.value = 0;
    if (kind == EITS_EVENT_PRESS && z->corners_mm == NULL && z->inner_mm > 0) {
        const eits_real turn = eits_angle_deg(event.y_mm - z->y_mm, event.x_mm - z->x_mm);
        event.value = (turn < 0 ? turn + 360 : turn) / 360;
    }
    eits_report(out, event);
}

/* A finger has left: the zone is released, or is another's that is in it. */
static void leave(eits_zones *zones, uint32_t place, const eits_event *cause, event_list *out)
{
    const uint32_t zone = zones->finger[place].zone, id = zones->finger[place].id;
    zones->finger[place].zone = 0;
    if (zone == 0 || zones->presser[zone - 1] != id)
        return;
    zones->presser[zone - 1] = 0;
    for (uint32_t k = 0; k < EITS_MAX_CONTACTS; ++k) {
        if (zones->finger[k].zone == zone)
            zones->presser[zone - 1] = zones->finger[k].id;
    }
    if (zones->presser[zone - 1] == 0)
        report_zone(zones, cause, EITS_EVENT_RELEASE, EITS_PHASE_ONCE, zone, out);
}

/* A second finger in a pressed zone presses nothing: whoever presses keys wants one event. */
static void enter(eits_zones *zones, uint32_t place, uint32_t zone, const eits_event *cause,
                  event_list *out)
{
    zones->finger[place].zone = zone;
    if (zone == 0 || zones->presser[zone - 1] != 0)
        return;
    zones->presser[zone - 1] = zones->finger[place].id;
    report_zone(zones, cause, EITS_EVENT_PRESS, EITS_PHASE_BEGIN, zone, out);
}

/* Leave before enter, so that a finger that slides never holds two zones. */
static void move(eits_zones *zones, const eits_event *event, event_list *out)
{
    const uint32_t place = finger_of(zones, event->first_id);
    if (place == EITS_MAX_CONTACTS) {
        ++zones->dropped;
        return;
    }
    zones->finger[place].id = event->first_id;
    const uint32_t before = zones->finger[place].zone;
    const uint32_t zone = zone_at(zones, before, event->x_mm, event->y_mm);
    if (zone != before) {
        leave(zones, place, event, out);
        enter(zones, place, zone, event, out);
    } else if (zone != 0 && zones->presser[zone - 1] == event->first_id &&
               zones->zone[zone - 1].inner_mm > 0) {
        report_zone(zones, event, EITS_EVENT_PRESS, EITS_PHASE_CHANGE, zone, out);
    }
}

static void lift(eits_zones *zones, const eits_event *event, event_list *out)
{
    const uint32_t place = finger_of(zones, event->first_id);
    if (place == EITS_MAX_CONTACTS || zones->finger[place].id != event->first_id)
        return;
    leave(zones, place, event, out);
    zones->finger[place].id = 0;
}

eits_status eits_zones_update(eits_zones *zones, const eits_event *events, uint32_t count,
                              eits_event *out, uint32_t room, uint32_t *reported)
{
    if (zones == NULL || reported == NULL || (events == NULL && count > 0) ||
        (out == NULL && room > 0))
        return EITS_E_ARGUMENT;
    event_list list = {.events = out, .room = room, .dropped = &zones->dropped};
    for (uint32_t k = 0; k < count; ++k) {
        const eits_event *event = &events[k];
        /* an event that came over a link may hold anything */
        if (event->first_id == 0 || !eits_is_place(event->x_mm, event->y_mm))
            continue;
        if (event->kind == EITS_EVENT_DOWN || event->kind == EITS_EVENT_MOVE)
            move(zones, event, &list);
        else if (event->kind == EITS_EVENT_UP)
            lift(zones, event, &list);
    }
    *reported = list.count;
    return EITS_OK;
}
