/* eitskin: scalar width, status codes, version.
 *
 * eits_real is the scalar of every frame, image and touch: `float`, which microcontrollers use, or
 * `double` with EITS_DOUBLE defined. The same sources build in both widths, so that tests can
 * compare the narrow one with the wide one. A program is built for one width: link the library of
 * that width, and define EITS_DOUBLE for the wide one, as CMake and pkg-config do. A mismatch of
 * program and library shows only in eits_real_size, so bindings compare it when they start.
 */
#ifndef EITSKIN_TYPES_H
#define EITSKIN_TYPES_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#if defined(__BYTE_ORDER__) && __BYTE_ORDER__ != __ORDER_LITTLE_ENDIAN__
#error "eitskin reads little-endian models in place; this target is big-endian"
#endif

#ifdef EITS_DOUBLE
typedef double eits_real;
#else
typedef float eits_real;
#endif

/* Version of the library; the .eitm format has its own (model.h). */
#define EITS_VERSION_MAJOR 0
#define EITS_VERSION_MINOR 1
#define EITS_VERSION_PATCH 0

/* Every function that can fail returns one of these. A solve that ends early is not an error:
 * eits_info.stop states how it ended. */
typedef enum eits_status {
    EITS_OK = 0,
    /* a null pointer, an option out of its documented range, or a call that came too early */
    EITS_E_ARGUMENT = -1,
    EITS_E_WORKSPACE = -2,       /* the workspace is too small or not 16-byte aligned */
    EITS_E_MODEL_TRUNCATED = -3, /* the blob ends before the size that its header states */
    EITS_E_MODEL_MAGIC = -4,     /* not an .eitm model */
    EITS_E_MODEL_VERSION = -5,   /* a newer major version than this library reads */
    EITS_E_MODEL_CRC = -6,       /* the checksum does not fit the content */
    /* a required section is missing, misplaced, misaligned or of the wrong size */
    EITS_E_MODEL_SECTION = -7,
    /* a dimension, index or number inside a section is out of range or not finite */
    EITS_E_MODEL_VALUE = -8,
    EITS_E_MODEL_ALIGNMENT = -9, /* the blob does not start at a 16-byte boundary */
    EITS_E_FRAME_LENGTH = -10,   /* a frame's length is not the number of protocol rows */
    EITS_E_FRAME_ROWS = -11,     /* more rows cannot be used than options.max_masked allows */
    /* the reference or another frame is all zero, or contains only noise: the front end is dead */
    EITS_E_FRAME_ZERO = -12,
    EITS_E_NO_REFERENCE = -13, /* a frame came before the reference frame was set */
    /* a reference was finished with fewer frames than it needs, or its noise is needed and it was
     * taken from one frame */
    EITS_E_REFERENCE_SHORT = -14,
    /* a result would not be finite; the outputs were cleared instead */
    EITS_E_NOT_FINITE = -15,
    /* the core was compiled so that its results differ in bits from a model's golden frame: with
     * contraction (compile with -ffp-contract=off), with sums in another order, or for a processor
     * that does not round to nearest */
    EITS_E_ARITHMETIC = -16,
    /* something touched the skin, or moved on it, while the reference was taken */
    EITS_E_REFERENCE_TOUCHED = -17
} eits_status;

/* One line of English for a status; never NULL. It is meant for people. Programs compare the
 * number, which no later version changes. */
const char *eits_status_text(eits_status status);

/* "MAJOR.MINOR.PATCH" of the library that is linked. */
const char *eits_version_text(void);

/* sizeof(eits_real) of the library that is linked, for bindings: 4 or 8. */
size_t eits_real_size(void);

#ifdef __cplusplus
}
#endif
#endif
