/* What the parts of this module share. */
#ifndef EITSKIN_FAST_ROOM_H
#define EITSKIN_FAST_ROOM_H

#include "base/vec.h"
#include "context/context.h"
#include "eitskin/fast.h"
#include "fast/constants.h"
#include "search/trial.h"

_Static_assert(EITS_FAST_MAX_TOUCHES == EITS_FAST_TOUCHES, "the header's");
_Static_assert(EITS_FAST_MAX_ROWS == EITS_FAST_ROWS, "the header's");
_Static_assert(EITS_FAST_RING == EITS_FAST_WAITING, "the header's");

/* A touch's place in the state: x, y, strength, and speeds. */
enum { FAST_X = 0, FAST_Y = 1, FAST_C = 2, FAST_VX = 3, FAST_VY = 4 };
enum { FAST_SIZE = EITS_FAST_STATE_NUMBERS };
enum { FAST_NUMBERS = FAST_SIZE * EITS_FAST_MAX_TOUCHES };
/* An answer and its derivatives by x and y. */
enum { FAST_WAYS = EITS_FAST_ANSWER_NUMBERS };

typedef struct fast_drive {
    uint16_t first, count; /* in `row` */
    uint8_t plus, minus;
    uint8_t explained; /* when it was last measured */
    uint8_t learned;   /* an error of the model in its rows */
    uint32_t rest_at;  /* the count of drives when `rest` of its rows was kept */
    /* by touch: 1 where it was there then, and x, y, strength */
    uint8_t there[EITS_FAST_MAX_TOUCHES];
    eits_real then[EITS_FAST_MAX_TOUCHES][FAST_WAYS];
} fast_drive;

/* The fields at a place: the mean over its disc of each electrode's field (x of each, then y) and
 * of the mirror's four numbers. Two such places give what two touches do to each other. */
typedef struct fast_sight {
    eits_real *field;
    eits_real z[2], radius;
} fast_sight;

/* The last frame did not show a touch, showed it where drives had it, or showed it elsewhere. */
typedef enum fast_last { FAST_NOT_SEEN, FAST_AGREED, FAST_ELSEWHERE } fast_last;

/* A touch beside its state. */
typedef struct fast_known {
    uint32_t id;
    uint32_t on, off_drives, age; /* age: drives since it was born or put elsewhere */
    uint32_t moving, slow;        /* it has a speed; drives on end that it was slow */
    uint32_t frames_missed, confirmed;
    uint32_t aligned; /* it was there when a frame was last aligned, and where */
    eits_real at[2];
    fast_last last; /* what the last solved frame said of it, where it had it, and when */
    eits_real place[2];
    uint32_t place_us;
    uint32_t creeps;     /* drives on end in which it had gone the same way since the last scan */
    eits_real anchor[2]; /* where it was `slow` drives ago; of a still one, how far it had gone */
    eits_real energy;    /* mean of what it explains of a drive's chi^2 */
    eits_real peak;      /* its greatest strength */
    eits_real rho2;      /* square of where its soft disc ends, mm^2 */
} fast_known;

/* A touch as frames report it: one that they alone show, or one that drives follow, which frames
 * take over if drives lose it (report.c). */
typedef struct fast_seen {
    eits_touch touch;          /* as it was last found */
    eits_real at[2], speed[2]; /* mm; mm in a frame */
    /* covariance of place and velocity, along either axis */
    eits_real place_mm2, both_mm2, speed_mm2;
    uint32_t id;       /* 0: not reported yet */
    uint32_t kept_id;  /* the id that is kept for it until it is reported; 0: none */
    uint32_t followed; /* drives did: frames that must show it before they report it */
    uint32_t seen;     /* frames that showed it, counted up to EITS_FAST_SEEN_KNOWN */
    uint32_t missed;   /* consecutive frames that did not */
    uint32_t faint;    /* 1: it was fainter than noise when it was last found */
} fast_seen;

/* A drive of the ring: rows, the triangle that whitens them, the known touches' answers with their
 * slopes, and their states then. Once it is `ready`, rows and answers are whitened, with strengths
 * free to change. */
typedef struct fast_held {
    eits_real *white, *factor, *known;
    uint32_t time_us;
    uint32_t used; /* a bit for each row in use */
    uint16_t drive, rows;
    uint8_t count;                       /* touches that were known */
    uint8_t ready, loose, mapped, plain; /* loose: strengths are free in the factor already */
    eits_real chi2;
    eits_real state[EITS_FAST_MAX_TOUCHES][FAST_WAYS];
} fast_held;

struct eits_fast {
    const eits_context *ctx;
    const eits_model *model;
    uint32_t drives, most_rows, cells;
    fast_drive *drive;
    uint16_t *row;   /* n_rows, drive by drive */
    uint16_t *cell;  /* pixels at which touches are first looked for */
    eits_real *gain; /* n_rows: model volts per measured volt */
    uint8_t *masked; /* n_rows: uses an electrode that a frame named */
    eits_real sign, rho2, sigma, noise_v;
    eits_real drift;                               /* of the gain */
    uint32_t drifted;                              /* frames on end that it was far */
    uint32_t time_us, timed, begun, next_id, born; /* born: since a frame was last aligned */
    uint32_t drive_count;
    uint32_t unexplained, newsy; /* a bit for each of the last 32 drives */
    uint32_t unexplained_frames, frame_explained;
    uint32_t aligned_us; /* when a frame was last aligned, and how long after the one before */
    eits_real frame_s;
    uint32_t glitched;                    /* in the last drive */
    uint32_t fresh;                       /* begun since a frame was last aligned */
    uint32_t stirred;                     /* touches changed in that frame */
    uint32_t named, named_before;         /* diagnostics of the last two solved frames */
    uint32_t wild;                        /* rows since the last frame */
    uint32_t faulty;                      /* the last solved frame named an electrode */
    uint8_t suspect[EITS_MAX_ELECTRODES]; /* wild rows of each electrode, less those that are not */
    /* touches of frames; and those that drives followed when one was last aligned */
    uint32_t n_seen;
    uint32_t aligned; /* a frame that is not reported yet */
    uint32_t n_followed;
    uint32_t kept_from, kept_until,
        kept_used; /* ids kept at the last align; one of them is given */
    fast_seen seen[EITS_MAX_TOUCHES];
    eits_fast_touch followed[EITS_FAST_MAX_TOUCHES];
    /* touches that drives may find: their ids, where they were, and which were found */
    uint32_t n_expected, expected_id[EITS_MAX_TOUCHES];
    eits_real expected_at[EITS_MAX_TOUCHES][2];
    uint8_t expected_found[EITS_MAX_TOUCHES];
    /* tracks; strengths are above zero whatever the touches' sign */
    uint32_t count;
    fast_known known[EITS_FAST_MAX_TOUCHES];
    eits_real state[FAST_NUMBERS];
    eits_real p[FAST_NUMBERS][FAST_NUMBERS];
    fast_sight sight[EITS_FAST_MAX_TOUCHES];
    /* a drive's rows at hand, most_rows numbers each: measured; along a drift; expected of touches;
     * their interplay, which each of two touches' answers has; of the model's error, what is
     * learned and the variance of the rest */
    eits_real *z, *along, *h, *twice, *learned, *error;
    eits_real *e, *white, *spare;
    uint8_t *used;
    uint16_t *kept; /* which pixel's fields are in each place of `field`, + 1 */
    eits_real *field;
    eits_real *answer;                /* by touch and way */
    eits_real *moved;                 /* P H', FAST_NUMBERS a row */
    eits_real *factor, *other_factor; /* triangles: S = L L' */
    /* the model's error, n_rows each, drive by drive: learned, its variance, what touches gave the
     * row when it was learned; and what was left of it when it last was news */
    eits_real *bias, *bias_variance, *bias_h, *rest;
    /* drives: the last ones; those of them that wait for an explanation; quiet ones on end */
    uint32_t ring_count, held_count, quiet;
    fast_held held[EITS_FAST_RING], *ring[EITS_FAST_RING]; /* the drives; from the oldest on */
    eits_real
        chi2[EITS_FAST_SUM_DRIVES]; /* of the last drives above their rows, the oldest first */
    uint32_t chi2_count;
    eits_real *score; /* by cell: what a new touch there would explain */
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

/* Four at a time, in their order: half of the instructions of a plain loop on a small processor. */
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

/* Row i of a triangle by rows. */
static inline eits_real *fast_line(eits_real *factor, uint32_t i)
{
    return factor + (size_t)i * (i + 1) / 2;
}

/* Row i of a factor L, once the rows before it are known: on entry A_ij for each j < i, on return
 * L_ij. Returns the pivot, `diagonal` less the squares of these; its root is L_ii. */
static inline eits_real fast_factor_row(eits_real *factor, uint32_t i, eits_real diagonal)
{
    eits_real *line = fast_line(factor, i);
    for (uint32_t j = 0; j < i; ++j) {
        const eits_real *other = fast_line(factor, j);
        line[j] = (line[j] - fast_dot(line, other, j)) / other[j];
    }
    return diagonal - fast_dot(line, line, i);
}

/* v <- L^-1 v, L a triangle. */
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

/* Whether two places are further from each other than EITS_FAST_APART_MM. */
static inline int fast_apart(const eits_real *a, const eits_real *b)
{
    return fast_distance2(a, b) > fast_square(EITS_FAST_APART_MM);
}

/* From one instant to another, s; the clock may wrap. */
static inline eits_real fast_between_s(uint32_t from_us, uint32_t to_us)
{
    return (eits_real)(int32_t)(to_us - from_us) * R(1e-6);
}

/* Return the least distance from a touch at which another may be born. It grows with its width. */
static inline eits_real fast_room_of_mm(const eits_fast *fast, eits_real rho2)
{
    return EITS_FAST_APART_MM + EITS_FAST_APART_WIDE * (eits_sqrt(rho2) - eits_sqrt(fast->rho2));
}

static inline eits_real fast_room_mm(const eits_fast *fast, uint32_t k)
{
    return fast_room_of_mm(fast, fast->known[k].rho2);
}

/* Whether a touch is as wide as a palm. The solver takes it for several discs, so that frames tell
 * neither where it is nor how strong. */
static inline int fast_is_palm(eits_real rho2)
{
    return rho2 > fast_square(EITS_FAST_PALM_MM);
}

/* Whether a frame's touch, at `place` and with this strength, is what the solver makes of a palm at
 * `palm` (x, y, strength): it lies on it, or is much fainter. */
static inline int fast_is_rest_of(const eits_fast *fast, eits_real rho2, const eits_real *palm,
                                  const eits_real *place, eits_real strength)
{
    return fast_is_palm(rho2) &&
           (eits_fabs(strength) < EITS_FAST_PALM_REST * eits_fabs(palm[FAST_C]) ||
            fast_distance2(place, palm) < fast_square(fast_room_of_mm(fast, rho2)));
}

/* Whether it is, with a palm that drives follow now and a place of the model. */
static inline int fast_is_rest(const eits_fast *fast, const eits_real *place, eits_real strength)
{
    for (uint32_t k = 0; k < fast->count; ++k) {
        if (fast_is_rest_of(fast, fast->known[k].rho2, fast->state + FAST_SIZE * k, place,
                            strength))
            return 1;
    }
    return 0;
}

/* ---- rows.c ---- */

/* The pixels of a touch's soft disc, which ends at the root of `rho2`; 0 where none is kept. */
int eits_fast_gather(const eits_fast *fast, const eits_real *place, eits_real rho2,
                     fast_disc *disc);
/* The answer of a drive's rows to a touch of strength 1 there, and its derivatives by x and y:
 * `out` has FAST_WAYS rows of most_rows numbers. */
void eits_fast_answer(const eits_fast *fast, uint32_t drive, const fast_disc *disc, eits_real *out);
/* Whether a pixel is near enough to answer. */
int eits_fast_on_skin(const eits_fast *fast, const eits_real *place, eits_real rho2);

/* Fields at a touch. */
void eits_fast_look(const eits_fast *fast, const eits_real *place, eits_real rho2,
                    const fast_disc *disc, fast_sight *sight);
/* What two touches of strength 1 add to a drive's rows beside their own answers, each by bending
 * the field at the other; times `factor` onto `out`. */
void eits_fast_add_interplay(const eits_fast *fast, uint32_t drive, const fast_sight *a,
                             const fast_sight *b, eits_real factor, eits_real *out);

/* ---- report.c ---- */

/* A frame was aligned: ids are kept for touches that its report may name, and drives may find the
 * touches that frames alone have shown. */
void eits_fast_expect_touches(eits_fast *fast);
/* Drives begin again: they may find the touches that they followed. */
void eits_fast_expect_again(eits_fast *fast);
/* The id of a touch that is born at `place`. */
uint32_t eits_fast_id_at(eits_fast *fast, const eits_real *place);

/* ---- bias.c ---- */

/* Answers of the known touches in a drive, what is expected of its rows, and the model's error in
 * them as far as it is learned. */
void eits_fast_expect(eits_fast *fast, uint32_t drive);
/* News that was left of the same rows one scan before is the model's error, not a touch's: it is
 * learned. 1 where it is. */
int eits_fast_is_known_error(eits_fast *fast, uint32_t drive, eits_real chi2);
/* Learn the model's error from what the update has left of the rows; `strength` are the strengths
 * before the update. */
void eits_fast_learn(eits_fast *fast, uint32_t drive, const eits_real *strength);
void eits_fast_forget_errors(eits_fast *fast, uint32_t drive);

/* ---- tracks.c ---- */

/* dt on: places follow speeds, and all grows less sure. */
void eits_fast_predict(eits_fast *fast, eits_real dt_s);
/* white, e, factor and moved of z where it is used; chi^2. eits_fast_expect must be the drive's. */
eits_real eits_fast_innovate(eits_fast *fast, uint32_t rows);
/* The same where each strength may have changed at once, by a deviation of which `share2` is the
 * square, as a fraction of its greatest. */
eits_real eits_fast_loosen(eits_fast *fast, uint32_t rows, eits_real share2);
/* L of L L' + x x' in place of L; x is spent. */
void eits_fast_grow(eits_real *factor, eits_real *x, uint32_t rows);
/* Believe the rows: `white` as it is now; `moved` is spent. */
void eits_fast_update(eits_fast *fast, uint32_t rows);
/* A touch, of which nothing is known that others share; `covariance` of x, y, strength, speeds. */
void eits_fast_add(eits_fast *fast, const eits_real *state, eits_real (*covariance)[FAST_SIZE],
                   eits_real energy, eits_real rho2);
/* Touch k's covariance, apart from the others'. */
void eits_fast_set_covariance(eits_fast *fast, uint32_t k, eits_real (*covariance)[FAST_SIZE]);
/* Touch k does not move. */
void eits_fast_still(eits_fast *fast, uint32_t k);
void eits_fast_forget(eits_fast *fast, uint32_t k);

/* ---- map.c ---- */

/* A drive enters the map of what a touch at each cell would explain; `beside`: another touch's
 * whitened answer, which is taken out, NULL for none. */
void eits_fast_map(eits_fast *fast, const fast_held *held, const eits_real *beside,
                   eits_real *score);
/* The greatest cell of `score` apart from the `count` places; 0 where nothing is above zero. */
int eits_fast_peak(const eits_fast *fast, const eits_real *score, const eits_real (*places)[2],
                   uint32_t count, eits_real *place);

/* ---- ring.c ---- */

/* Put the present drive into the ring. It waits for an explanation if it is news or if others wait.
 */
void eits_fast_keep(eits_fast *fast, uint32_t drive, uint32_t rows, int news);
/* A new touch's answer and its slopes, whitened as the drive is. */
void eits_fast_whiten_ways(const fast_held *held, uint32_t stride, uint32_t rows,
                           eits_real *answer);
/* Rows and answers of a drive that waits, whitened. */
void eits_fast_whiten_held(eits_fast *fast, fast_held *held);
/* The drives before wait too: together they say what none of them said. A search whitens them. */
void eits_fast_hold_all(eits_fast *fast);
/* Nothing waits, and the drives before are no more: touches have changed. */
void eits_fast_empty_ring(eits_fast *fast);
/* Touch k goes, and with it what waits: drives remember touches by their number. */
void eits_fast_drop(eits_fast *fast, uint32_t k);

#endif
