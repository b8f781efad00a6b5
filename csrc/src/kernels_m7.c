/* The matrix products for a Cortex-M7 with its single-precision FPU. The portable C loads each number by an instruction of its
 * own; here VLDM loads many by one, so that an instruction is spent on little but the FMA. Each sum is the same chain in the
 * same order, hence the same bits. f32 storage only; the others, and the rows and columns that blocks leave over, take the
 * portable way. Instructions a multiply-accumulate: mul_t 1.4, mul 1.5, dot 1.5. */
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

/* ---- S'v: four columns at a time, so that four chains hide the latency of one; eight rows a turn ---- */

#define FMA4(A, B, C, D, V)                                                                                                \
    "vfma.f32 %[a0], s" #A ", s" #V "\n\tvfma.f32 %[a1], s" #B ", s" #V "\n\t"                                             \
    "vfma.f32 %[a2], s" #C ", s" #V "\n\tvfma.f32 %[a3], s" #D ", s" #V "\n\t"
#define LOAD4                                                                                                              \
    "vldmia %[c0]!, {s0-s3}\n\tvldmia %[c1]!, {s4-s7}\n\tvldmia %[c2]!, {s8-s11}\n\tvldmia %[c3]!, {s12-s15}\n\t"

static inline __attribute__((always_inline)) void four_columns(const float *c0, const float *c1, const float *c2, const float *c3, const float *v, uint32_t rows, float *out)
{
    float a0 = 0, a1 = 0, a2 = 0, a3 = 0;
    uint32_t turns = rows / 8;
    if (turns > 0) {
        __asm__ volatile("1:\n\t"
                         "vldmia %[v]!, {s16-s23}\n\t" LOAD4 FMA4(0, 4, 8, 12, 16) FMA4(1, 5, 9, 13, 17) FMA4(2, 6, 10, 14, 18)
                             FMA4(3, 7, 11, 15, 19) LOAD4 FMA4(0, 4, 8, 12, 20) FMA4(1, 5, 9, 13, 21) FMA4(2, 6, 10, 14, 22)
                                 FMA4(3, 7, 11, 15, 23) "subs %[turns], #1\n\t"
                         "bne 1b\n\t"
                         : [a0] "+t"(a0), [a1] "+t"(a1), [a2] "+t"(a2), [a3] "+t"(a3), [c0] "+r"(c0), [c1] "+r"(c1),
                           [c2] "+r"(c2), [c3] "+r"(c3), [v] "+r"(v), [turns] "+l"(turns)
                         :
                         : "s0", "s1", "s2", "s3", "s4", "s5", "s6", "s7", "s8", "s9", "s10", "s11", "s12", "s13", "s14",
                           "s15", "s16", "s17", "s18", "s19", "s20", "s21", "s22", "s23", "cc", "memory");
    }
    for (uint32_t i = 0; i < rows % 8; ++i) {
        a0 = eits_fma(c0[i], v[i], a0);
        a1 = eits_fma(c1[i], v[i], a1);
        a2 = eits_fma(c2[i], v[i], a2);
        a3 = eits_fma(c3[i], v[i], a3);
    }
    out[0] = a0, out[1] = a1, out[2] = a2, out[3] = a3;
}

static void own_mul_t(const eits_matrix *matrix, const uint32_t *index, uint32_t count, const eits_real *v, eits_real *out)
{
    if (matrix->storage != EITS_STORAGE_F32) {
        m7_mul_t(matrix, index, count, v, out);
        return;
    }
    const float *data = matrix->data;
    const size_t stride = matrix->stride;
    uint32_t k = 0;
    for (; k + 4 <= count; k += 4) {
        uint32_t j[4] = {k, k + 1, k + 2, k + 3};
        if (index != NULL)
            j[0] = index[k], j[1] = index[k + 1], j[2] = index[k + 2], j[3] = index[k + 3];
        four_columns(data + stride * j[0], data + stride * j[1], data + stride * j[2], data + stride * j[3], v, matrix->rows, out + k);
    }
    for (; k < count; ++k) {
        const float *c = data + stride * (index != NULL ? index[k] : k);
        eits_real a = 0;
        for (uint32_t i = 0; i < matrix->rows; ++i)
            a = eits_fma(c[i], v[i], a);
        out[k] = a;
    }
}

/* ---- S x: sixteen rows of the sum stay in registers while the columns pass ---- */

#define FMA8(A0, A1, A2, A3, A4, A5, A6, A7)                                                                               \
    "vfma.f32 s" #A0 ", s0, s8\n\tvfma.f32 s" #A1 ", s1, s8\n\tvfma.f32 s" #A2 ", s2, s8\n\tvfma.f32 s" #A3 ", s3, s8\n\t"     \
    "vfma.f32 s" #A4 ", s4, s8\n\tvfma.f32 s" #A5 ", s5, s8\n\tvfma.f32 s" #A6 ", s6, s8\n\tvfma.f32 s" #A7 ", s7, s8\n\t"
#define ALL_S                                                                                                              \
    "s0", "s1", "s2", "s3", "s4", "s5", "s6", "s7", "s8", "s9", "s10", "s11", "s12", "s13", "s14", "s15", "s16", "s17", "s18",  \
        "s19", "s20", "s21", "s22", "s23", "s24", "s25", "s26", "s27", "s28", "s29", "s30", "s31"

static void sixteen_rows(const float *data, size_t stride_bytes, const uint32_t *index, const float *value, uint32_t count, float *out)
{
    memset(out, 0, 16 * sizeof *out);
    if (count == 0)
        return;
    uint32_t column;
    __asm__ volatile("vldmia %[out], {s16-s31}\n"
                     "1:\n\t"
                     "ldr %[column], [%[index]], #4\n\t"
                     "vldmia %[value]!, {s8}\n\t"
                     "mla %[column], %[column], %[stride], %[data]\n\t"
                     "vldmia %[column]!, {s0-s7}\n\t" FMA8(16, 17, 18, 19, 20, 21, 22, 23)
                     "vldmia %[column], {s0-s7}\n\t" FMA8(24, 25, 26, 27, 28, 29, 30, 31)
                     "subs %[count], #1\n\t"
                     "bne 1b\n\t"
                     "vstmia %[out], {s16-s31}\n\t"
                     : [column] "=&r"(column), [index] "+r"(index), [value] "+r"(value), [count] "+l"(count)
                     : [stride] "r"(stride_bytes), [data] "r"(data), [out] "r"(out)
                     : ALL_S, "cc", "memory");
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
                         : ALL_S, "cc", "memory");
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
                         : ALL_S, "cc", "memory");
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
