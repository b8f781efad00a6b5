/* Memory of the fast path, and how it begins. */
#include "fast/fast.h"

/* The number of drives in the protocol's table, and the greatest number of rows of one drive. */
typedef struct shape {
    uint32_t drives, most_rows;
} shape;

static int same_drive(const eits_model *model, uint32_t a, uint32_t b)
{
    return memcmp(model->protocol + 4 * (size_t)a, model->protocol + 4 * (size_t)b, 2) == 0;
}

/* Rows of the drive that row i is of, before it and from it on. */
static void count_rows(const eits_model *model, uint32_t i, uint32_t *before, uint32_t *after)
{
    *before = *after = 0;
    for (uint32_t j = 0; j < model->n_rows; ++j) {
        if (same_drive(model, i, j))
            ++*(j < i ? before : after);
    }
}

/* Every fourth pixel: a peak of the map is far wider than two pixels, and Gauss-Newton steps go the
 * rest of the way. */
static int is_cell(const eits_pixel *pixel)
{
    return pixel->ix % 2 == 0 && pixel->iy % 2 == 0;
}

/* Whether drives can be followed: what touches answer to them is predicted by the fields. */
static int has_fields(const eits_model *model)
{
    return model->fields.at.data != NULL;
}

static shape shape_of(const eits_model *model)
{
    shape s = {0, 0};
    for (uint32_t i = 0; i < model->n_rows && has_fields(model); ++i) {
        uint32_t before, after;
        count_rows(model, i, &before, &after);
        s.drives += before == 0;
        s.most_rows = after > s.most_rows ? after : s.most_rows;
    }
    return s.most_rows <= EITS_FAST_MAX_ROWS ? s : (shape){0, 0};
}

/* The next of the memory that is handed out, all zero. */
static void *take(uint8_t **next, size_t bytes)
{
    uint8_t *taken = *next;
    *next += EITS_ALIGN16(bytes);
    return taken;
}

/* By the lists that EITS_FAST_SIZE adds up (eitskin/fast.h). */
#define TAKE_INTO(part, place, element, count)                               \
    _Static_assert(sizeof *(part)->place == sizeof(element), "its element"); \
    (part)->place = take(&next, (size_t)(count) * sizeof(element));
#define TAKE(place, element, count)         TAKE_INTO(fast, place, element, count)
#define TAKE_WAITING(place, element, count) TAKE_INTO(held, place, element, count)
#define TAKE_TOUCH(place, element, count)   TAKE_INTO(sight, place, element, count)

static void lay_out(uint8_t *next, const eits_model *model, shape s, eits_fast *fast)
{
    for (uint32_t n = 0; n < EITS_FAST_RING; ++n)
        fast->ring[n] = &fast->held[n];
    if (s.drives == 0)
        return;
    fast->drive = take(&next, s.drives * sizeof *fast->drive);
    EITS_FAST_ARRAYS(TAKE, model->n_rows, s.most_rows, model->n_electrodes, model->nx, model->ny)
    for (fast_sight *sight = fast->sight; sight < fast->sight + EITS_FAST_MAX_TOUCHES; ++sight) {
        EITS_FAST_TOUCH_ARRAYS(TAKE_TOUCH, model->n_electrodes)
    }
    for (fast_held *held = fast->held; held < fast->held + EITS_FAST_RING; ++held) {
        EITS_FAST_WAITING_ARRAYS(TAKE_WAITING, s.most_rows)
    }
}

size_t eits_fast_size(const eits_model *model)
{
    if (model == NULL)
        return 0;
    const shape s = shape_of(model);
    return EITS_FAST_SIZE(model->n_rows, s.drives, s.most_rows, model->n_electrodes, model->nx,
                          model->ny);
}

/* The drives' rows, in the order of the table, and the cells. */
static void list(eits_fast *fast)
{
    const eits_model *model = fast->model;
    uint32_t row = 0;
    if (fast->most_rows == 0)
        return;
    for (uint32_t i = 0; i < model->n_rows; ++i) {
        uint32_t before, after;
        count_rows(model, i, &before, &after);
        if (before > 0)
            continue;
        const uint8_t *electrodes = model->protocol + 4 * (size_t)i;
        fast->drive[fast->drives++] = (fast_drive){.first = (uint16_t)row,
                                                   .count = (uint16_t)after,
                                                   .plus = electrodes[0],
                                                   .minus = electrodes[1]};
        for (uint32_t j = i; j < model->n_rows; ++j) {
            if (same_drive(model, i, j))
                fast->row[row++] = (uint16_t)j;
        }
    }
    for (uint32_t j = 0; j < model->n_pixels; ++j) {
        if (is_cell(&model->pixel[j]))
            fast->cell[fast->cells++] = (uint16_t)j;
    }
}

eits_status eits_fast_init(void *memory, size_t size, const eits_context *ctx, eits_fast **fast)
{
    if (memory == NULL || ctx == NULL || fast == NULL)
        return EITS_E_ARGUMENT;
    if (size < eits_fast_size(ctx->model) || (uintptr_t)memory % 16 != 0)
        return EITS_E_WORKSPACE;
    const shape s = shape_of(ctx->model);
    eits_fast *made = memory;
    memset(memory, 0, eits_fast_size(ctx->model));
    lay_out((uint8_t *)memory + EITS_FAST_STATE, ctx->model, s, made);
    made->ctx = ctx;
    made->model = ctx->model;
    made->most_rows = s.most_rows;
    made->rho2 =
        fast_square(EITS_FAST_SOFT_RADIUS * (eits_real)ctx->model->defaults->touch_seed_radius_mm);
    made->next_id = 1;
    list(made);
    *fast = made;
    return EITS_OK;
}

eits_status eits_fast_begin(eits_fast *fast)
{
    if (fast == NULL)
        return EITS_E_ARGUMENT;
    const eits_reference *reference = &fast->ctx->reference;
    fast->begun = 0;
    if (!reference->ready)
        return EITS_E_NO_REFERENCE;
    /* Without noise every residual would be news, and chi-squares infinite. */
    if (!(reference->noise_v > 0))
        return EITS_E_REFERENCE_SHORT;
    const uint32_t rows = fast->drives > 0 ? fast->model->n_rows : 0;
    eits_real energy = 0;
    /* Copied once: after a tare the caller begins again, so that a touch is never seen by two sets
     * of gains. */
    for (uint32_t i = 0; i < rows; ++i) {
        fast->gain[i] = reference->gain * reference->row_gain[i];
        fast->masked[i] = 0;
        energy += fast->gain[i] * fast->gain[i];
    }
    fast->noise_v = reference->noise_v;
    fast->sigma = rows > 0 ? reference->noise_v * eits_sqrt(energy / (eits_real)rows) : 0;
    fast->sign = fast->ctx->options.sign == EITS_SIGN_DECREASE ? R(-1) : R(1);
    eits_fast_expect_again(fast);
    fast->drift = 0;
    fast->wild = fast->faulty = 0;
    memset(fast->suspect, 0, sizeof fast->suspect);
    fast->count = fast->quiet = fast->seeds = fast->newsy = fast->drive_count = fast->born = 0;
    fast->timed = fast->unexplained = fast->unexplained_frames = fast->glitched = 0;
    eits_fast_empty_ring(fast);
    fast->search.warm_count = fast->search.pair_known = fast->search.last_count = 0;
    /* Nothing of what came before: a recording that begins here gives the same bits. */
    fast->search.decisions = fast->search.warm_at = fast->search.pair_at = 0;
    fast->search.last_at = fast->search.last_times = 0;
    fast->frame_s = 0;
    for (uint32_t n = 0; n < EITS_FAST_RING; ++n)
        fast->ring[n]->plain = 0;
    /* The touches that frames named stay until the next frame is aligned, because a frame may still
     * be being solved meanwhile. */
    fast->fresh = 1;
    for (uint32_t n = 0; n < fast->drives; ++n) {
        /* Nothing is wrong with drives that were not measured yet; the first frame is not held back
         * for them. */
        fast->drive[n].explained = 1;
        fast->drive[n].rest_at = 0;
        fast->drive[n].learned = 1;
        eits_fast_forget_errors(fast, n);
        for (uint32_t k = 0; k < EITS_FAST_MAX_TOUCHES; ++k)
            fast->drive[n].there[k] = 0;
    }
    fast->begun = 1;
    return EITS_OK;
}

uint32_t eits_fast_drives(const eits_fast *fast)
{
    return fast == NULL ? 0 : fast->drives;
}

const uint16_t *eits_fast_rows(const eits_fast *fast, uint32_t drive, uint32_t *count)
{
    if (fast == NULL || count == NULL || drive >= fast->drives)
        return NULL;
    *count = fast->drive[drive].count;
    return fast->row + fast->drive[drive].first;
}
