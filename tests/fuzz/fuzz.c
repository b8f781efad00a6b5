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
    const eits_info *info = eits_get_info(ctx);
    const eits_real numbers[] = {info->lambda,  info->lambda_max, info->lambda_noise, info->gap,
                                 info->gap_rel, info->residual,   info->data_norm};
    for (size_t i = 0; i < sizeof numbers / sizeof numbers[0]; ++i)
        MUST(eits_is_finite(numbers[i]) && numbers[i] >= 0);
    MUST(info->iterations <= eits_get_options(ctx)->iterations);
    MUST((uint32_t)info->stop <= (uint32_t)EITS_STOP_OPTIMUM);
    MUST(info->masked <= eits_get_model(ctx)->n_rows);
    MUST(info->residual <= info->data_norm * R(1.001));
    MUST(eits_get_options(ctx)->mac_limit == 0 || info->macs <= eits_get_options(ctx)->mac_limit ||
         info->macs <= frame_macs);
}

void fuzz_check_result(const eits_context *ctx, eits_status status, uint64_t frame_macs)
{
    uint32_t nonzeros = 0;
    for (uint32_t j = 0; j < eits_get_model(ctx)->n_pixels; ++j) {
        MUST(eits_is_finite(eits_get_image(ctx)[j]));
        MUST(eits_is_finite(eits_get_coefficients(ctx)[j]));
        MUST(status == EITS_OK || eits_get_image(ctx)[j] == 0);
        MUST(eits_get_options(ctx)->sign == EITS_SIGN_DECREASE ||
             eits_get_coefficients(ctx)[j] >= 0 || eits_get_options(ctx)->sign == EITS_SIGN_BOTH);
        MUST(eits_get_options(ctx)->sign == EITS_SIGN_INCREASE ||
             eits_get_coefficients(ctx)[j] <= 0 || eits_get_options(ctx)->sign == EITS_SIGN_BOTH);
        nonzeros += eits_get_coefficients(ctx)[j] != 0;
    }
    MUST(eits_get_info(ctx)->nonzeros == nonzeros);
    MUST(status != EITS_OK || eits_get_info(ctx)->masked <= eits_get_options(ctx)->max_masked);
    check_info(ctx, frame_macs);
}

void fuzz_check_touches(const eits_context *ctx, const eits_touch *touches, uint32_t count)
{
    MUST(count <= eits_get_options(ctx)->max_touches);
    MUST(count == eits_get_info(ctx)->touches);
    for (uint32_t k = 0; k < count; ++k) {
        const eits_touch *t = touches + k;
        MUST(eits_is_finite(t->force_n) && t->force_n >= 0);
        MUST(eits_is_finite(t->x_mm) && eits_is_finite(t->y_mm) &&
             eits_is_finite(t->strength_s_per_m_mm2));
        MUST(t->radius_mm >= eits_get_options(ctx)->touch_min_radius_mm &&
             t->radius_mm <= eits_get_options(ctx)->touch_max_radius_mm);
        MUST(t->explained >= 0 && t->explained <= 1);
        MUST(t->confidence >= 0 && t->confidence <= 1);
        MUST(eits_is_finite(t->x_variance_mm2) && t->x_variance_mm2 >= 0);
        MUST(eits_is_finite(t->y_variance_mm2) && t->y_variance_mm2 >= 0);
        MUST(eits_is_finite(t->long_x_mm) && eits_is_finite(t->long_y_mm));
        MUST(eits_is_finite(t->xy_covariance_mm2));
        MUST(t->id != 0);
        for (uint32_t l = 0; l < k; ++l)
            MUST(touches[l].id != t->id);
    }
}
