#include "base/cholesky.h"

/* Returns value minus the sum of a_k b_k over k < count. */
static eits_real less_dot(eits_real value, const eits_real *a, const eits_real *b, uint32_t count)
{
    for (uint32_t k = 0; k < count; ++k)
        value = eits_fma(-a[k], b[k], value);
    return value;
}

eits_real eits_cholesky_row(eits_real *lower, uint32_t i)
{
    eits_real *row = eits_lower_row(lower, i);
    for (uint32_t j = 0; j < i; ++j) {
        const eits_real *above = eits_lower_row(lower, j);
        row[j] = less_dot(row[j], row, above, j) / above[j];
    }
    return less_dot(row[i], row, row, i);
}

void eits_lower_solve(eits_real *lower, uint32_t n, eits_real *v)
{
    for (uint32_t i = 0; i < n; ++i) {
        const eits_real *row = eits_lower_row(lower, i);
        v[i] = less_dot(v[i], row, v, i) / row[i];
    }
}

void eits_lower_solve_transposed(eits_real *lower, uint32_t n, eits_real *v)
{
    for (uint32_t i = n; i-- > 0;) {
        eits_real value = v[i];
        for (uint32_t k = i + 1; k < n; ++k)
            value = eits_fma(-eits_lower_row(lower, k)[i], v[k], value);
        v[i] = value / eits_lower_row(lower, i)[i];
    }
}
