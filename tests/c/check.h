/* A few words to test with: a TEST runs by RUN_TESTS or run_tests(), in the order of the file; each
 * failed CHECK says where, in which test and, in a table, in which CASE (the first MAX_SHOWN of
 * them). */
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
static const char *checks_test = "main", *checks_case = "";
static long checks_number = -1;

/* Counts a check; whether it is to be shown. Inline functions, so that a header may hold them
 * without each test using them. */
static inline int check_counts(int right, const char *file, int line)
{
    ++checks_made;
    if (right || ++checks_failed > MAX_SHOWN)
        return 0;
    printf("%s:%d: %s", file, line, checks_test);
    if (checks_case[0] != 0)
        printf(", %s", checks_case);
    if (checks_number >= 0)
        printf(", case %ld", checks_number);
    return 1;
}

static inline void check_that(int right, const char *file, int line, const char *what)
{
    if (check_counts(right, file, line))
        printf(": not true: %s\n", what);
}

static inline void check_near(double got, double want, double tolerance, const char *file, int line,
                              const char *what)
{
    const double off = got > want ? got - want : want - got;
    if (check_counts(off <= tolerance, file, line)) /* false for NaN */
        printf(": %s = %.9g, expected %.9g within %.3g\n", what, got, want, tolerance);
}

static inline void check_equal(long long got, long long want, const char *file, int line,
                               const char *what)
{
    if (check_counts(got == want, file, line))
        printf(": %s = %lld, expected %lld\n", what, got, want);
}

#define CHECK(condition) check_that((condition) != 0, __FILE__, __LINE__, #condition)
#define CHECK_NEAR(value, expected, tolerance) \
    check_near((double)(value), (double)(expected), (double)(tolerance), __FILE__, __LINE__, #value)
/* Compares whole numbers, statuses and enums. */
#define CHECK_EQUAL(value, expected) \
    check_equal((long long)(value), (long long)(expected), __FILE__, __LINE__, #value)
#define CHECK_OK(call)      CHECK_EQUAL(call, EITS_OK)
#define CHECK_REFUSED(call) CHECK_EQUAL(call, EITS_E_ARGUMENT)

/* Names the case of the failures from here on, until another CASE or the end of the test. EACH_ROW
 * goes through a table whose rows begin with a name, and failures show the name of the row. With a
 * loop over another table, for (size_t k = 0; IN_TABLE(k, cases); ++k), they show the number of
 * the row. */
#define CASE(name)     (checks_case = (name))
#define COUNT_OF(list) (sizeof(list) / sizeof(list)[0])
#define EACH_ROW(row, rows)                         \
    for (const __typeof__((rows)[0]) *row = (rows); \
         row < (rows) + COUNT_OF(rows) ? (CASE(row->name), 1) : (CASE(""), 0); ++row)
#define IN_TABLE(k, list) ((checks_number = (k) < COUNT_OF(list) ? (long)(k) : -1) >= 0)

static inline int checks_report(const char *name)
{
    printf("%s, %d bytes a real: %d checks, %d failed\n", name, (int)sizeof(eits_real), checks_made,
           checks_failed);
    return checks_failed == 0 && checks_made > 0 ? 0 : 1;
}

enum { MAX_TESTS = 64 };
static struct {
    int line;
    const char *name;
    void (*run)(void);
} checks_tests[MAX_TESTS];
static int checks_tests_known = 0;

/* Put a test in its place by line: constructors run in an order that the system chooses. */
static inline void check_known(int line, const char *name, void (*run)(void))
{
    int at = checks_tests_known++;
    for (; at > 0 && checks_tests[at - 1].line > line; --at)
        checks_tests[at] = checks_tests[at - 1];
    checks_tests[at].line = line;
    checks_tests[at].name = name;
    checks_tests[at].run = run;
}

/* A test: the body follows. It puts itself on the list before main. */
#define TEST(body)                                              \
    static void body(void);                                     \
    __attribute__((constructor)) static void body##_known(void) \
    {                                                           \
        check_known(__LINE__, #body, body);                     \
    }                                                           \
    static void body(void)

static inline void run_tests(void)
{
    for (int k = 0; k < checks_tests_known; ++k) {
        checks_test = checks_tests[k].name;
        CASE(""), checks_number = -1;
        checks_tests[k].run();
    }
    checks_test = "main";
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
