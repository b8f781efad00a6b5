/* Outliers in reference frames: a reading that disagrees with its reciprocal is left out of the
 * reference.
 *
 * A wrong reading in a frame spoils that frame. A wrong reading in the reference spoils all later
 * frames, and raises the learned noise, so that faint touches are missed. Outliers of later frames
 * are judged by the noise, which is not known yet here. Reference frames therefore have rules of
 * their own, which compare changes between frames with each other.
 *
 * Method: between two frames of an untouched skin each row changes by noise and drift, and drift
 * changes a row and its reciprocal alike. The oddity of a fold is the difference of these two
 * changes. A fold is an outlier if its oddity exceeds three limits: a multiple of the median oddity
 * (for normal noise, 1.4826 times the median is the standard deviation), a fraction of the greatest
 * voltage, and a fraction of the fold's own voltage. No single limit suffices: the median may be
 * zero on quantised voltages, small rows jump by a large fraction of themselves, and the noise of
 * large rows grows with them.
 *
 * In: a reference frame and the mean so far, or the first two frames. Out: EITS_MASKED_NOW in
 * rows.masked for the reading at fault, until eits_reference_unmask. */
#include "diagnostics/diagnostics.h"

#include "base/vec.h"

/* The functions below compare `newer` with `older`. Rows without a voltage in one of them do not
 * count. */
static int in_use(const eits_context *ctx, uint32_t row, const eits_real *older)
{
    return row != EITS_FOLD_NONE && !ctx->rows.masked[row] && eits_is_finite(older[row]);
}

static eits_real change(const eits_context *ctx, uint32_t row, const eits_real *newer,
                        const eits_real *older)
{
    return in_use(ctx, row, older) ? newer[row] - older[row] : 0;
}

/* Return the difference of the changes of fold k's rows; with `paired` 0, the greater of the
 * changes. */
static eits_real oddity(const eits_context *ctx, uint32_t k, const eits_real *newer,
                        const eits_real *older, int paired)
{
    const eits_fold fold = ctx->model->fold[k];
    const eits_real first = change(ctx, fold.first, newer, older);
    const eits_real second = (eits_real)fold.sign * change(ctx, fold.second, newer, older);
    if (paired)
        return in_use(ctx, fold.first, older) && in_use(ctx, fold.second, older)
                   ? eits_fabs(first - second)
                   : 0;
    return eits_larger(eits_fabs(first), eits_fabs(second));
}

/* Return the greater voltage of fold k's rows. */
static eits_real size_of(const eits_context *ctx, uint32_t k, const eits_real *older)
{
    const eits_fold fold = ctx->model->fold[k];
    const eits_real first = in_use(ctx, fold.first, older) ? eits_fabs(older[fold.first]) : 0;
    const eits_real second = in_use(ctx, fold.second, older) ? eits_fabs(older[fold.second]) : 0;
    return eits_larger(first, second);
}

/* Return the limit of an oddity. Sets `paired` to 1 if reciprocal rows can be compared. */
static eits_real limit_of(const eits_context *ctx, const eits_scratch *scratch,
                          const eits_real *newer, const eits_real *older, int *paired)
{
    const uint32_t folds = ctx->model->n_folded;
    eits_real largest = 0;
    for (uint32_t i = 0; i < ctx->model->n_rows; ++i) {
        const eits_real v = in_use(ctx, i, older) ? eits_fabs(older[i]) : 0;
        largest = v > largest ? v : largest;
    }
    /* Reciprocal rows are compared first: they are measured in the same frame, so they differ by
     * noise only. If they never differ they are copies, and the changes themselves are used. */
    for (int way = 1; way >= 0; --way) {
        int any = 0;
        for (uint32_t k = 0; k < folds; ++k) {
            scratch->value[k] = oddity(ctx, k, newer, older, way);
            any |= scratch->value[k] > 0;
        }
        if (!any)
            continue;
        *paired = way;
        const eits_real spread = EITS_ROBUST * eits_kth(scratch->value, folds, folds / 2);
        const eits_real limit = way ? EITS_PAIRED * spread : EITS_UNPAIRED * spread,
                        min = (way ? EITS_PAIRED_MIN : EITS_UNPAIRED_MIN) * largest;
        return limit > min ? limit : min;
    }
    *paired = 0;
    return largest;
}

/* More than EITS_OUTLIER_MAX odd folds are a change of the skin; then no fold is marked. */
uint32_t eits_reference_compare(eits_context *ctx, const eits_scratch *scratch,
                                const eits_real *newer, const eits_real *older, uint8_t bit)
{
    int paired;
    const eits_real limit = limit_of(ctx, scratch, newer, older, &paired);
    uint32_t count = 0;
    for (uint32_t k = 0; k < ctx->model->n_folded; ++k) {
        const eits_real off = oddity(ctx, k, newer, older, paired);
        const int odd = off > limit && off > EITS_OWN_MIN * size_of(ctx, k, older);
        scratch->index[k] = (scratch->index[k] & ~(uint32_t)bit) | (odd ? bit : 0u);
        count += (uint32_t)odd;
    }
    for (uint32_t k = 0; k < ctx->model->n_folded && count > EITS_OUTLIER_MAX; ++k)
        scratch->index[k] &= ~(uint32_t)bit;
    return count > EITS_OUTLIER_MAX ? 0 : count;
}

/* The rows of fold k that changed: the one that changed more, and the other if it changed about as
 * much. */
static uint32_t odd_rows(const eits_context *ctx, uint32_t k, const eits_real *newer,
                         const eits_real *older, uint32_t rows[2])
{
    const eits_fold fold = ctx->model->fold[k];
    const eits_real first = eits_fabs(change(ctx, fold.first, newer, older)),
                    second = eits_fabs(change(ctx, fold.second, newer, older));
    uint32_t count = 0;
    if (first > 0 && first >= EITS_CHANGED_AS_MUCH * second)
        rows[count++] = fold.first;
    if (second > 0 && second >= EITS_CHANGED_AS_MUCH * first)
        rows[count++] = fold.second;
    return count;
}

/* A wrong reading in a reference frame would affect every later frame, like a touch that never
 * ends. Too many of them are not outliers: the skin was touched or moved. Then all readings are
 * kept, and the learned noise shows it. */
uint32_t eits_reference_mask_outliers(eits_context *ctx, const eits_scratch *scratch,
                                      const eits_real *frame)
{
    uint32_t left = 0;
    if (eits_reference_compare(ctx, scratch, frame, ctx->reference.v0, 1) == 0)
        return 0;
    for (uint32_t k = 0; k < ctx->model->n_folded; ++k) {
        uint32_t rows[2], count = (scratch->index[k] & 1u) != 0
                                      ? odd_rows(ctx, k, frame, ctx->reference.v0, rows)
                                      : 0;
        left += count;
        while (count > 0)
            ctx->rows.masked[rows[--count]] = EITS_MASKED_NOW;
    }
    return left;
}

/* Two of three frames agree: the third frame shows which of the first two was wrong, and the wrong
 * reading gets the value of the other. */
uint32_t eits_reference_weigh_second(eits_context *ctx, const eits_scratch *scratch,
                                     const eits_real *frame)
{
    enum { WITH_SECOND = 1, FIRST_WITH_THIRD = 2, SECOND_WITH_THIRD = 4 };
    eits_real *first = ctx->reference.v0, *second = ctx->reference.m2;
    uint32_t left = 0;
    (void)eits_reference_compare(ctx, scratch, second, first, WITH_SECOND);
    (void)eits_reference_compare(ctx, scratch, frame, first, FIRST_WITH_THIRD);
    (void)eits_reference_compare(ctx, scratch, frame, second, SECOND_WITH_THIRD);
    for (uint32_t k = 0; k < ctx->model->n_folded; ++k) {
        const uint32_t odd = scratch->index[k] & 7u;
        uint32_t rows[2], count = 0;
        if (odd == (WITH_SECOND | FIRST_WITH_THIRD) || odd == (WITH_SECOND | SECOND_WITH_THIRD))
            count = odd_rows(ctx, k, second, first, rows);
        left += count;
        while (count > 0) {
            const uint32_t i = rows[--count];
            if (odd == (WITH_SECOND | FIRST_WITH_THIRD))
                first[i] = second[i];
            else
                second[i] = first[i];
        }
    }
    return left;
}

/* The caller's own mask, 1, stays. */
void eits_reference_unmask(eits_context *ctx)
{
    for (uint32_t i = 0; i < ctx->model->n_rows; ++i)
        ctx->rows.masked[i] = ctx->rows.masked[i] == EITS_MASKED_NOW ? 0 : ctx->rows.masked[i];
}
