/* Any bytes as an .eitm model; where it opens, its own golden frame, its defaults, and frames made
 * of its own voltages. */
#include "fuzz.h"

#include "base/vec.h"

enum { MAX_BYTES = 1 << 15, MAX_WORK = 20000, MAX_ITERATIONS = 30, MAX_ROWS = 512 };

static void frame_of(const eits_model *model, const float *volts, float factor, eits_real *frame)
{
    for (uint32_t i = 0; i < model->n_rows; ++i)
        frame[i] = (eits_real)(volts[i] * factor);
}

static void reconstruct(eits_context *ctx, const eits_real *frame)
{
    eits_touch touches[EITS_MAX_TOUCHES];
    uint32_t count;
    const eits_status status =
        eits_reconstruct(ctx, frame, eits_get_model(ctx)->n_rows, NULL, NULL);
    fuzz_check_result(ctx, status, 0);
    MUST(eits_find_touches(ctx, touches, EITS_MAX_TOUCHES, &count) == EITS_OK);
    MUST(status == EITS_OK || count == 0);
    for (uint32_t j = 0; j < eits_get_model(ctx)->n_pixels; ++j) /* perhaps solved again */
        MUST(eits_is_finite(eits_get_image(ctx)[j]));
    fuzz_check_touches(ctx, touches, count);
}

static void use(const eits_model *model)
{
    eits_context *ctx;
    eits_reference_info reference;
    static eits_real frame[MAX_ROWS];
    eits_options options;
    eits_real difference;
    const size_t size = eits_workspace_size(model, 1);
    const uint64_t work = (uint64_t)model->n_pixels * model->rank;
    if (size > FUZZ_WORKSPACE || model->n_rows > MAX_ROWS || work > MAX_WORK)
        return;
    const int prepared = model->meta_size % 2 == 0;
    const eits_status begun =
        eits_init(fuzz_workspace(0), prepared ? size : eits_workspace_size(model, 0), model, &ctx);
    /* a section UNCE that is no covariance */
    MUST(begun == EITS_OK || (begun == EITS_E_MODEL_VALUE && model->uncertainty.errors != NULL));
    if (begun != EITS_OK)
        return;
    MUST(eits_options_default(model, &options) == EITS_OK);
    MUST(eits_set_options(ctx, &options) == EITS_OK); /* its own defaults are always good ones */
    if (options.iterations <= MAX_ITERATIONS) {
        const eits_status status = eits_self_test(ctx, &difference);
        /* infinite where the golden image is not of this world, never NaN */
        MUST(difference >= 0);
        MUST(eits_get_reference(ctx, &reference) == EITS_OK);
        if (reference.ready)
            fuzz_check_result(ctx, status, 0);
    }
    uint32_t sums[EITS_SELF_TEST_SUMS];
    if (options.max_touches % 4 == 0) /* one in four: as long as all the rest */
        if (eits_self_test_sums(ctx, sums) == EITS_OK)
            fuzz_note("self-test", sums, sizeof sums);
    options.iterations = 1 + (options.iterations - 1) % MAX_ITERATIONS;
    options.touch_sweeps = 2;
    options.warm_start = 1;
    MUST(eits_set_options(ctx, &options) == EITS_OK);
    frame_of(model, model->golden.reference, 1.0f, frame);
    if (eits_reference_set(ctx, frame, model->n_rows) != EITS_OK)
        return;
    frame_of(model, model->golden.frame, 1.0f, frame);
    reconstruct(ctx, frame);
    options.sign = EITS_SIGN_BOTH;
    options.second_pass = 1;
    /* another solver than the model's; 2 is reserved */
    options.solver = model->defaults->solver == EITS_SOLVER_WORKING_SET ? EITS_SOLVER_ACTIVE_SET
                     : model->defaults->solver == EITS_SOLVER_FISTA     ? EITS_SOLVER_WORKING_SET
                                                                        : EITS_SOLVER_FISTA;
    MUST(eits_set_options(ctx, &options) == EITS_OK);
    frame_of(model, model->golden.frame, 1.5f, frame);
    reconstruct(ctx, frame);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static _Alignas(16) uint8_t room[MAX_BYTES];
    eits_model model, before;
    if (size > MAX_BYTES)
        return 0;
    /* a read too far runs out of `room`, but for 15 bytes */
    uint8_t *blob = room + MAX_BYTES - ((size + 15u) & ~(size_t)15u);
    memcpy(blob, data, size);
    memset(&model, 0x5A, sizeof model);
    memcpy(&before, &model, sizeof model);
    const eits_status status = eits_model_open(&model, blob, size);
    MUST(status == EITS_OK || memcmp(&model, &before, sizeof model) == 0);
    fuzz_note("opened", &status, sizeof status);
    MUST(eits_model_open(&before, blob + 1, size) == EITS_E_MODEL_ALIGNMENT);
    if (status == EITS_OK)
        use(&model);
    return 0;
}
