/* What most tests begin with: the sheet, a model of it in bank 0, the board and its host. */
#ifndef FW_TEST_BENCH_H
#define FW_TEST_BENCH_H

#include "host.h"
#include "skin_model.h"

typedef struct bench {
    fake_board board;
    host host;
    sheet sheet;
    skin_model model;
    eits_model open; /* a view of it */
} bench;

/* With `spec` NULL: no model. The application has started; what was there before is stopped. `b` is
 * static, or zero before the first time. */
void bench_start(bench *b, const skin_spec *spec);
void bench_stop(bench *b);

/* The board's `volts`: of the sheet. */
double bench_sheet(void *user, const uint8_t electrodes[4], uint64_t at_ns);

/* Restart the board on what its flash holds. */
void bench_restart(bench *b);

/* What the model's rows should read now, in volts. */
double bench_volts(const bench *b, uint32_t row);

#endif
