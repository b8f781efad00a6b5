/* Columns of S that are in use, unpacked to floats and kept together: repeated products over few
 * columns then neither convert nor read flash. If there is enough memory, all of S is also kept in
 * panels. */
#ifndef EITSKIN_COLUMN_CACHE_H
#define EITSKIN_COLUMN_CACHE_H

#include "kernels/kernels.h"

#define EITS_NO_PIXEL 0xFFFFu

typedef struct eits_columns {
    const eits_matrix *s;
    eits_real *panels; /* S again, in panels of EITS_PANEL columns; NULL: not prepared */
    uint32_t room;     /* EITS_CACHED(n_pixels): the most columns in the cache */
    uint32_t next;     /* the slot that is reused next */
    float *data;       /* room x stride */
    uint16_t *slot;    /* n_pixels: the slot of a column; EITS_NO_PIXEL: not cached */
    uint16_t *column;  /* room: the column in each slot */
    /* room: marks the requested columns during a request, so that none replaces another */
    uint8_t *wanted;
} eits_columns;

/* Empty the cache; for a fresh workspace. */
void eits_clear_column_cache(eits_columns *columns);

/* Cache all listed columns; each must be listed once. Columns of earlier calls are replaced if
 * there is no room. Returns 0, and changes nothing, if the list is longer than the cache. */
uint32_t eits_cache_columns(eits_columns *columns, const eits_kernels *kernels,
                            const uint32_t *index, uint32_t count);

/* Write into `slot` the positions of the listed columns, which must be cached, in the matrix of
 * eits_cached_columns. `slot` may be `index`. */
void eits_cache_slots(const eits_columns *columns, const uint32_t *index, uint32_t count,
                      uint32_t *slot);

/* Return the cached columns as a matrix of floats without scales. */
eits_matrix eits_cached_columns(const eits_columns *columns);

#endif
