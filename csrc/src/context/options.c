/* The options: their defaults, and what they may be. */
#include "context/options.h"

#include "base/vec.h"

/* Chosen on training scenes at 30 to 55 dB, of one to three touches, six, light ones and drift. */
#define REGULARISATION_NOISE_FACTOR R(5.0)

eits_status eits_options_default(const eits_model *model, eits_options *options)
{
    if (model == NULL || options == NULL)
        return EITS_E_ARGUMENT;
    const eits_defaults *d = model->defaults;
    const eits_options chosen = {
        .iterations = d->iterations,
        .gap_every = 10,
        .max_touches = d->max_touches < EITS_MAX_TOUCHES ? d->max_touches : EITS_MAX_TOUCHES,
        .max_masked = model->n_rows / 2,
        .sign = EITS_SIGN_INCREASE,
        .solver = (eits_solver)d->solver,
        .warm_start = 0,
        .project_reference = 1,
        .lambda_abs = 0,
        .lambda_rel = (eits_real)d->lambda_rel,
        .lambda_noise_factor = (eits_real)d->lambda_noise_factor,
        .detection_factor = (eits_real)d->detection_factor,
        .gap_rel = 0,
        .mac_limit = 0,
        .saturation_v = 0,
        .touch_threshold = (eits_real)d->touch_threshold,
        .touch_min_fraction = (eits_real)d->touch_min_fraction,
        .touch_min_radius_mm = (eits_real)d->touch_min_radius_mm,
        .touch_max_radius_mm = (eits_real)d->touch_max_radius_mm,
        .touch_seed_radius_mm = (eits_real)d->touch_seed_radius_mm,
        .touch_change_s_per_m = (eits_real)d->touch_change_s_per_m,
        .touch_sweeps = 6,
        .touch_radius_weight = (eits_real)d->touch_radius_weight,
        .follow_mm = (eits_real)d->follow_mm,
        .diagnostics = EITS_DIAGNOSTICS_ALL,
        .touch_fit = EITS_TOUCH_FIT_ALL & ~d->touch_fit_left_out,
        .second_pass = 0,
        .track_confirm = 0,
        .track_hold = 0,
        .track_smooth = 0,
        .regularisation_noise_factor = REGULARISATION_NOISE_FACTOR,
    };
    *options = chosen;
    return EITS_OK;
}

eits_status eits_options_track(eits_options *options)
{
    if (options == NULL)
        return EITS_E_ARGUMENT;
    /* A lower threshold lets more noise through as touches; confirmation over two frames takes
     * those out again, and what remains is more of the light touches. Fitted on tuning streams. */
    options->detection_factor *= R(0.75);
    options->track_confirm = 2;
    options->track_hold = 2;
    options->track_smooth = R(0.66);
    return EITS_OK;
}

static int in_range(eits_real value, eits_real low, eits_real high)
{
    return eits_is_finite(value) && value >= low && value <= high;
}

/* Limits are wide: they keep numbers finite and counts in range, and do not say what is
 * sensible. */
int eits_options_valid(const eits_options *o)
{
    const eits_real huge = R(1e30);
    return o->iterations >= 1 && o->gap_every >= 1 && o->max_touches <= EITS_MAX_TOUCHES &&
           (uint32_t)o->sign <= (uint32_t)EITS_SIGN_BOTH &&
           (uint32_t)o->solver <= (uint32_t)EITS_SOLVER_ACTIVE_SET && o->warm_start <= 1 &&
           o->project_reference <= 1 && in_range(o->lambda_abs, 0, huge) &&
           in_range(o->lambda_rel, 0, 1) && in_range(o->lambda_noise_factor, 0, huge) &&
           in_range(o->detection_factor, 0, huge) && in_range(o->gap_rel, 0, 1) &&
           in_range(o->saturation_v, 0, huge) && in_range(o->touch_threshold, 0, 1) &&
           in_range(o->touch_min_fraction, 0, 1) && in_range(o->touch_change_s_per_m, 0, huge) &&
           in_range(o->touch_radius_weight, 0, huge) &&
           in_range(o->touch_min_radius_mm, R(1e-6), huge) &&
           in_range(o->touch_max_radius_mm, o->touch_min_radius_mm, huge) &&
           in_range(o->touch_seed_radius_mm, o->touch_min_radius_mm, o->touch_max_radius_mm) &&
           in_range(o->follow_mm, 0, huge) && o->touch_sweeps <= 1000 &&
           o->diagnostics <= EITS_DIAGNOSTICS_ALL && o->touch_fit <= EITS_TOUCH_FIT_ALL &&
           o->second_pass <= 1 && o->track_confirm <= EITS_MAX_TRACK_FRAMES &&
           o->track_hold <= EITS_MAX_TRACK_FRAMES && in_range(o->track_smooth, 0, huge) &&
           in_range(o->regularisation_noise_factor, 0, huge);
}
