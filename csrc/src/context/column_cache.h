/* Columns of S that are in use, unpacked to floats and kept together: products over few columns,
 * again and again, then neither convert nor read flash. And all of S in panels, where memory is
 * plentiful. */
#ifndef EITSKIN_COLUMN_CACHE_H
#define EITSKIN_COLUMN_CACHE_H

#include "kernels/kernels.h"

#define EITS_NO_PIXEL 0xFFFFu

typedef struct eits_columns {
    const eits_matrix *s;
    eits_real *panels; /* S again, in panels of EITS_PANEL columns; NULL: not prepared */
    uint32_t room;     /* EITS_CACHED(n_pixels): columns that the cache can hold */
    uint32_t next;     /* where to look for room */
    float *data;       /* room x stride */
    uint16_t *slot;    /* n_pixels: where a column is; EITS_NO_PIXEL: nowhere */
    uint16_t *column;  /* room: which column is there */
    /* room: marks while columns are asked for, so that none gives way to another of the list */
    uint8_t *wanted;
} eits_columns;

/* Nothing is cached: for a fresh workspace. */
void eits_clear_column_cache(eits_columns *columns);

/* Cache all columns listed, each once; those of earlier calls give way where there is no room.
 * Returns 0, nothing changed, if the list is longer than the room. */
uint32_t eits_cache_columns(eits_columns *columns, const eits_kernels *kernels,
                            const uint32_t *index, uint32_t count);

/* Where the listed columns, which are cached, stand in the matrix below. `slot` may be `index`. */
void eits_cache_slots(const eits_columns *columns, const uint32_t *index, uint32_t count,
                      uint32_t *slot);

/* The cached columns as a matrix without scales, of float storage. */
eits_matrix eits_cached_columns(const eits_columns *columns);

#endif
