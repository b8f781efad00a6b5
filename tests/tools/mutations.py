"""Mistakes that the C tests must notice, one at a time: in the numerics of the core, and in what it reads and writes."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Mutation:
    """``original``, which stands once in ``csrc/src/file``, becomes ``replacement``. ``first`` is the C test to ask first."""

    name: str
    file: str
    original: str
    replacement: str
    first: str


def _of(file: str, *rows: tuple[str, str, str, str]) -> tuple[Mutation, ...]:
    return tuple(Mutation(name, file, original, replacement, first) for name, original, replacement, first in rows)


FISTA = _of(
    "fista.c",
    ("a step twice too long", "eits_real step = 1 / (eits_real)", "eits_real step = 2 / (eits_real)", "solve"),
    ("a step half as long", "eits_real step = 1 / (eits_real)", "eits_real step = R(0.5) / (eits_real)", "solve"),
    ("no momentum", "beta = (*t - 1) / t_next", "beta = 0 * (*t - 1) / t_next", "solve"),
    ("momentum grows too slowly", "eits_fma(4 * *t, *t, 1)", "eits_fma(3 * *t, *t, 1)", "solve"),
    ("momentum never grows", "    *t = t_next;\n", "", "solve"),
    ("threshold without the step", ".threshold = step * lambda", ".threshold = lambda", "solve"),
    (
        "S z extrapolated from the older point",
        "ctx->sx_next[i] - ctx->sx[i], ctx->sx_next[i])",
        "ctx->sx_next[i] - ctx->sx[i], ctx->sx[i])",
        "solve",
    ),
    ("the step is never halved", "step *= R(0.5);", "step *= R(1.0);", "solve_state"),
    ("momentum kept where the step is halved", "            t = 1;\n", "", "starts"),
    ("divergence seen too late", "if (!(c.objective <= ceiling)) {", "if (c.objective > R(1e9) * ceiling) {", "solve_state"),
    ("stops at twice the gap", "c.gap <= o->gap_rel * scale", "c.gap <= 2 * o->gap_rel * scale", "solve"),
    ("momentum survives from the last frame", "    eits_copy(ctx->z, ctx->x, held(ctx));\n", "", "solve_state"),
    ("columns looked at once only", "s->interval < UINT32_MAX - k ?", "0 ?", "working_set"),
)

KERNELS = (
    _of(
        "kernels_body.h",
        ("soft threshold does not shrink", "v > t ? v - t : 0", "v > t ? v : 0", "kernels"),
        ("soft threshold shrinks outward", "v < -t ? v + t : 0", "v < -t ? v - t : 0", "kernels"),
        (
            "sign rule: increases allowed where only decreases are",
            "allow_up = how->sign != EITS_SIGN_DECREASE",
            "allow_up = how->sign != EITS_SIGN_BOTH",
            "kernels",
        ),
        ("an overflow ends as a zero", "up + down + (v - v)", "up + down", "kernels"),
        ("no extrapolation", "z[j] = eits_fma(beta, moved - x[j], moved);", "z[j] = moved;", "kernels"),
        ("product's chain not fused", "a5 = eits_fma(READ(c[5]), v, a5);", "a5 += READ(c[5]) * v;", "kernels"),
        ("transposed product loses the last column", "for (; k < count; ++k) { ", "for (; k + 1 < count; ++k) { ", "kernels"),
        ("scales of other columns", "matrix->scale[index == NULL ? k : index[k]]", "matrix->scale[k]", "kernels"),
        ("8-bit numbers without sign", "DEFINE_UNPACK(i8, int8_t, (float))", "DEFINE_UNPACK(i8, uint8_t, (float))", "columns"),
        ("the dot product forgets the rest", "i + l < count; ++l)", "i + l + 1 < count; ++l)", "kernels"),
    )
    + _of(
        "kernels_avx2.c",
        ("AVX2: soft threshold does not shrink", "up_mask), SUB(v, high))", "up_mask), v)", "kernels"),
        ("AVX2: sign rule ignored", "allow_down ? EVERYWHERE : ZERO()", "EVERYWHERE", "kernels"),
        ("AVX2: an overflow ends as a zero", "ADD(ADD(up, down), SUB(v, v))", "ADD(up, down)", "kernels"),
        (
            "AVX2: the last few coefficients not fused",
            "eits_fma(step, gradient[j], z[j])",
            "step * gradient[j] + z[j]",
            "kernels",
        ),
        (
            "AVX2: 16-bit numbers without sign",
            "_mm_cvtepi32_ps(_mm_cvtepi16_epi32(",
            "_mm_cvtepi32_ps(_mm_cvtepu16_epi32(",
            "kernels",
        ),
        (
            "AVX2: rows beyond the last eight lost",
            "for (uint32_t i = whole; i < rows; ++i)",
            "for (uint32_t i = whole; i + 1 < rows; ++i)",
            "kernels",
        ),
        ("AVX2: lanes crossed", "row[1] = _mm256_blend_ps(ad, d, 0xCC)", "row[1] = _mm256_blend_ps(d, ad, 0xCC)", "kernels"),
    )
    + _of(
        "kernels.c",
        (
            "columns not scaled",
            "values[k] *= (eits_real)matrix->scale[index[k]];",
            "values[k] *= (eits_real)matrix->scale[0];",
            "kernels",
        ),
        (
            "panels of a working set from the wrong lane",
            "const uint32_t j = ctx->working[k < ctx->working_count ? k : 0];",
            "const uint32_t j = k;",
            "working_set",
        ),
    )
    + _of(
        "half.h",
        ("halves half as great", "0x1p112f", "0x1p111f", "numbers"),
        ("halves lose their sign", "(half & 0x8000u) << 16", "(half & 0x8000u) << 15", "numbers"),
    )
    + _of(
        "columns.c",
        (
            "a column gives way that is wanted",
            "            ctx->held_wanted[ctx->held_at[index[k]]] = 1;\n",
            "            ;\n",
            "columns",
        ),
    )
)

FRAME = (
    _of(
        "frame.c",
        ("reciprocals added without their sign", "sum += turn ? -value : value", "sum += value", "frame"),
        ("a fold's sum for its mean", "used == BOTH ? R(0.5) * sum : sum", "sum", "frame"),
        ("NaN let through", "!eits_is_finite(frame[i]) || ", "", "frame"),
        ("rows without a reference let through", " || !eits_is_finite(ctx->baseline.v0[i])", "", "baseline"),
        ("saturation only beyond the limit", "eits_fabs(frame[i]) >= limit", "eits_fabs(frame[i]) > limit", "frame"),
        ("saturation on one side only", "limit > 0 && eits_fabs(frame[i]) >= limit", "limit > 0 && frame[i] >= limit", "frame"),
        ("masked rows used", "(uint8_t)(ctx->bad[i] || unknown || saturated)", "(uint8_t)(unknown || saturated)", "frame"),
        ("the gain left out", "return ctx->baseline.gain * (v - v0);", "return v - v0;", "frame"),
        ("ratios of another sign", "return (v - v0) / v0;", "return (v - v0) / eits_fabs(v0);", "frame"),
        (
            "the basis of the frame before",
            "if (fold_data(ctx, frame) || ctx->basis_stale)",
            "(void)fold_data(ctx, frame);\n    if (ctx->basis_stale)",
            "frame",
        ),
        ("Gram and Schmidt once", "pass < 2; ++pass", "pass < 1; ++pass", "frame"),
        (
            "drift of the gain along the first rows only",
            "(eits_real)fold.sign * ctx->baseline.v0[fold.second] : 0",
            "ctx->baseline.v0[fold.second] : 0",
            "frame",
        ),
        ("a dead front end taken for a quiet skin", "if (!ctx->unusable[i] && frame[i] != 0)", "if (!ctx->unusable[i])", "frame"),
        ("the logarithm bounded elsewhere", "high = R(16.0)", "high = R(32.0)", "frame"),
    )
    + _of(
        "log.h",
        ("the logarithm's series cut short", "terms = 6", "terms = 4", "numbers"),
        ("another base", "R(0.69314718055994530942)", "R(0.69314118055994530942)", "numbers"),
    )
    + _of(
        "baseline.c",
        (
            "Welford's deviation from the old mean twice",
            "eits_fma(delta, frame[i] - b->v0[i], b->m2[i])",
            "eits_fma(delta, delta, b->m2[i])",
            "baseline",
        ),
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
        ("noise learned against nothing", "b->count == b->wanted / 2", "b->count == b->wanted / 2 + 1", "baseline"),
        ("a warm start over a new reference", "    ctx->warm = 0;\n", "", "solve_state"),
    )
)

SOLVE = (
    _of(
        "solve.c",
        ("no gate", "if (o->gate_factor > 0 && ", "if (0 && ", "solve_state"),
        ("a gate twice as high", "lambda_max < o->gate_factor *", "lambda_max < 2 * o->gate_factor *", "solve_state"),
        ("lambda the less of two", "return by_data > by_noise ?", "return by_data < by_noise ?", "solve_state"),
        (
            "the noise without its factor",
            "o->lambda_noise_factor * ctx->baseline.lambda_noise",
            "ctx->baseline.lambda_noise",
            "solve",
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
    + _of(
        "stages.c",
        ("projected by half", "v, -eits_dot(ctx, direction, v, rank)", "v, R(-0.5) * eits_dot(ctx, direction, v, rank)", "frame"),
        (
            "the greatest under the other sign",
            "sign != EITS_SIGN_DECREASE ? most_of",
            "sign != EITS_SIGN_INCREASE ? most_of",
            "solve",
        ),
        ("the last few never the greatest", "        lane[0] = g[j] > lane[0] ? g[j] : lane[0];\n", "        ;\n", "numbers"),
        (
            "the first alone is looked at for NaN",
            "if (!eits_is_finite(values[i]))",
            "if (!eits_is_finite(values[0]))",
            "solve_state",
        ),
    )
    + _of(
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

WORKING_SET = _of(
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
    _of(
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
    + _of(
        "active_set.c",
        ("pulls without lambda", "a->pull[k] = eits_fma(-a->sign[k], a->lambda, *g);", "a->pull[k] = *g;", "exact_edges"),
        ("Newton's step beyond a change of sign", "if (a->sign[k] * target > 0)", "if (1)", "exact_edges"),
        ("tolerance a thousand times as wide", "a.tolerance = 2 * EPSILON", "a.tolerance = 20000 * EPSILON", "exact_edges"),
    )
    + _of(
        "factor.c",
        (
            "a rotation the wrong way",
            "r[c] = eits_fma(cosine, left, sine * right);",
            "r[c] = eits_fma(cosine, left, -sine * right);",
            "exact_edges",
        ),
        (
            "the back substitution adds",
            "eits_axpy(ctx, w, -d[i], row(ctx, i), i);",
            "eits_axpy(ctx, w, d[i], row(ctx, i), i);",
            "exact_edges",
        ),
    )
    + _of(
        "missing.c",
        (
            "columns missed whose correlation is beyond lambda",
            "if (!(v[j] > least) ||",
            "if (!(v[j] > 4 * least) ||",
            "exact_edges",
        ),
    )
)

TOUCH = (
    _of(
        "disc.c",
        ("covers half a pixel too wide", "share = R(0.5) + (radius - distance)", "share = R(1.0) + (radius - distance)", "disc"),
        ("a rim without slope", "share < 1 ? factor / pixel : 0", "share < 1 ? 0 * factor / pixel : 0", "disc"),
        ("weights not divided by", "return scale / (eits_real)model->column_weight[j];", "return scale;", "disc"),
    )
    + _of(
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
        (
            "strength without the soft edge",
            "eits_fma(disc->radius_mm, disc->radius_mm, soft_edge)",
            "eits_fma(disc->radius_mm, disc->radius_mm, 0 * soft_edge)",
            "touch_fit",
        ),
        ("a radius that strength does not tell", "weight = o->touch_radius_weight * energy", "weight = 0 * energy", "touch_fit"),
        ("touches that noise makes", "return best >= least;", "return best >= 0 * least;", "touch"),
    )
    + _of(
        "track.c",
        ("the farthest for the nearest", "squared <= nearest", "squared <= limit", "track"),
        ("two touches of one id", "        taken[from] = 1;\n", "", "track"),
        ("the id 0", "ctx->next_id == UINT32_MAX ? 1 : ctx->next_id + 1", "ctx->next_id + 1", "track"),
    )
)

BYTES = _of(
    "model.c",
    (
        "a checksum of every other nibble",
        "        crc ^= p[i];\n        crc = (crc >> 4) ^ table[crc & 15u];\n",
        "        crc ^= p[i];\n",
        "model",
    ),
    ("sections may reach beyond the end", "size > total - offset", "size > total", "model"),
    ("halves that are infinite", "(values[i] & 0x7C00u) == 0x7C00u", "(values[i] & 0x7FFFu) == 0x7FFFu", "model_values"),
) + _of(
    "link.c",
    ("a full block stands for a zero", "if (d->in_packet && d->code != LONGEST_BLOCK)", "if (d->in_packet)", "link"),
    (
        "checksums not looked at",
        "if (eits_crc32(0, d->buffer, d->used - CHECKSUM) !=",
        "if (0 && eits_crc32(0, d->buffer, d->used - CHECKSUM) !=",
        "link",
    ),
)

MUTATIONS = FISTA + KERNELS + FRAME + SOLVE + WORKING_SET + EXACT + TOUCH + BYTES
