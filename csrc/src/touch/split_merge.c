/* Peaks are not touches: near the rim one touch may have two, and two near ones may have one.
 *
 * The fit moves discs but does not change how many there are, and the image's peaks decide where it
 * starts. Here the number is put right: two discs that nearly touch are replaced by one of their
 * area, and a disc by two side by side, each tried for real, refitted, and undone where the
 * residual does not bear it out. Merging may cost a little (fewer parameters explain less),
 * splitting has to gain clearly (more of them always explain more): hence two
 * sets of limits. One may undo what the other did, so touch.c runs them in turn a fixed number of
 * times, and a disc that was tried as two is not tried again.
 *
 * Limits are parts of |y|^2, of what is left, and of what noise gives one direction
 * (f->noise / rank): the first guards against the model's own error, which scales with the touch,
 * the last against noise. A trial costs a few moves of disc_fit.c; the search is greedy, nearest
 * pair and largest disc first, since trying all subsets would grow without bound. Once the frame's
 * work has reached EITS_SPLIT_WORK no disc is tried as two, and after EITS_FIT_WORK no two as one:
 * the discs go to the test of touches. */
#include "touch/constants.h"
#include "touch/disc_fit.h"

#include "base/vec.h"
#include "kernels/kernels.h"

static eits_real lesser(eits_real a, eits_real b)
{
    return a < b ? a : b;
}

/* The distance between two discs' edges, in units of the smaller radius. */
static eits_real edge_distance(const eits_disc *a, const eits_disc *b)
{
    const eits_real dx = a->x_mm - b->x_mm, dy = a->y_mm - b->y_mm;
    return (eits_sqrt(eits_fma(dx, dx, dy * dy)) - a->radius_mm - b->radius_mm) /
           lesser(a->radius_mm, b->radius_mm);
}

/* ---- merging ---- */

typedef struct pair {
    eits_real distance;
    uint32_t i, j;
} pair;

/* A total order: distances may be equal, and the pairs then go by their numbers. */
static int comes_after(const pair *a, const pair *b)
{
    if (a->distance != b->distance)
        return a->distance > b->distance;
    return a->i != b->i ? a->i > b->i : a->j > b->j;
}

/* The nearest pair of one sign after `last` (NULL: at all) that may be one touch; 0 where there is
 * none.
 *
 * Nearest first, in an order that does not depend on how the discs are numbered. Discs of
 * opposite sign are never one touch. */
static int next_pair(const eits_fit *f, const pair *last, pair *next)
{
    int found = 0;
    for (uint32_t i = 0; i < f->count; ++i) {
        for (uint32_t j = i + 1u; j < f->count; ++j) {
            const pair here = {edge_distance(&f->disc[i], &f->disc[j]), i, j};
            if (f->disc[i].polarity != f->disc[j].polarity || !(here.distance < EITS_MERGE_NEAR) ||
                (last != NULL && !comes_after(&here, last)))
                continue;
            if (!found || comes_after(next, &here))
                *next = here;
            found = 1;
        }
    }
    return found;
}

/* One disc in the middle of both, weighted by strength, of their area. */
static eits_disc merged_disc(const eits_options *o, const eits_disc *a, const eits_disc *b)
{
    const eits_real of_a = eits_fabs(a->change) * a->radius_mm * a->radius_mm,
                    of_b = eits_fabs(b->change) * b->radius_mm * b->radius_mm;
    const eits_real w = of_a + of_b > 0 ? of_a / (of_a + of_b) : R(0.5);
    const eits_real radius =
        eits_sqrt(eits_fma(a->radius_mm, a->radius_mm, b->radius_mm * b->radius_mm));
    return (eits_disc){
        .x_mm = eits_fma(w, a->x_mm - b->x_mm, b->x_mm),
        .y_mm = eits_fma(w, a->y_mm - b->y_mm, b->y_mm),
        .radius_mm = lesser(radius, o->touch_max_radius_mm),
        .polarity = a->polarity,
    };
}

/* Make the pair one disc; 1 if that is kept.
 *
 * Tried for real and undone where it does not hold: a criterion from the two discs alone would
 * not know what the data say. */
static int try_merge(eits_context *ctx, const eits_scratch *scratch, eits_fit *f, const pair *p)
{
    const uint32_t rank = ctx->model->rank;
    const eits_fit_kept before = eits_fit_keep(ctx, f);
    f->disc[p->i] = merged_disc(&ctx->options, &f->disc[p->i], &f->disc[p->j]);
    --f->count;
    for (uint32_t k = p->j; k < f->count; ++k)
        f->disc[k] = f->disc[k + 1u];
    eits_fit_restart(ctx, scratch, f);
    f->disc[p->i].change = eits_best_change(ctx, &f->disc[p->i], eits_atom(ctx, p->i), f->residual);
    eits_axpy(ctx->kernels, f->residual, -f->disc[p->i].change, eits_atom(ctx, p->i), rank);
    f->macs += 3u * rank;
    eits_fit_move(ctx, scratch, f, p->i, p->i, EITS_MERGE_SWEEPS);
    eits_fit_move_all(ctx, scratch, f, 1);
    const eits_real more =
        eits_fma(EITS_MERGE_TOTAL, f->total,
                 eits_fma(EITS_MERGE_LEFT, before.left,
                          EITS_DIRECTIONS_OF_NOISE * f->noise / (eits_real)rank));
    if (eits_fit_left(ctx, f) <= before.left + more)
        return 1;
    eits_fit_undo(ctx, scratch, f, &before);
    return 0;
}

/* From the nearest pair on; after a merge the order is another, so it starts again. */
int eits_fit_merge(eits_context *ctx, const eits_scratch *scratch, eits_fit *f)
{
    int any = 0;
    pair next, last;
    const pair *after = NULL;
    while (next_pair(f, after, &next) && eits_fit_may_go_on(ctx, f)) {
        if (try_merge(ctx, scratch, f, &next)) {
            any = 1;
            after = NULL;
        } else {
            last = next;
            after = &last;
        }
    }
    return any;
}

/* ---- splitting ---- */

typedef struct two {
    eits_disc disc[2];
    eits_real left; /* |residual|^2 with them in the place of the one; -1: no two are possible */
} two;

/* Strengths of two atoms that explain `target` best; what they leave, or -1 where they are no
 * touches of that sign. */
static eits_real both_changes(const eits_context *ctx, const eits_scratch *scratch,
                              const eits_real *target, eits_real *const atom[2], eits_real polarity,
                              eits_real change[2])
{
    eits_real *left = scratch->row[1];
    const uint32_t rank = ctx->model->rank;
    const eits_real aa = eits_dot(ctx->kernels, atom[0], atom[0], rank),
                    bb = eits_dot(ctx->kernels, atom[1], atom[1], rank);
    const eits_real ab = eits_dot(ctx->kernels, atom[0], atom[1], rank);
    const eits_real at = eits_dot(ctx->kernels, atom[0], target, rank),
                    bt = eits_dot(ctx->kernels, atom[1], target, rank);
    /* Normal equations of two unknowns. Where the atoms are all but parallel there is no telling
     * them apart. */
    const eits_real determinant = eits_fma(aa, bb, -(ab * ab));
    if (!(determinant > EITS_PARALLEL * aa * bb))
        return -1;
    change[0] = eits_fma(bb, at, -(ab * bt)) / determinant;
    change[1] = eits_fma(aa, bt, -(ab * at)) / determinant;
    if (!(change[0] * polarity > 0 && change[1] * polarity > 0))
        return -1;
    for (uint32_t i = 0; i < rank; ++i)
        left[i] = eits_fma(-change[1], atom[1][i], eits_fma(-change[0], atom[0][i], target[i]));
    return eits_dot(ctx->kernels, left, left, rank);
}

/* The best of some pairs in the place of disc k.
 *
 * Two discs side by side along four directions, in the place of the one: a start for the fit,
 * not a result. Which direction is best hardly depends on the exact offset. */
static two best_two(eits_context *ctx, const eits_scratch *scratch, eits_fit *f, uint32_t k)
{
    static const eits_real along[EITS_SPLIT_DIRECTIONS][2] = {
        {1, 0},
        {R(0.70710678118654752440), R(0.70710678118654752440)},
        {0, 1},
        {-R(0.70710678118654752440), R(0.70710678118654752440)}};
    const uint32_t rank = ctx->model->rank;
    const eits_disc one = f->disc[k];
    const eits_real radius = EITS_SPLIT_RADIUS * one.radius_mm,
                    smallest = ctx->options.touch_min_radius_mm;
    eits_real *target = scratch->row[3], *const atom[2] = {scratch->row[5], scratch->row[6]};
    two best = {.left = -1};
    eits_copy(target, f->residual, EITS_STRIDE(rank));
    eits_axpy(ctx->kernels, target, one.change, eits_atom(ctx, k), rank);
    for (int d = 0; d < EITS_SPLIT_DIRECTIONS; ++d) {
        const eits_real dx = EITS_SPLIT_OFFSET * one.radius_mm * along[d][0],
                        dy = EITS_SPLIT_OFFSET * one.radius_mm * along[d][1];
        two here = {.disc = {one, one}};
        for (int side = 0; side < 2; ++side) {
            here.disc[side].x_mm += side ? -dx : dx;
            here.disc[side].y_mm += side ? -dy : dy;
            here.disc[side].radius_mm = radius > smallest ? radius : smallest;
        }
        if (!eits_disc_on_skin(ctx, &here.disc[0]) || !eits_disc_on_skin(ctx, &here.disc[1]))
            continue;
        for (int side = 0; side < 2; ++side)
            f->macs += eits_disc_atom(ctx, scratch, &here.disc[side], atom[side], NULL);
        eits_real change[2];
        here.left = both_changes(ctx, scratch, target, atom, one.polarity, change);
        f->macs += 8u * rank;
        if (here.left < 0 || (best.left >= 0 && here.left >= best.left))
            continue;
        here.disc[0].change = change[0];
        here.disc[1].change = change[1];
        best = here;
    }
    return best;
}

/* The two discs' own sweeps, the others being where they belong; 0 where they are given up.
 *
 * Sweeps gain less and less: where this one's gain in each that is left, and in the last over all,
 * would still not do, two are hopeless. */
static int settle_two(eits_context *ctx, const eits_scratch *scratch, eits_fit *f, uint32_t k,
                      uint32_t last, eits_real limit)
{
    eits_real before = 0;
    for (int sweep = 0; sweep < EITS_SPLIT_SWEEPS; ++sweep) {
        eits_fit_move(ctx, scratch, f, k, k, 1);
        eits_fit_move(ctx, scratch, f, last, last, 1);
        const eits_real left = eits_fit_left(ctx, f);
        f->macs += ctx->model->rank;
        if (sweep > 0 && left - (eits_real)(EITS_SPLIT_SWEEPS - sweep) * (before - left) > limit)
            return 0;
        before = left;
    }
    return 1;
}

/* Make disc k two; 1 if that is kept.
 *
 * A start that leaves far more than the one disc did is not worth fitting, among many discs less
 * surely so, as neighbours have taken up what the two would have; what comes of the fit
 * has to leave clearly less, beyond what noise would give, and to be two discs that one can tell
 * apart. */
static int try_split(eits_context *ctx, const eits_scratch *scratch, eits_fit *f, uint32_t k)
{
    const uint32_t last = f->count;
    const eits_fit_kept before = eits_fit_keep(ctx, f);
    const two begin = best_two(ctx, scratch, f, k);
    if (begin.left < 0 || begin.left > EITS_SPLIT_FIRST * before.left)
        return 0;
    f->disc[k] = begin.disc[0];
    f->disc[last] = begin.disc[1];
    ++f->count;
    eits_fit_restart(ctx, scratch, f);
    const int hopeful = settle_two(ctx, scratch, f, k, last, EITS_SPLIT_FALL * before.left);
    if (hopeful)
        eits_fit_move_all(ctx, scratch, f, 1);
    const eits_real left = eits_fit_left(ctx, f),
                    min =
                        eits_fma(EITS_SPLIT_TOTAL, f->total,
                                 EITS_DIRECTIONS_OF_NOISE * f->noise / (eits_real)ctx->model->rank);
    if (hopeful && left <= EITS_SPLIT_GAIN * before.left && before.left - left >= min &&
        edge_distance(&f->disc[k], &f->disc[last]) > EITS_SPLIT_DISTANCE)
        return 1;
    eits_fit_undo(ctx, scratch, f, &before);
    return 0;
}

/* The largest disc is the likeliest to be two touches. Each is tried once a frame. */
int eits_fit_split(eits_context *ctx, const eits_scratch *scratch, eits_fit *f)
{
    uint8_t looked[EITS_MAX_TOUCHES] = {0};
    const eits_real enough = eits_fma(EITS_SPLIT_TOTAL, f->total, EITS_SPLIT_NOISE * f->noise);
    int any = 0;
    /* those that come by splitting are not split again at once */
    const uint32_t before = f->count;
    for (uint32_t turn = 0; turn < before; ++turn) {
        if (f->count >= ctx->options.max_touches ||
            f->macs >= eits_fit_limit(ctx, EITS_SPLIT_WORK) || eits_fit_left(ctx, f) < enough)
            return any;
        uint32_t k = before;
        for (uint32_t i = 0; i < before; ++i) { /* the largest first */
            if (!looked[i] && (k == before || f->disc[i].radius_mm > f->disc[k].radius_mm))
                k = i;
        }
        looked[k] = 1;
        any |= try_split(ctx, scratch, f, k);
    }
    return any;
}
