/* Very many warm-started frames of a hand on the skin (hand.h), among them broken, dead and
 * saturated ones, tares, changed options: nothing may become infinite, grow, drift or be written
 * outside the workspace.
 *
 *     soak MODEL FRAMES [portable]       on a host
 *
 * With SOAK_FRAMES defined it takes no arguments, so many frames and "model.eitm": on an emulated
 * board. The last line's CRC is over all images and touches, the same everywhere. */
#include "hand.h"

#include "base/vec.h"
#include "context/context.h"
#include "eitskin/eitskin.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum {
    MAX_MODEL = 1024 * 1024,
    MAX_WORKSPACE = 640 * 1024,
    MAX_PIXELS = 4096,
    GUARD = 64,
    REFERENCE_FRAMES = 8,
    PAINT = 0xA5
};
enum { HELD_FRAMES = 10, LONG_RUN = 100000, SHORT = 1000 };
static const eits_real HELD_GAP = R(1e-3);

typedef struct guarded {
    _Alignas(16) uint8_t before[GUARD];
    _Alignas(16) uint8_t workspace[MAX_WORKSPACE];
    uint8_t after[GUARD];
    eits_context *ctx;
} guarded;

static _Alignas(16) uint8_t model_bytes[MAX_MODEL];
static guarded run, fresh;
static hand fingers;
static eits_model model;
static eits_real frame[MAX_ROWS], held_frame[MAX_ROWS];

/* The reference that is in force: how to take it again. */
static uint32_t tare_random;
static eits_real tare_gain = 1;
static uint32_t masked_row = UINT32_MAX;

static uint64_t frame_number;
static uint32_t crc;
static struct counts {
    unsigned long refused, tares, touches, probes;
    uint64_t max_macs;
} counts;

static void check_at(int right, int line, const char *what)
{
    if (right)
        return;
    printf("frame %lu, line %d: not true: %s\n", (unsigned long)frame_number, line, what);
    exit(1);
}
#define CHECK(condition) check_at((condition) != 0, __LINE__, #condition)

static void open_context(guarded *g, int portable)
{
    memset(g->before, PAINT, sizeof g->before);
    memset(g->after, PAINT, sizeof g->after);
    const size_t size = eits_workspace_size(&model, 0);
    CHECK(size <= sizeof g->workspace);
    memset(g->workspace + size, PAINT, sizeof g->workspace - size);
    CHECK(eits_init(g->workspace, size, &model, &g->ctx) == EITS_OK);
    CHECK(eits_use_portable_kernels(g->ctx, portable) == EITS_OK);
}

static void check_guards(const guarded *g)
{
    const size_t size = eits_workspace_size(&model, 0);
    const size_t beyond = sizeof g->workspace - size < GUARD ? sizeof g->workspace - size : GUARD;
    for (size_t i = 0; i < GUARD; ++i)
        CHECK(g->before[i] == PAINT && g->after[i] == PAINT &&
              (i >= beyond || g->workspace[size + i] == PAINT));
}

/* As the reference in force was taken. */
static void take_reference(eits_context *ctx)
{
    hand again = fingers;
    again.random = tare_random;
    for (uint32_t i = 0; i < model.n_rows; ++i)
        CHECK(eits_mask_row(ctx, i, i == masked_row) == EITS_OK);
    CHECK(eits_reference_begin(ctx, REFERENCE_FRAMES) == EITS_OK);
    for (int k = 0; k < REFERENCE_FRAMES; ++k) {
        hand_frame(&again, 0, tare_gain, 0, frame);
        CHECK(eits_reference_add(ctx, frame, model.n_rows) == EITS_OK);
    }
    CHECK(eits_reference_finish(ctx) == EITS_OK);
}

static void tare(void)
{
    tare_random = fingers.random;
    fingers.random += 12345;
    tare_gain = R(1) + R(0.0005) * (eits_real)hand_draw(&fingers, 101) - R(0.025);
    masked_row = hand_draw(&fingers, 3) == 0 ? hand_draw(&fingers, model.n_rows) : UINT32_MAX;
    take_reference(run.ctx);
    ++counts.tares;
}

static void set_options(eits_context *ctx, eits_options o)
{
    CHECK(eits_set_options(ctx, &o) == EITS_OK);
}

static void change_options(void)
{
    static const eits_solver SOLVERS[] = {EITS_SOLVER_FISTA, EITS_SOLVER_WORKING_SET,
                                          EITS_SOLVER_ACTIVE_SET};
    eits_options o = *eits_get_options(run.ctx);
    o.solver = SOLVERS[hand_draw(&fingers, 3)];
    o.iterations = 5 + hand_draw(&fingers, 40);
    o.gap_rel = hand_draw(&fingers, 2) ? R(1e-2) : 0;
    o.sign = hand_draw(&fingers, 4) ? EITS_SIGN_INCREASE : EITS_SIGN_BOTH;
    o.warm_start = hand_draw(&fingers, 8) != 0;
    o.project_reference = hand_draw(&fingers, 8) != 0;
    o.mac_limit = hand_draw(&fingers, 4) ? 0 : 200000 + hand_draw(&fingers, 1000000);
    o.touch_fit = hand_draw(&fingers, 2)
                      ? EITS_TOUCH_FIT_ALL
                      : hand_draw(&fingers, EITS_TOUCH_FIT_ALL + 1) & EITS_TOUCH_FIT_ALL;
    o.second_pass = hand_draw(&fingers, 3) == 0;
    o.saturation_v = 100 * fingers.rms;
    set_options(run.ctx, o);
}

/* Unusable rows, each another, none of them masked; returns their number. */
static uint32_t break_rows(uint32_t wanted)
{
    static const double wild[] = {NAN, INFINITY, -INFINITY, 1000, -1000};
    uint32_t broken = 0;
    for (uint32_t k = 0; k < wanted; ++k) {
        const uint32_t row = hand_draw(&fingers, model.n_rows);
        if (row == masked_row || !eits_is_finite(frame[row]) ||
            eits_fabs(frame[row]) > 500 * fingers.rms)
            continue;
        const double value = wild[hand_draw(&fingers, 5)];
        frame[row] = (eits_real)(value > 999    ? 1000
                                 : value < -999 ? -1000
                                                : value) *
                     (isfinite(value) ? fingers.rms : 1);
        if (!isfinite(value))
            frame[row] = (eits_real)value;
        ++broken;
    }
    return broken;
}

static void check_finite(const eits_context *ctx)
{
    const eits_info *i = eits_get_info(ctx);
    for (uint32_t j = 0; j < model.n_pixels; ++j)
        CHECK(eits_is_finite(eits_get_image(ctx)[j]) &&
              eits_is_finite(eits_get_coefficients(ctx)[j]));
    CHECK(eits_is_finite(i->lambda) && eits_is_finite(i->lambda_max) && eits_is_finite(i->gap) &&
          eits_is_finite(i->gap_rel) && eits_is_finite(i->residual) &&
          eits_is_finite(i->data_norm));
    CHECK(i->gap >= 0 && i->residual >= 0 && i->residual <= i->data_norm * R(1.001));
    CHECK(i->iterations <= eits_get_options(ctx)->iterations && i->nonzeros <= model.n_pixels &&
          i->masked <= model.n_rows);
    CHECK(ctx->projection.count <= model.rank && ctx->solver.working_count <= model.n_pixels);
    CHECK(i->macs <= 20ull * (i->iterations + 20) * model.n_pixels * model.rank);
}

static void check_touches(const eits_touch *touches, uint32_t count)
{
    CHECK(count <= EITS_MAX_TOUCHES);
    for (uint32_t k = 0; k < count; ++k) {
        const eits_touch *t = touches + k;
        CHECK(t->id != 0 && eits_is_finite(t->x_mm) && eits_is_finite(t->y_mm) &&
              eits_is_finite(t->radius_mm));
        CHECK(eits_is_finite(t->strength_s_per_m_mm2) && t->explained >= 0 && t->explained <= 1);
        for (uint32_t l = 0; l < k; ++l)
            CHECK(touches[l].id != t->id);
        CHECK(t->confidence >= 0 && t->confidence <= 1 && t->x_variance_mm2 >= 0 &&
              t->y_variance_mm2 >= 0);
        const eits_real numbers[] = {t->x_mm,
                                     t->y_mm,
                                     t->radius_mm,
                                     t->strength_s_per_m_mm2,
                                     t->explained,
                                     t->force_n,
                                     t->confidence,
                                     t->x_variance_mm2,
                                     t->xy_covariance_mm2,
                                     t->y_variance_mm2,
                                     t->long_x_mm,
                                     t->long_y_mm,
                                     t->radius_sd_mm};
        crc = eits_crc32(crc, &t->id, sizeof t->id);
        crc = eits_crc32(crc, numbers, sizeof numbers);
    }
}

/* One frame through everything; `expected`: its status. */
static void reconstruct(eits_status expected, uint32_t masked)
{
    eits_touch touches[EITS_MAX_TOUCHES];
    uint32_t count = 0;
    CHECK(eits_reconstruct(run.ctx, frame, model.n_rows, NULL, NULL) == expected);
    check_finite(run.ctx);
    if (expected == EITS_OK) {
        CHECK(eits_get_info(run.ctx)->masked == masked);
        CHECK(eits_find_touches(run.ctx, touches, EITS_MAX_TOUCHES, &count) == EITS_OK);
    } else {
        CHECK(eits_greatest(run.ctx->kernels, eits_get_image(run.ctx), model.n_pixels,
                            EITS_SIGN_BOTH) == 0);
        ++counts.refused;
    }
    check_touches(touches, count);
    crc = eits_crc32(crc, eits_get_image(run.ctx),
                     model.n_pixels * sizeof eits_get_image(run.ctx)[0]);
    counts.touches += count;
    counts.max_macs = eits_get_info(run.ctx)->macs > counts.max_macs ? eits_get_info(run.ctx)->macs
                                                                     : counts.max_macs;
}

static void one_frame(uint64_t k)
{
    if (k % 997 == 0)
        tare();
    if (k % 313 == 0)
        change_options();
    if (k % 401 == 0)
        eits_forget(run.ctx);
    hand_frame(&fingers, k, tare_gain, 1, frame);
    const uint32_t masked = masked_row != UINT32_MAX;
    if (k % 211 == 5) {
        eits_zero(frame, model.n_rows);
        reconstruct(EITS_E_FRAME_ZERO, masked);
    } else if (k % 101 == 7) {
        for (uint32_t i = 0; i < model.n_rows; i += 1 + i % 2)
            frame[i] = R(NAN);
        reconstruct(EITS_E_FRAME_ROWS, masked);
    } else {
        reconstruct(EITS_OK, masked + (k % 17 == 3 ? break_rows(1 + hand_draw(&fingers, 8)) : 0));
    }
}

/* A cold frame gives what it gives in a context that has seen nothing but the reference. */
static void probe_for_drift(int portable)
{
    open_context(&fresh, portable);
    set_options(fresh.ctx, *eits_get_options(run.ctx));
    take_reference(fresh.ctx);
    eits_forget(run.ctx);
    eits_touch seen[EITS_MAX_TOUCHES], expected[EITS_MAX_TOUCHES];
    uint32_t count, expected_count;
    CHECK(eits_reconstruct(run.ctx, held_frame, model.n_rows, NULL, NULL) == EITS_OK);
    CHECK(eits_reconstruct(fresh.ctx, held_frame, model.n_rows, NULL, NULL) == EITS_OK);
    /* else the limit counts the basis, which one of them made earlier */
    if (eits_get_options(run.ctx)->mac_limit == 0) {
        const eits_info *a = eits_get_info(run.ctx), *b = eits_get_info(fresh.ctx);
        CHECK(memcmp(eits_get_image(run.ctx), eits_get_image(fresh.ctx),
                     model.n_pixels * sizeof eits_get_image(run.ctx)[0]) == 0);
        CHECK(a->stop == b->stop && a->iterations == b->iterations && a->gap == b->gap &&
              a->residual == b->residual);
        CHECK(eits_find_touches(run.ctx, seen, EITS_MAX_TOUCHES, &count) == EITS_OK);
        CHECK(eits_find_touches(fresh.ctx, expected, EITS_MAX_TOUCHES, &expected_count) == EITS_OK);
        CHECK(count == expected_count);
        for (uint32_t k = 0; k < count; ++k)
            CHECK(seen[k].x_mm == expected[k].x_mm && seen[k].y_mm == expected[k].y_mm &&
                  seen[k].explained == expected[k].explained);
    }
    check_guards(&fresh);
    ++counts.probes;
}

static eits_real objective(const eits_context *ctx)
{
    eits_real sum = 0;
    for (uint32_t j = 0; j < model.n_pixels; ++j)
        sum += eits_fabs(eits_get_coefficients(ctx)[j]);
    return R(0.5) * eits_get_info(ctx)->residual * eits_get_info(ctx)->residual +
           eits_get_info(ctx)->lambda * sum;
}

/* The same frame again and again: the gap asked for is kept, and no result is further from the
 * optimum than its gap. */
static void hold_a_frame(void)
{
    const eits_options kept = *eits_get_options(run.ctx);
    eits_options o = kept;
    o.warm_start = 1;
    o.mac_limit = 0;
    o.gap_rel = HELD_GAP;
    o.iterations = 3000;
    o.solver = (eits_solver)(counts.probes % 2); /* FISTA's two: the others end at the optimum */
    set_options(run.ctx, o);
    eits_forget(run.ctx);
    eits_real first = 0;
    for (int k = 0; k < HELD_FRAMES; ++k) {
        CHECK(eits_reconstruct(run.ctx, held_frame, model.n_rows, NULL, NULL) == EITS_OK);
        const eits_real half = R(0.5) * eits_get_info(run.ctx)->data_norm *
                               eits_get_info(run.ctx)->data_norm,
                        now = objective(run.ctx);
        CHECK(eits_get_info(run.ctx)->gap_rel <= HELD_GAP);
        first = k == 0 ? now : first;
        CHECK(eits_fabs(now - first) <= (HELD_GAP + R(1e-5)) * half);
    }
    set_options(run.ctx, kept);
}

/* So many iterations: the gap ends at rounding. */
static void run_long(void)
{
    const eits_options kept = *eits_get_options(run.ctx);
    eits_options o = kept;
    o.warm_start = o.mac_limit = 0;
    o.gap_rel = 0;
    o.iterations = LONG_RUN;
    o.solver = EITS_SOLVER_WORKING_SET;
    set_options(run.ctx, o);
    CHECK(eits_reconstruct(run.ctx, held_frame, model.n_rows, NULL, NULL) == EITS_OK);
    check_finite(run.ctx);
    CHECK(eits_get_info(run.ctx)->stop != EITS_STOP_DIVERGED &&
          eits_get_info(run.ctx)->gap_rel < R(1e-4));
    set_options(run.ctx, kept);
}

static void open_model(const char *path)
{
    FILE *file = fopen(path, "rb");
    const size_t size = file == NULL ? 0 : fread(model_bytes, 1, sizeof model_bytes, file);
    if (file != NULL)
        fclose(file);
    CHECK(eits_model_open(&model, model_bytes, size) == EITS_OK);
    CHECK(model.n_pixels <= MAX_PIXELS && hand_begin(&fingers, &model));
}

static void soak(uint64_t frames, int portable)
{
    eits_real difference;
    open_context(&run, portable);
    CHECK(eits_self_test(run.ctx, &difference) == EITS_OK);
    CHECK(sizeof(eits_real) != 4 || difference == 0);
    open_context(&run, portable);
    const uint64_t interval = frames > 20000 ? frames / 40 : frames / 4 + 1;
    for (frame_number = 0; frame_number < frames; ++frame_number) {
        one_frame(frame_number);
        check_guards(&run);
        if (frame_number % interval != interval - 1)
            continue;
        hand_frame(&fingers, 20, tare_gain, 1, held_frame);
        probe_for_drift(portable);
        hold_a_frame();
    }
    if (frames > SHORT)
        run_long();
    CHECK(counts.probes > 0 && counts.touches > frames / 2);
}

#ifdef SOAK_FRAMES
int main(void)
{
    const uint64_t frames = SOAK_FRAMES;
    open_model("model.eitm");
    soak(frames, 0);
#else
int main(int argc, char **argv)
{
    const uint64_t frames = argc > 2 ? strtoull(argv[2], NULL, 10) : 0;
    if (argc < 3 || argc > 4 || frames < 100) {
        printf("usage: soak MODEL FRAMES [portable]; at least 100 frames\n");
        return 2;
    }
    open_model(argv[1]);
    soak(frames, argc == 4);
#endif
    printf("%lu frames, %lu refused, %lu tares, %lu touches, %lu probes, most MACs %lu, kernels "
           "%s, crc %08lx\n",
           (unsigned long)frames, counts.refused, counts.tares, counts.touches, counts.probes,
           (unsigned long)counts.max_macs, eits_kernels_name(run.ctx), (unsigned long)crc);
    return 0;
}
