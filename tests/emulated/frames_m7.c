/* Reads "model.eitm" and "frames.f32" (quiet frames, then frames; counts on "plan.txt") from the host's folder, runs them as a
 * board would, and prints for each frame: why the solve stopped, iterations, MACs and instructions of the solve and of the
 * touches, the stack that they took, the image's CRC-32, and the touches' numbers as hexadecimal bits. Floats are printed as
 * bits: there is nothing to round. Options in "options.txt", a name and a value a line, replace the model's own; the file may
 * be absent. */
#include "eitskin/eitskin.h"

#include <stdio.h>
#include <string.h>

enum { MOST_MODEL = 2048 * 1024, MOST_WORKSPACE = 1024 * 1024, MOST_ROWS = 4096 };

static _Alignas(16) uint8_t model_bytes[MOST_MODEL];
static _Alignas(16) uint8_t workspace[MOST_WORKSPACE];
static float frame[MOST_ROWS];

/* CMSDK timer 0 at 25 MHz counts down; QEMU's -icount shift=6 makes it 1.6 ticks an instruction. */
#define TIMER_CTRL (*(volatile uint32_t *)0x40000000u)
#define TIMER_VALUE (*(volatile uint32_t *)0x40000004u)
#define TIMER_RELOAD (*(volatile uint32_t *)0x40000008u)

static void start_timer(void)
{
    TIMER_RELOAD = 0xFFFFFFFFu;
    TIMER_VALUE = 0xFFFFFFFFu;
    TIMER_CTRL = 1;
}

static unsigned long instructions_since(uint32_t start)
{
    return (unsigned long)((uint64_t)(start - TIMER_VALUE) * 5u / 8u);
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

static unsigned long bits_of(float value)
{
    uint32_t bits;
    memcpy(&bits, &value, sizeof bits);
    return (unsigned long)bits;
}

static int fail(const char *what, eits_status status)
{
    printf("error %s: %s\n", what, eits_status_text(status));
    return 1;
}

/* Options by name; a name that is none of these is refused. */
static int read_options(eits_options *options)
{
    char name[32];
    float value;
    FILE *file = fopen("options.txt", "r");
    int known = 1;
    while (known && file != NULL && fscanf(file, "%31s %f", name, &value) == 2) {
        if (strcmp(name, "iterations") == 0)
            options->iterations = (uint32_t)value;
        else if (strcmp(name, "touch_sweeps") == 0)
            options->touch_sweeps = (uint32_t)value;
        else if (strcmp(name, "gap_rel") == 0)
            options->gap_rel = value;
        else if (strcmp(name, "lambda_rel") == 0)
            options->lambda_rel = value;
        else if (strcmp(name, "mac_limit") == 0)
            options->mac_limit = (uint32_t)value;
        else
            known = 0;
    }
    if (file != NULL)
        fclose(file);
    return known;
}

int main(void)
{
    eits_model model;
    eits_context ctx;
    unsigned quiet = 0, count = 0, warm = 0, sign = 0, solver = 0, portable = 0;
    FILE *file = fopen("plan.txt", "r");
    if (file == NULL || fscanf(file, "%u %u %u %u %u %u", &quiet, &count, &warm, &sign, &solver, &portable) != 6)
        return fail("plan.txt", EITS_E_ARGUMENT);
    fclose(file);
    file = fopen("model.eitm", "rb");
    const size_t size = file == NULL ? 0 : fread(model_bytes, 1, sizeof model_bytes, file);
    eits_status status = eits_model_open(&model, model_bytes, size);
    if (status != EITS_OK)
        return fail("model", status);
    fclose(file);
    const size_t need = eits_workspace_size(&model, 0);
    status = need <= sizeof workspace ? eits_init(&ctx, &model, workspace, need) : EITS_E_WORKSPACE;
    if (status != EITS_OK)
        return fail("init", status);
    eits_options options = ctx.options;
    options.warm_start = warm;
    options.sign = (eits_sign)sign;
    options.solver = (eits_solver)solver;
    status = read_options(&options) ? eits_set_options(&ctx, &options) : EITS_E_ARGUMENT;
    if (status == EITS_OK)
        status = eits_use_portable_kernels(&ctx, (int)portable);
    if (status == EITS_OK)
        status = quiet >= 4 ? eits_baseline_begin(&ctx, quiet) : EITS_OK;
    if (status != EITS_OK)
        return fail("baseline", status);
    printf("workspace %lu kernels %s\n", (unsigned long)need, eits_kernels_name(&ctx));
    file = fopen("frames.f32", "rb");
    start_timer();
    for (unsigned k = 0; file != NULL && k < quiet + count; ++k) {
        if (fread(frame, sizeof frame[0], model.n_rows, file) != model.n_rows)
            return fail("frames.f32", EITS_E_FRAME_LENGTH);
        if (k < quiet) {
            status = quiet >= 4 ? eits_baseline_add(&ctx, frame, model.n_rows) : eits_baseline_set(&ctx, frame, model.n_rows);
            if (status == EITS_OK && quiet >= 4 && k + 1 == quiet)
                status = eits_baseline_finish(&ctx);
            if (status != EITS_OK)
                return fail("quiet frame", status);
            continue;
        }
        volatile uint32_t *const painted = lowest_painted();
        paint_stack(painted);
        uint32_t start = TIMER_VALUE;
        status = eits_reconstruct(&ctx, frame, model.n_rows, NULL, NULL);
        const unsigned long solve = instructions_since(start);
        eits_touch touches[EITS_MAX_TOUCHES];
        uint32_t found = 0;
        start = TIMER_VALUE;
        (void)eits_find_touches(&ctx, touches, EITS_MAX_TOUCHES, &found);
        const unsigned long touch = instructions_since(start);
        const unsigned long stack = stack_used(painted);
        printf("frame %u status %d stop %d iterations %lu macs %lu touchmacs %lu solve %lu touch %lu stack %lu image %08lx touches %lu",
               k - quiet, (int)status, (int)ctx.info.stop, (unsigned long)ctx.info.iterations, (unsigned long)ctx.info.macs,
               (unsigned long)ctx.info.touch_macs, solve, touch, stack, (unsigned long)eits_crc32(0, ctx.image, (size_t)model.n_pixels * sizeof ctx.image[0]), (unsigned long)found);
        for (uint32_t t = 0; t < found; ++t)
            printf(" %lu:%08lx:%08lx:%08lx:%08lx:%08lx", (unsigned long)touches[t].id, bits_of(touches[t].x_mm), bits_of(touches[t].y_mm),
                   bits_of(touches[t].radius_mm), bits_of(touches[t].strength_s_per_m_mm2), bits_of(touches[t].confidence));
        printf("\n");
    }
    return file == NULL ? fail("frames.f32", EITS_E_ARGUMENT) : 0;
}
