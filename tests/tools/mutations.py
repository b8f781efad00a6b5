"""Mistakes that the C tests must notice, one at a time: in the numerics of the core, and in what it
reads and writes."""

from __future__ import annotations

from mutation import of
from mutations_of_frames import FRAMES
from mutations_of_kernels import KERNELS
from mutations_of_touches import LOAD, TOUCHES

FISTA = of(
    "fista.c",
    (
        "a step twice too long",
        "eits_real step = 1 / (eits_real)",
        "eits_real step = 2 / (eits_real)",
        "solve",
    ),
    (
        "a step half as long",
        "eits_real step = 1 / (eits_real)",
        "eits_real step = R(0.5) / (eits_real)",
        "solve",
    ),
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
    (
        "no look where nothing is left",
        "!(o->gap_rel > 0) && !none && eits_dot",
        "!(o->gap_rel > 0) && eits_dot",
        "starts",
    ),
    ("the step is never halved", "step *= R(0.5);", "step *= R(1.0);", "solve_state"),
    ("momentum kept where the step is halved", "            t = 1;\n", "", "starts"),
    (
        "divergence seen too late",
        "if (!(c.objective <= ceiling) || (none",
        "if (c.objective > R(1e9) * ceiling || (none",
        "solve_state",
    ),
    (
        "stops at twice the gap",
        "c.gap <= o->gap_rel * scale",
        "c.gap <= 2 * o->gap_rel * scale",
        "solve",
    ),
    (
        "momentum survives from the last frame",
        "    eits_copy(ctx->z, ctx->x, held(ctx));\n",
        "",
        "solve_state",
    ),
    ("columns looked at once only", "s->interval < UINT32_MAX - k ?", "0 ?", "working_set"),
)

FRAME = (
    of(
        "frame.c",
        (
            "reciprocals added without their sign",
            "value = turn ? -measured : measured;",
            "value = measured;",
            "frame",
        ),
        (
            "a fold's sum for its mean",
            "ctx->d[k] = used == EITS_SIDE_BOTH ? R(0.5) * sum : sum",
            "ctx->d[k] = sum",
            "frame",
        ),
        (
            "a straight fold's sum",
            "ctx->list_value[count] = used == EITS_SIDE_BOTH ? R(0.5) * sum : sum",
            "ctx->list_value[count] = sum",
            "coupling",
        ),
        (
            "straight reciprocals not turned",
            "sum += side == 1 && fold.sign < 0 ? -value : value;",
            "sum += value;",
            "coupling",
        ),
        (
            "a logarithm of no reference",
            "eits_fabs(v0[i]) < least ? datum(ctx, frame[i], v0[i]) :",
            "",
            "coupling",
        ),
        (
            "rounding tells two measurements",
            "const eits_real rounding = sizeof(eits_real) == 4 ? R(0x1p-20) : R(0x1p-49);",
            "const eits_real rounding = 0;",
            "frame",
        ),
        (
            "NaN let through",
            "unknown = !eits_is_finite(frame[i]) ? EITS_ROW_UNKNOWN : 0",
            "unknown = 0",
            "frame",
        ),
        (
            "rows without a reference let through",
            " || !eits_is_finite(ctx->baseline.v0[i])",
            "",
            "baseline",
        ),
        (
            "saturation only beyond the limit",
            "eits_fabs(frame[i]) >= limit",
            "eits_fabs(frame[i]) > limit",
            "frame",
        ),
        (
            "saturation on one side only",
            "limit > 0 && eits_fabs(frame[i]) >= limit",
            "limit > 0 && frame[i] >= limit",
            "frame",
        ),
        ("masked rows used", "masked = ctx->bad[i] || !eits", "masked = !eits", "frame"),
        ("the gain left out", "return ctx->baseline.gain * (v - v0);", "return v - v0;", "frame"),
        (
            "ratios of another sign",
            "return (v - v0) / v0;",
            "return (v - v0) / eits_fabs(v0);",
            "frame",
        ),
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
        (
            "the noise without its unit",
            "used > 0 ? b->m2_unit * eits_sqrt",
            "used > 0 ? eits_sqrt",
            "baseline",
        ),
        (
            "the unit is one",
            "            b->m2_unit = unit_for(ctx, frame);\n",
            "            b->m2_unit = 1;\n",
            "judgements",
        ),
        (
            "readings left out are taken in",
            "        if (ctx->bad[i] == EITS_BAD_NOW)\n            continue;\n",
            "",
            "findings",
        ),
        (
            "the second frame's own are never weighed",
            "    b->glitches += eits_quiet_weigh(ctx, frame);\n",
            "",
            "findings",
        ),
        (
            "the mean of one frame more",
            "b->v0[i] += delta / (eits_real)b->count;",
            "b->v0[i] += delta / (eits_real)(b->count + 1);",
            "baseline",
        ),
        (
            "noise over all frames, not one less",
            "(eits_real)(b->count - 1)",
            "(eits_real)b->count",
            "baseline",
        ),
        ("the gain always positive", "        b->gain = -b->gain;\n", "        ;\n", "baseline"),
        (
            "the quiet frames' least for their greatest",
            "if (seen > ctx->baseline.lambda_noise)",
            "if (seen < ctx->baseline.lambda_noise)",
            "baseline",
        ),
        (
            "lambda_noise learned with the model's floor",
            "        b->noise_v = noise_so_far(ctx);",
            "        ;",
            "floor",
        ),
        (
            "noise learned against nothing",
            "b->count == b->wanted / 2",
            "b->count == b->wanted / 2 + 1",
            "baseline",
        ),
        ("a warm start over a new reference", "    ctx->warm = 0;\n", "", "solve_state"),
    )
)

SOLVE = (
    of(
        "solve.c",
        (
            "solved again from the last image",
            "    (void)solve(ctx, 0);\n    if",
            "    (void)solve(ctx, 1);\n    if",
            "regroup",
        ),
        (
            "only the second solve counts",
            "    ctx->info.iterations += before.iterations;\n",
            "",
            "regroup",
        ),
        (
            "nothing comes of it, and it stays",
            "    if (!ctx->warm) { /* it came",
            "    if (0) { /* it came",
            "regroup",
        ),
        ("no gate", "if (o->gate_factor > 0 && ", "if (0 && ", "solve_state"),
        (
            "a gate twice as high",
            "lambda_max < o->gate_factor *",
            "lambda_max < 2 * o->gate_factor *",
            "solve_state",
        ),
        (
            "lambda the less of two",
            "return by_data > by_noise ?",
            "return by_data < by_noise ?",
            "solve_state",
        ),
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
        (
            "projected by half",
            "v, -eits_dot(ctx, direction, v, rank)",
            "v, R(-0.5) * eits_dot(ctx, direction, v, rank)",
            "frame",
        ),
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
        (
            "the objective without its penalty",
            "lane_l1[j % 8] += weight;",
            "lane_l1[j % 8] += 0 * weight;",
            "solve_state",
        ),
        (
            "the gap without the columns",
            "eits_tree8(lane));\n    c.objective",
            "0);\n    c.objective",
            "solve",
        ),
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
    (
        "panels of columns that were dropped",
        "    if (count < before)\n        eits_pack_panels(ctx);\n",
        "",
        "working_set",
    ),
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
        (
            "a coordinate's step without its norm",
            "v = eits_fma(norm, before, gradient)",
            "v = before + gradient",
            "exact_edges",
        ),
        (
            "a coordinate not shrunk",
            "shrunk = up ? v - d->lambda",
            "shrunk = up ? v",
            "exact_edges",
        ),
        (
            "the residual moves without the scale",
            "ctx->residual, -step * scale, column",
            "ctx->residual, -step, column",
            "exact_edges",
        ),
        (
            "the ignored direction not taken out",
            "gradient = eits_fma(-d->along, d->slant[j], gradient);",
            ";",
            "exact_edges",
        ),
        (
            "rest for what still moves",
            "return 64 * epsilon * epsilon *",
            "return 64 * epsilon *",
            "exact_edges",
        ),
    )
    + of(
        "active_set.c",
        (
            "pulls without lambda",
            "a->pull[k] = *g - a->sign[k] * a->lambda;",
            "a->pull[k] = *g;",
            "exact_edges",
        ),
        (
            "Newton's step beyond a change of sign",
            "if (a->sign[k] * target > 0)",
            "if (1)",
            "exact_edges",
        ),
        (
            "tolerance a thousand times as wide",
            "a.tolerance = 2 * EPSILON",
            "a.tolerance = 20000 * EPSILON",
            "exact_edges",
        ),
    )
    + of(
        "factor.c",
        (
            "a row of K without its sign",
            "r[k] = -share * d[k];",
            "r[k] = share * d[k];",
            "exact_edges",
        ),
        ("a row of K not scaled", "    r[count] = share;\n", "    r[count] = 1;\n", "exact_edges"),
        (
            "a reflection half as far",
            "1 / (norm * (norm + end)) : 0",
            "R(0.5) / (norm * (norm + end)) : 0",
            "exact_edges",
        ),
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
    (
        "halves that are infinite",
        "(values[i] & 0x7C00u) == 0x7C00u",
        "(values[i] & 0x7FFFu) == 0x7FFFu",
        "model_values",
    ),
) + of(
    "link.c",
    (
        "a full block stands for a zero",
        "if (d->in_packet && d->code != LONGEST_BLOCK)",
        "if (d->in_packet)",
        "link",
    ),
    (
        "checksums not looked at",
        "if (eits_crc32(0, d->buffer, d->used - CHECKSUM) !=",
        "if (0 && eits_crc32(0, d->buffer, d->used - CHECKSUM) !=",
        "link",
    ),
)

MUTATIONS = FISTA + KERNELS + FRAME + SOLVE + WORKING_SET + EXACT + TOUCHES + LOAD + BYTES + FRAMES
