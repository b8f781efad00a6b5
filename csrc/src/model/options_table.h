/* Ranges and default values, included by options.c alone. Written by tables/make_tables.py from
 * tables/options.toml. */
/* clang-format off */
#define OPTION(name, whole, least, greatest) \
    {#name, offsetof(eits_options, name), sizeof(((eits_options *)0)->name), whole, \
     (eits_real)least, (eits_real)greatest}
static const eits_option OPTIONS[] = {
    OPTION(iterations, 1, 1, UINT32_MAX),
    OPTION(gap_every, 1, 1, UINT32_MAX),
    OPTION(max_touches, 1, 0, EITS_MAX_TOUCHES),
    OPTION(max_masked, 1, 0, UINT32_MAX),
    OPTION(sign, 1, 0, 2),
    OPTION(solver, 1, 0, 3),
    OPTION(warm_start, 1, 0, 1),
    OPTION(project_reference, 1, 0, 1),
    OPTION(lambda_abs, 0, 0, 1e30f),
    OPTION(lambda_rel, 0, 0, 1),
    OPTION(lambda_noise_factor, 0, 0, 1e30f),
    OPTION(detection_factor, 0, 0, 1e30f),
    OPTION(gap_rel, 0, 0, 1),
    OPTION(saturation_v, 0, 0, 1e30f),
    OPTION(touch_threshold, 0, 0, 1),
    OPTION(touch_min_fraction, 0, 0, 1),
    OPTION(touch_min_radius_mm, 0, 1e-06f, 1e30f),
    OPTION(touch_max_radius_mm, 0, 1e-06f, 1e30f),
    OPTION(touch_seed_radius_mm, 0, 1e-06f, 1e30f),
    OPTION(touch_change_s_per_m, 0, 0, 1e30f),
    OPTION(touch_radius_weight, 0, 0, 1e30f),
    OPTION(touch_sweeps, 1, 0, 1000),
    OPTION(follow_mm, 0, 0, 1e30f),
    OPTION(mac_limit, 1, 0, UINT32_MAX),
    OPTION(diagnostics, 1, 0, EITS_DIAGNOSTICS_ALL),
    OPTION(touch_seek, 1, 0, 1),
    OPTION(touch_fit, 1, 0, EITS_TOUCH_FIT_ALL),
    OPTION(second_pass, 1, 0, 1),
    OPTION(regularisation_noise_factor, 0, 0, 1e30f),
    OPTION(row_gains, 1, 0, 1),
    OPTION(touch_test, 1, 0, 1),
    OPTION(test_columns, 1, 0, UINT32_MAX),
    OPTION(reference_frames, 1, 0, UINT32_MAX),
    OPTION(noise_floor_v, 0, 0, 1e30f),
};
#undef OPTION

/* An option that depends on more of a model than its defaults is 0 here. */
static eits_options usual_options(const eits_defaults *d)
{
    return (eits_options){
        .iterations = (uint32_t)d->iterations,
        .gap_every = (uint32_t)10,
        .max_touches = (uint32_t)0,
        .max_masked = (uint32_t)0,
        .sign = (eits_sign)EITS_SIGN_INCREASE,
        .solver = (eits_solver)d->solver,
        .warm_start = (uint32_t)0,
        .project_reference = (uint32_t)0,
        .lambda_abs = (eits_real)0,
        .lambda_rel = (eits_real)d->lambda_rel,
        .lambda_noise_factor = (eits_real)d->lambda_noise_factor,
        .detection_factor = (eits_real)d->detection_factor,
        .gap_rel = (eits_real)0,
        .saturation_v = (eits_real)0,
        .touch_threshold = (eits_real)d->touch_threshold,
        .touch_min_fraction = (eits_real)d->touch_min_fraction,
        .touch_min_radius_mm = (eits_real)d->touch_min_radius_mm,
        .touch_max_radius_mm = (eits_real)d->touch_max_radius_mm,
        .touch_seed_radius_mm = (eits_real)d->touch_seed_radius_mm,
        .touch_change_s_per_m = (eits_real)d->touch_change_s_per_m,
        .touch_radius_weight = (eits_real)d->touch_radius_weight,
        .touch_sweeps = (uint32_t)6,
        .follow_mm = (eits_real)d->follow_mm,
        .mac_limit = (uint32_t)0,
        .diagnostics = (uint32_t)EITS_DIAGNOSTICS_ALL,
        .touch_seek = (uint32_t)0,
        .touch_fit = (uint32_t)0,
        .second_pass = (uint32_t)0,
        .regularisation_noise_factor = (eits_real)5,
        .row_gains = (uint32_t)1,
        .touch_test = (uint32_t)1,
        .test_columns = (uint32_t)200,
        .reference_frames = (uint32_t)0,
        .noise_floor_v = (eits_real)0,
    };
}
/* clang-format on */
