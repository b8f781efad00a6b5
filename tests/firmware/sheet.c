#include "sheet.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { CELLS = SHEET_SIDE * SHEET_SIDE, NODES = CELLS + SHEET_ELECTRODES };

static bool inside(int x, int y)
{
    const double cx = x - (SHEET_SIDE - 1) / 2.0, cy = y - (SHEET_SIDE - 1) / 2.0;
    return x >= 0 && y >= 0 && x < SHEET_SIDE && y < SHEET_SIDE &&
           cx * cx + cy * cy <= (SHEET_SIDE / 2.0) * (SHEET_SIDE / 2.0);
}

static void join(double *matrix, int a, int b, double conductance)
{
    matrix[a * NODES + a] += conductance;
    matrix[b * NODES + b] += conductance;
    matrix[a * NODES + b] -= conductance;
    matrix[b * NODES + a] -= conductance;
}

/* The cell inside the rim nearest to an electrode. */
static int rim_cell(int electrode)
{
    const double angle = 2 * acos(-1.0) * electrode / SHEET_ELECTRODES,
                 middle = (SHEET_SIDE - 1) / 2.0;
    int best = -1;
    double nearest = 1e9;
    for (int y = 0; y < SHEET_SIDE; ++y) {
        for (int x = 0; x < SHEET_SIDE; ++x) {
            const double off = hypot(x - middle - SHEET_SIDE / 2.0 * cos(angle),
                                     y - middle - SHEET_SIDE / 2.0 * sin(angle));
            if (inside(x, y) && off < nearest) {
                nearest = off;
                best = y * SHEET_SIDE + x;
            }
        }
    }
    return best;
}

static double *assemble(const sheet *s)
{
    double *matrix = calloc((size_t)NODES * NODES, sizeof *matrix);
    if (matrix == NULL)
        abort();
    for (int y = 0; y < SHEET_SIDE; ++y) {
        for (int x = 0; x < SHEET_SIDE; ++x) {
            const int at = y * SHEET_SIDE + x;
            if (inside(x, y) && inside(x + 1, y))
                join(matrix, at, at + 1, 0.5 * (s->conductance[y][x] + s->conductance[y][x + 1]));
            if (inside(x, y) && inside(x, y + 1))
                join(matrix, at, at + SHEET_SIDE,
                     0.5 * (s->conductance[y][x] + s->conductance[y + 1][x]));
        }
    }
    for (int e = 0; e < SHEET_ELECTRODES; ++e)
        join(matrix, CELLS + e, rim_cell(e), s->detached[e] ? 0 : s->contact[e]);
    for (int k = 0; k < NODES; ++k)
        matrix[k * NODES + k] +=
            1e-6; /* a weak connection to ground; nodes outside do not make the matrix singular */
    return matrix;
}

/* Solve by Cholesky; columns of the right side are the electrodes. */
static void solve_columns(double *a, double *b)
{
    for (int j = 0; j < NODES; ++j) {
        for (int i = j; i < NODES; ++i) {
            double sum = a[i * NODES + j];
            for (int k = 0; k < j; ++k)
                sum -= a[i * NODES + k] * a[j * NODES + k];
            a[i * NODES + j] = i == j ? sqrt(sum) : sum / a[j * NODES + j];
        }
    }
    for (int e = 0; e < SHEET_ELECTRODES; ++e) {
        double *x = b + (size_t)e * NODES;
        for (int i = 0; i < NODES; ++i) {
            for (int k = 0; k < i; ++k)
                x[i] -= a[i * NODES + k] * x[k];
            x[i] /= a[i * NODES + i];
        }
        for (int i = NODES - 1; i >= 0; --i) {
            for (int k = i + 1; k < NODES; ++k)
                x[i] -= a[k * NODES + i] * x[k];
            x[i] /= a[i * NODES + i];
        }
    }
}

void sheet_solve(sheet *s)
{
    double *matrix = assemble(s),
           *columns = calloc((size_t)SHEET_ELECTRODES * NODES, sizeof *columns);
    if (columns == NULL)
        abort();
    for (size_t e = 0; e < SHEET_ELECTRODES; ++e)
        columns[e * NODES + CELLS + e] = 1;
    solve_columns(matrix, columns);
    for (size_t e = 0; e < SHEET_ELECTRODES; ++e) {
        for (size_t f = 0; f < SHEET_ELECTRODES; ++f)
            /* voltages like the skin's: 0.01 to 0.5 V adjacent, to 1.5 V opposite */
            s->transfer[e][f] = 3.5 * columns[f * NODES + CELLS + e];
    }
    free(matrix);
    free(columns);
}

void sheet_init(sheet *s)
{
    memset(s, 0, sizeof *s);
    for (int y = 0; y < SHEET_SIDE; ++y) {
        for (int x = 0; x < SHEET_SIDE; ++x)
            s->conductance[y][x] = 1;
    }
    for (int e = 0; e < SHEET_ELECTRODES; ++e)
        s->contact[e] = 3;
    sheet_solve(s);
}

void sheet_touch(sheet *s, double x, double y, double radius, double factor)
{
    const double middle = (SHEET_SIDE - 1) / 2.0;
    for (int row = 0; row < SHEET_SIDE; ++row) {
        for (int column = 0; column < SHEET_SIDE; ++column) {
            if (hypot(column - middle - x, row - middle - y) <= radius)
                s->conductance[row][column] *= factor;
        }
    }
}

double sheet_volts(const sheet *s, const uint8_t e[4])
{
    for (int k = 0; k < 4; ++k) {
        if (s->detached[e[k]])
            return 0;
    }
    return s->transfer[e[2]][e[0]] - s->transfer[e[2]][e[1]] - s->transfer[e[3]][e[0]] +
           s->transfer[e[3]][e[1]];
}
