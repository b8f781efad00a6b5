/* The start of most tests: the sheet, a model of it in bank 0, the board and its host. */
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

/* Start the application; what ran before is stopped. `spec` NULL: without a model. `b` is static,
 * or zero before the first call. */
void bench_start(bench *b, const skin_spec *spec);
void bench_stop(bench *b);

/* The sheet's voltages, for the board's `volts`. */
double bench_sheet(void *user, const uint8_t electrodes[4], uint64_t at_ns);

/* Restart the board; its flash stays. */
void bench_restart(bench *b);

/* The voltage that a row of the model should read now. */
double bench_volts(const bench *b, uint32_t row);

#endif
