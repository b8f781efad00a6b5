"""Mistakes in the products with vectors and without, in reading stored numbers, and in which
columns are held."""

from __future__ import annotations

from mutation import of

KERNELS = (
    of(
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
        (
            "no extrapolation",
            "z[j] = eits_fma(beta, moved - x[j], moved);",
            "z[j] = moved;",
            "kernels",
        ),
        (
            "product's chain not fused",
            "a5 = eits_fma(READ(c[5]), v, a5);",
            "a5 += READ(c[5]) * v;",
            "kernels",
        ),
        (
            "transposed product loses the last column",
            "for (; k < count; ++k) { ",
            "for (; k + 1 < count; ++k) { ",
            "kernels",
        ),
        (
            "scales of other columns",
            "matrix->scale[index == NULL ? k : index[k]]",
            "matrix->scale[k]",
            "kernels",
        ),
        (
            "8-bit numbers without sign",
            "DEFINE_UNPACK(i8, int8_t, (float))",
            "DEFINE_UNPACK(i8, uint8_t, (float))",
            "kernels",
        ),
        (
            "the dot product forgets the rest",
            "i + l < count; ++l)",
            "i + l + 1 < count; ++l)",
            "kernels",
        ),
        (
            "dots forget the rest",
            "for (uint32_t l = 0; i + l < rows; ++l)",
            "for (uint32_t l = 0; i + l + 1 < rows; ++l)",
            "kernels",
        ),
        (
            "dots of other columns",
            "(size_t)matrix->stride * index[k];                                \\\n",
            "(size_t)matrix->stride * k;                                       \\\n",
            "kernels",
        ),
        (
            "the greatest under the other sign",
            "high = sign != EITS_SIGN_DECREASE ?",
            "high = sign != EITS_SIGN_INCREASE ?",
            "numbers",
        ),
        (
            "the last few never the greatest",
            "lane[0] = a[i] > lane[0] ? a[i] : lane[0];",
            ";",
            "kernels",
        ),
        (
            "the last few never the least",
            "lane[0] = a[i] < lane[0] ? a[i] : lane[0];",
            ";",
            "kernels",
        ),
        ("non-zeros that are zeros", "found += a[j] != 0;", "found += 1;", "kernels"),
        (
            "extrapolated from the older point",
            "out[i] = eits_fma(factor, a[i] - b[i], a[i]);",
            "out[i] = eits_fma(factor, a[i] - b[i], b[i]);",
            "kernels",
        ),
        (
            "a sum of one row less",
            "    for (uint32_t k = 0; k < count; ++k)\n        NAME(axpy)",
            "    for (uint32_t k = 1; k < count; ++k)\n        NAME(axpy)",
            "kernels",
        ),
        (
            "the second panel left out",
            "; j += 2 * EITS_PANEL)",
            "; j += 3 * EITS_PANEL)",
            "kernels",
        ),
    )
    + of(
        "kernels_avx2.c",
        (
            "AVX2: soft threshold does not shrink",
            "up_mask), SUB(v, high))",
            "up_mask), v)",
            "kernels",
        ),
        ("AVX2: sign rule ignored", "allow_down ? EVERYWHERE : ZERO()", "EVERYWHERE", "kernels"),
        (
            "AVX2: an overflow ends as a zero",
            "ADD(ADD(up, down), SUB(v, v))",
            "ADD(up, down)",
            "kernels",
        ),
        (
            "AVX2: the last few coefficients not fused",
            "eits_fma(step, gradient[j], z[j])",
            "step * gradient[j] + z[j]",
            "kernels",
        ),
        (
            "AVX2: the second panel is the first",
            "FMA(LOAD(other + (size_t)i * EITS_PANEL",
            "FMA(LOAD(panel + (size_t)i * EITS_PANEL",
            "kernels",
        ),
        (
            "AVX2: a panel's sums of the other",
            "    for (int k = 0; k < 2 * VECTORS; ++k)\n        STORE(sum",
            "    for (int k = 0; k < VECTORS; ++k)\n        STORE(sum",
            "kernels",
        ),
    )
    + of(
        "kernels_avx2_stored.h",
        (
            "AVX2: 16-bit numbers without sign",
            "_mm256_cvtepi32_ps(_mm256_cvtepi16_epi32(",
            "_mm256_cvtepi32_ps(_mm256_cvtepu16_epi32(",
            "kernels",
        ),
        (
            "AVX2: rows beyond the last eight lost",
            "for (uint32_t i = whole; i < rows; ++i)",
            "for (uint32_t i = whole; i + 1 < rows; ++i)",
            "kernels",
        ),
        (
            "AVX2: lanes crossed",
            "row[1] = _mm256_blend_ps(ad, d, 0xCC)",
            "row[1] = _mm256_blend_ps(d, ad, 0xCC)",
            "kernels",
        ),
    )
    + of(
        "kernels_avx2_dots.h",
        (
            "AVX2: dots' last columns the first",
            "(last < 2 ? last : 2)], *c3 = data",
            "(last < 2 ? last : 0)], *c3 = data",
            "kernels",
        ),
        (
            "AVX2: dots lose the rest",
            (
                "lanes[2][w] = CHOOSE(lanes[2][w], FMA(lanes_##TAG(c2 + at), some, lanes[2][w]),"
                " rest[w]);"
            ),
            (
                "lanes[2][w] = lanes[2][w];                                                        "
                "       "
            ),
            "kernels",
        ),
        (
            "AVX2: another tree",
            "_mm_add_ps(_mm_unpacklo_ps(four[2], four[3])",
            "_mm_add_ps(_mm_unpacklo_ps(four[3], four[2])",
            "kernels",
        ),
        (
            "AVX2: a row's dot product with another",
            "lanes[3][w] = FMA(LOAD(r3 + at), some, lanes[3][w]);",
            "lanes[3][w] = FMA(LOAD(r2 + at), some, lanes[3][w]);",
            "kernels",
        ),
        (
            "AVX2: a sum of rows not fused",
            "sum[w] = FMA(SET1(value[k]), LOAD(rows + stride * k + i + w * LANES), sum[w]);",
            "sum[w] = ADD(sum[w], SET1(value[k]) * LOAD(rows + stride * k + i + w * LANES));",
            "kernels",
        ),
        (
            "AVX2: the greatest of one sign",
            "flip = sign == EITS_SIGN_DECREASE ? minus",
            "flip = sign == EITS_SIGN_INCREASE ? minus",
            "kernels",
        ),
        (
            "AVX2: the greatest by magnitude",
            "clear = sign == EITS_SIGN_BOTH ? minus : ZERO()",
            "clear = ZERO()",
            "kernels",
        ),
        (
            "AVX2: the last never the greatest",
            "greatest = value > greatest ? value : greatest;",
            ";",
            "kernels",
        ),
        (
            "AVX2: the greatest of three",
            "MAX(MAX(most[0], most[1]), MAX(most[2], most[3]))",
            "MAX(MAX(most[0], most[1]), most[2])",
            "kernels",
        ),
        (
            "AVX2: non-zeros in another order",
            "{L(1), L(2), L(3), NO}, {L(0), L(1), L(2), L(3)}",
            "{L(2), L(1), L(3), NO}, {L(0), L(1), L(2), L(3)}",
            "kernels",
        ),
        (
            "AVX2: non-zeros miscounted",
            "{0, 1, 1, 2, 1, 2, 2, 3, 1,",
            "{0, 1, 1, 2, 1, 2, 2, 2, 1,",
            "kernels",
        ),
        (
            "AVX2: non-zeros of the first four",
            "places = _mm_add_epi32(places, _mm_set1_epi32(4));",
            ";",
            "kernels",
        ),
    )
    + of(
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
    + of(
        "half.h",
        ("halves half as great", "0x1p112f", "0x1p111f", "numbers"),
        ("halves lose their sign", "(half & 0x8000u) << 16", "(half & 0x8000u) << 15", "numbers"),
    )
    + of(
        "columns.c",
        (
            "a column gives way that is wanted",
            "            ctx->held_wanted[ctx->held_at[index[k]]] = 1;\n",
            "            ;\n",
            "columns",
        ),
    )
)
