/* The matrix products for a Cortex-M7 with its single-precision FPU. A compiler loads each number
 * by an instruction of its own; here one VLDM loads many, so that most instructions are FMAs. Each
 * sum is the same chain in the same order as in the portable build, so the bits are the same.
 * Instructions per multiply-accumulate: mul_t 1.35 (f16 2.4, i16 3.3, i8 4.0), mul 1.35, dot 1.5;
 * for mul and dots, other storages are unpacked block by block before. Instructions to unpack a
 * number: f16 1.5, i16 and i8 3.1.
 *
 * The FPU has s0 to s31; sums stay in the upper half (from s16 or s24 on) while the lower half
 * takes the numbers that are loaded. Operands name the variables that change ("+r"), clobbers name
 * every register used, and "memory" keeps the compiler from moving loads and stores across.
 *
 * Conversions are exact, so a number that is unpacked first and multiplied after gives the same
 * bits as a product that reads storage directly. */
#define NAME(x) m7_##x

#include "base/vec.h"
#include "kernels/kernels.h"

/* Contexts with panels use this (eits_init got memory for them); boards have no memory to spare for
 * panels. */
static void m7_sum_panel(const eits_real *panel, const eits_real *v, uint32_t rows, eits_real *sum)
{
    for (uint32_t l = 0; l < EITS_PANEL; ++l) {
        eits_real a = 0;
        for (uint32_t i = 0; i < rows; ++i)
            a = eits_fma(panel[(size_t)i * EITS_PANEL + l], v[i], a);
        sum[l] = a;
    }
}

#define KERNELS_OWN_VECTORS /* dot and axpy stand below */
#define KERNELS_OWN_ROWS
#define KERNELS_OWN_PRODUCTS
#include "kernels/body.h"

#define LOW_S                                                                                      \
    "s0", "s1", "s2", "s3", "s4", "s5", "s6", "s7", "s8", "s9", "s10", "s11", "s12", "s13", "s14", \
        "s15"
#define MIDDLE_S "s16", "s17", "s18", "s19", "s20", "s21", "s22", "s23"
#define HIGH_S   "s24", "s25", "s26", "s27", "s28", "s29", "s30", "s31"

#include "kernels/m7_unpack.h"

/* ---- S'v: eight columns at a time, in two groups of four, so that four chains hide the latency of
 * one; eight rows per turn ---- */

#define FMA4(A0, A1, A2, A3, R0, R1, R2, R3, V)                                        \
    "vfma.f32 s" #A0 ", s" #R0 ", s" #V "\n\tvfma.f32 s" #A1 ", s" #R1 ", s" #V "\n\t" \
    "vfma.f32 s" #A2 ", s" #R2 ", s" #V "\n\tvfma.f32 s" #A3 ", s" #R3 ", s" #V "\n\t"
/* Four columns by four rows: sums, columns, and the registers that hold v. */
#define BLOCK(A0, A1, A2, A3, C0, C1, C2, C3, V0, V1, V2, V3)                        \
    "vldmia %[" #C0 "]!, {s0-s3}\n\tvldmia %[" #C1 "]!, {s4-s7}\n\t"                 \
    "vldmia %[" #C2 "]!, {s8-s11}\n\tvldmia %[" #C3                                  \
    "]!, {s12-s15}\n\t" FMA4(A0, A1, A2, A3, 0, 4, 8, 12, V0)                        \
        FMA4(A0, A1, A2, A3, 1, 5, 9, 13, V1) FMA4(A0, A1, A2, A3, 2, 6, 10, 14, V2) \
            FMA4(A0, A1, A2, A3, 3, 7, 11, 15, V3)
static const float zeros[16];

/* out = the sums over these rows, for eight columns */
static void eight_columns(const float *const column[8], const float *v, uint32_t rows, float *out)
{
    const float *c0 = column[0], *c1 = column[1], *c2 = column[2], *c3 = column[3];
    const float *c4 = column[4], *c5 = column[5], *c6 = column[6], *c7 = column[7];
    uint32_t turns = rows / 8;
    if (turns == 0) {
        memcpy(out, zeros, 8 * sizeof *out);
    } else {
        __asm__ volatile(
            "vldmia %[zeros], {s24-s31}\n"
            "1:\n\t"
            "vldmia %[v]!, {s16-s23}\n\t" BLOCK(24, 25, 26, 27, c0, c1, c2, c3, 16, 17, 18, 19)
                BLOCK(24, 25, 26, 27, c0, c1, c2, c3, 20, 21, 22, 23)
                    BLOCK(28, 29, 30, 31, c4, c5, c6, c7, 16, 17, 18, 19)
                        BLOCK(28, 29, 30, 31, c4, c5, c6, c7, 20, 21, 22,
                              23) "subs %[turns], #1\n\t"
                                  "bne 1b\n\t"
                                  "vstmia %[out], {s24-s31}\n\t"
            : [c0] "+r"(c0), [c1] "+r"(c1), [c2] "+r"(c2), [c3] "+r"(c3), [c4] "+r"(c4),
              [c5] "+r"(c5), [c6] "+r"(c6), [c7] "+r"(c7), [v] "+r"(v), [turns] "+r"(turns)
            : [out] "r"(out), [zeros] "r"(zeros)
            : LOW_S, MIDDLE_S, HIGH_S, "cc", "memory");
    }
    const float *const rest[8] = {c0, c1, c2, c3, c4, c5, c6, c7};
    for (uint32_t i = 0; i < rows % 8; ++i) {
        for (int l = 0; l < 8; ++l)
            out[l] = eits_fma(rest[l][i], v[i], out[l]);
    }
}

static void mul_t_f32(const eits_matrix *matrix, const uint32_t *index, uint32_t count,
                      const eits_real *v, eits_real *out)
{
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

/* For the other storages, two columns at a time are converted in registers, eight rows per turn.
 * Each CONVERT leaves the numbers of the first column in s0-s7 and of the second in s8-s15, in the
 * order that its FMAS name. */
#define BOTH(S, T, V) "vfma.f32 s24, s" #S ", s" #V "\n\tvfma.f32 s25, s" #T ", s" #V "\n\t"
#define TWO_COLUMNS(NAME, CONVERT, FMAS)                                                         \
    static void NAME(const void *c0, const void *c1, const float *v, uint32_t turns, float *sum) \
    {                                                                                            \
        uint32_t a, b, c, d;                                                                     \
        __asm__ volatile("vldmia %[sum], {s24-s25}\n"                                            \
                         "1:\n\t" CONVERT "vldmia %[v]!, {s16-s23}\n\t" FMAS                     \
                         "subs %[turns], #1\n\t"                                                 \
                         "bne 1b\n\t"                                                            \
                         "vstmia %[sum], {s24-s25}\n\t"                                          \
                         : [c0] "+r"(c0), [c1] "+r"(c1), [v] "+r"(v), [turns] "+r"(turns),       \
                           [a] "=&r"(a), [b] "=&r"(b), [c] "=&r"(c), [d] "=&r"(d)                \
                         : [sum] "r"(sum)                                                        \
                         : LOW_S, MIDDLE_S, "s24", "s25", "cc", "memory");                       \
    }

/* the conversion works in place: a register is overwritten only after its own two halves are read
 */
#define HALVES_FROM(C, A, B, C4, C5, C6, C7, D, E, F, G)                                     \
    "vldmia %[" #C "]!, {s" #C4 "-s" #C7 "}\n\t" HALVES(C4, A, B) HALVES(C5, D, E)           \
        HALVES(C6, F, G) "vcvtb.f32.f16 s" #C6 ", s" #C7 "\n\tvcvtt.f32.f16 s" #C7 ", s" #C7 \
                         "\n\t"
#define IN_ORDER   \
    BOTH(0, 8, 16) \
    BOTH(1, 9, 17) \
    BOTH(2, 10, 18) BOTH(3, 11, 19) BOTH(4, 12, 20) BOTH(5, 13, 21) BOTH(6, 14, 22) BOTH(7, 15, 23)
TWO_COLUMNS(two_columns_f16,
            HALVES_FROM(c0, 0, 1, 4, 5, 6, 7, 2, 3, 4, 5)
                HALVES_FROM(c1, 8, 9, 12, 13, 14, 15, 10, 11, 12, 13),
            IN_ORDER)

/* low halves are converted in the register into which they were loaded; high halves go through the
 * core's registers and end four registers higher */
#define LOW_HALF(S) "vcvt.f32.s16 s" #S ", s" #S ", #0\n\t"
#define SHORTS_FROM(C, S0, S1, S2, S3, S4, S5, S6, S7)                                             \
    "vldmia %[" #C "], {s" #S0 "-s" #S3 "}\n\tldrd %[a], %[b], [%[" #C                             \
    "]], #8\n\tldrd %[c], %[d], [%[" #C "]], #8\n\t"                                               \
    "asr %[a], %[a], #16\n\tasr %[b], %[b], #16\n\tasr %[c], %[c], #16\n\tasr %[d], %[d], #16\n\t" \
    "vmov s" #S4 ", s" #S5 ", %[a], %[b]\n\tvmov s" #S6 ", s" #S7 ", %[c], %[d]\n\t" LOW_HALF(S0)  \
        LOW_HALF(S1) LOW_HALF(S2) LOW_HALF(S3) TO_FLOAT(S4) TO_FLOAT(S5) TO_FLOAT(S6) TO_FLOAT(S7)
#define LOW_AND_HIGH \
    BOTH(0, 8, 16)   \
    BOTH(4, 12, 17)  \
    BOTH(1, 9, 18) BOTH(5, 13, 19) BOTH(2, 10, 20) BOTH(6, 14, 21) BOTH(3, 11, 22) BOTH(7, 15, 23)
TWO_COLUMNS(two_columns_i16,
            SHORTS_FROM(c0, 0, 1, 2, 3, 4, 5, 6, 7) SHORTS_FROM(c1, 8, 9, 10, 11, 12, 13, 14, 15),
            LOW_AND_HIGH)

#define BYTES_OF(W, S, T, U, V)                                                            \
    "sxtb %[c], %[" #W "]\n\tsxtb %[d], %[" #W "], ror #8\n\tvmov s" #S ", s" #T           \
    ", %[c], %[d]\n\t"                                                                     \
    "sxtb %[c], %[" #W "], ror #16\n\tasr %[" #W "], %[" #W "], #24\n\tvmov s" #U ", s" #V \
    ", %[c], %[" #W "]\n\t" TO_FLOAT(S) TO_FLOAT(T) TO_FLOAT(U) TO_FLOAT(V)
#define BYTES_FROM(C, S0, S1, S2, S3, S4, S5, S6, S7) \
    "ldrd %[a], %[b], [%[" #C "]], #8\n\t" BYTES_OF(a, S0, S1, S2, S3) BYTES_OF(b, S4, S5, S6, S7)
TWO_COLUMNS(two_columns_i8,
            BYTES_FROM(c0, 0, 1, 2, 3, 4, 5, 6, 7) BYTES_FROM(c1, 8, 9, 10, 11, 12, 13, 14, 15),
            IN_ORDER)

/* The rows beyond whole eights are unpacked to the stack: a column is padded to a multiple of
 * eight, so reading them is safe. */
static void mul_t_packed(const eits_matrix *matrix, const uint32_t *index, uint32_t count,
                         const eits_real *v, eits_real *out)
{
    const int half = matrix->storage == EITS_STORAGE_F16, byte = matrix->storage == EITS_STORAGE_I8;
    void (*const two_columns)(const void *, const void *, const float *, uint32_t, float *) =
        half ? two_columns_f16 : (byte ? two_columns_i8 : two_columns_i16);
    const uint8_t *data = matrix->data;
    const size_t stride = matrix->stride;
    const uint32_t shift = byte ? 0 : 1, whole = matrix->rows / 8 * 8;
    for (uint32_t k = 0; k < count; k += 2) { /* if one column is left, it is computed twice */
        const uint32_t next = k + 1 < count ? k + 1 : k;
        const size_t at[2] = {stride * (index != NULL ? index[k] : k),
                              stride * (index != NULL ? index[next] : next)};
        float sum[2] = {0, 0};
        if (whole > 0)
            two_columns(data + (at[0] << shift), data + (at[1] << shift), v, whole / 8, sum);
        for (uint32_t l = 0; l < 2 && whole < matrix->rows; ++l) {
            float rest[8];
            own_unpack(matrix, at[l] + whole, 8, rest);
            for (uint32_t i = whole; i < matrix->rows; ++i)
                sum[l] = eits_fma(rest[i - whole], v[i], sum[l]);
        }
        out[k] = sum[0];
        out[next] = next > k ? sum[1] : sum[0];
    }
    m7_scale(matrix, index, count, out);
}

static void own_mul_t(const eits_matrix *matrix, const uint32_t *index, uint32_t count,
                      const eits_real *v, eits_real *out)
{
    if (matrix->storage == EITS_STORAGE_F32)
        mul_t_f32(matrix, index, count, v, out);
    else
        mul_t_packed(matrix, index, count, v, out);
}

/* ---- S x: sixteen rows of the sum stay in registers while the columns pass, two per turn ---- */

#define FMA8(V, A0, A1, A2, A3, A4, A5, A6, A7)                                          \
    "vfma.f32 s" #A0 ", s0, s" #V "\n\tvfma.f32 s" #A1 ", s1, s" #V "\n\tvfma.f32 s" #A2 \
    ", s2, s" #V "\n\t"                                                                  \
    "vfma.f32 s" #A3 ", s3, s" #V "\n\tvfma.f32 s" #A4 ", s4, s" #V "\n\tvfma.f32 s" #A5 \
    ", s5, s" #V "\n\t"                                                                  \
    "vfma.f32 s" #A6 ", s6, s" #V "\n\tvfma.f32 s" #A7 ", s7, s" #V "\n\t"
#define COLUMN(AT, V)                                     \
    "vldmia %[" #AT                                       \
    "]!, {s0-s7}\n\t" FMA8(V, 16, 17, 18, 19, 20, 21, 22, \
                           23) "vldmia %[" #AT            \
                               "], {s0-s7}\n\t" FMA8(V, 24, 25, 26, 27, 28, 29, 30, 31)

/* out = from + the sums over these columns */
static void sixteen_rows(const float *data, size_t stride_bytes, const uint32_t *index,
                         const float *value, uint32_t count, const float *from, float *out)
{
    uint32_t one, other, pairs = count / 2;
    __asm__ volatile("vldmia %[from], {s16-s31}\n\t"
                     "cmp %[pairs], #0\n\t"
                     "beq 2f\n"
                     "1:\n\t"
                     "ldrd %[one], %[other], [%[index]], #8\n\t"
                     "vldmia %[value]!, {s8-s9}\n\t"
                     "mla %[one], %[one], %[stride], %[data]\n\t"
                     "mla %[other], %[other], %[stride], %[data]\n\t" COLUMN(one, 8)
                         COLUMN(other, 9) "subs %[pairs], #1\n\t"
                                          "bne 1b\n"
                                          "2:\n\t"
                                          "lsls %[pairs], %[count], #31\n\t"
                                          "beq 3f\n\t"
                                          "ldr %[one], [%[index]]\n\t"
                                          "vldmia %[value], {s8}\n\t"
                                          "mla %[one], %[one], %[stride], %[data]\n\t" COLUMN(
                                              one, 8) "3:\n\t"
                                                      "vstmia %[out], {s16-s31}\n\t"
                     : [one] "=&r"(one), [other] "=&r"(other), [index] "+r"(index),
                       [value] "+r"(value), [pairs] "+l"(pairs)
                     : [count] "r"(count), [stride] "r"(stride_bytes), [data] "r"(data),
                       [from] "r"(from), [out] "r"(out)
                     : LOW_S, MIDDLE_S, HIGH_S, "cc", "memory");
}

static void few_rows(const float *data, size_t stride, const uint32_t *index, const float *value,
                     uint32_t count, float *out, uint32_t rows)
{
    for (uint32_t row = 0; row < rows; ++row) {
        for (uint32_t k = 0; k < count; ++k)
            out[row] = eits_fma(data[stride * index[k] + row], value[k], out[row]);
    }
}

static void mul_f32(const eits_matrix *matrix, const uint32_t *index, const eits_real *value,
                    uint32_t count, eits_real *out)
{
    const float *data = matrix->data;
    const size_t stride = matrix->stride;
    size_t row = 0;
    for (; row + 16 <= stride; row += 16)
        sixteen_rows(data + row, stride * sizeof *data, index, value, count, zeros, out + row);
    memset(out + row, 0, (stride - row) * sizeof *out);
    few_rows(data + row, stride, index, value, count, out + row, (uint32_t)(stride - row));
}

/* Sixteen rows of eight columns are unpacked at a time: this takes half a kilobyte of stack instead
 * of a copy of S, and each number is unpacked once. */
static void mul_unpacked(const eits_matrix *matrix, const uint32_t *index, const eits_real *value,
                         uint32_t count, eits_real *out)
{
    static const uint32_t in_order[8] = {0, 1, 2, 3, 4, 5, 6, 7};
    const size_t stride = matrix->stride;
    float block[8][16];
    for (size_t row = 0; row < stride; row += 16) {
        const uint32_t rows = stride - row < 16 ? (uint32_t)(stride - row) : 16;
        for (uint32_t k = 0; k < count; k += 8) {
            const uint32_t columns = count - k < 8 ? count - k : 8;
            for (uint32_t l = 0; l < columns; ++l)
                own_unpack(matrix, stride * index[k + l] + row, rows, block[l]);
            if (rows == 16)
                sixteen_rows(block[0], sizeof block[0], in_order, value + k, columns,
                             k == 0 ? zeros : out + row, out + row);
            else
                few_rows(block[0], 16, in_order, value + k, columns, out + row, rows);
        }
    }
}

static void own_mul(const eits_matrix *matrix, const uint32_t *index, const eits_real *value,
                    uint32_t count, eits_real *out)
{
    if (matrix->storage != EITS_STORAGE_F32 || count == 0)
        memset(out, 0, matrix->stride * sizeof *out);
    if (count == 0)
        return;
    if (matrix->storage == EITS_STORAGE_F32)
        mul_f32(matrix, index, value, count, out);
    else
        mul_unpacked(matrix, index, value, count, out);
}

#include "kernels/m7_vectors.h"

const eits_kernels eits_kernels_m7 = {
    .name = "cortex-m7",
    .mul = own_mul,
    .mul_t = own_mul_t,
    .mul_t_panels = m7_mul_t_panels,
    .dots = own_dots,
    .rows_dot = own_rows_dot,
    .rows_add = own_rows_add,
    .unpack = own_unpack,
    .dot = own_dot,
    .axpy = own_axpy,
    .extrapolate = m7_extrapolate,
    .nonzeros = m7_nonzeros,
    .greatest = m7_greatest,
    .prox = m7_prox,
};
