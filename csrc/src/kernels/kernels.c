/* What the kernels' builds fraction: choosing one, listing non-zeros, reading columns, making
 * panels.
 */
#include "kernels/kernels.h"

#include "base/half.h"
#include "base/vec.h"
#include "context/column_cache.h"

#ifdef EITS_BUILD_AVX2
extern const eits_kernels eits_kernels_avx2;
#ifdef __clang__ /* which up to version 14 at least does not know the name; each processor with \
                    AVX2 has it */
#define SUPPORTS_F16C 1
#else
#define SUPPORTS_F16C __builtin_cpu_supports("f16c")
#endif
#endif
#ifdef EITS_BUILD_M7
extern const eits_kernels eits_kernels_m7;
#endif

const eits_kernels *eits_kernels_best(void)
{
#ifdef EITS_BUILD_AVX2
    if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") && SUPPORTS_F16C)
        return &eits_kernels_avx2;
#endif
#ifdef EITS_BUILD_M7
    return &eits_kernels_m7;
#else
    return &eits_kernels_portable;
#endif
}

static eits_real read_entry(const eits_matrix *matrix, size_t at)
{
    switch (matrix->storage) {
    case EITS_STORAGE_F32:
        return (eits_real)((const float *)matrix->data)[at];
    case EITS_STORAGE_F16:
        return (eits_real)eits_half_to_float(((const uint16_t *)matrix->data)[at]);
    case EITS_STORAGE_I16:
        return (eits_real)((const int16_t *)matrix->data)[at];
    case EITS_STORAGE_I8:
        break;
    }
    return (eits_real)((const int8_t *)matrix->data)[at];
}

void eits_read_column(const eits_matrix *matrix, uint32_t column, eits_real *out)
{
    for (uint32_t i = 0; i < matrix->rows; ++i)
        out[i] = read_entry(matrix, (size_t)matrix->stride * column + i);
}

static void scale_listed(const eits_matrix *matrix, const uint32_t *index, uint32_t count,
                         eits_real *values)
{
    if (matrix->scale == NULL)
        return;
    for (uint32_t k = 0; k < count; ++k)
        values[k] *= (eits_real)matrix->scale[index[k]];
}

uint32_t eits_list_nonzeros(const eits_kernels *kernels, const eits_matrix *matrix,
                            const eits_real *x, uint32_t *index, eits_real *value)
{
    const uint32_t count = kernels->nonzeros(x, matrix->cols, index, value);
    scale_listed(matrix, index, count, value);
    return count;
}

void eits_apply_t(const eits_context *ctx, const eits_real *v, eits_real *out)
{
    const eits_matrix *s = &ctx->model->sensitivity;
    if (ctx->panels != NULL)
        ctx->kernels->mul_t_panels(s, ctx->panels, NULL, s->cols, v, out);
    else
        ctx->kernels->mul_t(s, NULL, s->cols, v, out);
}

void eits_apply_t_working(const eits_context *ctx, const eits_real *v, eits_real *out)
{
    const eits_matrix *s = &ctx->model->sensitivity;
    if (ctx->working_panels != NULL) {
        ctx->kernels->mul_t_panels(s, ctx->working_panels, ctx->working, ctx->working_count, v,
                                   out);
    } else if (ctx->working_cached) {
        const eits_matrix cached = eits_cached_columns(ctx);
        ctx->kernels->mul_t(&cached, ctx->working_slot, ctx->working_count, v, out);
        scale_listed(s, ctx->working, ctx->working_count, out);
    } else {
        ctx->kernels->mul_t(s, ctx->working, ctx->working_count, v, out);
    }
}

uint32_t eits_apply(const eits_context *ctx, const eits_real *x, eits_real *out)
{
    const eits_matrix *s = &ctx->model->sensitivity;
    const uint32_t count = eits_list_nonzeros(ctx->kernels, s, x, ctx->list_index, ctx->list_value);
    ctx->kernels->mul(s, ctx->list_index, ctx->list_value, count, out);
    return count;
}

uint32_t eits_apply_working(const eits_context *ctx, const eits_real *x, eits_real *out)
{
    const eits_matrix *s = &ctx->model->sensitivity;
    uint32_t count = 0;
    for (uint32_t k = 0; k < ctx->working_count; ++k) {
        ctx->list_index[count] = ctx->working[k];
        ctx->list_value[count] = x[k];
        count += x[k] != 0;
    }
    scale_listed(s, ctx->list_index, count, ctx->list_value);
    if (ctx->working_cached) {
        const eits_matrix cached = eits_cached_columns(ctx);
        eits_cache_slots(ctx, ctx->list_index, count, ctx->list_index);
        ctx->kernels->mul(&cached, ctx->list_index, ctx->list_value, count, out);
    } else {
        ctx->kernels->mul(s, ctx->list_index, ctx->list_value, count, out);
    }
    return count;
}

void eits_pack_panels(eits_context *ctx)
{
    const uint32_t rows = ctx->model->rank;
    ctx->working_cached = eits_cache_columns(ctx, ctx->working, ctx->working_count);
    if (ctx->working_cached)
        eits_cache_slots(ctx, ctx->working, ctx->working_count, ctx->working_slot);
    if (ctx->working_panels == NULL)
        return;
    for (uint32_t k = 0; k < EITS_PANEL_COLUMNS(ctx->working_count); ++k) {
        eits_real *to =
            ctx->working_panels + (size_t)(k / EITS_PANEL) * EITS_PANEL * rows + k % EITS_PANEL;
        /* lanes to spare hold any column */
        const uint32_t j = ctx->working[k < ctx->working_count ? k : 0];
        const eits_real *from =
            ctx->panels + (size_t)(j / EITS_PANEL) * EITS_PANEL * rows + j % EITS_PANEL;
        for (uint32_t i = 0; i < rows; ++i)
            to[(size_t)i * EITS_PANEL] = from[(size_t)i * EITS_PANEL];
    }
}

void eits_make_panels(const eits_matrix *matrix, eits_real *panels)
{
    for (uint32_t j = 0; j < EITS_PANEL_COLUMNS(matrix->cols); ++j) {
        eits_real *lane =
            panels + (size_t)(j / EITS_PANEL) * EITS_PANEL * matrix->rows + j % EITS_PANEL;
        for (uint32_t i = 0; i < matrix->rows; ++i)
            lane[(size_t)i * EITS_PANEL] =
                j < matrix->cols ? read_entry(matrix, (size_t)matrix->stride * j + i) : 0;
    }
}
