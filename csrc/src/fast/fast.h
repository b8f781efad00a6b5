/* What the parts of this module share. */
#ifndef EITSKIN_FAST_ROOM_H
#define EITSKIN_FAST_ROOM_H

#include "base/vec.h"
#include "context/context.h"
#include "eitskin/fast.h"
#include "fast/constants.h"

_Static_assert(EITS_FAST_MAX_TOUCHES == EITS_FAST_TOUCHES, "the header's");
_Static_assert(EITS_FAST_MAX_ROWS == EITS_FAST_ROWS, "the header's");
_Static_assert(EITS_FAST_HELD == EITS_FAST_WAITING, "the header's");

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
    uint8_t reserved;
    /* by touch: 1 where it was there then, and x, y, strength */
    uint8_t there[EITS_FAST_MAX_TOUCHES];
    eits_real then[EITS_FAST_MAX_TOUCHES][FAST_WAYS];
} fast_drive;

/* A touch beside its state. */
typedef struct fast_known {
    uint32_t id;
    uint32_t on, off_drives, frames_missed, confirmed;
    uint32_t aligned; /* it was there when a frame was last aligned, and where */
    eits_real at[2];
    eits_real energy; /* mean of what it explains of a drive's chi^2 */
    eits_real peak;   /* its greatest strength */
} fast_known;

/* A touch that frames show and no drive follows (report.c). */
typedef struct fast_seen {
    eits_touch touch;          /* as it was last found */
    eits_real at[2], speed[2]; /* mm; mm in a frame */
    /* covariance of place and velocity, along either axis */
    eits_real place_mm2, both_mm2, speed_mm2;
    uint32_t id;     /* 0: not reported yet */
    uint32_t seen;   /* frames that showed it, counted up to EITS_FAST_SEEN_KNOWN */
    uint32_t missed; /* consecutive frames that did not */
    uint32_t faint;  /* 1: it was fainter than noise when it was last found */
} fast_seen;

/* What one drive says of touches at places: how it is explained, and how to move them. */
typedef struct fast_share {
    eits_real strength[2], variance[2];
    eits_real left, score; /* of its chi^2, and explained of it */
    eits_real own[2];      /* what each explains beside the other */
    eits_real b[4], h[10]; /* normal equations, h by rows up to the diagonal */
} fast_share;

/* A drive that waits: rows and the triangle that whitened them, in memory of its own; and what it
 * said of the places that the last search came to, bits in `said`. */
typedef struct fast_held {
    eits_real *white, *factor;
    uint16_t drive, rows;
    uint32_t used;  /* a bit for each row in use */
    uint8_t alone;  /* no touch was known */
    uint8_t sudden; /* much is unexplained: if it waits first, a touch may have landed within it */
    uint8_t said;
    fast_share share[EITS_FAST_STARTS];
} fast_held;

/* Touches as they explain drives that wait. */
typedef struct fast_fit {
    uint32_t count; /* of touches: 1 or 2 */
    eits_real place[2][2];
    fast_share share[EITS_FAST_HELD]; /* by drives that wait; and their sums: */
    eits_real left_all, score, own[2];
    eits_real h[4][4], b[4];
    eits_real variance[2]; /* of the strengths in the last drive */
} fast_fit;

/* What the next search is for: a drive's work is bounded, so that two touches at once take three.
 */
typedef enum fast_stage { FAST_ONE, FAST_BESIDE, FAST_TWO } fast_stage;

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
    eits_real drift;  /* of the gain */
    uint32_t drifted; /* frames on end that it was far */
    uint32_t time_us, timed, begun, next_id;
    uint32_t unexplained; /* a bit for each of the last 32 drives */
    uint32_t unexplained_frames;
    uint32_t glitched, changed;           /* in the last drive; within this one */
    uint32_t fresh;                       /* begun since a frame was last aligned */
    uint32_t stirred, next_aligned;       /* touches changed in that frame; next_id as it was */
    uint32_t named, named_before;         /* diagnostics of the last two solved frames */
    uint32_t wild;                        /* rows since the last frame */
    uint8_t suspect[EITS_MAX_ELECTRODES]; /* wild rows of each electrode, less those that are not */
    /* touches of frames; and those that drives followed when one was last aligned */
    uint32_t n_seen, seen_ids;
    uint32_t driven;  /* drives have come: ids of `seen` are then above EITS_FAST_FRAME_IDS */
    uint32_t aligned; /* a frame that is not reported yet */
    uint32_t n_followed;
    fast_seen seen[EITS_MAX_TOUCHES];
    eits_fast_touch followed[EITS_FAST_MAX_TOUCHES];
    /* tracks */
    uint32_t count;
    fast_known known[EITS_FAST_MAX_TOUCHES];
    eits_real state[FAST_NUMBERS];
    eits_real p[FAST_NUMBERS][FAST_NUMBERS];
    /* a drive's rows at hand, most_rows numbers each */
    eits_real *z, *along, *e, *white, *spare;
    uint8_t *used;
    eits_real *answer; /* by touch and way */
    eits_real *moved;  /* P H', FAST_NUMBERS a row */
    eits_real *factor; /* a triangle: S = L L' */
    /* births */
    uint32_t held_count, quiet, waited, last_count;
    fast_stage stage;
    uint32_t turn; /* of which start has the step that is left over */
    fast_held held[EITS_FAST_HELD];
    fast_fit fit[EITS_FAST_STARTS], trial;
    eits_real *score, *pair_score; /* by cell */
    eits_real first[2], last[EITS_FAST_STARTS][2];
    uint32_t seeds;
    eits_real seed[EITS_FAST_MAX_TOUCHES][2];
};

_Static_assert(sizeof(fast_drive) <= EITS_FAST_DRIVE, "the header counts it");
_Static_assert(sizeof(struct eits_fast) <= EITS_FAST_STATE, "the header counts it");
_Static_assert(sizeof(struct eits_fast) + 256 > EITS_FAST_STATE, "the header counts too much");

static inline eits_real fast_square(eits_real value)
{
    return value * value;
}

static inline eits_real fast_dot(const eits_real *a, const eits_real *b, uint32_t count)
{
    eits_real sum = 0;
    for (uint32_t i = 0; i < count; ++i)
        sum += a[i] * b[i];
    return sum;
}

static inline void fast_axpy(eits_real *out, eits_real factor, const eits_real *a, uint32_t count)
{
    for (uint32_t i = 0; i < count; ++i)
        out[i] += factor * a[i];
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

/* Whether two places are further from each other than EITS_FAST_APART_MM. */
static inline int fast_apart(const eits_real *a, const eits_real *b)
{
    const eits_real dx = a[0] - b[0], dy = a[1] - b[1];
    return dx * dx + dy * dy > fast_square(EITS_FAST_APART_MM);
}

/* ---- rows.c ---- */

/* The answer of a drive's rows to a touch of strength 1 at a place, and its derivatives by x and y:
 * `out` has FAST_WAYS rows of most_rows numbers. 0 where no pixel is near enough; `out` is then
 * zero. */
int eits_fast_answer(const eits_fast *fast, uint32_t drive, const eits_real *place, eits_real *out);
/* Whether a pixel is near enough to answer. */
int eits_fast_on_skin(const eits_fast *fast, const eits_real *place);

/* ---- tracks.c ---- */

/* dt on: places follow speeds, and all grows less sure. */
void eits_fast_predict(eits_fast *fast, eits_real dt_s);
/* Each touch may have changed by these at once, the strength as a fraction of its greatest. */
void eits_fast_loosen(eits_fast *fast, eits_real strength, eits_real place_mm);
/* white, e, factor and moved of z where it is used; chi^2. `answer` must be the drive's. */
eits_real eits_fast_innovate(eits_fast *fast, uint32_t rows);
/* Believe the rows: `white` as it is now; `moved` is spent. */
void eits_fast_update(eits_fast *fast, uint32_t rows);
/* A touch with its variances, and those of its place and strength among each other. */
void eits_fast_add(eits_fast *fast, const eits_real *state, const eits_real *variance,
                   eits_real xy);
void eits_fast_forget(eits_fast *fast, uint32_t k);

/* ---- frames.c ---- */

/* The nearest to `place`, mm, of those found that no touch has taken, within EITS_FAST_CONFIRM_MM;
 * `count` where there is none. */
uint32_t eits_fast_nearest(const eits_real *place, const eits_real (*found)[2],
                           const uint8_t *taken, uint32_t count);

/* ---- map.c ---- */

/* A drive enters the map of what a touch at each cell would explain. */
void eits_fast_map(eits_fast *fast, const fast_held *held);
/* The map beside a first touch, of the newest drives that wait. */
void eits_fast_map_beside(eits_fast *fast, const eits_real *first);
/* The greatest cell of `score` apart from the `count` places; 0 where nothing is above zero. */
int eits_fast_peak(const eits_fast *fast, const eits_real *score, const eits_real (*places)[2],
                   uint32_t count, eits_real *place);

/* ---- births.c ---- */

/* The inverse of a symmetric matrix (n x n, n at most 4); 0 where it is not well above zero. */
int eits_fast_invert(const eits_real h[4][4], uint32_t n, eits_real inverse[4][4]);
/* How `fit->place` explains the drives held from `from` on; its shares of those in the bits of
 * `known` are there. 0 where a place is off the skin. */
int eits_fast_fit_at(eits_fast *fast, uint32_t from, uint32_t known, fast_fit *fit);
/* The newest drive says what it does at the places that the last search came to. */
void eits_fast_keep_up(eits_fast *fast);
/* Looks for one touch in them, or by the map beside it for a second at `first`; the best, with its
 * lead over the next best elsewhere; NULL where there is none. Owned by this module until the next
 * search. */
const fast_fit *eits_fast_find(eits_fast *fast, uint32_t from, const eits_real *first,
                               eits_real *lead);

/* ---- wait.c ---- */

/* A drive is held until it is accounted for, as long as there is room. */
void eits_fast_wait(eits_fast *fast, uint32_t drive, uint32_t rows, int news);
/* Touches that explain what waits, by one search; 1 where there are. */
int eits_fast_find_births(eits_fast *fast);

#endif
