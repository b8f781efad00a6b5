/* Ids that follow touches from frame to frame. */
#include "check.h"
#include "dense.h"
#include "small_model.h"

#include "base/vec.h"
#include "eitskin/solve.h"
#include "eitskin/touch.h"
#include "touch/disc.h"

#include <math.h>
#include <string.h>

static dense_bench b;

static eits_context *set_up(dense_bench *b, double follow_mm)
{
    eits_context *ctx = dense_bench_open(b, (small_spec){.rank = 3, .side = 3}, 0);
    CHANGE_OPTIONS(ctx, o.follow_mm = (eits_real)follow_mm);
    return ctx;
}

static eits_touch at(double x, double y)
{
    return (eits_touch){.id = 77, .x_mm = (eits_real)x, .y_mm = (eits_real)y, .radius_mm = 9};
}

TEST(ids_follow_moves_and_not_jumps)
{
    eits_context *ctx = set_up(&b, 10);
    eits_touch t = at(0, 0);
    eits_track(ctx, &t, 1);
    CHECK_EQUAL(t.id, 1);
    for (int k = 1; k <= 20; ++k) { /* 9 mm a frame, far away from where it began */
        t = at(9 * k, 0);
        eits_track(ctx, &t, 1);
        CHECK_EQUAL(t.id, 1);
    }
    t = at(180 + 6, 8); /* just at the limit */
    eits_track(ctx, &t, 1);
    CHECK_EQUAL(t.id, 1);
    t = at(186 + 10.1, 8); /* and beyond it */
    eits_track(ctx, &t, 1);
    CHECK_EQUAL(t.id, 2);
    eits_track(ctx, NULL, 0); /* a frame without touches ends all */
    t = at(196.1, 8);
    eits_track(ctx, &t, 1);
    CHECK_EQUAL(t.id, 3);
    eits_forget(ctx);
    eits_track(ctx, &t, 1);
    CHECK_EQUAL(t.id, 4);
}

/* Two that pass each other: nearness says which is which, whatever the order in which they
 * are listed. */
TEST(crossing)
{
    eits_context *ctx = set_up(&b, 25);
    for (int k = 0; k <= 20; ++k) {
        const eits_touch right = at(-50 + 5 * k, 4), left = at(50 - 5 * k, -4);
        eits_touch both[2] = {k % 2 == 0 ? right : left, k % 2 == 0 ? left : right};
        eits_track(ctx, both, 2);
        CHECK_EQUAL(both[k % 2].id, 1);
        CHECK_EQUAL(both[1 - k % 2].id, 2);
    }
}

/* The nearest pairs first: the one that moved little keeps its id, though another is within reach
 * as well. */
TEST(nearest_first)
{
    eits_context *ctx = set_up(&b, 30);
    eits_touch first[3] = {at(0, 0), at(20, 0), at(40, 0)};
    eits_track(ctx, first, 3);
    CHECK(first[0].id == 1 && first[1].id == 2 && first[2].id == 3);
    eits_touch moved[3] = {at(12, 0), at(21, 0), at(90, 0)};
    eits_track(ctx, moved, 3);
    CHECK_EQUAL(moved[1].id, 2); /* 1 mm */
    CHECK_EQUAL(moved[0].id, 1); /* 12 mm to the first; to the second it would be 8 */
    CHECK_EQUAL(moved[2].id, 4); /* too far from the third */
    eits_touch fewer = at(88, 1);
    eits_track(ctx, &fewer, 1);
    CHECK_EQUAL(fewer.id, 4);
    eits_touch more[2] = {at(89, 1), at(87.5, 1)}; /* one splits: the nearer half keeps the id */
    eits_track(ctx, more, 2);
    CHECK(more[1].id == 4 && more[0].id == 5);
}

TEST(all_of_a_full_house)
{
    eits_context *ctx = set_up(&b, 5);
    uint32_t ids[EITS_MAX_TOUCHES];
    for (int round = 0; round < 5; ++round) {
        eits_touch t[EITS_MAX_TOUCHES];
        for (int k = 0; k < EITS_MAX_TOUCHES; ++k) {
            /* listed in another order each time */
            const int which = (k * 7 + round * 3) % EITS_MAX_TOUCHES;
            t[k] = at(20.0 * (which % 4) + 2 * round, 20.0 * (which / 4) - round);
        }
        eits_track(ctx, t, EITS_MAX_TOUCHES);
        for (int k = 0; k < EITS_MAX_TOUCHES; ++k) {
            const int which = (k * 7 + round * 3) % EITS_MAX_TOUCHES;
            if (round == 0)
                ids[which] = t[k].id;
            CHECK_EQUAL(t[k].id, ids[which]);
            for (int l = 0; l < k; ++l)
                CHECK(t[l].id != t[k].id);
        }
    }
    CHECK_EQUAL(ctx->tracker.next_id, EITS_MAX_TOUCHES + 1);
}

TEST(following_may_be_off)
{
    eits_context *ctx = set_up(&b, 0);
    eits_touch t = at(1, 2);
    eits_track(ctx, &t, 1);
    eits_track(ctx, &t, 1);
    CHECK_EQUAL(t.id, 1); /* it did not move at all */
    t.x_mm += R(0.01);
    eits_track(ctx, &t, 1);
    CHECK_EQUAL(t.id, 2);
}

TEST(zero_is_never_an_id)
{
    eits_context *ctx = set_up(&b, 5);
    ctx->tracker.next_id = UINT32_MAX - 1;
    eits_touch t[4] = {at(0, 0), at(50, 0), at(0, 50), at(50, 50)};
    eits_track(ctx, t, 4);
    CHECK(t[0].id == UINT32_MAX - 1 && t[1].id == UINT32_MAX && t[2].id == 1 && t[3].id == 2);
}

/* From data to ids: a disc that moves keeps its id, is lifted and comes back with a new one, jumps
 * and is another. */
TEST(through_the_whole_core)
{
    eits_context *ctx =
        dense_bench_open(&b, (small_spec){.rank = 64, .side = 20, .shape = SMALL_WAVES}, 0);
    static const struct {
        double x, y, change;
        uint32_t id;
    } frames[] = {{-40, 0, 0.05, 1}, {-25, 5, 0.05, 1}, {-10, 12, 0.05, 1},
                  {5, 10, 0.05, 1},  {20, -5, 0.05, 1}, {20, -5, 0, 0},
                  {20, -5, 0.05, 2}, {22, -6, 0.05, 2}, {-30, 30, 0.05, 3}};
    for (size_t k = 0; k < sizeof frames / sizeof frames[0]; ++k) {
        const eits_disc disc = {
            .x_mm = (eits_real)frames[k].x, .y_mm = (eits_real)frames[k].y, .radius_mm = 9};
        eits_real atom[64];
        eits_touch touch;
        uint32_t count;
        (void)eits_disc_atom(ctx, &ctx->scratch, &disc, atom, NULL);
        for (int i = 0; i < 64; ++i)
            ctx->frame.y[i] = (eits_real)frames[k].change * atom[i];
        CHECK_EQUAL(eits_solve(ctx, NULL), EITS_OK);
        CHECK_EQUAL(eits_find_touches(ctx, &touch, 1, &count), EITS_OK);
        CHECK_EQUAL(count, frames[k].change > 0);
        if (count == 0)
            continue;
        CHECK_EQUAL(touch.id, frames[k].id);
        CHECK_NEAR(hypot((double)touch.x_mm - frames[k].x, (double)touch.y_mm - frames[k].y), 0,
                   0.1);
    }
}

RUN_TESTS("touch ids", dense_bench_close(&b))
