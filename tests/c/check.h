/* A few words to test with: a TEST runs by RUN_TESTS or run_tests(), in the order of the file; each
 * failed CHECK says where (the first MAX_SHOWN of them). */
#ifndef EITSKIN_TEST_CHECK_H
#define EITSKIN_TEST_CHECK_H

#include "eitskin/types.h"

#include <float.h>
#include <stdio.h>

#ifdef EITS_DOUBLE
#define EPS                       DBL_EPSILON
#define BOTH_WIDTHS(narrow, wide) (wide)
#else
#define EPS                       ((double)FLT_EPSILON)
#define BOTH_WIDTHS(narrow, wide) (narrow)
#endif

enum { MAX_SHOWN = 20 };
static int checks_failed = 0;
static int checks_made = 0;

/* An inline function, so that a header may hold it without each test using it. */
static inline void check_that(int right, const char *file, int line, const char *what)
{
    ++checks_made;
    if (right)
        return;
    if (++checks_failed <= MAX_SHOWN)
        printf("%s:%d: not true: %s\n", file, line, what);
}

static inline void check_near(double got, double want, double tolerance, const char *file, int line,
                              const char *what)
{
    const double off = got > want ? got - want : want - got;
    ++checks_made;
    if (off <= tolerance) /* false for NaN */
        return;
    if (++checks_failed <= MAX_SHOWN)
        printf("%s:%d: %s = %.9g, expected %.9g within %.3g\n", file, line, what, got, want,
               tolerance);
}

static inline void check_equal(long long got, long long want, const char *file, int line,
                               const char *what)
{
    ++checks_made;
    if (got == want)
        return;
    if (++checks_failed <= MAX_SHOWN)
        printf("%s:%d: %s = %lld, expected %lld\n", file, line, what, got, want);
}

#define CHECK(condition) check_that((condition) != 0, __FILE__, __LINE__, #condition)
#define CHECK_NEAR(value, expected, tolerance) \
    check_near((double)(value), (double)(expected), (double)(tolerance), __FILE__, __LINE__, #value)
/* Of whole numbers, statuses, enums. */
#define CHECK_EQUAL(value, expected) \
    check_equal((long long)(value), (long long)(expected), __FILE__, __LINE__, #value)

static inline int checks_report(const char *name)
{
    printf("%s, %d bytes a real: %d checks, %d failed\n", name, (int)sizeof(eits_real), checks_made,
           checks_failed);
    return checks_failed == 0 && checks_made > 0 ? 0 : 1;
}

enum { MAX_TESTS = 64 };
static void (*checks_tests[MAX_TESTS])(void);
static int checks_tests_known = 0;

/* A test: the body follows. It puts itself on the list before main. */
#define TEST(name)                                              \
    static void name(void);                                     \
    __attribute__((constructor)) static void name##_known(void) \
    {                                                           \
        checks_tests[checks_tests_known++] = name;              \
    }                                                           \
    static void name(void)

static inline void run_tests(void)
{
    for (int k = 0; k < checks_tests_known; ++k)
        checks_tests[k]();
}

/* A main that runs the tests, then what is given as a last step. */
#define RUN_TESTS(name, ...)        \
    int main(void)                  \
    {                               \
        run_tests();                \
        __VA_ARGS__;                \
        return checks_report(name); \
    }

#endif
