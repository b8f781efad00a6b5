/* The core's model of a touch: a disc or an ellipse of changed conductivity, as multipoles in the
 * electrodes' fields, with the interaction of touches and their images in the rim.
 * docs/design/joint-fit.md has the sources of the formulas.
 *
 * In an even skin the potential of each electrode's current is harmonic: u = Re sum a_n (z - c)^n
 * about the touch's middle c, z = x + iy. A disc of radius r and contrast k answers order n with an
 * outgoing term of the same order, so the voltage between a measuring pair changes by
 *
 *     dV = - G q pi sum_n n r^(2n) Re(a_n,drive conj a_n,measure),    q = 2 (k - 1) / (k + 1)
 *
 * with G = C sigma (C is eits_fields.volts, sigma the skin's conductivity). An ellipse with half
 * axes a >= b couples orders, but its modes in elliptic coordinates do not couple. With eta = (a -
 * b) / (a + b), f^2 = a^2 - b^2 and the Taylor coefficients turned into the ellipse's frame,
 *
 *     beta_n = sum over k = n, n + 2, ... of a_k f^(k-n) 2^(1-k) binomial(k, (k-n)/2)
 *     dV = - G (k - 1) sum_n (n pi / 4) [(a+b)^(2n) - (a-b)^(2n)] (t_c Re Re + t_s Im Im)
 *     t_c, t_s = 2 / [(1 +- eta^n) + k (1 -+ eta^n)]
 *
 * where Re Re and Im Im are products of the drive's and the measuring pair's beta_n. The field in
 * which a touch lies is the electrodes' own field plus what the other touches and all images in the
 * rim send into it (induced.c). All lengths in this module are in pixels, from the grid's lower
 * left corner. tests/c/test_multipole.c
 * compares it with contour integrals, tests/python/acceptance/test_joint_fit.py with boundary
 * integrals.
 */
#ifndef EITSKIN_MULTIPOLE_H
#define EITSKIN_MULTIPOLE_H

#include "base/vec.h"
#include "context/context.h"

/* The numbers of orders in the answers of an ellipse and a disc. The Taylor series has
 * EITS_POLE_TERMS coefficients a_1, a_2 ... of each electrode's potential (eitskin/sizes.h), one
 * more than the orders of an ellipse; the last one is needed for slopes by place. At most
 * EITS_POLE_SENT outgoing orders reach other touches. */
enum { EITS_POLE_ORDERS = EITS_POLE_TERMS - 1, EITS_POLE_DISC_ORDERS = 3 };

/* A touch as the joint fit varies it. */
typedef struct eits_shape {
    eits_real x, y;      /* middle, pixels */
    eits_real radius;    /* of the disc of equal area, pixels */
    eits_real amplitude; /* q = 2 (contrast - 1) / (contrast + 1) of a disc */
    eits_real e1, e2;    /* eta times cos and sin of twice the long axis' angle */
} eits_shape;

/* The numbers of orders that are used. */
typedef struct eits_poles {
    uint32_t
        orders; /* orders in the answer: EITS_POLE_DISC_ORDERS for discs, else EITS_POLE_ORDERS */
    uint32_t sent;      /* outgoing orders that reach others: 1 to EITS_POLE_SENT */
    uint32_t of_others; /* 1: a shape gets nothing from its own image in the rim */
} eits_poles;

/* Return eta of a shape. */
static inline eits_real eits_pole_eta(const eits_shape *s)
{
    return eits_sqrt(eits_fma(s->e1, s->e1, s->e2 * s->e2));
}

/* Return the skin's conductivity, S/m. */
static inline eits_real eits_pole_sheet(const eits_model *model)
{
    return 1 / (R(6.28318530717958647693) * (eits_real)model->fields.per_sheet);
}

/* taylor.c: call this once for a context, before any other function. */
void eits_pole_init(eits_context *ctx);

/* taylor.c: return 1 if a place lies on a kept pixel. */
int eits_pole_on_skin(const eits_context *ctx, eits_real x, eits_real y);

/* taylor.c: compute the polynomial of each electrode's field about the pixel nearest to the shape's
 * middle, by least squares over the pixels around it. It is kept in slot k while the middle stays
 * near that pixel (EITS_POLE_STAYS). ctx->multipole.own gets the shape's own field
 * (eits_pole_field). Returns the multiply-accumulates of the polynomial, or 0 if the kept one is
 * used. */
uint64_t eits_pole_home(eits_context *ctx, uint32_t k, const eits_shape *shape);

/* Compute a_1 ... a_TERMS at the middle: TERMS x 2 L numbers, the real parts of a term before its
 * imaginary parts. eits_pole_home must have been called for slot k. */
void eits_pole_field(const eits_context *ctx, uint32_t k, const eits_shape *shape, eits_real *out);

/* induced.c: compute the field that each of `count` shapes gets from the others and from the rim,
 * in ctx->multipole.induced, by `rounds` more rounds. Returns the multiply-accumulates. */
uint64_t eits_pole_induced(eits_context *ctx, const eits_shape *shape, uint32_t count,
                           const eits_poles *poles, uint32_t rounds);

/* The same for only `into_count` of them, whose numbers `into` lists ascending. The other shapes
 * keep the fields that they get and send. */
uint64_t eits_pole_induced_in(eits_context *ctx, const eits_shape *shape, uint32_t count,
                              const uint32_t *into, uint32_t into_count, const eits_poles *poles,
                              uint32_t rounds);

/* Forget all polynomials. This is done at the start of a frame, so that neither its work nor its
 * results under a budget depend on the frames before. */
void eits_pole_forget(eits_context *ctx);

/* Set the induced fields to zero, before the first rounds of a frame. */
void eits_pole_clear(eits_context *ctx, uint32_t count);

/* induced.c: return the distance of a middle from the rim in pixels, which is half of the distance
 * to its image. eits_pole_home must have been called for slot k. */
eits_real eits_pole_room(const eits_context *ctx, uint32_t k, const eits_shape *shape);

/* Set the induced field of slot k alone to zero. */
void eits_pole_lift(eits_context *ctx, uint32_t k);

/* rows.c: the memory for a shape's answer on the folds first ... first + count - 1, and for its
 * slopes by x, y, log(radius), amplitude and, unless `poles` are those of discs, e1 and e2. The
 * slopes hold the induced field. They are computed if slope[0] is not NULL. */
typedef struct eits_pole_out {
    eits_real *value;
    eits_real *slope[6];
} eits_pole_out;

uint64_t eits_pole_rows(eits_context *ctx, uint32_t k, const eits_shape *shape,
                        const eits_poles *poles, uint32_t first, uint32_t count,
                        const eits_pole_out *out);

#endif
