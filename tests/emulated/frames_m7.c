/* Does what "script.txt" in the host's folder says, a word and its values a line, as a board would,
 * and prints a line for each that can fail and for each frame. Numbers of frames come one after
 * another from "frames.f32".
 *
 *     portable 0|1    plain C or the processor's own kernels, from the next model on
 *     model FILE      open a model and start a context: no options, masks or reference stay
 *     option NAME X   as eits_options calls it; "choose" puts all of them in force
 *     choose
 *     mask ROW 0|1
 *     untouched COUNT     take the reference from as many frames, until one is refused
 *     frames COUNT    reconstruct as many
 *     solve COUNT     as many vectors of reduced data, by the solver alone
 *     drives COUNT STEP   as many scans by the fast path, each drive STEP after the last, and by
 * the solver what the fast path trusts forget
 *
 * A frame's line says why the solve stopped, iterations, MACs and instructions of the solve and of
 * the touches, instructions of the gestures made of them, the stack that they took, the image's
 * CRC-32, info and touches; a drive's line the instructions of the fast path, the stack, and its
 * touches. Floats are printed as bits: there is nothing to round. */
#include "eitskin/eitskin.h"

#include <stdio.h>
#include <string.h>

enum { MAX_MODEL = 2048 * 1024, MAX_WORKSPACE = 1280 * 1024, MAX_ROWS = 4096, MAX_FAST = 65536 };

static _Alignas(16) uint8_t model_bytes[MAX_MODEL];
static _Alignas(16) uint8_t workspace[MAX_WORKSPACE];
static _Alignas(16) uint8_t fast_memory[MAX_FAST];
static float frame[MAX_ROWS], reduced_data[EITS_MAX_RANK];
static eits_model model;
static eits_context *ctx;
static eits_options options;
static unsigned portable;
static eits_gestures gestures;
static eits_event events[EITS_MAX_EVENTS];
static FILE *numbers;

enum { FRAME_US = 20833, ROW_US = 100 }; /* 48 frames a second */

#ifdef EITS_BARE
/* CMSDK timer 0 at 25 MHz counts down; QEMU's -icount shift=6 makes it 1.6 ticks an instruction. */
#define TIMER_CTRL   (*(volatile uint32_t *)0x40000000u)
#define TIMER_VALUE  (*(volatile uint32_t *)0x40000004u)
#define TIMER_RELOAD (*(volatile uint32_t *)0x40000008u)

/* Again for every count, so that none depends on where between two ticks it began. */
static void start_timer(void)
{
    TIMER_CTRL = 0;
    TIMER_RELOAD = 0xFFFFFFFFu;
    TIMER_VALUE = 0xFFFFFFFFu;
    TIMER_CTRL = 1;
}

static unsigned long instructions_since_start(void)
{
    return (unsigned long)((uint64_t)(0xFFFFFFFFu - TIMER_VALUE) * 5u / 8u);
}

/* The stack below here is painted before the calls and looked at after them. */
enum { PAINTED_WORDS = 16 * 1024 / 4, LEAVE_FREE_WORDS = 64 };
static const uint32_t PAINT = 0x5AC7A57Eu;

static volatile uint32_t *lowest_painted(void)
{
    return (volatile uint32_t *)__builtin_frame_address(0) - LEAVE_FREE_WORDS - PAINTED_WORDS;
}

__attribute__((noinline)) static void paint_stack(volatile uint32_t *from)
{
    for (int k = 0; k < PAINTED_WORDS; ++k)
        from[k] = PAINT;
}

static unsigned long stack_used(volatile const uint32_t *from)
{
    unsigned long words = PAINTED_WORDS;
    for (; words > 0 && *from == PAINT; ++from)
        --words;
    return (words + LEAVE_FREE_WORDS) * 4;
}
#else
/* Under a user's emulator nothing is counted: bits alone are compared. */
static void start_timer(void)
{
}

static unsigned long instructions_since_start(void)
{
    return 0;
}

static volatile uint32_t *lowest_painted(void)
{
    return NULL;
}

static void paint_stack(volatile uint32_t *from)
{
    (void)from;
}

static unsigned long stack_used(volatile const uint32_t *from)
{
    (void)from;
    return 0;
}
#endif

static unsigned long bits_of(float value)
{
    uint32_t bits;
    memcpy(&bits, &value, sizeof bits);
    return (unsigned long)bits;
}

static int fail(const char *what)
{
    printf("error %s\n", what);
    return 0;
}

/* Sets an option by its name; returns 0 if there is no such option. */
static int set_option(const char *name, double value)
{
    uint32_t count;
    const eits_option *table = eits_option_table(&count);
    for (uint32_t k = 0; k < count; ++k) {
        if (strcmp(name, table[k].name) != 0)
            continue;
        const uint32_t whole = table[k].whole ? (uint32_t)value : 0;
        const eits_real real = (eits_real)value;
        memcpy((uint8_t *)&options + table[k].offset,
               table[k].whole ? (const void *)&whole : (const void *)&real, table[k].size);
        return 1;
    }
    return 0;
}

static int load(const char *name)
{
    FILE *file = fopen(name, "rb");
    const size_t size = file == NULL ? 0 : fread(model_bytes, 1, sizeof model_bytes, file);
    if (file != NULL)
        fclose(file);
    size_t need = 0;
    eits_status status = eits_model_open(&model, model_bytes, size);
    if (status == EITS_OK) {
        need = eits_workspace_size(&model, 0);
        status = need <= sizeof workspace && model.n_rows <= MAX_ROWS
                     ? eits_init(workspace, need, &model, &ctx)
                     : EITS_E_WORKSPACE;
    }
    if (status == EITS_OK)
        status = eits_use_portable_kernels(ctx, (int)portable);
    if (status == EITS_OK)
        options = *eits_get_options(ctx);
    (void)eits_gestures_init(&gestures, NULL);
    printf("model status %d workspace %lu kernels %s\n", (int)status, (unsigned long)need,
           status == EITS_OK ? eits_kernels_name(ctx) : "none");
    return status == EITS_OK;
}

static int read_numbers(float *to, uint32_t count)
{
    return numbers != NULL && count <= MAX_ROWS && fread(to, sizeof to[0], count, numbers) == count;
}

/* All of `count` frames are read, also where one is refused. */
static int tare(unsigned count)
{
    eits_status status = count >= 4 ? eits_reference_begin(ctx, count) : EITS_OK;
    for (unsigned k = 0; k < count; ++k) {
        if (!read_numbers(frame, model.n_rows))
            return fail("frames.f32 is short");
        if (status == EITS_OK)
            status = count >= 4 ? eits_reference_add(ctx, frame, model.n_rows)
                                : eits_reference_set(ctx, frame, model.n_rows);
    }
    if (status == EITS_OK && count >= 4)
        status = eits_reference_finish(ctx);
    printf("quiet status %d\n", (int)status);
    return 1;
}

static void print_touches(const eits_touch *touches, uint32_t found)
{
    printf(" touches %lu", (unsigned long)found);
    for (uint32_t k = 0; k < found; ++k) {
        const eits_touch *t = touches + k;
        const float reals[] = {t->x_mm,
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
                               t->radius_sd_mm,
                               (float)t->confirmed};
        printf(" %lu", (unsigned long)t->id);
        for (size_t l = 0; l < sizeof reals / sizeof reals[0]; ++l)
            printf(":%08lx", bits_of(reals[l]));
    }
    printf("\n");
}

static void print_info(const eits_info *info)
{
    printf(" info %lu:%lu:%lu", (unsigned long)info->nonzeros, (unsigned long)info->masked,
           (unsigned long)info->step_halvings);
    const float reals[] = {info->lambda,  info->lambda_max, info->lambda_noise, info->gap,
                           info->gap_rel, info->residual,   info->data_norm};
    for (size_t k = 0; k < sizeof reals / sizeof reals[0]; ++k)
        printf(":%08lx", bits_of(reals[k]));
    printf(":%lu:%lu:%lu:%08lx:%08lx", (unsigned long)info->diagnostics,
           (unsigned long)info->saturated, (unsigned long)info->outliers,
           bits_of(info->model_mismatch), bits_of(info->unexplained));
    const uint64_t electrodes[] = {info->open_electrodes, info->bridged_electrodes,
                                   info->noisy_electrodes};
    for (size_t k = 0; k < 3; ++k)
        printf(":%08lx%08lx", (unsigned long)(electrodes[k] >> 32),
               (unsigned long)(electrodes[k] & 0xFFFFFFFFu));
}

/* One frame, or one vector of reduced data. */
static int solve_one(unsigned k, int reduced)
{
    if (!read_numbers(reduced ? reduced_data : frame, reduced ? model.rank : model.n_rows))
        return fail("frames.f32 is short");
    volatile uint32_t *const painted = lowest_painted();
    paint_stack(painted);
    start_timer();
    const eits_status status = reduced ? eits_solve(ctx, reduced_data)
                                       : eits_reconstruct(ctx, frame, model.n_rows, NULL, NULL);
    const unsigned long solve = instructions_since_start();
    const eits_info *const info = eits_get_info(ctx);
    const float *const image = eits_get_image(ctx);
    eits_touch touches[EITS_MAX_TOUCHES];
    uint32_t found = 0;
    start_timer();
    (void)eits_find_touches(ctx, touches, EITS_MAX_TOUCHES, &found);
    const unsigned long touch = instructions_since_start();
    uint32_t reported = 0;
    start_timer();
    (void)eits_gestures_update(&gestures, touches, found, gestures.time_us + FRAME_US, events,
                               EITS_MAX_EVENTS, &reported);
    const unsigned long gesture = instructions_since_start();
    const unsigned long stack = stack_used(painted);
    printf("frame %u status %d stop %d iterations %lu macs %lu touchmacs %lu solve %lu touch %lu "
           "gesture %lu stack %lu image %08lx",
           k, (int)status, (int)info->stop, (unsigned long)info->iterations,
           (unsigned long)info->macs, (unsigned long)info->touch_macs, solve, touch, gesture, stack,
           (unsigned long)eits_crc32(0, image, (size_t)model.n_pixels * sizeof image[0]));
    print_info(info);
    print_touches(touches, found);
    return 1;
}

/* One drive of the present frame. */
static void play_drive(eits_fast *fast, uint32_t drive, uint32_t time_us)
{
    eits_real volts[EITS_FAST_ROWS];
    eits_fast_touch touches[EITS_FAST_TOUCHES];
    uint32_t count, found = 0;
    const uint16_t *rows = eits_fast_rows(fast, drive, &count);
    for (uint32_t i = 0; i < count; ++i)
        volts[i] = frame[rows[i]];
    volatile uint32_t *const painted = lowest_painted();
    paint_stack(painted);
    start_timer();
    const eits_status status = eits_fast_drive(fast, drive, volts, count, time_us);
    const unsigned long instructions = instructions_since_start();
    (void)eits_fast_touches(fast, touches, EITS_FAST_TOUCHES, &found);
    printf("drive %lu status %d fast %lu stack %lu touches %lu", (unsigned long)drive, (int)status,
           instructions, stack_used(painted), (unsigned long)found);
    for (uint32_t k = 0; k < found; ++k) {
        const eits_fast_touch *t = touches + k;
        printf(" %lu:%lu:%08lx:%08lx:%08lx:%08lx:%08lx", (unsigned long)t->id,
               (unsigned long)t->confirmed, bits_of(t->x_mm), bits_of(t->y_mm),
               bits_of(t->vx_mm_per_s), bits_of(t->vy_mm_per_s), bits_of(t->strength_s_per_m_mm2));
    }
    printf("\n");
}

/* Gives the solver's touches of the scan back to the fast path. */
static void end_scan(eits_fast *fast)
{
    eits_touch touches[EITS_MAX_TOUCHES];
    uint32_t state = 0, found = 0;
    start_timer();
    const eits_status status = eits_fast_align(fast, frame, model.n_rows, frame, &state);
    const unsigned long align = instructions_since_start();
    unsigned long confirm = 0;
    if ((state & EITS_FAST_TRUSTED) != 0) {
        (void)eits_reconstruct(ctx, frame, model.n_rows, NULL, NULL);
        (void)eits_find_touches(ctx, touches, EITS_MAX_TOUCHES, &found);
        start_timer();
        (void)eits_fast_confirm(fast, touches, found);
        confirm = instructions_since_start();
    }
    printf("scan status %d align %lu confirm %lu state %lu frame %08lx\n", (int)status, align,
           confirm, (unsigned long)state,
           (unsigned long)eits_crc32(0, frame, (size_t)model.n_rows * sizeof frame[0]));
}

static int play_scans(unsigned count, unsigned step)
{
    eits_fast *fast;
    const size_t need = eits_fast_size(&model);
    eits_status status =
        need <= MAX_FAST ? eits_fast_init(fast_memory, need, ctx, &fast) : EITS_E_WORKSPACE;
    if (status == EITS_OK)
        status = eits_fast_begin(fast);
    printf("fast status %d workspace %lu\n", (int)status, (unsigned long)need);
    for (unsigned k = 0; k < count; ++k) {
        if (!read_numbers(frame, model.n_rows))
            return fail("frames.f32 is short");
        if (status != EITS_OK)
            continue;
        const uint32_t drives = eits_fast_drives(fast), drive_us = ROW_US * model.n_rows / drives;
        for (uint32_t n = 0; n < drives; ++n)
            play_drive(fast, n * step % drives, (k * drives + n) * drive_us);
        end_scan(fast);
    }
    return 1;
}

/* One line of the script; 0 ends the run. */
static int obey(const char *word, FILE *script)
{
    static char name[64];
    double value;
    unsigned a, b;
    if (strcmp(word, "portable") == 0)
        return fscanf(script, "%u", &portable) == 1 || fail("portable");
    if (strcmp(word, "model") == 0)
        return fscanf(script, "%63s", name) == 1 && load(name);
    if (strcmp(word, "option") == 0)
        return (fscanf(script, "%63s %lf", name, &value) == 2 && set_option(name, value)) ||
               fail("unknown option");
    if (strcmp(word, "choose") == 0) {
        printf("choose status %d\n", (int)eits_set_options(ctx, &options));
        return 1;
    }
    if (strcmp(word, "mask") == 0)
        return (fscanf(script, "%u %u", &a, &b) == 2 && eits_mask_row(ctx, a, (int)b) == EITS_OK) ||
               fail("mask");
    if (strcmp(word, "quiet") == 0)
        return fscanf(script, "%u", &a) == 1 && tare(a);
    if (strcmp(word, "forget") == 0) {
        eits_forget(ctx);
        return 1;
    }
    if (strcmp(word, "drives") == 0)
        return fscanf(script, "%u %u", &a, &b) == 2 && play_scans(a, b);
    const int reduced = strcmp(word, "solve") == 0;
    if ((!reduced && strcmp(word, "frames") != 0) || fscanf(script, "%u", &a) != 1)
        return fail("unknown word");
    for (b = 0; b < a; ++b) {
        if (!solve_one(b, reduced))
            return 0;
    }
    return 1;
}

int main(void)
{
    char word[16];
    FILE *script = fopen("script.txt", "r");
    if (script == NULL)
        return !fail("no script.txt");
    numbers = fopen("frames.f32", "rb");
    while (fscanf(script, "%15s", word) == 1) {
        if (!obey(word, script))
            return 1;
    }
    return 0;
}
