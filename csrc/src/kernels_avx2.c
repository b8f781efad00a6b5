/* The matrix products for x86-64 with AVX2 and FMA; this file alone is compiled with -mavx2 -mfma. */
#define NAME(x) avx2_##x

#include "kernels.h"
#include "vec.h"

#include <immintrin.h>

#ifdef EITS_DOUBLE
enum { LANES = 4 };
typedef __m256d vector;
#define LOAD _mm256_loadu_pd
#define STORE _mm256_storeu_pd
#define SET1 _mm256_set1_pd
#define FMA _mm256_fmadd_pd
#define ZERO _mm256_setzero_pd
#else
enum { LANES = 8 };
typedef __m256 vector;
#define LOAD _mm256_loadu_ps
#define STORE _mm256_storeu_ps
#define SET1 _mm256_set1_ps
#define FMA _mm256_fmadd_ps
#define ZERO _mm256_setzero_ps
#endif

enum { VECTORS = (int)EITS_PANEL / LANES };

static void avx2_sum_panel(const eits_real *panel, const eits_real *v, uint32_t rows, eits_real *sum)
{
    vector lane[VECTORS];
    for (int k = 0; k < VECTORS; ++k)
        lane[k] = ZERO();
    for (uint32_t i = 0; i < rows; ++i) {
        const vector w = SET1(v[i]);
        for (int k = 0; k < VECTORS; ++k)
            lane[k] = FMA(LOAD(panel + (size_t)i * EITS_PANEL + (size_t)(k * LANES)), w, lane[k]);
    }
    for (int k = 0; k < VECTORS; ++k)
        STORE(sum + k * LANES, lane[k]);
}

#include "kernels_body.h"

extern const eits_kernels eits_kernels_avx2;
const eits_kernels eits_kernels_avx2 = KERNELS_TABLE("avx2");
