/* This part of m7.c has dots, axpy and rows. Eight lanes are s16 to s23; a turn loads eight numbers
 * of either vector by one VLDM each. Numbers beyond the last multiple of eight are added in C, to
 * the same lanes. */

#define EIGHTS                                                                                    \
    "1:\n\t"                                                                                      \
    "vldmia %[a]!, {s0-s7}\n\t"                                                                   \
    "vldmia %[b]!, {s8-s15}\n\t"                                                                  \
    "vfma.f32 s16, s0, s8\n\tvfma.f32 s17, s1, s9\n\tvfma.f32 s18, s2, s10\n\tvfma.f32 s19, s3, " \
    "s11\n\t"                                                                                     \
    "vfma.f32 s20, s4, s12\n\tvfma.f32 s21, s5, s13\n\tvfma.f32 s22, s6, s14\n\tvfma.f32 s23, "   \
    "s7, s15\n\t"                                                                                 \
    "subs %[turns], #1\n\t"                                                                       \
    "bne 1b\n\t"

/* Add `turns` times eight products to the lanes; `turns` is at least 1. */
static void add_eights(const float *a, const float *b, uint32_t turns, float lane[8])
{
    __asm__ volatile("vldmia %[lane], {s16-s23}\n" EIGHTS "vstmia %[lane], {s16-s23}\n\t"
                     : [a] "+r"(a), [b] "+r"(b), [turns] "+l"(turns)
                     : [lane] "r"(lane)
                     : LOW_S, MIDDLE_S, "cc", "memory");
}

/* Returns the tree over eight lanes that begin at zero. */
static float dot_of_eights(const float *a, const float *b, uint32_t turns)
{
    float sum;
    __asm__ volatile(
        "vldmia %[zeros], {s16-s23}\n" EIGHTS
        "vadd.f32 s16, s16, s20\n\tvadd.f32 s18, s18, s22\n\tvadd.f32 s16, s16, s18\n\t"
        "vadd.f32 s17, s17, s21\n\tvadd.f32 s19, s19, s23\n\tvadd.f32 s17, s17, s19\n\t"
        "vadd.f32 %[sum], s16, s17\n\t"
        : [a] "+r"(a), [b] "+r"(b), [turns] "+l"(turns), [sum] "=&t"(sum)
        : [zeros] "r"(zeros)
        : LOW_S, MIDDLE_S, "cc", "memory");
    return sum;
}

static eits_real own_dot(const eits_real *a, const eits_real *b, size_t count)
{
    const size_t whole = count / 8 * 8;
    eits_real lane[8];
    if (whole == count && count > 0)
        return dot_of_eights(a, b, (uint32_t)(count / 8));
    memcpy(lane, zeros, sizeof lane);
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

/* Sixteen numbers of the sum stay in registers while the rows pass, or eight; `count` is at least
 * 1. */
#define ADD_ROWS(NAME, SUMS, EIGHTS, SUMMED)                                                     \
    static void NAME(const float *rows, size_t stride, const float *value, uint32_t count,       \
                     float *out)                                                                 \
    {                                                                                            \
        const size_t next = (stride - (SUMMED - 8)) * sizeof *rows;                              \
        __asm__ volatile("vldmia %[out], {" SUMS "}\n"                                           \
                         "1:\n\t"                                                                \
                         "vldmia %[value]!, {s8}\n\t" EIGHTS "add %[rows], %[rows], %[next]\n\t" \
                         "subs %[count], #1\n\t"                                                 \
                         "bne 1b\n\t"                                                            \
                         "vstmia %[out], {" SUMS "}\n\t"                                         \
                         : [rows] "+r"(rows), [value] "+r"(value), [count] "+l"(count)           \
                         : [out] "r"(out), [next] "r"(next)                                      \
                         : LOW_S, MIDDLE_S, HIGH_S, "cc", "memory");                             \
    }
ADD_ROWS(add_eight, "s16-s23",
         "vldmia %[rows], {s0-s7}\n\t" FMA8(8, 16, 17, 18, 19, 20, 21, 22, 23), 8)
ADD_ROWS(add_sixteen, "s16-s31", COLUMN(rows, 8), 16)

static void own_rows_add(const eits_real *rows, size_t stride, uint32_t count, size_t length,
                         const eits_real *value, eits_real *out)
{
    size_t i = 0;
    for (; count > 0 && i + 16 <= length; i += 16)
        add_sixteen(rows + i, stride, value, count, out + i);
    for (; count > 0 && i + 8 <= length; i += 8)
        add_eight(rows + i, stride, value, count, out + i);
}
