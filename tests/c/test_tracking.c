/* Touches followed in time: tracks that start once confirmed and end after the hold, places
 * smoothed. */
#include "steps.h"

#include "touch/disc.h"

static dense_bench b;

/* A 120 mm square around the origin; a frame whose S'y is ten times that of noise. */
static eits_context *set_up(dense_bench *b, uint32_t confirm, uint32_t hold, double smooth)
{
    eits_context *ctx = dense_bench_open(b, (small_spec){.rank = 8, .side = 20}, 0);
    CHANGE_OPTIONS(ctx, o.track_confirm = confirm, o.track_hold = hold,
                   o.track_smooth = (eits_real)smooth);
    ctx->info.lambda_max = 10;
    ctx->info.lambda_noise = 1;
    return ctx;
}

/* Its own S'y is 10 sqrt(explained) times the noise's: faint from 0.009 down; above 0.05 a start
 * is sure. */
static eits_touch at(double x, double y, double explained)
{
    return (eits_touch){.x_mm = (eits_real)x,
                        .y_mm = (eits_real)y,
                        .radius_mm = 9,
                        .strength_s_per_m_mm2 = 1,
                        .explained = (eits_real)explained};
}

static uint32_t none(eits_context *ctx, eits_touch *reported)
{
    return eits_track(ctx, reported, 0);
}

static uint32_t one_along_y(eits_context *ctx, eits_touch *reported, double y, double explained)
{
    reported[0] = at(0, y, explained);
    return eits_track(ctx, reported, 1);
}

static uint32_t one(eits_context *ctx, eits_touch *reported, double x, double explained)
{
    reported[0] = at(x, 0, explained);
    return eits_track(ctx, reported, 1);
}

/* Sure ones at once, others once they were found as often as is asked, on end. */
TEST(tracks_start_once_confirmed)
{
    eits_touch t[EITS_MAX_TOUCHES];
    eits_context *ctx = set_up(&b, 3, 0, 0);
    CHECK_EQUAL(one(ctx, t, 0, 0.5), 1);
    CHECK_EQUAL(t[0].id, 1);
    eits_forget(ctx);
    for (int round = 0; round < 3; ++round) { /* a flicker is never reported, and takes no id */
        CHECK_EQUAL(one(ctx, t, 0, 0.005), 0);
        CHECK_EQUAL(one(ctx, t, 1, 0.005), 0);
        CHECK_EQUAL(none(ctx, t), 0);
    }
    CHECK_EQUAL(one(ctx, t, 0, 0.005), 0);
    CHECK_EQUAL(one(ctx, t, 1, 0.005), 0);
    CHECK_EQUAL(one(ctx, t, 2, 0.005), 1);
    CHECK(t[0].id == 2 && t[0].x_mm == 2);
    CHECK_EQUAL(one(ctx, t, 3, 0.005), 1); /* from then on at once */
    eits_forget(ctx);
    CHECK_EQUAL(one(ctx, t, 0, 0.04), 0); /* clear, but perhaps a part of another */
    CHECK_EQUAL(one(ctx, t, 0, 0.06), 1); /* it was that touch itself: no need to wait */
    CHECK_EQUAL(t[0].id, 3);
    eits_forget(ctx);
    ctx->info.lambda_noise = 5; /* a large fraction of a frame that is little more than noise */
    CHECK_EQUAL(one(ctx, t, 0, 0.2), 0);
    eits_forget(ctx);
    ctx->info.lambda_noise = 2; /* 1.2 times noise: not faint, and not sure either */
    CHECK_EQUAL(one(ctx, t, 0, 0.06), 0);
    eits_forget(ctx);
    ctx->info.lambda_noise = 0; /* unknown: nothing is tentative for it */
    CHECK_EQUAL(one(ctx, t, 60, 0.2), 1);
}

/* A track_start has to be found again near by; one that is known may move further. */
TEST(reach)
{
    eits_touch t[EITS_MAX_TOUCHES];
    eits_context *ctx = set_up(&b, 2, 0, 0); /* follow_mm 25 */
    CHECK_EQUAL(one(ctx, t, 0, 0.005), 0);
    CHECK_EQUAL(one(ctx, t, 15.1, 0.005), 0);
    CHECK_EQUAL(one(ctx, t, 0.2, 0.005), 1);
    CHECK_EQUAL(one(ctx, t, 25.1, 0.005), 1);
    CHECK_EQUAL(t[0].id, 1);
    /* nearer to the known touch than its own finger: the known one chooses first */
    t[0] = at(27, 0, 0.005);
    t[1] = at(0, 30, 0.005);
    CHECK_EQUAL(eits_track(ctx, t, 2), 1);
    t[0] = at(0, 30, 0.005);
    t[1] = at(27, 0, 0.5);
    CHECK_EQUAL(eits_track(ctx, t, 2), 2);
    CHECK(t[0].id == 2 && t[1].id == 1);
}

/* A clear touch that is lifted is gone at once, though its id is kept for a while; a faint one is
 * reported meanwhile. */
TEST(tracks_end_after_the_hold)
{
    eits_touch t[EITS_MAX_TOUCHES];
    eits_context *ctx = set_up(&b, 2, 2, 0);
    for (int k = 0; k < 10; ++k)
        CHECK_EQUAL(one(ctx, t, 0, 0.5), 1);
    CHECK_EQUAL(none(ctx, t), 0);
    CHECK_EQUAL(none(ctx, t), 0);
    CHECK_EQUAL(one(ctx, t, 5, 0.005), 1); /* known, so that there is no doubt */
    CHECK_EQUAL(t[0].id, 1);
    CHECK_EQUAL(none(ctx, t), 1);
    CHECK(t[0].id == 1 && t[0].x_mm == 5 && t[0].explained == 0 && t[0].strength_s_per_m_mm2 == 1 &&
          t[0].radius_mm == 9);
    CHECK_EQUAL(none(ctx, t), 1);
    CHECK_EQUAL(none(ctx, t), 0);
    CHECK_EQUAL(one(ctx, t, 5, 0.5), 1); /* too late: another */
    CHECK_EQUAL(t[0].id, 2);
    eits_forget(ctx);
    /* reported in the second, third and fourth: not known long enough before that */
    for (int k = 0; k < 4; ++k)
        CHECK_EQUAL(one(ctx, t, 0, 0.005), k > 0);
    CHECK_EQUAL(t[0].id, 3);
    CHECK_EQUAL(none(ctx, t), 1);
    eits_forget(ctx); /* no ghost afterwards */
    CHECK_EQUAL(none(ctx, t), 0);
    for (int k = 0; k < 3; ++k)
        CHECK_EQUAL(one(ctx, t, 0, 0.005), k > 0);
    CHECK_EQUAL(none(ctx, t), 0); /* found three times only: it may have been noise */
    CHECK_EQUAL(one(ctx, t, 0, 0.005), 1);
    CHECK_EQUAL(t[0].id, 4);
}

/* Held touches never take the place of found ones. */
TEST(a_full_house)
{
    eits_touch t[EITS_MAX_TOUCHES];
    eits_context *ctx = set_up(&b, 0, 5, 0);
    for (int round = 0; round < 5; ++round) {
        for (int k = 0; k < EITS_MAX_TOUCHES; ++k)
            t[k] = at(30.0 * (k % 4) - 45, 30.0 * (k / 4) - 45, 0.005);
        CHECK_EQUAL(eits_track(ctx, t, EITS_MAX_TOUCHES), EITS_MAX_TOUCHES);
    }
    ctx->options.max_touches = 3;
    t[0] = at(-45, -45, 0.005);
    CHECK_EQUAL(eits_track(ctx, t, 1), 3);     /* the found one and two of those held */
    for (int k = 0; k < EITS_MAX_TOUCHES; ++k) /* all others */
        t[k] = at(30.0 * (k % 4) - 1000, 30.0 * (k / 4), 0.5);
    CHECK_EQUAL(eits_track(ctx, t, EITS_MAX_TOUCHES), EITS_MAX_TOUCHES);
    CHECK(t[0].id == 17 && t[EITS_MAX_TOUCHES - 1].id == 32);
    CHECK_EQUAL(none(ctx, t), 0);
}

/* Noise of the place that the filter expects; how far it is off on average, found and reported. */
static void jitter(eits_context *ctx, double speed, double explained, double *found_mm,
                   double *reported_mm)
{
    uint64_t random = 9;
    eits_touch t[EITS_MAX_TOUCHES];
    *found_mm = *reported_mm = 0;
    eits_forget(ctx);
    for (int k = 0; k < 60; ++k) {
        const double x = -50 + speed * k, off = 4 * small_random(&random) / (10 * sqrt(explained));
        CHECK_EQUAL(one(ctx, t, x + off, explained), 1);
        CHECK_EQUAL(t[0].id, ctx->tracker.next_id - 1);
        if (k >= 10) {
            *found_mm += off * off;
            *reported_mm += ((double)t[0].x_mm - x) * ((double)t[0].x_mm - x);
        }
    }
    *found_mm = sqrt(*found_mm / 50);
    *reported_mm = sqrt(*reported_mm / 50);
}

TEST(smoothing)
{
    double found, still, moving, clear;
    eits_context *ctx = set_up(&b, 0, 2, 0.66);
    jitter(ctx, 0, 0.02, &found, &still);
    CHECK(still < 0.8 * found);
    const double fraction = still / found;
    /* 80 mm/s at 48 frames a second: no lag once it goes at a constant speed */
    jitter(ctx, 1.7, 0.02, &found, &moving);
    CHECK(moving < 0.8 * found);
    jitter(ctx, 0, 1, &found, &clear); /* the surer a place, the less it is smoothed */
    CHECK(clear / found > fraction);
    eits_touch t[EITS_MAX_TOUCHES];
    eits_forget(ctx);
    /* no noise: places are as found, but for the hundredth of a pixel that none is surer than */
    ctx->info.lambda_noise = 0;
    for (int k = 0; k < 5; ++k) {
        CHECK_EQUAL(one(ctx, t, 3 * (k % 2), 0.5), 1);
        CHECK_NEAR(t[0].x_mm, 3 * (k % 2), 0.2);
    }
}

/* Radius and strength follow the gain of the place; explained is the frame's own. */
TEST(smooth_strengths)
{
    eits_touch t[EITS_MAX_TOUCHES];
    eits_context *ctx = set_up(&b, 0, 2, 0.66);
    for (int k = 0; k < 20; ++k)
        CHECK_EQUAL(one(ctx, t, 0, 0.01), 1);
    t[0] = (eits_touch){
        .x_mm = 2, .y_mm = -4, .radius_mm = 11, .strength_s_per_m_mm2 = 3, .explained = R(0.02)};
    CHECK_EQUAL(eits_track(ctx, t, 1), 1);
    const double gain = (double)t[0].x_mm / 2;
    CHECK(gain > 0.1 && gain < 0.9);
    CHECK_NEAR(t[0].y_mm, -4 * gain, 1e-5);
    CHECK_NEAR(t[0].radius_mm, 9 + 2 * gain, 1e-5);
    CHECK_NEAR(t[0].strength_s_per_m_mm2, 1 + 2 * gain, 1e-5);
    CHECK_NEAR(t[0].explained, 0.02, 1e-8);
}

/* Two fingers that pass one another keep their ids by where they are going; without that the
 * nearest place is another's. */
TEST(passing)
{
    for (int smooth = 0; smooth < 2; ++smooth) {
        eits_touch t[EITS_MAX_TOUCHES];
        eits_context *ctx = set_up(&b, 0, 2, smooth ? 0.66 : 0);
        for (int k = 0; k <= 10; ++k) {
            t[0] = at(-31.5 + 7 * k, 2, 0.5);
            t[1] = at(31.5 - 7 * k, -2, 0.4);
            CHECK_EQUAL(eits_track(ctx, t, 2), 2);
        }
        const uint32_t right = t[0].x_mm > 0 ? t[0].id : t[1].id;
        CHECK_EQUAL(right, smooth ? 1 : 2);
    }
}

/* A touch that is held goes on as it went, along either axis, but not off the skin. */
TEST(held_in_motion)
{
    for (int axis = 0; axis < 2; ++axis) {
        eits_touch t[EITS_MAX_TOUCHES];
        const eits_real *along = axis ? &t[0].y_mm : &t[0].x_mm,
                        *across = axis ? &t[0].x_mm : &t[0].y_mm;
        eits_context *ctx = set_up(&b, 0, 20, 0.66);
        ctx->info.lambda_noise = 2;
        for (int k = 0; k <= 10; ++k)
            CHECK_EQUAL((axis ? one_along_y : one)(ctx, t, 3 * k, 0.03), 1);
        const double at_last = (double)*along;
        CHECK_NEAR(at_last, 30, 0.5);
        for (int k = 1; k <= 20; ++k) {
            CHECK_EQUAL(none(ctx, t), 1);
            if (k < 5)
                CHECK_NEAR(*along, at_last + 3 * k, 0.3 * k);
            CHECK(*along < 60 + 6 + 0.1 && *across == 0);
        }
        CHECK(*along > 57);
        CHECK_EQUAL(none(ctx, t), 0);
    }
}

/* Options at the ends of their ranges: reported numbers are numbers. */
TEST(extremes)
{
    static const double huge[] = {0, 1e-30, 1e30};
    for (int k = 0; k < 27; ++k) {
        eits_touch t[EITS_MAX_TOUCHES];
        eits_context *ctx = set_up(&b, 0, 3, huge[k % 3]);
        ctx->options.follow_mm = (eits_real)huge[k / 3 % 3];
        ctx->info.lambda_noise = (eits_real)huge[k / 9];
        for (int frame = 0; frame < 6; ++frame) {
            const uint32_t count =
                frame == 3 ? none(ctx, t) : one(ctx, t, frame, frame == 2 ? 0 : 0.5);
            for (uint32_t l = 0; l < count; ++l)
                CHECK(eits_is_finite(t[l].x_mm) && eits_is_finite(t[l].y_mm) &&
                      eits_is_finite(t[l].radius_mm) && eits_is_finite(t[l].strength_s_per_m_mm2) &&
                      t[l].id != 0);
        }
    }
}

/* Switched on and off between frames: off, touches are as they were found. */
TEST(switched)
{
    eits_touch t[EITS_MAX_TOUCHES];
    eits_context *ctx = set_up(&b, 2, 2, 0.66);
    for (int k = 0; k < 6; ++k) {
        ctx->options.track_smooth = k % 2 ? R(0.66) : 0;
        CHECK_EQUAL(one(ctx, t, k, 0.06), 1);
        CHECK(t[0].id == 1);
        if (k % 2 == 0)
            CHECK(t[0].x_mm == (eits_real)k);
    }
    ctx->options.track_hold = 0;
    CHECK_EQUAL(none(ctx, t), 0);
    CHECK_EQUAL(one(ctx, t, 6, 0.5), 1);
    CHECK_EQUAL(t[0].id, 2);
}

/* A faint touch that is not found is waited for: smoothed it goes on as it went, else it stays. */
TEST(a_held_touch_goes_on_or_stays)
{
    eits_touch t[EITS_MAX_TOUCHES];
    for (int smooth = 0; smooth < 2; ++smooth) {
        eits_context *ctx = set_up(&b, 2, 2, 0.66);
        for (int k = 0; k < 20; ++k)
            (void)one(ctx, t, k, 0.009);
        const eits_real x = t[0].x_mm;
        CHECK_NEAR(x, 19, 0.5);
        ctx->options.track_smooth = smooth ? R(0.66) : 0;
        CHECK_EQUAL(none(ctx, t), 1);
        CHECK_NEAR(t[0].x_mm, x + (smooth ? 1 : 0), smooth ? 0.1 : 0);
    }
}

RUN_TESTS("track in time", dense_bench_close(&b))
