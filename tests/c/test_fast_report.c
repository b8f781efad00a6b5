/* A frame's touches: those that drives follow, with what the solver found of them, and those that
 * frames alone show, followed from frame to frame. */
#include "steps.h"

#include "fast/fast.h"

static dense_bench b;
static void *memory;
static eits_fast *fast;
static eits_touch t[EITS_MAX_TOUCHES];

/* A 120 mm square around the origin; a frame whose lambda_max is ten times that of noise. */
static void set_up(void)
{
    eits_context *ctx = dense_bench_open(&b, (small_spec){.rank = 8, .side = 20}, 0);
    const size_t size = eits_fast_size(&b.c.model);
    free(memory);
    memory = aligned_alloc(16, size);
    CHECK_OK(eits_fast_init(memory, size, ctx, &fast));
    ctx->info.lambda_max = 10;
    ctx->info.lambda_noise = 1;
}

/* Its own lambda_max is 10 sqrt(explained) times the noise's: faint from 0.009 down; above 0.05 it
 * is clear. */
static eits_touch at(double x, double y, double explained)
{
    return (eits_touch){.x_mm = (eits_real)x,
                        .y_mm = (eits_real)y,
                        .radius_mm = 9,
                        .strength_s_per_m_mm2 = 1,
                        .explained = (eits_real)explained,
                        .confidence = 1};
}

static uint32_t report(const eits_touch *found, uint32_t count)
{
    uint32_t reported = 99;
    CHECK_OK(eits_fast_report(fast, found, count, t, &reported));
    return reported;
}

static uint32_t one(double x, double explained)
{
    const eits_touch found = at(x, 0, explained);
    return report(&found, 1);
}

static uint32_t none(void)
{
    return report(t, 0);
}

/* As eits_fast_align does it: drives follow these. */
static void drives_follow(const eits_fast_touch *touches, uint32_t count)
{
    fast->aligned = 1;
    fast->count = fast->n_followed = count;
    for (uint32_t k = 0; k < count; ++k) {
        fast->followed[k] = touches[k];
        fast->known[k].id = touches[k].id;
    }
    eits_fast_expect_touches(fast);
}

TEST(wrong_arguments)
{
    uint32_t count;
    set_up();
    CHECK_EQUAL(eits_fast_report(NULL, t, 0, t, &count), EITS_E_ARGUMENT);
    CHECK_EQUAL(eits_fast_report(fast, t, 0, NULL, &count), EITS_E_ARGUMENT);
    CHECK_EQUAL(eits_fast_report(fast, t, 0, t, NULL), EITS_E_ARGUMENT);
    CHECK_EQUAL(eits_fast_report(fast, NULL, 1, t, &count), EITS_E_ARGUMENT);
    CHECK_EQUAL(eits_fast_report(fast, t, EITS_MAX_TOUCHES + 1, t, &count), EITS_E_ARGUMENT);
    CHECK_EQUAL(report(NULL, 0), 0);
}

/* A model without fields has no drives, and its frames have touches all the same. */
TEST(without_fields)
{
    uint32_t count = 0;
    set_up();
    CHECK_EQUAL(eits_fast_drives(fast), 0);
    CHECK(eits_fast_rows(fast, 0, &count) == NULL);
    CHECK_EQUAL(eits_fast_drive(fast, 0, b.c.ctx->reference.v0, 13, 0), EITS_E_ARGUMENT);
    CHECK_EQUAL(one(0, 0.5), 1);
    CHECK_EQUAL(eits_fast_begin(fast), EITS_E_NO_REFERENCE);
    CHECK_EQUAL(one(0, 0.5), 1);
    CHECK(t[0].id == 1 && t[0].confirmed == 1);
    eits_fast_forget_all(NULL);
    eits_fast_forget_all(fast);
    CHECK_EQUAL(one(0, 0.5), 1);
    CHECK(t[0].id == 2 && t[0].confirmed == 0);
}

/* The nearer touch that was found gives its place and shape, the one followed its id; what is not
 * found is reported as followed. The strongest comes first. */
TEST(a_followed_touch_is_what_was_found_near_it)
{
    const eits_fast_touch followed[] = {
        {.id = 3, .strength_s_per_m_mm2 = 1, .radius_mm = 7, .x_variance_mm2 = 2},
        {.id = 4, .x_mm = 50, .strength_s_per_m_mm2 = 2, .radius_mm = 7, .x_variance_mm2 = 2}};
    eits_touch found[] = {at(5, 0, 0.5), at(1, 0, 0.5)};
    set_up();
    found[1].strength_s_per_m_mm2 = 3;
    drives_follow(followed, 2);
    CHECK_EQUAL(report(found, 2), 2);
    CHECK(t[0].id == 3 && t[0].x_mm == 1 && t[0].radius_mm == 9 && t[0].confirmed == 1);
    CHECK(t[1].id == 4 && t[1].x_mm == 50 && t[1].radius_mm == 7 && t[1].x_variance_mm2 == 2);
    CHECK(t[1].confirmed == 0 && t[1].explained == 0);
    drives_follow(followed, 2); /* a frame that was not solved */
    CHECK_EQUAL(report(NULL, 0), 2);
    CHECK(t[0].id == 4 && t[1].id == 3 && t[1].x_mm == 0);
    CHECK_EQUAL(report(NULL, 0), 0); /* the report of a frame is made once */
}

/* In noise, drives lag behind a finger, so the frame's place is shown. The solver takes a wide
 * contact for several touches, so that one stays where drives have it. */
TEST(where_the_two_differ_the_frame_is_shown)
{
    const eits_fast_touch finger = {.id = 3, .strength_s_per_m_mm2 = 1, .radius_mm = 7};
    const eits_fast_touch palm = {.id = 3, .strength_s_per_m_mm2 = 1, .radius_mm = 25};
    const eits_touch found = at(12, 0, 0.5);
    set_up();
    drives_follow(&finger, 1);
    CHECK_EQUAL(report(&found, 1), 1);
    CHECK(t[0].id == 3 && t[0].x_mm == 12 && t[0].explained > 0 && t[0].confirmed == 0);
    drives_follow(&palm, 1);
    CHECK_EQUAL(report(&found, 1), 1);
    CHECK(t[0].id == 3 && t[0].x_mm == 0 && t[0].explained == 0);
}

/* The solver takes a palm that lands for several touches. If a touch grew by much while the frame
 * was scanned, and drives have it as one, the frame shows that one. */
TEST(a_touch_that_grows_is_not_several)
{
    const eits_fast_touch finger = {.id = 3, .strength_s_per_m_mm2 = 1, .radius_mm = 7};
    const eits_touch found[2] = {at(12, 0, 0.5), at(-13, 0, 0.4)};
    set_up();
    for (uint32_t count = 1; count <= 2; ++count) {
        for (uint32_t grows = 0; grows < 2; ++grows) {
            drives_follow(&finger, 1);
            fast->smeared = grows ? FAST_GROWS : 0;
            CHECK_EQUAL(report(found, count), 1);
            CHECK_NEAR(t[0].x_mm, grows && count == 2 ? 0 : 12, 0.01);
            fast->n_seen = 0;
        }
    }
}

/* In noise the place lies between that of the frame and that of drives, nearer to the more certain
 * one. A place that drives have lost counts for nothing. */
TEST(places_of_frame_and_drives_are_weighed)
{
    const eits_fast_touch followed = {.id = 3, .strength_s_per_m_mm2 = 1, .radius_mm = 7};
    const struct {
        double variance_mm2, x_mm, shown_mm;
    } cases[] = {{0, 4, 4}, {9, 4, 2}, {27, 4, 1}, {9, 14, 14}};
    set_up();
    for (size_t n = 0; IN_TABLE(n, cases); ++n) {
        eits_touch found = at(cases[n].x_mm, 0, 0.5);
        found.x_variance_mm2 = found.y_variance_mm2 = (eits_real)cases[n].variance_mm2;
        drives_follow(&followed, 1);
        CHECK_EQUAL(report(&found, 1), 1);
        CHECK_NEAR(t[0].x_mm, cases[n].shown_mm, 1e-5);
        CHECK_NEAR(t[0].x_variance_mm2, cases[n].variance_mm2, 1e-5);
    }
}

/* A touch that no drive follows counts from its second frame on, however clear it is. A frame that
 * was not solved is none, and nothing is held. */
TEST(a_touch_beside_those_of_drives)
{
    const eits_touch found = at(-40, 0, 0.005), clear = at(40, 0, 0.5);
    set_up();
    for (int frame = 0; frame < 6; ++frame) {
        drives_follow(NULL, 0);
        CHECK_EQUAL(report(&found, 1), frame > 0);
        CHECK(frame == 0 || (t[0].id == 1 && t[0].confirmed == 1));
        drives_follow(NULL, 0);
        CHECK_EQUAL(report(NULL, 0), 0);
    }
    drives_follow(NULL, 0);
    CHECK_EQUAL(report(&clear, 1), 0);
}

/* All touches have one sequence of ids: touches that drives start continue after those of frames.
 * */
TEST(ids_are_one_sequence)
{
    const eits_real here[2] = {0, 0}, there[2] = {40, 0};
    set_up();
    CHECK_EQUAL(one(0, 0.5), 1);
    CHECK_EQUAL(t[0].id, 1);
    drives_follow(NULL, 0);
    CHECK_EQUAL(eits_fast_id_at(fast, there), 2);
    CHECK_EQUAL(one(0, 0.5), 1); /* still the same touch */
    CHECK_EQUAL(t[0].id, 1);
    CHECK_EQUAL(eits_fast_id_at(fast, here), 1); /* now drives have found it, */
    CHECK_EQUAL(eits_fast_id_at(fast, here), 3); /* and what comes later is another */
    eits_fast_forget_all(fast);
    CHECK_EQUAL(one(0, 0.5), 1);
    CHECK_EQUAL(t[0].id, 4);
    fast->next_id = EITS_FAST_IDS;
    eits_touch four[4] = {at(-50, 50, 0.5), at(50, 50, 0.5), at(-50, -50, 0.5), at(50, -50, 0.5)};
    CHECK_EQUAL(report(four, 4), 4);
    CHECK(t[0].id == EITS_FAST_IDS && t[1].id == 1 && t[2].id == 2); /* never 0 */
}

/* A frame may be reported before or after drives of the next have found its touch: a board's drives
 * do not wait for the solver. The ids are the same. */
TEST(ids_do_not_depend_on_when_a_frame_is_reported)
{
    const eits_touch found = at(-40, 0, 0.5);
    const eits_real near[2] = {-38, 3}, far[2] = {40, 0};
    for (int late = 0; late < 2; ++late) {
        uint32_t born = 0, other = 0;
        set_up();
        drives_follow(NULL, 0);
        CHECK_EQUAL(report(&found, 1), 0); /* the first frame with it */
        drives_follow(NULL, 0);
        for (int turn = 0; turn < 2; ++turn) {
            if (turn == late) {
                CHECK_EQUAL(report(&found, 1), 1);
                CHECK_EQUAL(t[0].id, 1);
            } else {
                other = eits_fast_id_at(fast, far);
                born = eits_fast_id_at(fast, near);
            }
        }
        CHECK(born == 1 && other == 2);
        const eits_fast_touch followed[2] = {{.id = born, .x_mm = -38, .y_mm = 3},
                                             {.id = other, .x_mm = 40}};
        drives_follow(followed, 2);
        CHECK_EQUAL(report(&found, 1), 2); /* it is one touch, with one id */
        CHECK(t[0].id == 1 && t[0].x_mm == -40 && t[1].id == 2);
    }
}

/* Drives follow a touch, lose it while frames still show it, and find it again. */
TEST(a_touch_keeps_its_id_when_drives_lose_it)
{
    const eits_fast_touch followed = {.id = 1, .x_mm = 10, .confirmed = 1};
    const eits_real here[2] = {11, 0};
    const eits_touch found = at(12, 0, 0.5);
    set_up();
    fast->next_id = 2;
    drives_follow(&followed, 1);
    CHECK_EQUAL(report(&found, 1), 1);
    drives_follow(NULL, 0);
    CHECK_EQUAL(report(&found, 1), 0); /* it may have lifted in this scan */
    drives_follow(NULL, 0);
    CHECK_EQUAL(report(&found, 1), 1);
    CHECK(t[0].id == 1 && t[0].confirmed == 1);
    drives_follow(NULL, 0);
    CHECK_EQUAL(eits_fast_id_at(fast, here), 1);
    /* and through a gap: drives begin again, and frames between were not aligned */
    drives_follow(&followed, 1);
    CHECK_EQUAL(report(&found, 1), 1);
    CHECK_EQUAL(report(&found, 1), 1);
    CHECK(t[0].id == 1 && fast->n_seen == 1);
    eits_fast_expect_again(fast);
    CHECK_EQUAL(eits_fast_id_at(fast, here), 1);
    /* one that lifted is not followed any more, and another that lands there is not it */
    drives_follow(&followed, 1);
    CHECK_EQUAL(report(&found, 1), 1);
    drives_follow(NULL, 0);
    CHECK_EQUAL(none(), 0);
    drives_follow(NULL, 0);
    CHECK_EQUAL(eits_fast_id_at(fast, here), 2);
}

/* Noise that one frame alone shows takes no id with it. */
TEST(ids_that_nothing_takes_are_given_to_the_next)
{
    const eits_touch found = at(-40, 0, 0.5);
    const eits_real far[2] = {40, 0};
    set_up();
    for (int round = 0; round < 3; ++round) {
        drives_follow(NULL, 0);
        CHECK_EQUAL(report(&found, 1), 0);
        drives_follow(NULL, 0);
        CHECK_EQUAL(none(), 0);
    }
    drives_follow(NULL, 0);
    CHECK_EQUAL(eits_fast_id_at(fast, far), 1);
}

/* Clear ones at once, unconfirmed; others with the second frame. */
TEST(touches_start)
{
    set_up();
    CHECK_EQUAL(one(0, 0.5), 1);
    CHECK(t[0].id == 1 && t[0].confirmed == 0 && t[0].x_mm == 0);
    CHECK_EQUAL(one(1, 0.5), 1);
    CHECK(t[0].id == 1 && t[0].confirmed == 1 && t[0].x_mm == 1);
    eits_fast_forget_all(fast);
    for (int round = 0; round < 3; ++round) { /* a flicker is never reported, and takes no id */
        CHECK_EQUAL(one(0, 0.005), 0);
        CHECK_EQUAL(none(), 0);
    }
    CHECK_EQUAL(one(0, 0.005), 0);
    CHECK_EQUAL(one(1, 0.005), 1);
    CHECK(t[0].id == 2 && t[0].confirmed == 1 && t[0].x_mm == 1);
    CHECK_EQUAL(one(40, 0.04), 0); /* clear, but perhaps a part of another */
    eits_fast_forget_all(fast);
    b.c.ctx->info.lambda_noise = 5; /* a large part of a frame that is little more than noise */
    CHECK_EQUAL(one(0, 0.2), 0);
    eits_fast_forget_all(fast);
    b.c.ctx->info.lambda_noise = 2; /* 1.2 times noise: not faint, and not clear either */
    CHECK_EQUAL(one(0, 0.06), 0);
    eits_fast_forget_all(fast);
    b.c.ctx->info.lambda_noise = 0; /* unknown: nothing is doubtful */
    CHECK_EQUAL(one(0, 0.005), 1);
}

/* A doubtful touch must be found again near by; one that was reported may move further. */
TEST(reach)
{
    set_up(); /* follow_mm 25 */
    CHECK_EQUAL(one(0, 0.005), 0);
    CHECK_EQUAL(one(15.1, 0.005), 0);
    CHECK_EQUAL(one(0.2, 0.005), 1);
    eits_fast_forget_all(fast);
    CHECK_EQUAL(one(0, 0.5), 1);
    CHECK_EQUAL(one(24.9, 0.5), 1);
    CHECK_EQUAL(t[0].id, 2);
    eits_fast_forget_all(fast);
    CHECK_EQUAL(one(0, 0.5), 1);
    CHECK_EQUAL(one(25.1, 0.5), 1);
    CHECK_EQUAL(t[0].id, 4);
    /* nearer to the doubtful touch than its own finger: the one that was reported chooses first */
    eits_fast_forget_all(fast);
    const eits_touch before[2] = {at(0, 0, 0.5), at(30, 0, 0.005)};
    const eits_touch after[2] = {at(20, 0, 0.5), at(0, 40, 0.5)};
    CHECK_EQUAL(report(before, 2), 1);
    CHECK_EQUAL(report(after, 2), 2);
    CHECK(t[0].id == 5 && t[1].id == 6);
}

/* A clear touch that is lifted ends at once, although its id is kept for two frames. A faint touch
 * that is well known is reported in these frames, at its last place. */
TEST(touches_end)
{
    set_up();
    for (int k = 0; k < 10; ++k)
        CHECK_EQUAL(one(0, 0.5), 1);
    CHECK_EQUAL(none(), 0);
    CHECK_EQUAL(none(), 0);
    CHECK_EQUAL(one(5, 0.005), 1); /* it was reported before */
    CHECK_EQUAL(t[0].id, 1);
    for (int k = 0; k < 2; ++k) {
        CHECK_EQUAL(none(), 1);
        CHECK(t[0].id == 1 && t[0].x_mm == 5 && t[0].explained == 0 && t[0].confidence == 0 &&
              t[0].strength_s_per_m_mm2 == 1 && t[0].confirmed == 1);
    }
    CHECK_EQUAL(none(), 0);
    CHECK_EQUAL(one(5, 0.5), 1); /* too late: another */
    CHECK_EQUAL(t[0].id, 2);
    eits_fast_forget_all(fast);
    for (int k = 0; k < 3; ++k)
        CHECK_EQUAL(one(0, 0.005), k > 0);
    CHECK_EQUAL(none(), 0); /* found three times only: it may have been noise */
    CHECK_EQUAL(one(0, 0.005), 1);
    CHECK_EQUAL(t[0].id, 3);
    CHECK_EQUAL(none(), 1);
    b.c.ctx->options.max_touches = 0; /* no more are reported because they are held */
    CHECK_EQUAL(none(), 0);
}

/* Touches that are waited for never take the place of found ones, and ids follow each of them. */
TEST(a_full_house)
{
    eits_touch all[EITS_MAX_TOUCHES], others[EITS_MAX_TOUCHES];
    set_up();
    for (int round = 0; round < 5; ++round) {
        for (int k = 0; k < EITS_MAX_TOUCHES; ++k) { /* listed in another order each time */
            const int which = (k * 7 + round * 3) % EITS_MAX_TOUCHES;
            all[k] = at(30.0 * (which % 4) - 45 + round, 30.0 * (which / 4) - 45, 0.5);
            all[k].radius_mm = (eits_real)which;
            others[k] = at(30.0 * (which % 4) - 1000, 30.0 * (which / 4), 0.5);
        }
        CHECK_EQUAL(report(all, EITS_MAX_TOUCHES), EITS_MAX_TOUCHES);
        for (int k = 0; k < EITS_MAX_TOUCHES; ++k)
            CHECK_EQUAL((eits_real)(t[k].id - 1), (eits_real)((int)t[k].radius_mm * 7 % 16));
    }
    CHECK_EQUAL(report(others, EITS_MAX_TOUCHES), EITS_MAX_TOUCHES);
    CHECK(t[0].id == EITS_MAX_TOUCHES + 1 && t[EITS_MAX_TOUCHES - 1].id == 2 * EITS_MAX_TOUCHES);
    CHECK_EQUAL(none(), 0);
}

/* Nearest pairs first; where one touch becomes two, the nearer keeps the id. */
TEST(nearest_first)
{
    set_up();
    const eits_touch first[3] = {at(0, 0, 0.5), at(20, 0, 0.5), at(40, 0, 0.5)};
    const eits_touch moved[3] = {at(12, 0, 0.5), at(21, 0, 0.5), at(90, 0, 0.5)};
    CHECK_EQUAL(report(first, 3), 3);
    CHECK_EQUAL(report(moved, 3), 3);
    CHECK(t[0].id == 1 && t[1].id == 2 && t[2].id == 4);
    eits_fast_forget_all(fast);
    const eits_touch two[2] = {at(1, 1, 0.5), at(-0.5, 1, 0.5)};
    CHECK_EQUAL(report(first, 1), 1);
    CHECK_EQUAL(report(two, 2), 2);
    CHECK(t[1].id == 5 && t[0].id == 6);
}

/* Two fingers that pass one another keep their ids by where they are going: the nearest place is
 * the other's. */
TEST(passing)
{
    set_up();
    for (int k = 0; k <= 10; ++k) {
        eits_touch two[2] = {at(-31.5 + 7 * k, 2, 0.5), at(31.5 - 7 * k, -2, 0.4)};
        two[0].strength_s_per_m_mm2 = 2;
        CHECK_EQUAL(report(two, 2), 2);
        CHECK(t[0].id == 1 && t[1].id == 2);
        CHECK(t[0].x_mm == two[0].x_mm); /* places are as they were found */
    }
}

/* Options and noise at the ends of their ranges: places are numbers, ids are given. */
TEST(extremes)
{
    static const double huge[] = {0, 1e-30, 1e30};
    for (int k = 0; k < 9; ++k) {
        set_up();
        b.c.ctx->options.follow_mm = (eits_real)huge[k % 3];
        b.c.ctx->info.lambda_noise = (eits_real)huge[k / 3];
        for (int frame = 0; frame < 9; ++frame) {
            const uint32_t count = frame == 5 ? none() : one(frame, frame == 2 ? 0 : 0.5);
            for (uint32_t l = 0; l < count; ++l)
                CHECK(t[l].id != 0 && eits_is_finite(t[l].x_mm));
        }
        CHECK(fast->n_seen > 0 && eits_all_finite(fast->seen[0].at, 2));
    }
}

RUN_TESTS("fast_report", dense_bench_close(&b); free(memory))
