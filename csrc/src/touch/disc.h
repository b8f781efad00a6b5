/* Discs of changed conductivity, placed off the grid, and what the skin answers to them in reduced
 * space. */
#ifndef EITSKIN_DISC_H
#define EITSKIN_DISC_H

#include "context/context.h"

typedef struct eits_disc {
    eits_real x_mm, y_mm, radius_mm;
    eits_real change;   /* S/m, uniform within the disc */
    eits_real polarity; /* +1 or -1: the sign that `change` must keep */
} eits_disc;

/* A pixel is covered by clamp(1/2 + (radius - distance) / pixel): exact for a straight edge that
 * crosses it squarely. `atom` (stride numbers) gets Q F S w (whitening.h), w the covers over the
 * column weights, that is the answer to a change of 1 S/m; with `slope` not NULL, its three arrays
 * get the derivatives by x, y and radius. Returns the
 * multiply-accumulates. */
uint64_t eits_disc_atom(eits_context *ctx, const eits_scratch *scratch, const eits_disc *disc,
                        eits_real *atom, eits_real *const *slope);

/* The same, and with `edge` not NULL in its two arrays the derivatives by how much further out the
 * rim lies, in mm, times cos and sin of twice the angle: an ellipse of the same area, to first
 * order. */
uint64_t eits_disc_shape(eits_context *ctx, const eits_scratch *scratch, const eits_disc *disc,
                         eits_real *atom, eits_real *const *slope, eits_real *const *edge);

/* Q F S w of the disc with its rim so much further out (mm): an ellipse's answer to a change of
 * 1 S/m, in one product. */
uint64_t eits_disc_ellipse(eits_context *ctx, const eits_scratch *scratch, const eits_disc *disc,
                           const eits_real edge_mm[2], eits_real *atom);

/* The model's fields (eits_fields), averaged over the disc's covers: `field` has fields.at.stride
 * numbers, zeros where no pixel is covered.
 * Returns the multiply-accumulates. */
uint64_t eits_disc_field(eits_context *ctx, const eits_scratch *scratch, const eits_disc *disc,
                         eits_real *field);

/* mm^2 that the disc's covers add up to on the pixels that count: what its change was fitted with.
 * On a coarse grid that differs by per cents from place to place, and near the rim it is only the
 * part on the skin. */
eits_real eits_disc_area(const eits_context *ctx, const eits_disc *disc);

/* Whether a kept pixel is at the disc's centre or next to it: data that fit no disc would draw it
 * far beyond the rim. */
int eits_disc_on_skin(const eits_context *ctx, const eits_disc *disc);

/* The nearest place on a kept pixel to one that is next to it. */
void eits_bring_onto_skin(const eits_context *ctx, eits_real *x_mm, eits_real *y_mm);

#endif
