"""Mistakes in how touches are found: discs, their fit, which are kept, joined and parted, and what
they do to each other."""

from __future__ import annotations

from mutation import of

TOUCHES = (
    of(
        "disc.c",
        (
            "an area of whole pixels",
            "pixels += share > 0 ? (share < 1 ? share : 1) : 0;",
            "pixels += share > 0 ? 1 : 0;",
            "disc",
        ),
        (
            "covers half a pixel too wide",
            "share = R(0.5) + (radius - distance)",
            "share = R(1.0) + (radius - distance)",
            "disc",
        ),
        (
            "a rim without slope",
            "c->ramp[k] *= factor / pixel;",
            "c->ramp[k] *= 0 * factor / pixel;",
            "disc",
        ),
        ("weights not divided by", " / (eits_real)model->column_weight[j];", ";", "disc"),
        (
            "the skin a cell too wide",
            "x1 > 2 ? x1 - 2 : 0; ix <= x1 &&",
            "x1 > 2 ? x1 - 2 : 0; ix <= x1 + 1 &&",
            "disc",
        ),
        (
            "the skin is all of the image",
            "            if (ctx->cell[(size_t)iy * model->nx + ix] != EITS_NO_PIXEL)\n",
            "            if (1)\n",
            "disc",
        ),
        (
            "the skin begins at its first cell",
            "if (!(x >= -1 && y >= -1 &&",
            "if (!(x >= 0 && y >= -1 &&",
            "disc",
        ),
    )
    + of(
        "fit.c",
        (
            "touches of the other sign",
            "return change * disc->polarity > 0 ? change : 0;",
            "return change;",
            "touch",
        ),
        (
            "a disc moves downhill only by luck",
            "g[i] = disc->change * eits_dot(ctx, column[i], left, rank);",
            "g[i] = -disc->change * eits_dot(ctx, column[i], left, rank);",
            "touch_fit",
        ),
        (
            "no halving of a disc's step",
            "attempt < 3; ++attempt",
            "attempt < 1; ++attempt",
            "track",
        ),
        (
            "a radius that strength does not tell",
            "by_energy = f->radius_weight * energy",
            "by_energy = 0 * energy",
            "touch_fit",
        ),
        (
            "a restart from half the discs",
            "eits_axpy(ctx, ctx->residual, -f->disc[k].change",
            "eits_axpy(ctx, ctx->residual, R(-0.5) * f->disc[k].change",
            "regroup",
        ),
    )
    + of(
        "keep.c",
        (
            "too weak a touch is kept",
            "f->explained[weakest] >= ctx->options.touch_share",
            "f->explained[weakest] >= 0",
            "touch",
        ),
        (
            "the strongest is dropped",
            "f->explained[k] < f->explained[weakest] ? k",
            "f->explained[k] > f->explained[weakest] ? k",
            "touch",
        ),
        (
            "what is dropped stays explained",
            (
                "eits_axpy(ctx, ctx->residual, f->disc[k].change, eits_atom(ctx, k), rank);\n   "
                " --f->count"
            ),
            "--f->count",
            "touch",
        ),
        ("touches that noise makes", "return best >= least;", "return best >= 0 * least;", "touch"),
    )
    + of(
        "touch.c",
        (
            "refined within a limit of work",
            "ctx->options.refine && ctx->options.mac_limit == 0",
            "ctx->options.refine",
            "regroup",
        ),
        (
            "no discs joined or parted",
            "EITS_SEARCH_REGROUP) != 0 &&",
            "EITS_SEARCH_REGROUP) == 9 &&",
            "regroup",
        ),
    )
    + of(
        "coupling.c",
        (
            "interplay of log ratios",
            "ctx->model->data_kind == EITS_DATA_DIFFERENCE &&",
            "1 &&",
            "coupling",
        ),
        (
            "no limit of the interplay",
            "if (!(added <= MOST * whole))",
            "if (added > R(1e9) * whole)",
            "coupling",
        ),
        (
            "dipoles inside each other",
            "const eits_real share = distance < touching ? distance / touching : 1;",
            "const eits_real share = 1;",
            "coupling",
        ),
        ("no rim", "{mirror[0] - b_z.re, mirror[1] - b_z.im}", "{0 * b_z.re, 0}", "coupling"),
        (
            "the mirror turned round",
            "s * (direct.re - mirrored.re), s * (direct.im - mirrored.im)",
            "s * (direct.re + mirrored.re), s * (direct.im + mirrored.im)",
            "coupling",
        ),
        ("a moment without the soft edge", "pixel * pixel / 12);", "0 * pixel);", "coupling"),
        (
            "each in its own field",
            "            if (j != i)\n",
            "            if (j != i || count == 2)\n",
            "coupling",
        ),
        (
            "interplay added, not taken out",
            "data[i] -= ctx->sx[i];",
            "data[i] += ctx->sx[i];",
            "coupling",
        ),
    )
    + of(
        "regroup.c",
        ("signs joined", "f->disc[i].polarity != f->disc[j].polarity || ", "", "regroup"),
        (
            "true touches joined",
            "if (left_over(ctx) <= before.left + more)",
            "if (left_over(ctx) <= before.left + R(1e3) * more)",
            "regroup",
        ),
        (
            "nothing is joined",
            "if (left_over(ctx) <= before.left + more)",
            "if (left_over(ctx) <= 0 * more)",
            "regroup",
        ),
        ("what is not joined stays joined", "    f->count = s->count;\n", "", "regroup"),
        (
            "more touches than there may be",
            "if (f->count >= ctx->options.max_touches || left_over",
            "if (left_over",
            "regroup",
        ),
        ("parted along two directions", "d < DIRECTIONS; ++d", "d < 2; ++d", "regroup"),
        (
            "parted where it gains nothing",
            "if (left <= PART_GAIN * before.left && before.left - left >= least &&",
            "if (",
            "regroup",
        ),
        (
            "noise parted",
            "eits_fma(PART_WHOLE, f->whole, PART_NOISE * f->noise)",
            "PART_WHOLE * f->whole",
            "regroup",
        ),
    )
    + of(
        "track.c",
        ("the farthest for the nearest", "squared <= nearest", "squared <= reach", "track"),
        ("two touches of one id", "        taken[from] = 1;\n", "", "track"),
        (
            "the id 0",
            "ctx->next_id == UINT32_MAX ? 1 : ctx->next_id + 1",
            "ctx->next_id + 1",
            "track",
        ),
        (
            "every birth waits",
            "f->seen < ctx->options.track_confirm && !clear",
            "f->seen < ctx->options.track_confirm && !(0 * clear)",
            "track_in_time",
        ),
        (
            "half of a touch is a touch",
            " && f->touch.confidence >= SURE_SHARE;",
            ";",
            "track_in_time",
        ),
        ("near noise is sure enough", ">= SURE_CLEARNESS * ctx", ">= 1 * ctx", "track_in_time"),
        ("noise is never faint", "< ctx->info.lambda_noise;", "< 0;", "track_in_time"),
        (
            "a share for its root",
            "eits_sqrt(touch->confidence)",
            "touch->confidence",
            "track_in_time",
        ),
        (
            "newborns reach as far as known touches",
            "told ? ctx->options.follow_mm : NEWBORN_REACH *",
            "told ? ctx->options.follow_mm :",
            "track_in_time",
        ),
        (
            "a lifted touch stays",
            "const int held = f->faint &&",
            "const int held =",
            "track_in_time",
        ),
        ("noise is held", "f->seen >= KNOWN_FRAMES && told", "told", "track_in_time"),
        ("held touches beyond the most", "&& told < ctx->options.max_touches", "", "track_in_time"),
        ("ids held for ever", "f->missed >= ctx->options.track_hold", "0", "track_in_time"),
        ("a held touch still explains", "        f->touch.confidence = 0;\n", "", "track_in_time"),
        (
            "a velocity that is not learned",
            "next.vx_mm = eits_fma(speed_gain, dx, before->vx_mm);",
            "next.vx_mm = before->vx_mm;",
            "track_in_time",
        ),
        (
            "a velocity that is not used",
            "next.touch.x_mm += f->vx_mm;",
            "next.touch.x_mm += 0;",
            "track_in_time",
        ),
        (
            "ever surer of the place",
            "next.place_mm2 += eits_fma(",
            "next.place_mm2 += 0 * eits_fma(",
            "track_in_time",
        ),
        (
            "noise that all touches share",
            "ctx->info.lambda_noise / own : 0",
            "1 : 0",
            "track_in_time",
        ),
        (
            "a finger runs off the skin",
            "is_finite(&next) && on_skin(ctx, &next.touch))",
            "is_finite(&next))",
            "track_in_time",
        ),
        (
            "a filter that breaks down",
            "is_finite(&next) && on_skin(ctx, &next.touch) ? next : anew",
            "1 ? next : anew",
            "track_in_time",
        ),
        (
            "a radius that lags by itself",
            "eits_fma(gain, found->radius_mm",
            "eits_fma(R(0.5), found->radius_mm",
            "track_in_time",
        ),
    )
)

LOAD = of(
    "load.c",
    (
        "a load without its place's gain",
        "(strength_s_per_m_mm2) * gain_at(load, u, v)",
        "(strength_s_per_m_mm2)",
        "load",
    ),
    (
        "a negative strength's load",
        "eits_fabs(strength_s_per_m_mm2) *",
        "strength_s_per_m_mm2 *",
        "load",
    ),
    ("a polynomial without bounds", "(gain < MOST_GAIN ? gain : MOST_GAIN)", "gain", "load"),
    ("beyond where it was calibrated", "if (from > reach) {", "if (0 * from > reach) {", "load"),
    (
        "powers of u and v mixed up",
        "power[degree + 1] = power[degree] * v;",
        "power[degree + 1] = power[degree] * u;",
        "load",
    ),
    (
        "the table's first piece for all",
        "while (k < last && strength >",
        "while (0 && strength >",
        "load",
    ),
    ("loads without end", "return found < most ? found : most;", "return found;", "load"),
)
