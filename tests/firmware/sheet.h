/* A conductive sheet as a network of resistors, with 16 electrodes at its rim: voltages that obey
 * reciprocity and touches. */
#ifndef FW_TEST_SHEET_H
#define FW_TEST_SHEET_H

#include <stdbool.h>
#include <stdint.h>

enum { SHEET_SIDE = 15, SHEET_ELECTRODES = 16 };

typedef struct sheet {
    double conductance[SHEET_SIDE][SHEET_SIDE]; /* of a cell; 1 untouched */
    double contact[SHEET_ELECTRODES];           /* of an electrode; 0: detached */
    /* V at one electrode for 1 mA into another; set by sheet_solve */
    double transfer[SHEET_ELECTRODES][SHEET_ELECTRODES];
    bool detached[SHEET_ELECTRODES];
} sheet;

/* An untouched sheet, solved. */
void sheet_init(sheet *s);

/* Multiply the conductance of the cells within `radius` of (x, y), in cells from the centre; then
 * sheet_solve. */
void sheet_touch(sheet *s, double x, double y, double radius, double factor);
void sheet_solve(sheet *s);

/* Voltage of [I+, I-, V+, V-] at 1 mA; 0 if one of them is detached. */
double sheet_volts(const sheet *s, const uint8_t electrodes[4]);

#endif
