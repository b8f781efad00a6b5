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

fuzz_sum fuzz_sums[FUZZ_SUMS + 1];
int fuzz_sums_wanted;

/* FNV-1a: apart from the core's checksum, which is under test. */
void fuzz_note(const char *name, const void *bytes, size_t size)
{
    fuzz_sum *sum = fuzz_sums;
    if (!fuzz_sums_wanted)
        return;
    while (sum->name != NULL && strcmp(sum->name, name) != 0)
        MUST(++sum < fuzz_sums + FUZZ_SUMS);
    sum->name = name;
    sum->input = sum->input == 0 ? 2166136261u : sum->input;
    for (size_t i = 0; i < size; ++i)
        sum->input = (sum->input ^ ((const uint8_t *)bytes)[i]) * 16777619u;
}

void fuzz_note_reals(const char *name, const eits_real *numbers, size_t count)
{
    for (size_t i = 0; i < count && fuzz_sums_wanted; ++i) {
        const int known = numbers[i] == numbers[i];
        fuzz_note(name, known ? (const char *)&numbers[i] : "NaN", known ? sizeof *numbers : 3);
    }
}

void fuzz_note_floats(const char *name, const uint8_t *bytes, size_t count)
{
    for (size_t i = 0; i < count && fuzz_sums_wanted; ++i) {
        float number;
        memcpy(&number, bytes + 4 * i, sizeof number);
        const eits_real value = (eits_real)number;
        fuzz_note_reals(name, &value, 1);
    }
}

void fuzz_end_input(void)
{
    for (fuzz_sum *sum = fuzz_sums; sum < fuzz_sums + FUZZ_SUMS; ++sum) {
        sum->all += sum->input;
        sum->input = 0;
    }
}

void *fuzz_workspace(int which)
{
    static _Alignas(64) uint8_t room[2][FUZZ_WORKSPACE];
    return room[which];
}

static void note_info(const char *name, const eits_info *info)
{
    const uint64_t whole[] = {
        info->iterations,       (uint64_t)info->stop,    info->nonzeros, info->masked,
        info->step_halvings,    info->touches,           info->macs,     info->touch_macs,
        info->diagnostics,      info->saturated,         info->outliers, info->open_electrodes,
        info->noisy_electrodes, info->bridged_electrodes};
    const eits_real numbers[] = {info->lambda,        info->lambda_max,  info->lambda_noise,
                                 info->gap,           info->gap_rel,     info->residual,
                                 info->data_norm,     info->unexplained, info->model_mismatch,
                                 info->regularisation};
    fuzz_note(name, whole, sizeof whole);
    fuzz_note_reals(name, numbers, sizeof numbers / sizeof numbers[0]);
}

static void check_info(const eits_context *ctx, uint64_t frame_macs)
{
    const eits_info *info = eits_get_info(ctx);
    note_info("image", info);
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
    const eits_model *model = eits_get_model(ctx);
    fuzz_note("data", &status, sizeof status);
    fuzz_note("data", eits_get_row_states(ctx), model->n_rows);
    fuzz_note("data", eits_get_electrode_states(ctx), model->n_electrodes);
    fuzz_note_reals("data", eits_get_reduced_data(ctx), model->rank);
    fuzz_note_reals("image", eits_get_image(ctx), model->n_pixels);
    fuzz_note_reals("image", eits_get_coefficients(ctx), model->n_pixels);
    for (uint32_t j = 0; j < model->n_pixels; ++j) {
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
    note_info("touches", eits_get_info(ctx));
    fuzz_note_reals("touches", eits_get_image(ctx), eits_get_model(ctx)->n_pixels);
    for (uint32_t k = 0; k < count; ++k) {
        const eits_touch *t = touches + k;
        fuzz_note("touches", &t->id, sizeof t->id);
        fuzz_note_reals("touches", &t->x_mm,
                        (offsetof(eits_touch, confirmed) - offsetof(eits_touch, x_mm)) /
                            sizeof t->x_mm);
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
        MUST(eits_is_finite(t->radius_sd_mm) && t->radius_sd_mm >= 0);
        MUST(eits_is_finite(t->xy_covariance_mm2));
        MUST(t->id != 0);
        for (uint32_t l = 0; l < k; ++l)
            MUST(touches[l].id != t->id);
    }
}
