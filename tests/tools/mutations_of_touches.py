"""Mistakes in how touches are found: discs, their fit, which are kept, joined and parted, and what they do to each other."""

from __future__ import annotations

from mutation import of

TOUCHES = (
    of(
        "disc.c",
        ("covers half a pixel too wide", "share = R(0.5) + (radius - distance)", "share = R(1.0) + (radius - distance)", "disc"),
        ("a rim without slope", "c->ramp[k] *= factor / pixel;", "c->ramp[k] *= 0 * factor / pixel;", "disc"),
        ("weights not divided by", " / (eits_real)model->column_weight[j];", ";", "disc"),
        ("the skin a cell too wide", "x1 > 2 ? x1 - 2 : 0; ix <= x1 &&", "x1 > 2 ? x1 - 2 : 0; ix <= x1 + 1 &&", "disc"),
        (
            "the skin is all of the image",
            "            if (ctx->cell[(size_t)iy * model->nx + ix] != EITS_NO_PIXEL)\n",
            "            if (1)\n",
            "disc",
        ),
        ("the skin begins at its first cell", "if (!(x >= -1 && y >= -1 &&", "if (!(x >= 0 && y >= -1 &&", "disc"),
    )
    + of(
        "fit.c",
        ("touches of the other sign", "return change * disc->polarity > 0 ? change : 0;", "return change;", "touch"),
        (
            "a disc moves downhill only by luck",
            "g[i] = disc->change * eits_dot(ctx, column[i], left, rank);",
            "g[i] = -disc->change * eits_dot(ctx, column[i], left, rank);",
            "touch_fit",
        ),
        ("no halving of a disc's step", "attempt < 3; ++attempt", "attempt < 1; ++attempt", "track"),
        ("a radius that strength does not tell", "by_energy = f->radius_weight * energy", "by_energy = 0 * energy", "touch_fit"),
        (
            "a restart from half the discs",
            "eits_axpy(ctx, ctx->residual, -f->disc[k].change",
            "eits_axpy(ctx, ctx->residual, R(-0.5) * f->disc[k].change",
            "regroup",
        ),
    )
    + of(
        "keep.c",
        ("too weak a touch is kept", "f->explained[weakest] >= ctx->options.touch_share", "f->explained[weakest] >= 0", "touch"),
        (
            "the strongest is dropped",
            "f->explained[k] < f->explained[weakest] ? k",
            "f->explained[k] > f->explained[weakest] ? k",
            "touch",
        ),
        (
            "what is dropped stays explained",
            "eits_axpy(ctx, ctx->residual, f->disc[k].change, eits_atom(ctx, k), rank);\n    --f->count",
            "--f->count",
            "touch",
        ),
        ("touches that noise makes", "return best >= least;", "return best >= 0 * least;", "touch"),
    )
    + of(
        "touch.c",
        (
            "strength without the soft edge",
            "eits_fma(disc->radius_mm, disc->radius_mm, soft_edge)",
            "eits_fma(disc->radius_mm, disc->radius_mm, 0 * soft_edge)",
            "touch_fit",
        ),
        (
            "refined within a limit of work",
            "ctx->options.refine && ctx->options.mac_limit == 0",
            "ctx->options.refine",
            "regroup",
        ),
        ("no discs joined or parted", "EITS_SEARCH_REGROUP) != 0, couples", "EITS_SEARCH_REGROUP) == 9, couples", "regroup"),
    )
    + of(
        "coupling.c",
        ("interplay of log ratios", "ctx->model->data_kind == EITS_DATA_DIFFERENCE &&", "1 &&", "coupling"),
        ("no limit of the interplay", "if (!(added <= MOST * whole))", "if (added > R(1e9) * whole)", "coupling"),
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
        ("each in its own field", "            if (j != i)\n", "            if (j != i || count == 2)\n", "coupling"),
        (
            "directions to ignore are not ignored",
            "ctx->model->rank + eits_project(ctx, out)",
            "ctx->model->rank + 0 * eits_project(ctx, ctx->sz)",
            "coupling",
        ),
        ("interplay added, not taken out", "data[i] -= ctx->sx[i];", "data[i] += ctx->sx[i];", "coupling"),
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
        ("nothing is joined", "if (left_over(ctx) <= before.left + more)", "if (left_over(ctx) <= 0 * more)", "regroup"),
        ("what is not joined stays joined", "    f->count = s->count;\n", "", "regroup"),
        ("more touches than there may be", "if (f->count >= ctx->options.max_touches || left_over", "if (left_over", "regroup"),
        ("parted along two directions", "d < DIRECTIONS; ++d", "d < 2; ++d", "regroup"),
        (
            "parted where it gains nothing",
            "if (left <= PART_GAIN * before.left && before.left - left >= least &&",
            "if (",
            "regroup",
        ),
        ("noise parted", "eits_fma(PART_WHOLE, f->whole, PART_NOISE * f->noise)", "PART_WHOLE * f->whole", "regroup"),
    )
    + of(
        "track.c",
        ("the farthest for the nearest", "squared <= nearest", "squared <= limit", "track"),
        ("two touches of one id", "        taken[from] = 1;\n", "", "track"),
        ("the id 0", "ctx->next_id == UINT32_MAX ? 1 : ctx->next_id + 1", "ctx->next_id + 1", "track"),
    )
)
