/* The problem again, dense and in double, written apart from the core: what the core's answers are
 * compared with. */
#ifndef EITSKIN_TEST_DENSE_H
#define EITSKIN_TEST_DENSE_H

#include "small_model.h"

#include "eitskin/eitskin.h"

typedef struct dense {
    uint32_t rank, n, folded;
    double *s; /* n columns of `rank` numbers, scales included */
    double *p; /* folded columns of `rank` numbers */
} dense;

dense dense_of(const eits_model *model);
void dense_free(dense *d);

/* One stored number, without scale, decoded by the definition of its type. */
double dense_entry(const eits_matrix *matrix, uint32_t column, uint32_t row);

/* r = y - S x; c = S' r. */
void dense_residual(const dense *d, const double *y, const double *x, double *r);
void dense_correlate(const dense *d, const double *r, double *c);

/* |y - S x|^2 / 2 + lambda |x|_1. */
double dense_objective(const dense *d, const double *y, const double *x, double lambda);

/* Objective less the dual objective |y|^2 / 2 - |y - t r|^2 / 2 at the greatest feasible t <= 1. */
double dense_gap(const dense *d, const double *y, const double *x, double lambda, eits_sign sign);

/* FISTA as in the paper, each product computed again; from x, which gets the result. */
void dense_fista(const dense *d, const double *y, double lambda, double lipschitz,
                 uint32_t iterations, eits_sign sign, double *x);

/* v without its part in the span of `count` directions of `rank` numbers (changed to an orthonormal
 * basis). */
void dense_project_out(double *v, double *directions, uint32_t count, uint32_t rank);

/* The frame stage: y (rank) from a frame. `out` (n_rows) marks rows left out; `gain` is taken as
 * given; with v0_drift not NULL, changes along that reference are projected away. */
void dense_frame(const eits_model *model, const dense *d, const double *v0, double gain,
                 const double *v0_drift, const eits_real *frame, const uint8_t *out, double *y);

/* sum a b; and the greatest |a - b|. */
double dense_dot(const double *a, const double *b, size_t count);
double dense_greatest_difference(const double *a, const eits_real *b, size_t count);

/* Zeroed doubles, or abort; and reals as doubles. */
double *dense_numbers(size_t count);
double *dense_copy(const eits_real *a, size_t count);

/* A small model, a context on it, and the model in doubles: the basis of most tests of a solve.
 * Opening it closes one that was open, so it is static, or zero before the first time. */
typedef struct dense_bench {
    small_model made;
    small_context c;
    dense d;
} dense_bench;
eits_context *dense_bench_open(dense_bench *bench, small_spec spec, int prepared);
/* On a model that was made already, and perhaps changed: it is sealed, and freed at the end. */
eits_context *dense_bench_take(dense_bench *bench, small_model made, int prepared);
void dense_bench_close(dense_bench *bench);

#endif
