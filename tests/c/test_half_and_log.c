/* Half precision and the logarithm, against the definitions. */
#include "check.h"
#include "dense.h"

#include "base/half.h"
#include "base/log.h"
#include "kernels/kernels.h"

#include <math.h>
#include <string.h>

TEST(halves)
{
    for (uint32_t half = 0; half < 65536; ++half) {
        const uint16_t bits = (uint16_t)half;
        const uint32_t exponent = half >> 10 & 31u, fraction = half & 1023u;
        if (exponent == 31)
            continue; /* infinities and NaN are refused when a model is opened */
        const double size = exponent == 0 ? ldexp((double)fraction, -24)
                                          : ldexp(1 + (double)fraction / 1024, (int)exponent - 15);
        const float expected = (float)(half & 0x8000u ? -size : size),
                    got = eits_half_to_float(bits);
        CHECK(memcmp(&got, &expected, sizeof got) == 0); /* the sign of zero too */
        const eits_matrix one = {
            .data = &bits, .rows = 1, .cols = 1, .stride = 1, .storage = EITS_STORAGE_F16};
        CHECK(dense_entry(&one, 0, 0) == (double)expected); /* what other tests take it for */
    }
}

#ifndef EITS_OWN_FMA /* else the C library's is not exact */
/* The sum in floats of all exponents, of which half nearly cancel the product or lie halfway. */
TEST(own_fused_multiply_add_is_the_librarys)
{
    static const uint32_t special[] = {0,           1,           0x80000000u, 0x007FFFFFu,
                                       0x00800000u, 0x7F7FFFFFu, 0x7F800000u, 0xFF800000u,
                                       0x7FC00000u, 0x3F800000u, 0x33800000u, 0x33800001u};
    const uint32_t specials = COUNT_OF(special);
    uint64_t state = 1;
    for (uint32_t k = 0; k < 200000; ++k) {
        uint32_t bits[3];
        float number[3];
        for (int i = 0; i < 3; ++i) {
            state = state * 6364136223846793005u + 1442695040888963407u;
            bits[i] = (uint32_t)(state >> 32);
            if ((state >> 8 & 15u) == 0)
                bits[i] = special[(state >> 12) % specials];
        }
        memcpy(number, bits, sizeof number);
        if (k % 2 == 0)
            number[2] = -number[0] * number[1] * (k % 4 == 0 ? 1.0f : 0x1p-24f);
        const float expected = fmaf(number[0], number[1], number[2]),
                    got = eits_float_fma(number[0], number[1], number[2]);
        CHECK(memcmp(&got, &expected, sizeof got) == 0 || (isnan(got) && isnan(expected)));
    }
}
#endif

static eits_real next_after(eits_real q)
{
#ifdef EITS_DOUBLE
    return nextafter(q, 100);
#else
    return nextafterf(q, 100);
#endif
}

/* |error| in units in the last place of the result. */
static double log_error(eits_real q)
{
    const long double exact = logl((long double)q);
    int exponent;
    (void)frexpl(exact, &exponent);
    const long double unit = ldexpl(1, exponent - BOTH_WIDTHS(24, 53));
    return (double)(fabsl((long double)eits_log(q) - exact) / unit);
}

/* Four roundings of half a unit each, of numbers up to twice as large relative to their last place:
 * 3 units hold; over all 67 million floats from 1/16 to 16 the worst is 2.85, near 1.13. */
TEST(logarithm_is_accurate)
{
    const double max = 3;
    double worst = log_error(R(1.13179791));
    for (double q = 1.0 / 16; q <= 16; q *= 1 + 3.7e-6)
        worst = fmax(worst, log_error((eits_real)q));
    for (int k = -40; k <= 40; ++k) { /* close to 1, where the result is small */
        for (int shift = 3; shift < BOTH_WIDTHS(23, 52); ++shift) {
            const double q = 1 + k * ldexp(1, -shift);
            if (q >= 1.0 / 16 && q <= 16 && (eits_real)q != 1)
                worst = fmax(worst, log_error((eits_real)q));
        }
    }
    CHECK(worst <= max);
    CHECK(eits_log(1) == 0);
    CHECK_NEAR(eits_log(2), 0.69314718055994530942, 0.5 * EPS);
    CHECK_NEAR(eits_log(R(0.5)), -0.69314718055994530942, 0.5 * EPS);
    CHECK_NEAR(eits_log(16), 2.77258872223978123767, 2 * EPS);
    CHECK_NEAR(eits_log(R(1.0 / 16)), -2.77258872223978123767, 2 * EPS);
}

TEST(logarithm_rises)
{
    /* across the sweep, in steps far above rounding */
    eits_real before = eits_log(R(1.0 / 16));
    for (double q = 1.0 / 16 * (1 + 1e-5); q <= 16; q *= 1 + 1e-5) {
        const eits_real now = eits_log((eits_real)q);
        CHECK(now > before);
        before = now;
    }
    /* from number to number where the reduction changes its branch: no step back at all */
    for (int k = -4; k <= 4; ++k) {
        const double places[] = {ldexp(1, k), ldexp(1.41421356237309504880, k)};
        for (int p = 0; p < 2; ++p) {
            eits_real q = (eits_real)(places[p] * (1 - 2000 * EPS));
            for (int step = 0; step < 8000; ++step) {
                const eits_real next = next_after(q);
                CHECK(eits_log(next) >= eits_log(q));
                q = next;
            }
        }
    }
}

/* The greatest under each sign rule, wherever it stands and however many there are. */
static void the_greatest(const eits_kernels *kernels)
{
    eits_real g[20];
    for (uint32_t count = 1; count <= 20; ++count) {
        for (uint32_t at = 0; at < count; ++at) {
            for (int turned = 0; turned < 2; ++turned) {
                const eits_real other = R(turned ? 0.5 : -0.5);
                for (uint32_t j = 0; j < count; ++j)
                    g[j] = other;
                g[at] = R(turned ? -2 : 2);
                const eits_real min = count > 1 ? R(0.5) : 0;
                CHECK(eits_greatest(kernels, g, count, EITS_SIGN_INCREASE) == (turned ? min : 2));
                CHECK(eits_greatest(kernels, g, count, EITS_SIGN_DECREASE) == (turned ? 2 : min));
                CHECK(eits_greatest(kernels, g, count, EITS_SIGN_BOTH) == 2);
            }
        }
    }
    CHECK(eits_greatest(kernels, g, 0, EITS_SIGN_BOTH) == 0);
}

int main(void)
{
    the_greatest(&eits_kernels_portable);
    the_greatest(eits_kernels_best());
    run_tests();
    return checks_report("numbers");
}
