/* Matrix products with the stored matrices. Every output number is one chain of fused multiply-adds
 * in a fixed order, so that each build gives the same bits, however it blocks, unrolls or
 * vectorises:
 *
 *     mul     out_i = sum over the listed columns, in their order, of column_i * value
 *     mul_t   out_k = scale_j * (sum over i = 0, 1, ... of column_j_i * v_i), j the k-th listed
 *
 * dots uses eight such chains and a tree over them (eits_tree8), so that no register has to hold
 * one row of many columns:
 *
 *     dots    out_k = scale_j * tree of lanes l = 0 to 7, each the sum over i = l, l + 8, ... of
 *             column_j_i * v_i */
#ifndef EITSKIN_KERNELS_H
#define EITSKIN_KERNELS_H

#include "eitskin/context.h"
#include "eitskin/model.h"

typedef struct eits_prox {
    eits_real step, threshold, beta;
    eits_sign sign;
} eits_prox;

typedef struct eits_kernels {
    const char *name;
    /* `out` has matrix->stride numbers; `value` already carries the column's scale. */
    void (*mul)(const eits_matrix *matrix, const uint32_t *index, const eits_real *value,
                uint32_t count, eits_real *out);
    /* If `index` is NULL, the first `count` columns are meant. */
    void (*mul_t)(const eits_matrix *matrix, const uint32_t *index, uint32_t count,
                  const eits_real *v, eits_real *out);
    /* The same product from panels that hold just these columns (eits_make_panels,
     * eits_pack_panels). */
    void (*mul_t_panels)(const eits_matrix *matrix, const eits_real *panels, const uint32_t *index,
                         uint32_t count, const eits_real *v, eits_real *out);
    /* S'v by eight lanes and a tree; `index` is not NULL. */
    void (*dots)(const eits_matrix *matrix, const uint32_t *index, uint32_t count,
                 const eits_real *v, eits_real *out);
    /* For `count` rows of reals, `stride` apart, of `length` numbers, a multiple of 8: rows_dot
     * gives out_k = row_k . v with the sums of dot; rows_add adds value_k * row_k to out, row after
     * row. */
    void (*rows_dot)(const eits_real *rows, size_t stride, uint32_t count, size_t length,
                     const eits_real *v, eits_real *out);
    void (*rows_add)(const eits_real *rows, size_t stride, uint32_t count, size_t length,
                     const eits_real *value, eits_real *out);
    /* out = the `count` stored numbers from place `first` on, both multiples of 8, as floats
     * without scales. */
    void (*unpack)(const eits_matrix *matrix, size_t first, size_t count, float *out);
    /* A sum over two vectors by eight lanes, each a chain of fused multiply-adds, then a fixed tree
     * (vec.h). */
    eits_real (*dot)(const eits_real *a, const eits_real *b, size_t count);
    /* out += factor * a */
    void (*axpy)(eits_real *out, eits_real factor, const eits_real *a, size_t count);
    /* out = a + factor * (a - b) */
    void (*extrapolate)(eits_real *out, eits_real factor, const eits_real *a, const eits_real *b,
                        size_t count);
    /* List the `count` numbers' non-zeros and their places, in order; returns how many. */
    uint32_t (*nonzeros)(const eits_real *a, uint32_t count, uint32_t *place, eits_real *value);
    /* Returns the greatest of `count` numbers under the sign rule: max a, max -a or max |a|. It is
     * at least 0, and NaN is skipped. */
    eits_real (*greatest)(const eits_real *a, size_t count, eits_sign sign);
    /* One proximal step of FISTA over n coefficients: next = shrink(z + step * gradient, threshold)
     * under the sign rule, then z = next + beta * (next - x). */
    void (*prox)(const eits_prox *how, uint32_t n, const eits_real *gradient, const eits_real *x,
                 eits_real *next, eits_real *z);
} eits_kernels;

extern const eits_kernels eits_kernels_portable;

/* Returns the fastest build that this processor can run. */
const eits_kernels *eits_kernels_best(void);

/* Copy column `column` as reals without its scale; `out` has matrix->rows numbers. */
void eits_read_column(const eits_matrix *matrix, uint32_t column, eits_real *out);

/* List the non-zeros of x in ascending order, multiplied by the column scales; returns their
 * number. */
uint32_t eits_list_nonzeros(const eits_kernels *kernels, const eits_matrix *matrix,
                            const eits_real *x, uint32_t *index, eits_real *value);

/* Multiply the values of listed columns by the columns' scales, if the matrix has any. */
void eits_scale_listed(const eits_matrix *matrix, const uint32_t *index, uint32_t count,
                       eits_real *values);

static inline eits_real eits_dot(const eits_kernels *kernels, const eits_real *a,
                                 const eits_real *b, size_t count)
{
    return kernels->dot(a, b, count);
}

static inline void eits_axpy(const eits_kernels *kernels, eits_real *out, eits_real factor,
                             const eits_real *a, size_t count)
{
    kernels->axpy(out, factor, a, count);
}

static inline eits_real eits_greatest(const eits_kernels *kernels, const eits_real *a, size_t count,
                                      eits_sign sign)
{
    return kernels->greatest(a, count, sign);
}

/* Copy S without scales into panels of EITS_PANEL columns, ordered by panel, row, lane. */
void eits_make_panels(const eits_matrix *matrix, eits_real *panels);

#endif
