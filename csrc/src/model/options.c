/* Get a model's own options and those for a stream, and check that options are in range. Names,
 * ranges and default values come from tables/options.toml. */
#include "model/options.h"

#include "base/vec.h"
#include "model/constants.h"
#include "model/options_table.h"

#include <string.h>

const eits_option *eits_option_table(uint32_t *count)
{
    if (count != NULL)
        *count = (uint32_t)(sizeof OPTIONS / sizeof OPTIONS[0]);
    return OPTIONS;
}

eits_status eits_options_default(const eits_model *model, eits_options *options)
{
    if (model == NULL || options == NULL)
        return EITS_E_ARGUMENT;
    const eits_defaults *d = model->defaults;
    *options = usual_options(d);
    /* A model may ask for more touches than this build holds; its other defaults are still valid.
     */
    options->max_touches = d->max_touches < EITS_MAX_TOUCHES ? d->max_touches : EITS_MAX_TOUCHES;
    options->max_masked = model->n_rows / 2;
    options->touch_fit = EITS_TOUCH_FIT_ALL & ~d->touch_fit_left_out;
    options->project_reference = (d->touch_fit_left_out & EITS_GAIN_DRIFT_KEPT) == 0;
    options->reference_frames =
        (d->touch_fit_left_out & EITS_TRACKS_REFERENCE) != 0 ? EITS_REFERENCE_TRACKING_FRAMES : 0;
    options->touch_seek = !options->project_reference; /* 1 for a taught model */
    return EITS_OK;
}

eits_status eits_options_track(eits_options *options)
{
    if (options == NULL)
        return EITS_E_ARGUMENT;
    /* A lower threshold reports more noise as touches; confirmation by a second frame removes those
     * again, and more of the light touches remain. The factor was fitted on tuning streams. */
    options->detection_factor *= EITS_TRACK_DETECTION;
    return EITS_OK;
}

/* A whole number takes one to four bytes: compilers for small processors pack enums. */
static int is_in_range(const eits_options *options, const eits_option *one)
{
    const void *place = (const uint8_t *)options + one->offset;
    eits_real value;
    if (one->whole) {
        uint32_t number = 0;
        memcpy(&number, place, one->size);
        value = (eits_real)number;
    } else {
        memcpy(&value, place, sizeof value);
    }
    return eits_is_finite(value) && value >= one->least && value <= one->greatest;
}

/* The range of the option has a gap: 2 was coordinate descent, which this core no longer has. Its
 * number stays reserved, so that no model and no host that still names it gets another solver. */
static int is_solver(eits_solver solver)
{
    switch (solver) {
    case EITS_SOLVER_FISTA:
    case EITS_SOLVER_WORKING_SET:
    case EITS_SOLVER_ACTIVE_SET:
        return 1;
    }
    return 0;
}

/* The bits have a gap, too: models use 8 and 16 for other things (touch_fit_left_out). */
static int is_touch_fit(uint32_t bits)
{
    return (bits & ~EITS_TOUCH_FIT_ALL) == 0;
}

/* Check that options are in range. The ranges are wide: they keep numbers finite and counts in
 * range, and do not say which values are sensible. */
int eits_options_in_range(const eits_options *o)
{
    for (size_t k = 0; k < sizeof OPTIONS / sizeof OPTIONS[0]; ++k) {
        if (!is_in_range(o, &OPTIONS[k]))
            return 0;
    }
    /* A fit starts from the seed radius and stays between the other two: a seed outside them would
     * jump. */
    return is_solver(o->solver) && is_touch_fit(o->touch_fit) &&
           o->touch_min_radius_mm <= o->touch_seed_radius_mm &&
           o->touch_seed_radius_mm <= o->touch_max_radius_mm;
}
