"""Mistakes that the C tests must notice, one at a time: in the numerics of the core, and in what it reads and writes."""

from __future__ import annotations

from mutation import of
from mutations_of_frames import FRAMES
from mutations_of_kernels import KERNELS

FISTA = of(
    "fista.c",
    ("a step twice too long", "eits_real step = 1 / (eits_real)", "eits_real step = 2 / (eits_real)", "solve"),
    ("a step half as long", "eits_real step = 1 / (eits_real)", "eits_real step = R(0.5) / (eits_real)", "solve"),
    ("no momentum", "beta = (*t - 1) / t_next", "beta = 0 * (*t - 1) / t_next", "solve"),
    ("momentum grows too slowly", "eits_fma(4 * *t, *t, 1)", "eits_fma(3 * *t, *t, 1)", "solve"),
    ("momentum never grows", "    *t = t_next;\n", "", "solve"),
    ("threshold without the step", ".threshold = step * lambda", ".threshold = lambda", "solve"),
    (
        "S z extrapolated from the older point",
        "extrapolate(ctx->sz, beta, ctx->sx_next, ctx->sx, EITS",
        "extrapolate(ctx->sz, beta, ctx->sx, ctx->sx_next, EITS",
        "solve",
    ),
    (
        "all coefficients thrown to zero taken for the answer",
        " || (none && c.gap > R(1e-3) * scale)) {",
        ") {",
        "starts",
    ),
    ("no look where nothing is left", "!(o->gap_rel > 0) && !none && eits_dot", "!(o->gap_rel > 0) && eits_dot", "starts"),
    ("the step is never halved", "step *= R(0.5);", "step *= R(1.0);", "solve_state"),
    ("momentum kept where the step is halved", "            t = 1;\n", "", "starts"),
    (
        "divergence seen too late",
        "if (!(c.objective <= ceiling) || (none",
        "if (c.objective > R(1e9) * ceiling || (none",
        "solve_state",
    ),
    ("stops at twice the gap", "c.gap <= o->gap_rel * scale", "c.gap <= 2 * o->gap_rel * scale", "solve"),
    ("momentum survives from the last frame", "    eits_copy(ctx->z, ctx->x, held(ctx));\n", "", "solve_state"),
    ("columns looked at once only", "s->interval < UINT32_MAX - k ?", "0 ?", "working_set"),
)

FRAME = (
    of(
        "frame.c",
        ("reciprocals added without their sign", "value = turn ? -measured : measured;", "value = measured;", "frame"),
        ("a fold's sum for its mean", "used == EITS_SIDE_BOTH ? R(0.5) * sum : sum", "sum", "frame"),
        ("NaN let through", "unknown = !eits_is_finite(frame[i]) ? EITS_ROW_UNKNOWN : 0", "unknown = 0", "frame"),
        ("rows without a reference let through", " || !eits_is_finite(ctx->baseline.v0[i])", "", "baseline"),
        ("saturation only beyond the limit", "eits_fabs(frame[i]) >= limit", "eits_fabs(frame[i]) > limit", "frame"),
        ("saturation on one side only", "limit > 0 && eits_fabs(frame[i]) >= limit", "limit > 0 && frame[i] >= limit", "frame"),
        ("masked rows used", "masked = ctx->bad[i] || !eits", "masked = !eits", "frame"),
        ("the gain left out", "return ctx->baseline.gain * (v - v0);", "return v - v0;", "frame"),
        ("ratios of another sign", "return (v - v0) / v0;", "return (v - v0) / eits_fabs(v0);", "frame"),
        (
            "the basis of the frame before",
            "if (changed || ctx->basis_stale)",
            "if (ctx->basis_stale)",
            "frame",
        ),
        ("Gram and Schmidt once", "pass < 2; ++pass", "pass < 1; ++pass", "frame"),
        (
            "drift of the gain along the first rows only",
            "(eits_real)fold.sign * ctx->baseline.v0[fold.second] : 0",
            "ctx->baseline.v0[fold.second] : 0",
            "frame",
        ),
        (
            "a dead front end taken for a quiet skin",
            "if (!ctx->unusable[i] && frame[i] != 0)",
            "if (!ctx->unusable[i])",
            "judgements",
        ),
        ("the logarithm bounded elsewhere", "high = R(16.0)", "high = R(32.0)", "frame"),
    )
    + of(
        "log.h",
        ("the logarithm's series cut short", "terms = 6", "terms = 4", "numbers"),
        ("another base", "R(0.69314718055994530942)", "R(0.69314118055994530942)", "numbers"),
    )
    + of(
        "baseline.c",
        (
            "Welford's deviation from the old mean twice",
            "(frame[i] - b->v0[i]) / b->m2_unit, b->m2[i])",
            "delta / b->m2_unit, b->m2[i])",
            "baseline",
        ),
        (
            "the second frame's square of the old mean",
            "(second - b->v0[i]) / b->m2_unit, 0)",
            "delta / b->m2_unit, 0)",
            "baseline",
        ),
        ("the noise without its unit", "used > 0 ? b->m2_unit * eits_sqrt", "used > 0 ? eits_sqrt", "baseline"),
        ("the unit is one", "            b->m2_unit = unit_for(ctx, frame);\n", "            b->m2_unit = 1;\n", "judgements"),
        ("readings left out are taken in", "        if (ctx->bad[i] == EITS_BAD_NOW)\n            continue;\n", "", "findings"),
        ("the second frame's own are never weighed", "    b->glitches += eits_quiet_weigh(ctx, frame);\n", "", "findings"),
        (
            "the mean of one frame more",
            "b->v0[i] += delta / (eits_real)b->count;",
            "b->v0[i] += delta / (eits_real)(b->count + 1);",
            "baseline",
        ),
        ("noise over all frames, not one less", "(eits_real)(b->count - 1)", "(eits_real)b->count", "baseline"),
        ("the gain always positive", "        b->gain = -b->gain;\n", "        ;\n", "baseline"),
        (
            "the quiet frames' least for their greatest",
            "if (seen > ctx->baseline.lambda_noise)",
            "if (seen < ctx->baseline.lambda_noise)",
            "baseline",
        ),
        ("lambda_noise learned with the model's floor", "        b->noise_v = noise_so_far(ctx);", "        ;", "floor"),
        ("noise learned against nothing", "b->count == b->wanted / 2", "b->count == b->wanted / 2 + 1", "baseline"),
        ("a warm start over a new reference", "    ctx->warm = 0;\n", "", "solve_state"),
    )
)

SOLVE = (
    of(
        "solve.c",
        ("no gate", "if (o->gate_factor > 0 && ", "if (0 && ", "solve_state"),
        ("a gate twice as high", "lambda_max < o->gate_factor *", "lambda_max < 2 * o->gate_factor *", "solve_state"),
        ("lambda the less of two", "return by_data > by_noise ?", "return by_data < by_noise ?", "solve_state"),
        (
            "the noise without its factor",
            "o->lambda_noise_factor * eits_lambda_noise(ctx)",
            "eits_lambda_noise(ctx)",
            "judgements",
        ),
        ("warm where zero is better", "return twice < ", "return twice > 0 * ", "solve_state"),
        (
            "a warm start's own penalty forgotten",
            "eits_fma(2 * ctx->info.lambda, l1,",
            "eits_fma(0 * ctx->info.lambda, l1,",
            "starts",
        ),
        (
            "old S x at a warm start",
            "ctx->info.nonzeros = eits_apply(ctx, ctx->x, ctx->sx);",
            "ctx->info.nonzeros = count;",
            "starts",
        ),
        ("a gated frame's start survives", "    ctx->warm = 0;\n", "", "starts"),
        (
            "column weights divide",
            "ctx->x[j] * (eits_real)ctx->model->column_weight[j]",
            "ctx->x[j] / (eits_real)ctx->model->column_weight[j]",
            "solve",
        ),
    )
    + of(
        "stages.c",
        ("projected by half", "v, -eits_dot(ctx, direction, v, rank)", "v, R(-0.5) * eits_dot(ctx, direction, v, rank)", "frame"),
        (
            "the first alone is looked at for NaN",
            "all &= eits_is_finite(values[i]);",
            "all &= eits_is_finite(values[0]);",
            "solve_state",
        ),
    )
    + of(
        "certificate.c",
        (
            "the gap's residual part to the first power",
            "R(0.5) * (1 - s) * (1 - s), c.residual_squared",
            "R(0.5) * (1 - s), c.residual_squared",
            "solve",
        ),
        (
            "the dual point not scaled",
            "s = largest > lambda ? lambda / largest : 1;\n    const uint32_t",
            "s = 1;\n    const uint32_t",
            "solve",
        ),
        ("the objective without its penalty", "lane_l1[j % 8] += weight;", "lane_l1[j % 8] += 0 * weight;", "solve_state"),
        (
            "a residual of the other sign",
            "eits_axpy(ctx, ctx->residual, -1, sx, stride);",
            "eits_axpy(ctx, ctx->residual, 1, sx, stride);",
            "solve",
        ),
        ("the gap without the columns", "eits_tree8(lane));\n    c.objective", "0);\n    c.objective", "solve"),
    )
)

WORKING_SET = of(
    "working_set.c",
    ("rising columns left out", "return gradient > rest.high || ", "return ", "working_set"),
    (
        "columns chosen by twice lambda",
        "sign == EITS_SIGN_DECREASE ? none : lambda}",
        "sign == EITS_SIGN_DECREASE ? none : 2 * lambda}",
        "working_set",
    ),
    ("panels of columns that were dropped", "    if (count < before)\n        eits_pack_panels(ctx);\n", "", "working_set"),
    (
        "coefficients stay where they were packed",
        "ctx->x_next[ctx->working[k]] = ctx->x[k];",
        "ctx->x_next[k] = ctx->x[k];",
        "working_set",
    ),
)

EXACT = (
    of(
        "coordinate.c",
        ("a coordinate's step without its norm", "v = eits_fma(norm, before, gradient)", "v = before + gradient", "exact_edges"),
        ("a coordinate not shrunk", "shrunk = up ? v - d->lambda", "shrunk = up ? v", "exact_edges"),
        (
            "the residual moves without the scale",
            "ctx->residual, -step * scale, column",
            "ctx->residual, -step, column",
            "exact_edges",
        ),
        ("the ignored direction not taken out", "gradient = eits_fma(-d->along, d->slant[j], gradient);", ";", "exact_edges"),
        ("rest for what still moves", "return 64 * epsilon * epsilon *", "return 64 * epsilon *", "exact_edges"),
    )
    + of(
        "active_set.c",
        ("pulls without lambda", "a->pull[k] = *g - a->sign[k] * a->lambda;", "a->pull[k] = *g;", "exact_edges"),
        ("Newton's step beyond a change of sign", "if (a->sign[k] * target > 0)", "if (1)", "exact_edges"),
        ("tolerance a thousand times as wide", "a.tolerance = 2 * EPSILON", "a.tolerance = 20000 * EPSILON", "exact_edges"),
    )
    + of(
        "factor.c",
        ("a row of K without its sign", "r[k] = -share * d[k];", "r[k] = share * d[k];", "exact_edges"),
        ("a row of K not scaled", "    r[count] = share;\n", "    r[count] = 1;\n", "exact_edges"),
        ("a reflection half as far", "1 / (norm * (norm + end)) : 0", "R(0.5) / (norm * (norm + end)) : 0", "exact_edges"),
        (
            "a reflection that cancels",
            "scratch[last] < 0 ? -(norm + end) : norm + end",
            "scratch[last] < 0 ? norm + end : -(norm + end)",
            "exact_edges",
        ),
        ("the column dropped stays", "        r[place] = r[last];\n", "", "exact_edges"),
        ("a column dropped leaves its end", "        r[last] = 0;\n", "", "exact_edges"),
        (
            "K' without the last row",
            "rows_sum(ctx->factor, stride, count, length, w, d);",
            "rows_sum(ctx->factor, stride, count - 1, length, w, d);",
            "exact_edges",
        ),
    )
    + of(
        "missing.c",
        (
            "columns missed whose correlation is beyond lambda",
            "whole ? flag[j - first] : v[j] > least)",
            "whole ? flag[j - first] : v[j] > 4 * least)",
            "exact_edges",
        ),
    )
)

TOUCH = (
    of(
        "disc.c",
        ("an area of whole pixels", "pixels += share > 0 ? (share < 1 ? share : 1) : 0;", "pixels += share > 0 ? 1 : 0;", "disc"),
        ("covers half a pixel too wide", "share = R(0.5) + (radius - distance)", "share = R(1.0) + (radius - distance)", "disc"),
        ("a rim without slope", "share < 1 ? factor / pixel : 0", "share < 1 ? 0 * factor / pixel : 0", "disc"),
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
        "touch.c",
        ("touches of the other sign", "return change * disc->polarity > 0 ? change : 0;", "return change;", "touch"),
        ("too weak a touch is kept", "f->explained[weakest] >= ctx->options.touch_share", "f->explained[weakest] >= 0", "touch"),
        (
            "the strongest is dropped",
            "f->explained[k] < f->explained[weakest] ? k",
            "f->explained[k] > f->explained[weakest] ? k",
            "touch",
        ),
        (
            "what is dropped stays explained",
            "eits_axpy(ctx, ctx->residual, f->disc[k].change, atom_of(ctx, k), rank);\n    --f->count",
            "--f->count",
            "touch",
        ),
        (
            "a disc moves downhill only by luck",
            "g[i] = disc->change * eits_dot(ctx, column[i], left, rank);",
            "g[i] = -disc->change * eits_dot(ctx, column[i], left, rank);",
            "touch_fit",
        ),
        ("no halving of a disc's step", "attempt < 3; ++attempt", "attempt < 1; ++attempt", "track"),
        ("a radius that strength does not tell", "weight = o->touch_radius_weight * energy", "weight = 0 * energy", "touch_fit"),
        ("touches that noise makes", "return best >= least;", "return best >= 0 * least;", "touch"),
    )
    + of(
        "track.c",
        ("the farthest for the nearest", "squared <= nearest", "squared <= reach", "track"),
        ("two touches of one id", "        taken[from] = 1;\n", "", "track"),
        ("the id 0", "ctx->next_id == UINT32_MAX ? 1 : ctx->next_id + 1", "ctx->next_id + 1", "track"),
        (
            "every birth waits",
            "f->seen < ctx->options.track_confirm && !clear",
            "f->seen < ctx->options.track_confirm && !(0 * clear)",
            "track_in_time",
        ),
        ("half of a touch is a touch", " && f->touch.confidence >= SURE_SHARE;", ";", "track_in_time"),
        ("near noise is sure enough", ">= SURE_CLEARNESS * ctx", ">= 1 * ctx", "track_in_time"),
        ("noise is never faint", "< ctx->info.lambda_noise;", "< 0;", "track_in_time"),
        ("a share for its root", "eits_sqrt(touch->confidence)", "touch->confidence", "track_in_time"),
        (
            "newborns reach as far as known touches",
            "told ? ctx->options.follow_mm : NEWBORN_REACH *",
            "told ? ctx->options.follow_mm :",
            "track_in_time",
        ),
        ("a lifted touch stays", "const int held = f->faint &&", "const int held =", "track_in_time"),
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
        ("a velocity that is not used", "next.touch.x_mm += f->vx_mm;", "next.touch.x_mm += 0;", "track_in_time"),
        ("ever surer of the place", "next.place_mm2 += eits_fma(", "next.place_mm2 += 0 * eits_fma(", "track_in_time"),
        ("noise that all touches share", "ctx->info.lambda_noise / own : 0", "1 : 0", "track_in_time"),
        ("a finger runs off the skin", "is_finite(&next) && on_skin(ctx, &next.touch))", "is_finite(&next))", "track_in_time"),
        (
            "a filter that breaks down",
            "is_finite(&next) && on_skin(ctx, &next.touch) ? next : anew",
            "1 ? next : anew",
            "track_in_time",
        ),
        ("a radius that lags by itself", "eits_fma(gain, found->radius_mm", "eits_fma(R(0.5), found->radius_mm", "track_in_time"),
    )
)

LOAD = of(
    "load.c",
    ("the gain left out", "eits_fabs(strength_s_per_m_mm2) * gain_at(load, u, v)", "eits_fabs(strength_s_per_m_mm2)", "load"),
    ("a negative strength's load", "eits_fabs(strength_s_per_m_mm2) *", "strength_s_per_m_mm2 *", "load"),
    ("a polynomial without bounds", "(gain < MOST_GAIN ? gain : MOST_GAIN)", "gain", "load"),
    ("beyond where it was calibrated", "if (from > reach) {", "if (0 * from > reach) {", "load"),
    ("powers of u and v mixed up", "power[degree + 1] = power[degree] * v;", "power[degree + 1] = power[degree] * u;", "load"),
    ("the table's first piece for all", "while (k < last && strength >", "while (0 && strength >", "load"),
    ("loads without end", "return found < most ? found : most;", "return found;", "load"),
)

BYTES = of(
    "model.c",
    (
        "a checksum of every other nibble",
        "        crc ^= p[i];\n        crc = (crc >> 4) ^ table[crc & 15u];\n",
        "        crc ^= p[i];\n",
        "model",
    ),
    ("sections may reach beyond the end", "size > total - offset", "size > total", "model"),
    ("calibrations that fall", " || !(values[k] > values[k - 1])", "", "load"),
    ("calibrations that begin above nothing", "return values[0] == 0.0f;", "return 1;", "load"),
    ("halves that are infinite", "(values[i] & 0x7C00u) == 0x7C00u", "(values[i] & 0x7FFFu) == 0x7FFFu", "model_values"),
) + of(
    "link.c",
    ("a full block stands for a zero", "if (d->in_packet && d->code != LONGEST_BLOCK)", "if (d->in_packet)", "link"),
    (
        "checksums not looked at",
        "if (eits_crc32(0, d->buffer, d->used - CHECKSUM) !=",
        "if (0 && eits_crc32(0, d->buffer, d->used - CHECKSUM) !=",
        "link",
    ),
)

MUTATIONS = FISTA + KERNELS + FRAME + SOLVE + WORKING_SET + EXACT + TOUCH + LOAD + BYTES + FRAMES
