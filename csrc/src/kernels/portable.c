/* The matrix products in plain C: every target has them, and they are what the others are compared
 * with, bit by bit. Written so that compilers can make vectors of the inner loops over lanes, and
 * must not reorder a sum: each lane is a chain of its own. */
#define NAME(x) portable_##x

#include "base/vec.h"
#include "kernels/kernels.h"

static void portable_sum_panel(const eits_real *panel, const eits_real *v, uint32_t rows,
                               eits_real *sum)
{
    for (uint32_t l = 0; l < EITS_PANEL; ++l)
        sum[l] = 0;
    for (uint32_t i = 0; i < rows; ++i) {
        for (uint32_t l = 0; l < EITS_PANEL; ++l)
            sum[l] = eits_fma(panel[(size_t)i * EITS_PANEL + l], v[i], sum[l]);
    }
}

#include "kernels/body.h"

const eits_kernels eits_kernels_portable = KERNELS_TABLE("portable");
