/* Discs of changed conductivity, placed off the grid, and their answers in reduced space. */
#ifndef EITSKIN_DISC_H
#define EITSKIN_DISC_H

#include "context/context.h"

typedef struct eits_disc {
    eits_real x_mm, y_mm, radius_mm;
    eits_real change;   /* S/m, uniform within the disc */
    eits_real polarity; /* +1 or -1: the sign that `change` must keep */
} eits_disc;

/* The cover of a pixel is clamp(1/2 + (radius - distance) / pixel, 0, 1), which is exact for a
 * straight edge that crosses the pixel squarely. `atom` (stride numbers) gets the answer to a
 * change of 1 S/m: Q F S w (whitening.h), where w is the covers over the column weights. If `slope`
 * is not NULL, its three arrays get the derivatives by x, y and radius. Returns the
 * multiply-accumulates. */
uint64_t eits_disc_atom(eits_context *ctx, const eits_scratch *scratch, const eits_disc *disc,
                        eits_real *atom, eits_real *const *slope);

/* The same. If `edge` is not NULL, its two arrays get the derivatives by two displacements of the
 * disc's edge, in mm: outwards by cos and by sin of twice the angle. To first order these make an
 * ellipse of the same area. */
uint64_t eits_disc_shape(eits_context *ctx, const eits_scratch *scratch, const eits_disc *disc,
                         eits_real *atom, eits_real *const *slope, eits_real *const *edge);

/* Compute the answer of an ellipse to a change of 1 S/m, in one product: Q F S w of the disc with
 * its edge displaced by `edge_mm`. */
uint64_t eits_disc_ellipse(eits_context *ctx, const eits_scratch *scratch, const eits_disc *disc,
                           const eits_real edge_mm[2], eits_real *atom);

/* Return the sum of the disc's covers on the kept pixels, in mm^2: the area with which its change
 * was fitted. On a coarse grid it differs from pi radius^2 by a few per cent from place to place,
 * and near the rim it is only the part on the skin. */
eits_real eits_disc_area(const eits_context *ctx, const eits_disc *disc);

/* Return 1 if a kept pixel is at the disc's centre or next to it. Without this check, data that fit
 * no disc would draw it far beyond the rim. */
int eits_disc_on_skin(const eits_context *ctx, const eits_disc *disc);

/* Move a place that is next to a kept pixel to the nearest place on it. */
void eits_bring_onto_skin(const eits_context *ctx, eits_real *x_mm, eits_real *y_mm);

#endif
