/* The last drives, each as it stood when it came: a hypothesis is judged by those that wait. Their
 * rows are whitened with strengths free to change, so that a known touch that presses harder or
 * lifts is no news to a hypothesis. */
#include "fast/fast.h"

/* Whitens an answer and its slopes together: no loop over the three, so that each number of the
 * factor is loaded once. */
void eits_fast_whiten_ways(const fast_held *held, uint32_t stride, uint32_t rows, eits_real *answer)
{
    eits_real *by_x = answer + stride, *by_y = by_x + stride;
    for (uint32_t i = 0; i < rows; ++i) {
        const eits_real *line = fast_line(held->factor, i);
        eits_real sum = 0, sum_x = 0, sum_y = 0;
        for (uint32_t j = held->count == 0 ? i : 0; j < i; ++j) {
            sum = eits_fma(line[j], answer[j], sum);
            sum_x = eits_fma(line[j], by_x[j], sum_x);
            sum_y = eits_fma(line[j], by_y[j], sum_y);
        }
        answer[i] = (answer[i] - sum) / line[i];
        by_x[i] = (by_x[i] - sum_x) / line[i];
        by_y[i] = (by_y[i] - sum_y) / line[i];
    }
}

/* Buffers go round: the oldest drive's memory becomes the newest's. */
static fast_held *next_place(eits_fast *fast)
{
    if (fast->ring_count < EITS_FAST_RING)
        return fast->ring[fast->ring_count++];
    fast_held *oldest = fast->ring[0];
    for (uint32_t n = 1; n < EITS_FAST_RING; ++n)
        fast->ring[n - 1] = fast->ring[n];
    fast->ring[EITS_FAST_RING - 1] = oldest;
    if (fast->search.from > 0)
        --fast->search.from;
    else
        fast->search.active = 0; /* its first drive is gone */
    return oldest;
}

/* The factor where no touch is known: the noise alone. It is the same for each such drive. */
static void set_plain(const eits_fast *fast, fast_held *held, uint32_t count)
{
    for (uint32_t i = 0; i < count && !held->plain; ++i) {
        eits_zero(fast_line(held->factor, i), i);
        fast_line(held->factor, i)[i] = fast->sigma;
    }
    held->plain = 1;
}

/* Rows and answers as they were measured; they are whitened when the drive waits. */
static void take_raw(const eits_fast *fast, fast_held *held, uint32_t count)
{
    const size_t size = FAST_WAYS * (size_t)fast->most_rows;
    eits_copy(held->white, fast->e, count);
    for (uint32_t k = 0; k < fast->count; ++k) {
        eits_copy(held->known + size * k, fast->answer + size * k, size);
        eits_copy(held->state[k], fast->state + (size_t)FAST_SIZE * k, FAST_WAYS);
        for (uint32_t i = 0; i < count; ++i) {
            for (uint32_t way = 0; way < FAST_WAYS && !fast->used[i]; ++way)
                held->known[size * k + (size_t)way * fast->most_rows + i] = 0;
        }
    }
    if (fast->count == 0) {
        set_plain(fast, held, count);
        return;
    }
    held->plain = 0;
    eits_copy(held->factor, fast->factor, (size_t)count * (count + 1) / 2);
}

/* Each strength may have changed by all of its greatest: a known touch that presses harder or lifts
 * is no news to a hypothesis. Of news that is so already. */
void eits_fast_whiten_held(eits_fast *fast, fast_held *held)
{
    const uint32_t count = fast->drive[held->drive].count;
    const size_t size = FAST_WAYS * (size_t)fast->most_rows;
    for (uint32_t k = 0; k < held->count && !held->loose; ++k) {
        for (uint32_t i = 0; i < count; ++i)
            fast->spare[i] = fast->known[k].peak * held->known[size * k + i];
        eits_fast_grow(held->factor, fast->spare, count);
    }
    fast_whiten(held->factor, held->white, count);
    held->chi2 = fast_dot(held->white, held->white, count);
    for (uint32_t k = 0; k < held->count; ++k)
        eits_fast_whiten_ways(held, fast->most_rows, count, held->known + size * k);
    held->ready = 1;
}

void eits_fast_keep(eits_fast *fast, uint32_t drive, uint32_t rows, int news)
{
    fast_held *held = next_place(fast);
    const uint32_t count = fast->drive[drive].count;
    const int begins = news && fast->held_count == 0;
    held->drive = (uint16_t)drive;
    held->rows = (uint16_t)rows;
    held->time_us = fast->time_us;
    held->count = (uint8_t)fast->count;
    held->loose = (uint8_t)news;
    held->ready = held->mapped = 0;
    held->used = 0;
    for (uint32_t i = 0; i < count; ++i)
        held->used |= (uint32_t)fast->used[i] << i;
    take_raw(fast, held, count);
    fast->quiet = news ? 0 : fast->quiet + 1;
    if (!news && fast->held_count == 0)
        return;
    fast->held_count += fast->held_count < EITS_FAST_HELD;
    eits_fast_whiten_held(fast, held);
    if (begins)
        eits_zero(fast->score, fast->cells);
    /* A touch may have landed while the drive was measured; the drive then shows a wrong place. */
    held->mapped = begins && held->chi2 > EITS_FAST_SUDDEN;
}

void eits_fast_hold_all(eits_fast *fast)
{
    fast->held_count = fast->ring_count < EITS_FAST_HELD ? fast->ring_count : EITS_FAST_HELD;
    eits_zero(fast->score, fast->cells);
    for (uint32_t n = fast->ring_count - fast->held_count; n < fast->ring_count; ++n)
        fast->ring[n]->mapped = 0;
}

void eits_fast_empty_ring(eits_fast *fast)
{
    fast->ring_count = fast->held_count = fast->chi2_count = 0;
    fast->search.active = 0;
}

void eits_fast_drop(eits_fast *fast, uint32_t k)
{
    eits_fast_forget(fast, k);
    eits_fast_empty_ring(fast);
}
