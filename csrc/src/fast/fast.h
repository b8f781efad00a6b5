/* The state of the tracker, and the functions that its files share. */
#ifndef EITSKIN_FAST_ROOM_H
#define EITSKIN_FAST_ROOM_H

#include "base/vec.h"
#include "context/context.h"
#include "eitskin/fast.h"
#include "fast/constants.h"
#include "search/constants.h"
#include "search/trial.h"

_Static_assert(EITS_FAST_MAX_TOUCHES == EITS_FAST_TOUCHES, "the header's");
_Static_assert(EITS_FAST_MAX_ROWS == EITS_FAST_ROWS, "the header's");
_Static_assert(EITS_FAST_RING == EITS_FAST_WAITING, "the header's");

/* Indices of a touch's numbers in the state: x, y, strength, and the speeds along x and y. */
enum { FAST_X = 0, FAST_Y = 1, FAST_C = 2, FAST_VX = 3, FAST_VY = 4 };
enum { FAST_SIZE = EITS_FAST_STATE_NUMBERS };
enum { FAST_NUMBERS = FAST_SIZE * EITS_FAST_MAX_TOUCHES };
/* An answer and its derivatives by x and y. */
enum { FAST_WAYS = EITS_FAST_ANSWER_NUMBERS };

typedef struct fast_drive {
    uint16_t first, count; /* in `row` */
    uint8_t plus, minus;
    uint8_t explained; /* 1: the drive was explained when it was last measured */
    uint8_t learned;   /* 1: the model's error in its rows is learned */
    uint32_t rest_at;  /* the count of drives when `rest` of its rows was kept */
    /* for each touch: 1 if it was on the skin at that time; its x, y and strength then */
    uint8_t there[EITS_FAST_MAX_TOUCHES];
    eits_real then[EITS_FAST_MAX_TOUCHES][FAST_WAYS];
} fast_drive;

/* The fields at a place: the mean over its disc of each electrode's field (x of each, then y) and
 * of the mirror's four numbers. Two such places give the interaction of two touches. */
typedef struct fast_sight {
    eits_real *field;
    eits_real z[2], radius;
} fast_sight;

/* The last frame did not show a touch, showed it at the place that drives gave it, or showed it
 * elsewhere. */
typedef enum fast_last { FAST_NOT_SEEN, FAST_AGREED, FAST_ELSEWHERE } fast_last;

/* Why the touches that drives follow may be better than those of a frame. */
enum { FAST_CHANGED = 1, FAST_GROWS = 2 };

/* A tracked touch: its numbers beside those in the state. */
typedef struct fast_known {
    uint32_t id;
    uint32_t on, off_drives, age; /* age: drives since it was born or put elsewhere */
    uint32_t moving, slow;        /* it has a speed; consecutive drives in which it was slow */
    uint32_t frames_missed, confirmed;
    uint32_t aligned; /* 1: it was on the skin when a frame was last aligned; its place then */
    eits_real at[2];
    /* the result of the last solved frame for it, its place there, and the time */
    fast_last last;
    eits_real place[2];
    uint32_t place_us;
    uint32_t creeps; /* consecutive drives in which it had moved the same way since the last scan;
                        if it moves, in which it had not */
    eits_real anchor[2]; /* its place `slow` drives ago; for a still touch, its displacement since
                            the last scan */
    eits_real energy;    /* mean of the chi^2 per drive that it explains */
    eits_real peak;      /* its greatest strength */
    eits_real rho2;      /* square of the radius at which its soft disc ends, mm^2 */
} fast_known;

/* A touch as frames report it: either only frames show it, or drives follow it and frames take it
 * over if drives lose it (report.c). */
typedef struct fast_seen {
    eits_touch touch;          /* as it was last found */
    eits_real at[2], speed[2]; /* mm; mm per frame */
    /* variance of the place, covariance of place and velocity, variance of the velocity; the same
     * along x and y */
    eits_real place_mm2, both_mm2, speed_mm2;
    uint32_t id;       /* 0: not reported yet */
    uint32_t kept_id;  /* the id that is kept for it until it is reported; 0: none */
    uint32_t followed; /* drives followed it: the number of frames that must show it before they
                          report it */
    uint32_t seen;     /* frames that showed it, counted up to EITS_FAST_SEEN_KNOWN */
    uint32_t missed;   /* consecutive frames that did not show it */
    uint32_t faint;    /* 1: it was fainter than noise when it was last found */
} fast_seen;

/* A drive in the ring: its rows, the triangle that whitens them, the answers of the known touches
 * with their slopes, and the states of these touches at that time. Once the drive is `ready`, rows
 * and answers are whitened, and the whitening lets the known strengths change. */
typedef struct fast_held {
    eits_real *white, *factor, *known;
    uint32_t time_us;
    uint32_t used; /* a bit for each row in use */
    uint16_t drive, rows;
    uint8_t count;                       /* touches that were known */
    uint8_t ready, loose, mapped, plain; /* loose: the factor lets strengths change already */
    eits_real chi2;
    eits_real state[EITS_FAST_MAX_TOUCHES][FAST_WAYS];
} fast_held;

struct eits_fast {
    const eits_context *ctx;
    const eits_model *model;
    uint32_t drives, most_rows, cells;
    fast_drive *drive;
    uint16_t *row;   /* n_rows, drive by drive */
    uint16_t *cell;  /* the pixel of each cell of the map */
    eits_real *gain; /* n_rows: model volts per measured volt */
    uint8_t *masked; /* n_rows: 1: the row uses an electrode that a frame named */
    eits_real sign, rho2, sigma, noise_v;
    eits_real drift;  /* of the gain */
    uint32_t drifted; /* consecutive frames in which it was large */
    /* born: 1: a touch was added since a frame was last aligned */
    uint32_t time_us, timed, begun, next_id, born;
    uint32_t drive_count;
    uint32_t unexplained, newsy; /* a bit for each of the last 32 drives */
    uint32_t unexplained_frames, frame_explained;
    uint32_t smeared;    /* FAST_CHANGED: a touch moved or changed in the last frame, and the frame
                            was not aligned; FAST_GROWS: it grew by much, and explains nearly all */
    uint32_t decided;    /* whether the last solved frame alone decided where touches are */
    uint32_t aligned_us; /* time of the last alignment of a frame, and the time between it and the
                            one before */
    eits_real frame_s;
    eits_real news;    /* the greatest chi^2 of a drive that nothing explained, since that frame */
    uint32_t glitched; /* 1: the last drive had an outlier */
    uint32_t fresh;    /* 1: the tracker was begun since a frame was last aligned */
    uint32_t stirred;  /* 1: touches changed in the last aligned frame */
    uint32_t named, named_before;         /* diagnostics of the last two solved frames */
    uint32_t wild;                        /* wild rows since the last frame */
    uint32_t faulty;                      /* 1: the last solved frame named an electrode */
    uint8_t suspect[EITS_MAX_ELECTRODES]; /* for each electrode: its wild rows minus its other rows,
                                             from 0 */
    /* touches of frames, and the touches that drives followed when a frame was last aligned */
    uint32_t n_seen;
    uint32_t aligned; /* 1: a frame was aligned and is not reported yet */
    uint32_t n_followed;
    uint32_t kept_from, kept_until,
        kept_used; /* ids kept at the last alignment; kept_used: 1: one of them was given */
    fast_seen seen[EITS_MAX_TOUCHES];
    eits_fast_touch followed[EITS_FAST_MAX_TOUCHES];
    /* the places of the touches that were off; there the solver may find what the skin keeps, which
     * is weaker than off_left */
    uint32_t n_off;
    eits_real off_at[EITS_FAST_MAX_TOUCHES][2], off_left[EITS_FAST_MAX_TOUCHES];
    /* touches that drives may find again: their ids, their places, and which were found */
    uint32_t n_expected, expected_id[EITS_MAX_TOUCHES];
    eits_real expected_at[EITS_MAX_TOUCHES][2];
    uint8_t expected_found[EITS_MAX_TOUCHES];
    /* tracks; their strengths are positive for either sign of the touches */
    uint32_t count;
    fast_known known[EITS_FAST_MAX_TOUCHES];
    eits_real state[FAST_NUMBERS];
    eits_real p[FAST_NUMBERS][FAST_NUMBERS];
    fast_sight sight[EITS_FAST_MAX_TOUCHES];
    /* rows of the present drive, most_rows numbers each: measured (z); direction of a gain drift
     * (along); expected from the touches (h); their interaction, which the answers of both touches
     * contain (twice); the model's error as learned, and the variance of the rest (error) */
    eits_real *z, *along, *h, *twice, *learned, *error;
    eits_real *e, *white, *spare;
    uint8_t *used;
    uint16_t *kept; /* for each place in `field`, the number of its pixel plus 1; 0: empty */
    eits_real *field;
    eits_real *answer;                /* for each touch, its answer and two derivatives */
    eits_real *moved;                 /* P H', FAST_NUMBERS per row */
    eits_real *factor, *other_factor; /* triangles: S = L L' */
    /* the model's error, n_rows numbers each, drive by drive: its learned value and variance, the
     * expected value of the row when it was learned, and the residual when the row was last news */
    eits_real *bias, *bias_variance, *bias_h, *rest;
    /* numbers of drives: in the ring; waiting for an explanation; consecutive ones without news */
    uint32_t ring_count, held_count, quiet;
    /* the drives, and pointers to them, the oldest first */
    fast_held held[EITS_FAST_RING], *ring[EITS_FAST_RING];
    eits_real chi2[EITS_FAST_SUM_DRIVES]; /* chi^2 of the last drives minus their numbers of rows,
                                             the oldest first */
    uint32_t chi2_count;
    eits_real *score; /* for each cell: the chi^2 that a new touch there would explain */
    fast_search search;
    uint32_t seeds;
    eits_real seed[EITS_FAST_MAX_TOUCHES][2];
};

_Static_assert(sizeof(fast_drive) <= EITS_FAST_DRIVE, "the header counts it");
_Static_assert(sizeof(struct eits_fast) <= EITS_FAST_STATE, "the header counts it");
_Static_assert(sizeof(struct eits_fast) + 512 > EITS_FAST_STATE, "the header counts too much");

static inline eits_real fast_square(eits_real value)
{
    return value * value;
}

/* The dot product, in the order of the numbers. The loop takes four numbers at a time, which needs
 * half of the instructions of a plain loop on a small processor. */
static inline eits_real fast_dot(const eits_real *a, const eits_real *b, uint32_t count)
{
    eits_real sum = 0;
    for (; count >= 4; count -= 4, a += 4, b += 4) {
        sum = eits_fma(a[0], b[0], sum);
        sum = eits_fma(a[1], b[1], sum);
        sum = eits_fma(a[2], b[2], sum);
        sum = eits_fma(a[3], b[3], sum);
    }
    for (uint32_t i = 0; i < count; ++i)
        sum = eits_fma(a[i], b[i], sum);
    return sum;
}

static inline void fast_axpy(eits_real *out, eits_real factor, const eits_real *a, uint32_t count)
{
    for (; count >= 4; count -= 4, a += 4, out += 4) {
        const eits_real first = eits_fma(factor, a[0], out[0]);
        const eits_real second = eits_fma(factor, a[1], out[1]);
        const eits_real third = eits_fma(factor, a[2], out[2]);
        out[3] = eits_fma(factor, a[3], out[3]);
        out[0] = first;
        out[1] = second;
        out[2] = third;
    }
    for (uint32_t i = 0; i < count; ++i)
        out[i] = eits_fma(factor, a[i], out[i]);
}

/* Return row i of a triangle that is stored by rows. */
static inline eits_real *fast_line(eits_real *factor, uint32_t i)
{
    return factor + (size_t)i * (i + 1) / 2;
}

/* Compute row i of a factor L, after the rows before it. On entry the row has A_ij for each j < i,
 * on return L_ij. Returns the pivot: `diagonal` minus the squares of the L_ij. Its root is L_ii. */
static inline eits_real fast_factor_row(eits_real *factor, uint32_t i, eits_real diagonal)
{
    eits_real *line = fast_line(factor, i);
    for (uint32_t j = 0; j < i; ++j) {
        const eits_real *other = fast_line(factor, j);
        line[j] = (line[j] - fast_dot(line, other, j)) / other[j];
    }
    return diagonal - fast_dot(line, line, i);
}

/* v = L^-1 v, where L is a triangle. */
static inline void fast_whiten(eits_real *factor, eits_real *v, uint32_t count)
{
    for (uint32_t i = 0; i < count; ++i) {
        const eits_real *line = fast_line(factor, i);
        v[i] = (v[i] - fast_dot(line, v, i)) / line[i];
    }
}

/* Return the squared distance of two places. */
static inline eits_real fast_distance2(const eits_real *a, const eits_real *b)
{
    const eits_real dx = a[0] - b[0], dy = a[1] - b[1];
    return dx * dx + dy * dy;
}

/* Return 1 if two places are further apart than EITS_FAST_APART_MM. */
static inline int fast_apart(const eits_real *a, const eits_real *b)
{
    return fast_distance2(a, b) > fast_square(EITS_FAST_APART_MM);
}

/* Return the time from one instant to another, s; the clock may wrap. */
static inline eits_real fast_between_s(uint32_t from_us, uint32_t to_us)
{
    return (eits_real)(int32_t)(to_us - from_us) * R(1e-6);
}

/* Return the least distance from a touch at which another touch may start. It grows with the
 * touch's width. */
static inline eits_real fast_room_of_mm(const eits_fast *fast, eits_real rho2)
{
    return EITS_FAST_APART_MM + EITS_FAST_APART_WIDE * (eits_sqrt(rho2) - eits_sqrt(fast->rho2));
}

static inline eits_real fast_room_mm(const eits_fast *fast, uint32_t k)
{
    return fast_room_of_mm(fast, fast->known[k].rho2);
}

/* Return 1 if a touch is as wide as a palm. The solver takes a palm for several discs, so that
 * frames give neither its place nor its strength. */
static inline int fast_is_palm(eits_real rho2)
{
    return rho2 > fast_square(EITS_FAST_PALM_MM);
}

/* Return 1 if a frame's touch, at `place` and with this strength, is one of the discs that the
 * solver makes of a palm at `palm` (x, y, strength): it lies on the palm, or is much fainter. */
static inline int fast_is_rest_of(const eits_fast *fast, eits_real rho2, const eits_real *palm,
                                  const eits_real *place, eits_real strength)
{
    return fast_is_palm(rho2) &&
           (eits_fabs(strength) < EITS_FAST_PALM_REST * eits_fabs(palm[FAST_C]) ||
            fast_distance2(place, palm) < fast_square(fast_room_of_mm(fast, rho2)));
}

/* The same for the palms that drives follow now; `place` is in the model's coordinates, without the
 * correction by the reference. */
static inline int fast_is_rest(const eits_fast *fast, const eits_real *place, eits_real strength)
{
    for (uint32_t k = 0; k < fast->count; ++k) {
        if (fast_is_rest_of(fast, fast->known[k].rho2, fast->state + FAST_SIZE * k, place,
                            strength))
            return 1;
    }
    return 0;
}

/* The square of the radius at which a palm's soft disc ends. */
#define FAST_PALM_MM2 (EITS_FAST_RHO_WIDER_MM * EITS_FAST_RHO_WIDER_MM)

/* Return 1 if a touch of the last frame is a whole palm: it is broad, and the frame holds hardly
 * anything else. Touches that explain the frame's drives are better known than that. */
static inline int fast_is_whole_palm(const eits_fast *fast, const eits_touch *found)
{
    return !fast->frame_explained && found->radius_mm > EITS_FAST_BROAD_MM &&
           found->explained > EITS_FAST_BROAD_SHARE;
}

/* ---- rows.c ---- */

/* Collect the pixels of a touch's soft disc, which ends at the root of `rho2`. Returns 0 if none of
 * them is kept. */
int eits_fast_gather(const eits_fast *fast, const eits_real *place, eits_real rho2,
                     fast_disc *disc);
/* Compute the answer of a drive's rows to a touch of strength 1 on this disc, and its derivatives
 * by x and y: `out` has FAST_WAYS rows of most_rows numbers. */
void eits_fast_answer(const eits_fast *fast, uint32_t drive, const fast_disc *disc, eits_real *out);
/* Return 1 if a pixel is near enough to give an answer. */
int eits_fast_on_skin(const eits_fast *fast, const eits_real *place, eits_real rho2);

/* Compute the fields at a touch. */
void eits_fast_look(const eits_fast *fast, const eits_real *place, eits_real rho2,
                    const fast_disc *disc, fast_sight *sight);
/* Add to `out`, times `factor`, the interaction of two touches of strength 1: the change of a
 * drive's rows because each touch changes the field at the other. */
void eits_fast_add_interplay(const eits_fast *fast, uint32_t drive, const fast_sight *a,
                             const fast_sight *b, eits_real factor, eits_real *out);

/* ---- trust.c ---- */

/* Return 1 if the solved frame alone decides where touches are: the drives were left unexplained
 * for so long that the solver was asked, and its touches explain the whole frame. They would not
 * explain a frame in which a finger landed. */
int eits_fast_decides(const eits_fast *fast);
/* Return which of the touches of a frame, which are `at` these places, is a whole palm on which
 * `place` lies; `count` if none is. */
uint32_t eits_fast_whole_palm(const eits_fast *fast, const eits_touch *found,
                              const eits_real (*at)[2], uint32_t count, const eits_real *place);
/* Return a bit for each of the places beside which a frame found a touch, if there are two or more
 * and it agrees with none of them: the solver has taken two touches for a wide one, and drives
 * explain the frame. 0: none. */
uint32_t eits_fast_between(const eits_fast *fast, const eits_real (*places)[2], uint32_t count,
                           const eits_real *found);
/* Return 1 if what the solver found is no better known than what drives follow: a touch grew, fell
 * or moved while the frame was scanned, and the frame could not be aligned. A palm that lands is
 * found as several discs then. */
int eits_fast_is_smeared(const eits_fast *fast, const eits_touch *found, uint32_t count);

/* ---- report.c ---- */

/* After a frame was aligned: keep ids for the touches that its report may name, and let drives find
 * the touches that only frames have shown. */
void eits_fast_expect_touches(eits_fast *fast);
/* When drives begin again: let them find the touches that they followed before. */
void eits_fast_expect_again(eits_fast *fast);
/* Return the id of a touch that starts at `place`. */
uint32_t eits_fast_id_at(eits_fast *fast, const eits_real *place);

/* ---- bias.c ---- */

/* Compute the answers of the known touches in a drive, the expected values of its rows, and the
 * learned part of the model's error in them. */
void eits_fast_expect(eits_fast *fast, uint32_t drive);
/* If the residual of a drive with news equals that of the same rows one scan before, it is an error
 * of the model, not a touch. Then learn it and return 1. */
int eits_fast_is_known_error(eits_fast *fast, uint32_t drive, eits_real chi2);
/* Learn the model's error from the residual of the rows after the update. */
void eits_fast_learn(eits_fast *fast, uint32_t drive);
void eits_fast_forget_errors(eits_fast *fast, uint32_t drive);

/* ---- tracks.c ---- */

/* Advance the state by dt_s: places follow speeds, and variances grow. */
void eits_fast_predict(eits_fast *fast, eits_real dt_s);
/* Compute white, e, factor and moved from the rows z that are in use, and return chi^2.
 * eits_fast_expect must have been called for this drive. */
eits_real eits_fast_innovate(eits_fast *fast, uint32_t rows);
/* The same if each strength may have changed suddenly. The standard deviation of the change is the
 * root of `share2`, as a fraction of the touch's greatest strength. */
eits_real eits_fast_loosen(eits_fast *fast, uint32_t rows, eits_real share2);
/* Replace L by the factor of L L' + x x'. Destroys x. */
void eits_fast_grow(eits_real *factor, eits_real *x, uint32_t rows);
/* Update the state with the rows, as `white` has them. Destroys `moved`. */
void eits_fast_update(eits_fast *fast, uint32_t rows);
/* Add a touch that is not correlated with the others; `covariance` is that of x, y, strength and
 * speeds. */
void eits_fast_add(eits_fast *fast, const eits_real *state, eits_real (*covariance)[FAST_SIZE],
                   eits_real energy, eits_real rho2);
/* Set the covariance of touch k, without correlation with the others. */
void eits_fast_set_covariance(eits_fast *fast, uint32_t k, eits_real (*covariance)[FAST_SIZE]);
/* Set the speed of touch k to 0. */
void eits_fast_still(eits_fast *fast, uint32_t k);
/* It is on. If it was off for longer than a bounce lasts, it is another touch, with its own id. */
void eits_fast_put_on(eits_fast *fast, uint32_t k);
void eits_fast_forget(eits_fast *fast, uint32_t k);

/* ---- map.c ---- */

/* Add a drive to the map `score` of the chi^2 that a touch at each cell would explain. `beside` is
 * the whitened answer of another touch, which is projected out; NULL: none. */
void eits_fast_map(eits_fast *fast, const fast_held *held, const eits_real *beside,
                   eits_real *score);
/* Find the greatest cell of `score` that is apart from the `count` places. Returns 0 if no cell is
 * above zero. */
int eits_fast_peak(const eits_fast *fast, const eits_real *score, const eits_real (*places)[2],
                   uint32_t count, eits_real *place);

/* ---- ring.c ---- */

/* Put the present drive into the ring. It waits for an explanation if it is news or if others wait.
 */
void eits_fast_keep(eits_fast *fast, uint32_t drive, uint32_t rows, int news);
/* Whiten a new touch's answer and its slopes in the way of the drive. */
void eits_fast_whiten_ways(const fast_held *held, uint32_t stride, uint32_t rows,
                           eits_real *answer);
/* Whiten the rows and answers of a drive that waits. */
void eits_fast_whiten_held(eits_fast *fast, fast_held *held);
/* Let the earlier drives of the ring wait as well: together they may show a change that no single
 * one of them shows. A search whitens them. */
void eits_fast_hold_all(eits_fast *fast);
/* Empty the ring: no drive waits any more, because touches have changed. */
void eits_fast_empty_ring(eits_fast *fast);
/* Remove touch k, and empty the ring, because its drives refer to touches by number. */
void eits_fast_drop(eits_fast *fast, uint32_t k);

#endif
