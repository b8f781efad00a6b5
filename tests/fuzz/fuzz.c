#include "fuzz.h"

#include "base/vec.h"

uint8_t fuzz_u8(fuzz_bytes *b)
{
    return b->at < b->end ? *b->at++ : 0;
}

uint32_t fuzz_u32(fuzz_bytes *b)
{
    uint32_t value = 0;
    for (int shift = 0; shift < 32; shift += 8)
        value |= (uint32_t)fuzz_u8(b) << shift;
    return value;
}

float fuzz_f32(fuzz_bytes *b)
{
    const uint32_t bits = fuzz_u32(b);
    float value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

void *fuzz_workspace(int which)
{
    static _Alignas(64) uint8_t room[2][FUZZ_WORKSPACE];
    return room[which];
}

static void check_info(const eits_context *ctx, uint64_t frame_macs)
{
    const eits_info *info = &ctx->info;
    const eits_real numbers[] = {info->lambda,  info->lambda_max, info->lambda_noise, info->gap,
                                 info->gap_rel, info->residual,   info->data_norm};
    for (size_t i = 0; i < sizeof numbers / sizeof numbers[0]; ++i)
        MUST(eits_is_finite(numbers[i]) && numbers[i] >= 0);
    MUST(info->iterations <= ctx->options.iterations);
    MUST((uint32_t)info->stop <= (uint32_t)EITS_STOP_OPTIMUM);
    MUST(info->masked <= ctx->model->n_rows);
    MUST(info->residual <= info->data_norm * R(1.001));
    MUST(ctx->options.mac_limit == 0 || info->macs <= ctx->options.mac_limit ||
         info->macs <= frame_macs);
}

void fuzz_check_result(const eits_context *ctx, eits_status status, uint64_t frame_macs)
{
    uint32_t nonzeros = 0;
    for (uint32_t j = 0; j < ctx->model->n_pixels; ++j) {
        MUST(eits_is_finite(ctx->image[j]));
        MUST(eits_is_finite(ctx->x[j]));
        MUST(status == EITS_OK || ctx->image[j] == 0);
        MUST(ctx->options.sign == EITS_SIGN_DECREASE || ctx->x[j] >= 0 ||
             ctx->options.sign == EITS_SIGN_BOTH);
        MUST(ctx->options.sign == EITS_SIGN_INCREASE || ctx->x[j] <= 0 ||
             ctx->options.sign == EITS_SIGN_BOTH);
        nonzeros += ctx->x[j] != 0;
    }
    MUST(ctx->info.nonzeros == nonzeros);
    MUST(status != EITS_OK || ctx->info.masked <= ctx->options.max_masked);
    check_info(ctx, frame_macs);
}

void fuzz_check_touches(const eits_context *ctx, const eits_touch *touches, uint32_t count)
{
    MUST(count <= ctx->options.max_touches);
    MUST(count == ctx->info.touches);
    for (uint32_t k = 0; k < count; ++k) {
        const eits_touch *t = touches + k;
        MUST(eits_is_finite(t->force_n) && t->force_n >= 0);
        MUST(eits_is_finite(t->x_mm) && eits_is_finite(t->y_mm) &&
             eits_is_finite(t->strength_s_per_m_mm2));
        MUST(t->radius_mm >= ctx->options.touch_min_radius_mm &&
             t->radius_mm <= ctx->options.touch_max_radius_mm);
        MUST(t->confidence >= 0 && t->confidence <= 1);
        MUST(t->id != 0);
        for (uint32_t l = 0; l < k; ++l)
            MUST(touches[l].id != t->id);
    }
}
