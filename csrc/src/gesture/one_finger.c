/* Tap, double tap, hold and swipe: the gestures of a single finger. */
#include "gesture/one_finger.h"

#include "gesture/plane.h"

/* Events carry the place at which the finger landed: a finger that lifts shifts its measured place,
 * and the user tapped where the finger was put down. */
static eits_event event_at(const eits_gestures *g, const eits_contact *c, uint32_t kind)
{
    return (eits_event){.kind = kind,
                        .first_id = c->id,
                        .time_us = g->time_us,
                        .x_mm = c->start_x_mm,
                        .y_mm = c->start_y_mm};
}

/* Report a tap or a double tap. The first tap is reported at once and is not taken back: waiting
 * for a second one would delay every tap. */
static void tap(eits_gestures *g, eits_contact *c, event_list *out)
{
    const int again = g->tapped && c->born_us - g->tap_us <= g->options.double_us &&
                      eits_distance(c->start_x_mm - g->tap_x_mm, c->start_y_mm - g->tap_y_mm) <=
                          g->options.double_mm;
    eits_report(out, event_at(g, c, again ? EITS_EVENT_DOUBLE_TAP : EITS_EVENT_TAP));
    c->flags |= CONTACT_TAPPED;
    g->tapped = !again; /* a third tap begins a new pair */
    g->tap_us = c->seen_us;
    g->tap_x_mm = c->start_x_mm;
    g->tap_y_mm = c->start_y_mm;
}

/* Returns the finger's speed over the last speed_us, or over the known time if that is shorter;
 * mm/s.
 *
 * Times are subtracted as unsigned numbers, so that the board's clock may wrap. */
static eits_real last_speed(const eits_gestures *g, const eits_contact *c)
{
    const uint32_t known = c->trail_count < EITS_TRAIL ? c->trail_count : EITS_TRAIL;
    uint32_t at = (c->trail_count - 1) % EITS_TRAIL;
    const uint32_t last_us = c->trail_us[at];
    for (uint32_t back = 1; back < known; ++back) {
        const uint32_t before = (c->trail_count - 1 - back) % EITS_TRAIL;
        if (last_us - c->trail_us[before] > g->options.speed_us)
            break;
        at = before;
    }
    const uint32_t span_us = last_us - c->trail_us[at];
    /* with one point, or two at one instant, the speed is unknown; 0 then makes it no swipe */
    if (span_us == 0)
        return 0;
    return eits_distance(c->x_mm - c->trail_x_mm[at], c->y_mm - c->trail_y_mm[at]) /
           ((eits_real)span_us * R(1e-6));
}

/* Report a swipe if the way is long and fast enough for one. */
static int is_swipe(const eits_gestures *g, eits_contact *c, eits_real dx, eits_real dy,
                    eits_real speed, event_list *out)
{
    const eits_real length = eits_distance(dx, dy), angle = eits_angle_deg(dy, dx);
    /* the finger moved for settle_us before the touch was reported */
    const eits_real before = speed * (eits_real)g->options.settle_us * R(1e-6);
    if (length + before < g->options.swipe_mm || speed < g->options.swipe_mm_per_s ||
        length < EITS_SWIPE_STRAIGHT * c->farthest_mm)
        return 0;
    eits_event event = event_at(g, c, EITS_EVENT_SWIPE);
    event.direction_deg = angle < 0 ? angle + 360 : angle;
    event.value = length;
    c->flags |= CONTACT_DONE;
    eits_report(out, event);
    return 1;
}

/* Returns the way of a finger from where the first frame showed it to where the last one did, if it
 * was there no longer than a tap; else 0. */
static eits_real quick_way(const eits_gestures *g, const eits_contact *c)
{
    if (c->trail_count > EITS_TRAIL || c->seen_us - c->born_us > g->options.tap_us)
        return 0;
    return eits_distance(c->seen_x_mm - c->trail_x_mm[0], c->seen_y_mm - c->trail_y_mm[0]);
}

/* Report a swipe. A quick swipe is over before three frames show it; then the frame in which the
 * finger landed counts, and that in which it lifts. */
static void swipe(const eits_gestures *g, eits_contact *c, event_list *out)
{
    const eits_real way_mm = quick_way(g, c);
    if (!is_swipe(g, c, c->x_mm - c->start_x_mm, c->y_mm - c->start_y_mm, last_speed(g, c), out) &&
        way_mm > 2 * g->options.still_mm && c->seen_us != c->trail_us[0])
        (void)is_swipe(g, c, c->seen_x_mm - c->trail_x_mm[0], c->seen_y_mm - c->trail_y_mm[0],
                       way_mm / ((eits_real)(c->seen_us - c->trail_us[0]) * R(1e-6)), out);
}

/* Returns 1 if another finger came no later and stayed at least as long: then this one is not
 * alone, or is an artefact of the other's landing. */
static int is_outlived(const eits_gestures *g, const eits_contact *c)
{
    for (uint32_t k = 0; k < EITS_MAX_CONTACTS; ++k) {
        const eits_contact *other = &g->contact[k];
        if (other != c && (other->state == CONTACT_DOWN || other->state == CONTACT_LIFTED) &&
            g->time_us - other->seen_us <= g->time_us - c->seen_us &&
            g->time_us - other->born_us >= g->time_us - c->born_us)
            return 1;
    }
    return 0;
}

void eits_lifted(eits_gestures *g, eits_contact *c, event_list *out)
{
    const uint32_t lasted_us = c->seen_us - c->born_us;
    if (is_outlived(g, c))
        return;
    if ((c->flags & (CONTACT_WITH | CONTACT_DONE | CONTACT_TAPPED)) == 0 &&
        c->farthest_mm <= g->options.still_mm && quick_way(g, c) <= 2 * g->options.still_mm &&
        (lasted_us >= g->options.short_us || c->explained >= g->options.clear) &&
        lasted_us <= g->options.tap_us)
        tap(g, c, out);
    else if ((c->flags & (CONTACT_WITH | CONTACT_DONE)) == 0 && lasted_us <= g->options.swipe_us)
        swipe(g, c, out);
}

/* A hold is reported while the finger is down, since the user waits for it. It therefore has a step
 * of its own, which also runs for frames in which nothing has changed. */
void eits_hold(eits_gestures *g, event_list *out)
{
    for (uint32_t k = 0; k < EITS_MAX_CONTACTS; ++k) {
        eits_contact *c = &g->contact[k];
        if (c->state != CONTACT_DOWN || (c->flags & (CONTACT_WITH | CONTACT_DONE)) != 0 ||
            g->time_us - c->born_us < g->options.hold_us || c->farthest_mm > g->options.still_mm)
            continue;
        c->flags |= CONTACT_DONE;
        eits_event event = event_at(g, c, EITS_EVENT_HOLD);
        event.value = (eits_real)(g->time_us - c->born_us) * R(1e-6);
        eits_report(out, event);
    }
}
