/* Presses of named zones: borders, rings, slides, and what came over a link. */
#include "check.h"

#include "eitskin/zone.h"

#include <math.h>
#include <string.h>

static const eits_real LEFT[] = {0, 0, 20, 0, 20, 30, 0, 30},
                       RIGHT[] = {20, 30, 40, 30, 40, 0, 20, 0};

typedef struct bench {
    eits_zone zone[4];
    eits_zones state;
    eits_event out[8];
    uint32_t reported;
} bench;

static bench b;

/* Two keys that share an edge, the second the other way round; a pad; a ring. */
static void begin(bench *b)
{
    memset(b, 0, sizeof *b);
    b->zone[0] = (eits_zone){.corners_mm = LEFT, .corners = 4};
    b->zone[1] = (eits_zone){.corners_mm = RIGHT, .corners = 4};
    b->zone[2] = (eits_zone){.x_mm = 100, .outer_mm = 10};
    b->zone[3] = (eits_zone){.x_mm = -100, .inner_mm = 20, .outer_mm = 30};
    CHECK_OK(eits_zones_init(&b->state, b->zone, 4));
}

static void give(bench *b, eits_event_kind kind, uint32_t id, double x, double y)
{
    const eits_event event = {.kind = (uint32_t)kind,
                              .first_id = id,
                              .time_us = 5,
                              .x_mm = (eits_real)x,
                              .y_mm = (eits_real)y};
    CHECK_OK(eits_zones_update(&b->state, &event, 1, b->out, 8, &b->reported));
}

static void expect(const bench *b, uint32_t place, eits_event_kind kind, uint32_t zone)
{
    CHECK(b->reported > place);
    CHECK_EQUAL(b->out[place].kind, kind);
    CHECK_EQUAL(b->out[place].zone, zone);
    CHECK_EQUAL(b->out[place].time_us, 5);
}

TEST(a_key_is_pressed_and_released)
{
    begin(&b);
    give(&b, EITS_EVENT_DOWN, 1, 5, 5);
    CHECK_EQUAL(b.reported, 1);
    expect(&b, 0, EITS_EVENT_PRESS, 1);
    CHECK_EQUAL(b.out[0].phase, EITS_PHASE_BEGIN);
    CHECK_EQUAL(b.out[0].value, 0);
    give(&b, EITS_EVENT_MOVE, 1, 10, 5);
    give(&b, EITS_EVENT_TAP, 1, 10, 5);
    CHECK_EQUAL(b.reported, 0);
    give(&b, EITS_EVENT_UP, 1, 10, 5);
    CHECK_EQUAL(b.reported, 1);
    expect(&b, 0, EITS_EVENT_RELEASE, 1);
    give(&b, EITS_EVENT_UP, 1, 10, 5);
    give(&b, EITS_EVENT_DOWN, 2, -50, 50); /* in none */
    CHECK_EQUAL(b.reported, 0);
}

TEST(every_place_of_a_shared_edge_is_in_one_key)
{
    for (int k = 0; k <= 300; ++k) {
        begin(&b);
        give(&b, EITS_EVENT_DOWN, 1, 20, 0.1 * k);
        CHECK_EQUAL(b.reported, k < 300); /* the upper end is outside both */
    }
}

TEST(a_slide_changes_keys_once_it_is_clearly_over_the_border)
{
    begin(&b);
    give(&b, EITS_EVENT_DOWN, 1, 19, 5);
    give(&b, EITS_EVENT_MOVE, 1, 21.5, 5);
    CHECK_EQUAL(b.reported, 0);
    give(&b, EITS_EVENT_MOVE, 1, 22.5, 5);
    CHECK_EQUAL(b.reported, 2);
    expect(&b, 0, EITS_EVENT_RELEASE, 1);
    expect(&b, 1, EITS_EVENT_PRESS, 2);
    give(&b, EITS_EVENT_MOVE, 1, 60, 5);
    CHECK_EQUAL(b.reported, 1);
    expect(&b, 0, EITS_EVENT_RELEASE, 2);
}

TEST(two_fingers_in_a_zone_press_it_once)
{
    begin(&b);
    give(&b, EITS_EVENT_DOWN, 1, 95, 0);
    expect(&b, 0, EITS_EVENT_PRESS, 3);
    give(&b, EITS_EVENT_DOWN, 2, 105, 0);
    CHECK_EQUAL(b.reported, 0);
    give(&b, EITS_EVENT_UP, 1, 95, 0);
    CHECK_EQUAL(b.reported, 0);
    give(&b, EITS_EVENT_UP, 2, 105, 0);
    CHECK_EQUAL(b.reported, 1);
    expect(&b, 0, EITS_EVENT_RELEASE, 3);
    give(&b, EITS_EVENT_DOWN, 3, 110, 0); /* its rim is outside */
    CHECK_EQUAL(b.reported, 0);
    give(&b, EITS_EVENT_DOWN, 4, 112, 0);
    CHECK_EQUAL(b.reported, 0);
}

TEST(a_ring_says_where)
{
    begin(&b);
    give(&b, EITS_EVENT_DOWN, 1, -75, 0);
    expect(&b, 0, EITS_EVENT_PRESS, 4);
    CHECK_NEAR(b.out[0].value, 0, 1e-6);
    give(&b, EITS_EVENT_MOVE, 1, -100, 25);
    expect(&b, 0, EITS_EVENT_PRESS, 4);
    CHECK_EQUAL(b.out[0].phase, EITS_PHASE_CHANGE);
    CHECK_NEAR(b.out[0].value, 0.25, 1e-5);
    give(&b, EITS_EVENT_MOVE, 1, -125, -0.001);
    CHECK_NEAR(b.out[0].value, 0.5, 1e-4);
    give(&b, EITS_EVENT_MOVE, 1, -100, -25);
    CHECK_NEAR(b.out[0].value, 0.75, 1e-5);
    give(&b, EITS_EVENT_DOWN, 2, -100, 0); /* its hole */
    CHECK_EQUAL(b.reported, 0);
    give(&b, EITS_EVENT_DOWN, 3, -100, 20); /* the inner border is in */
    give(&b, EITS_EVENT_MOVE, 3, -100, 22);
    CHECK_EQUAL(b.reported, 0); /* the place is that of the first finger */
    give(&b, EITS_EVENT_MOVE, 1, -100, 0);
    CHECK_EQUAL(b.reported, 0); /* the other is still in it */
    give(&b, EITS_EVENT_MOVE, 3, -80, 22);
    expect(&b, 0, EITS_EVENT_PRESS, 4);
}

TEST(room_and_places_that_run_out_are_counted)
{
    begin(&b);
    const eits_event down = {.kind = EITS_EVENT_DOWN, .first_id = 1, .x_mm = 5, .y_mm = 5};
    CHECK_OK(eits_zones_update(&b.state, &down, 1, NULL, 0, &b.reported));
    CHECK_EQUAL(b.reported, 0);
    CHECK_EQUAL(b.state.dropped, 1);
    for (uint32_t id = 2; id <= EITS_MAX_CONTACTS; ++id)
        give(&b, EITS_EVENT_DOWN, id, 5, 5);
    CHECK_EQUAL(b.state.dropped, 1);
    give(&b, EITS_EVENT_DOWN, 99, 5, 5);
    CHECK_EQUAL(b.state.dropped, 2);
    give(&b, EITS_EVENT_UP, 99, 5, 5);
    CHECK_EQUAL(b.reported, 0);
}

TEST(what_a_link_may_bring_is_passed_over)
{
    begin(&b);
    give(&b, EITS_EVENT_DOWN, 0, 5, 5);
    CHECK_EQUAL(b.reported, 0);
    give(&b, EITS_EVENT_DOWN, 1, (double)NAN, 5);
    CHECK_EQUAL(b.reported, 0);
    give(&b, EITS_EVENT_DOWN, 1, 5, 1e30);
    give(&b, (eits_event_kind)4000, 1, 5, 5);
    CHECK_EQUAL(b.reported, 0);
    give(&b, EITS_EVENT_DOWN, 1, 5, 5);
    CHECK_EQUAL(b.reported, 1);
}

TEST(zones_that_cannot_be_are_refused)
{
    begin(&b);
    const eits_real bad[] = {0, 0, 1, 0, (eits_real)NAN, 3};
    const eits_zone wrong[] = {
        {.corners_mm = LEFT, .corners = 2}, {.corners_mm = bad, .corners = 3},
        {.corners = 4, .outer_mm = 3},      {.x_mm = (eits_real)INFINITY, .outer_mm = 3},
        {.inner_mm = -1, .outer_mm = 3},    {.inner_mm = 3, .outer_mm = 3},
        {.outer_mm = (eits_real)1e9}};
    for (size_t k = 0; IN_TABLE(k, wrong); ++k)
        CHECK_REFUSED(eits_zones_init(&b.state, &wrong[k], 1));
    CHECK_REFUSED(eits_zones_init(NULL, b.zone, 1));
    CHECK_REFUSED(eits_zones_init(&b.state, NULL, 1));
    CHECK_REFUSED(eits_zones_init(&b.state, b.zone, EITS_MAX_ZONES + 1));
    CHECK_OK(eits_zones_init(&b.state, NULL, 0));
    const eits_event e = {.kind = EITS_EVENT_DOWN, .first_id = 1};
    CHECK_OK(eits_zones_update(&b.state, &e, 1, b.out, 8, &b.reported));
    CHECK_EQUAL(b.reported, 0);
    CHECK_OK(eits_zones_update(&b.state, NULL, 0, b.out, 8, &b.reported));
    CHECK_REFUSED(eits_zones_update(NULL, &e, 1, b.out, 8, &b.reported));
    CHECK_REFUSED(eits_zones_update(&b.state, NULL, 1, b.out, 8, &b.reported));
    CHECK_REFUSED(eits_zones_update(&b.state, &e, 1, NULL, 8, &b.reported));
    CHECK_REFUSED(eits_zones_update(&b.state, &e, 1, b.out, 8, NULL));
}

RUN_TESTS("zones")
