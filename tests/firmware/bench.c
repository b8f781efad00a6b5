#include "bench.h"

#include <stdlib.h>
#include <string.h>

double bench_sheet(void *user, const uint8_t electrodes[4], uint64_t at_ns)
{
    (void)at_ns;
    return sheet_volts(user, electrodes);
}

void bench_start(bench *b, const skin_spec *spec)
{
    bench_stop(b);
    fake_init(&b->board, 4294000000u); /* the clock wraps within a second */
    sheet_init(&b->sheet);
    b->board.volts = bench_sheet;
    b->board.user = &b->sheet;
    b->model = (skin_model){0};
    if (spec != NULL) {
        b->model = skin_model_make(spec);
        fake_put_model(&b->board, 0, 1, b->model.blob, b->model.size);
        if (eits_model_open(&b->open, b->model.blob, b->model.size) != EITS_OK)
            abort();
    }
    host_start(&b->host, &b->board);
}

void bench_restart(bench *b)
{
    fake_restart(&b->board);
    host_start(&b->host, &b->board);
}

void bench_stop(bench *b)
{
    skin_model_free(&b->model);
}

double bench_volts(const bench *b, uint32_t row)
{
    return sheet_volts(&b->sheet, b->open.protocol + 4 * (size_t)row);
}
