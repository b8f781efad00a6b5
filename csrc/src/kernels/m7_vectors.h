/* Part of m7.c: dots, axpy, rows. Eight lanes are s16 to s23; a turn loads eight numbers of either
 * vector by one VLDM each. The rest beyond whole eights is done in C, by the same lanes. */

/* Add `turns` times eight products to the lanes; `turns` is at least 1. */
static void add_eights(const float *a, const float *b, uint32_t turns, float lane[8])
{
    __asm__ volatile("vldmia %[lane], {s16-s23}\n"
                     "1:\n\t"
                     "vldmia %[a]!, {s0-s7}\n\t"
                     "vldmia %[b]!, {s8-s15}\n\t"
                     "vfma.f32 s16, s0, s8\n\tvfma.f32 s17, s1, s9\n\tvfma.f32 s18, s2, "
                     "s10\n\tvfma.f32 s19, s3, s11\n\t"
                     "vfma.f32 s20, s4, s12\n\tvfma.f32 s21, s5, s13\n\tvfma.f32 s22, s6, "
                     "s14\n\tvfma.f32 s23, s7, s15\n\t"
                     "subs %[turns], #1\n\t"
                     "bne 1b\n\t"
                     "vstmia %[lane], {s16-s23}\n\t"
                     : [a] "+r"(a), [b] "+r"(b), [turns] "+l"(turns)
                     : [lane] "r"(lane)
                     : LOW_S, MIDDLE_S, "cc", "memory");
}

static eits_real own_dot(const eits_real *a, const eits_real *b, size_t count)
{
    eits_real lane[8] = {0};
    const size_t whole = count / 8 * 8;
    if (whole > 0)
        add_eights(a, b, (uint32_t)(whole / 8), lane);
    for (size_t l = 0; l < count % 8; ++l)
        lane[l] = eits_fma(a[whole + l], b[whole + l], lane[l]);
    return eits_tree8(lane);
}

static eits_real dot_unpacked(const eits_matrix *matrix, size_t first, const eits_real *v)
{
    eits_real lane[8] = {0};
    for (uint32_t i = 0; i < matrix->rows; i += 64) {
        float block[64];
        const uint32_t rows = matrix->rows - i < 64 ? matrix->rows - i : 64, whole = rows / 8 * 8;
        own_unpack(matrix, first + i, (rows + 7u) / 8 * 8, block);
        if (whole > 0)
            add_eights(block, v + i, whole / 8, lane);
        for (uint32_t l = 0; l < rows - whole; ++l)
            lane[l] = eits_fma(block[whole + l], v[i + whole + l], lane[l]);
    }
    return eits_tree8(lane);
}

static void own_dots(const eits_matrix *matrix, const uint32_t *index, uint32_t count,
                     const eits_real *v, eits_real *out)
{
    for (uint32_t k = 0; k < count; ++k) {
        const size_t first = (size_t)matrix->stride * index[k];
        out[k] = matrix->storage == EITS_STORAGE_F32
                     ? own_dot((const float *)matrix->data + first, v, matrix->rows)
                     : dot_unpacked(matrix, first, v);
    }
    m7_scale(matrix, index, count, out);
}

static void own_axpy(eits_real *out, eits_real factor, const eits_real *a, size_t count)
{
    uint32_t turns = (uint32_t)(count / 8);
    if (turns > 0) {
        __asm__ volatile("vmov s16, %[factor]\n"
                         "1:\n\t"
                         "vldmia %[a]!, {s0-s7}\n\t"
                         "vldmia %[out], {s8-s15}\n\t"
                         "vfma.f32 s8, s16, s0\n\tvfma.f32 s9, s16, s1\n\tvfma.f32 s10, s16, "
                         "s2\n\tvfma.f32 s11, s16, s3\n\t"
                         "vfma.f32 s12, s16, s4\n\tvfma.f32 s13, s16, s5\n\tvfma.f32 s14, s16, "
                         "s6\n\tvfma.f32 s15, s16, s7\n\t"
                         "vstmia %[out]!, {s8-s15}\n\t"
                         "subs %[turns], #1\n\t"
                         "bne 1b\n\t"
                         : [a] "+r"(a), [out] "+r"(out), [turns] "+l"(turns)
                         : [factor] "r"(factor)
                         : LOW_S, MIDDLE_S, "cc", "memory");
    }
    for (size_t i = 0; i < count % 8; ++i)
        out[i] = eits_fma(factor, a[i], out[i]);
}

static void own_rows_dot(const eits_real *rows, size_t stride, uint32_t count, size_t length,
                         const eits_real *v, eits_real *out)
{
    for (uint32_t k = 0; k < count; ++k)
        out[k] = own_dot(rows + stride * k, v, length);
}

static void own_rows_sum(const eits_real *rows, size_t stride, uint32_t count, size_t length,
                         const eits_real *value, eits_real *out)
{
    eits_zero(out, length);
    for (uint32_t k = 0; k < count; ++k)
        own_axpy(out, value[k], rows + stride * k, length);
}
