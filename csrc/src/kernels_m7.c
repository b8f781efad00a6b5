/* The matrix products for a Cortex-M7 with its single-precision FPU. The portable C loads each number by an instruction of its
 * own; here VLDM loads many by one, so that an instruction is spent on little but the FMA. Each sum is the same chain in the
 * same order, hence the same bits. f32 storage only; the others, and the rows and columns that blocks leave over, take the
 * portable way. Instructions a multiply-accumulate: mul_t 1.35, mul 1.35, dot 1.5. */
#define NAME(x) m7_##x

#include "kernels.h"
#include "vec.h"

static void m7_sum_panel(const eits_real *panel, const eits_real *v, uint32_t rows, eits_real *sum)
{
    for (uint32_t l = 0; l < EITS_PANEL; ++l) {
        eits_real a = 0;
        for (uint32_t i = 0; i < rows; ++i)
            a = eits_fma(panel[(size_t)i * EITS_PANEL + l], v[i], a);
        sum[l] = a;
    }
}

#define KERNELS_OWN_VECTORS /* dot, axpy and prox stand below */
#include "kernels_body.h"

/* ---- S'v: eight columns at a time, by fours, so that four chains hide the latency of one; eight rows a turn ---- */

#define FMA4(A0, A1, A2, A3, R0, R1, R2, R3, V)                                                                            \
    "vfma.f32 s" #A0 ", s" #R0 ", s" #V "\n\tvfma.f32 s" #A1 ", s" #R1 ", s" #V "\n\t"                                   \
    "vfma.f32 s" #A2 ", s" #R2 ", s" #V "\n\tvfma.f32 s" #A3 ", s" #R3 ", s" #V "\n\t"
/* Four columns by four rows: sums, columns, and the registers that hold v. */
#define BLOCK(A0, A1, A2, A3, C0, C1, C2, C3, V0, V1, V2, V3)                                                              \
    "vldmia %[" #C0 "]!, {s0-s3}\n\tvldmia %[" #C1 "]!, {s4-s7}\n\t"                                                      \
    "vldmia %[" #C2 "]!, {s8-s11}\n\tvldmia %[" #C3 "]!, {s12-s15}\n\t"                                                   \
    FMA4(A0, A1, A2, A3, 0, 4, 8, 12, V0) FMA4(A0, A1, A2, A3, 1, 5, 9, 13, V1)                                            \
    FMA4(A0, A1, A2, A3, 2, 6, 10, 14, V2) FMA4(A0, A1, A2, A3, 3, 7, 11, 15, V3)
#define LOW_S                                                                                                              \
    "s0", "s1", "s2", "s3", "s4", "s5", "s6", "s7", "s8", "s9", "s10", "s11", "s12", "s13", "s14", "s15"
#define MIDDLE_S "s16", "s17", "s18", "s19", "s20", "s21", "s22", "s23"
#define HIGH_S "s24", "s25", "s26", "s27", "s28", "s29", "s30", "s31"

static void eight_columns(const float *const column[8], const float *v, uint32_t rows, float *out)
{
    const float *c0 = column[0], *c1 = column[1], *c2 = column[2], *c3 = column[3];
    const float *c4 = column[4], *c5 = column[5], *c6 = column[6], *c7 = column[7];
    uint32_t turns = rows / 8;
    memset(out, 0, 8 * sizeof *out);
    if (turns > 0) {
        __asm__ volatile("vldmia %[out], {s24-s31}\n"
                         "1:\n\t"
                         "vldmia %[v]!, {s16-s23}\n\t"
                         BLOCK(24, 25, 26, 27, c0, c1, c2, c3, 16, 17, 18, 19) BLOCK(24, 25, 26, 27, c0, c1, c2, c3, 20, 21, 22, 23)
                         BLOCK(28, 29, 30, 31, c4, c5, c6, c7, 16, 17, 18, 19) BLOCK(28, 29, 30, 31, c4, c5, c6, c7, 20, 21, 22, 23)
                         "subs %[turns], #1\n\t"
                         "bne 1b\n\t"
                         "vstmia %[out], {s24-s31}\n\t"
                         : [c0] "+r"(c0), [c1] "+r"(c1), [c2] "+r"(c2), [c3] "+r"(c3), [c4] "+r"(c4), [c5] "+r"(c5),
                           [c6] "+r"(c6), [c7] "+r"(c7), [v] "+r"(v), [turns] "+r"(turns)
                         : [out] "r"(out)
                         : LOW_S, MIDDLE_S, HIGH_S, "cc", "memory");
    }
    const float *const rest[8] = {c0, c1, c2, c3, c4, c5, c6, c7};
    for (uint32_t i = 0; i < rows % 8; ++i) {
        for (int l = 0; l < 8; ++l)
            out[l] = eits_fma(rest[l][i], v[i], out[l]);
    }
}

static void own_mul_t(const eits_matrix *matrix, const uint32_t *index, uint32_t count, const eits_real *v, eits_real *out)
{
    if (matrix->storage != EITS_STORAGE_F32) {
        m7_mul_t(matrix, index, count, v, out);
        return;
    }
    const float *data = matrix->data;
    const size_t stride = matrix->stride;
    const float *column[8];
    uint32_t k = 0;
    for (; k + 8 <= count; k += 8) {
        if (index == NULL) {
            for (uint32_t l = 0; l < 8; ++l)
                column[l] = data + stride * (k + l);
        } else {
            for (uint32_t l = 0; l < 8; ++l)
                column[l] = data + stride * index[k + l];
        }
        eight_columns(column, v, matrix->rows, out + k);
    }
    if (k < count) { /* lanes to spare take the last column again */
        float sum[8];
        for (uint32_t l = 0; l < 8; ++l) {
            const uint32_t at = k + l < count ? k + l : count - 1;
            column[l] = data + stride * (index != NULL ? index[at] : at);
        }
        eight_columns(column, v, matrix->rows, sum);
        memcpy(out + k, sum, (count - k) * sizeof *sum);
    }
}

/* ---- S x: sixteen rows of the sum stay in registers while the columns pass, two a turn ---- */

#define FMA8(V, A0, A1, A2, A3, A4, A5, A6, A7)                                                                            \
    "vfma.f32 s" #A0 ", s0, s" #V "\n\tvfma.f32 s" #A1 ", s1, s" #V "\n\tvfma.f32 s" #A2 ", s2, s" #V "\n\t"              \
    "vfma.f32 s" #A3 ", s3, s" #V "\n\tvfma.f32 s" #A4 ", s4, s" #V "\n\tvfma.f32 s" #A5 ", s5, s" #V "\n\t"              \
    "vfma.f32 s" #A6 ", s6, s" #V "\n\tvfma.f32 s" #A7 ", s7, s" #V "\n\t"
#define COLUMN(AT, V)                                                                                                      \
    "vldmia %[" #AT "]!, {s0-s7}\n\t" FMA8(V, 16, 17, 18, 19, 20, 21, 22, 23)                                             \
    "vldmia %[" #AT "], {s0-s7}\n\t" FMA8(V, 24, 25, 26, 27, 28, 29, 30, 31)

static void sixteen_rows(const float *data, size_t stride_bytes, const uint32_t *index, const float *value, uint32_t count, float *out)
{
    memset(out, 0, 16 * sizeof *out);
    if (count == 0)
        return;
    uint32_t one, other, pairs = count / 2;
    __asm__ volatile("vldmia %[out], {s16-s31}\n\t"
                     "cmp %[pairs], #0\n\t"
                     "beq 2f\n"
                     "1:\n\t"
                     "ldrd %[one], %[other], [%[index]], #8\n\t"
                     "vldmia %[value]!, {s8-s9}\n\t"
                     "mla %[one], %[one], %[stride], %[data]\n\t"
                     "mla %[other], %[other], %[stride], %[data]\n\t"
                     COLUMN(one, 8) COLUMN(other, 9)
                     "subs %[pairs], #1\n\t"
                     "bne 1b\n"
                     "2:\n\t"
                     "lsls %[pairs], %[count], #31\n\t"
                     "beq 3f\n\t"
                     "ldr %[one], [%[index]]\n\t"
                     "vldmia %[value], {s8}\n\t"
                     "mla %[one], %[one], %[stride], %[data]\n\t"
                     COLUMN(one, 8)
                     "3:\n\t"
                     "vstmia %[out], {s16-s31}\n\t"
                     : [one] "=&r"(one), [other] "=&r"(other), [index] "+r"(index), [value] "+r"(value), [pairs] "+l"(pairs)
                     : [count] "r"(count), [stride] "r"(stride_bytes), [data] "r"(data), [out] "r"(out)
                     : LOW_S, MIDDLE_S, HIGH_S, "cc", "memory");
}

static void own_mul(const eits_matrix *matrix, const uint32_t *index, const eits_real *value, uint32_t count, eits_real *out)
{
    if (matrix->storage != EITS_STORAGE_F32) {
        m7_mul(matrix, index, value, count, out);
        return;
    }
    const float *data = matrix->data;
    const size_t stride = matrix->stride;
    size_t row = 0;
    for (; row + 16 <= stride; row += 16)
        sixteen_rows(data + row, stride * sizeof *data, index, value, count, out + row);
    for (; row < stride; ++row) {
        eits_real a = 0;
        for (uint32_t k = 0; k < count; ++k)
            a = eits_fma(data[stride * index[k] + row], value[k], a);
        out[row] = a;
    }
}

/* ---- vectors ---- */

static eits_real own_dot(const eits_real *a, const eits_real *b, size_t count)
{
    eits_real lane[8] = {0};
    uint32_t turns = (uint32_t)(count / 8);
    if (turns > 0) {
        __asm__ volatile("vldmia %[lane], {s16-s23}\n"
                         "1:\n\t"
                         "vldmia %[a]!, {s0-s7}\n\t"
                         "vldmia %[b]!, {s8-s15}\n\t"
                         "vfma.f32 s16, s0, s8\n\tvfma.f32 s17, s1, s9\n\tvfma.f32 s18, s2, s10\n\tvfma.f32 s19, s3, s11\n\t"
                         "vfma.f32 s20, s4, s12\n\tvfma.f32 s21, s5, s13\n\tvfma.f32 s22, s6, s14\n\tvfma.f32 s23, s7, s15\n\t"
                         "subs %[turns], #1\n\t"
                         "bne 1b\n\t"
                         "vstmia %[lane], {s16-s23}\n\t"
                         : [a] "+r"(a), [b] "+r"(b), [turns] "+l"(turns)
                         : [lane] "r"(lane)
                         : LOW_S, MIDDLE_S, "cc", "memory");
    }
    for (size_t l = 0; l < count % 8; ++l)
        lane[l] = eits_fma(a[l], b[l], lane[l]);
    return eits_tree8(lane);
}

static void own_axpy(eits_real *out, eits_real factor, const eits_real *a, size_t count)
{
    uint32_t turns = (uint32_t)(count / 8);
    if (turns > 0) {
        __asm__ volatile("vmov s16, %[factor]\n"
                         "1:\n\t"
                         "vldmia %[a]!, {s0-s7}\n\t"
                         "vldmia %[out], {s8-s15}\n\t"
                         "vfma.f32 s8, s16, s0\n\tvfma.f32 s9, s16, s1\n\tvfma.f32 s10, s16, s2\n\tvfma.f32 s11, s16, s3\n\t"
                         "vfma.f32 s12, s16, s4\n\tvfma.f32 s13, s16, s5\n\tvfma.f32 s14, s16, s6\n\tvfma.f32 s15, s16, s7\n\t"
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

const eits_kernels eits_kernels_m7 = {
    .name = "cortex-m7",
    .mul = own_mul,
    .mul_t = own_mul_t,
    .mul_t_panels = m7_mul_t_panels,
    .dot = own_dot,
    .axpy = own_axpy,
    .prox = m7_prox,
};
