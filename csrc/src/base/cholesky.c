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

/* v is 0 before `first`. */
static void solve_from(eits_real *lower, uint32_t first, uint32_t n, eits_real *v)
{
    for (uint32_t i = first; i < n; ++i) {
        const eits_real *row = eits_lower_row(lower, i);
        v[i] = less_dot(v[i], row + first, v + first, i - first) / row[i];
    }
}

/* Numbers of v before `first` stay as they are. */
static void solve_transposed_to(eits_real *lower, uint32_t first, uint32_t n, eits_real *v)
{
    for (uint32_t i = n; i-- > first;) {
        eits_real value = v[i];
        for (uint32_t k = i + 1; k < n; ++k)
            value = eits_fma(-eits_lower_row(lower, k)[i], v[k], value);
        v[i] = value / eits_lower_row(lower, i)[i];
    }
}

void eits_lower_solve(eits_real *lower, uint32_t n, eits_real *v)
{
    solve_from(lower, 0, n, v);
}

void eits_lower_solve_transposed(eits_real *lower, uint32_t n, eits_real *v)
{
    solve_transposed_to(lower, 0, n, v);
}

void eits_lower_inverse(eits_real *lower, uint32_t n, uint32_t first, uint32_t last, eits_real *v)
{
    eits_zero(v, n);
    v[last - 1u] = 1;
    solve_from(lower, last - 1u, n, v);
    solve_transposed_to(lower, first, n, v);
}
