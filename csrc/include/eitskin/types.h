/* eitskin: scalar width, status codes, version.
 *
 * eits_real is the scalar of every frame, image and touch. A program is built for one width: link
 * the library of that width, and define EITS_DOUBLE for the wide one (CMake and pkg-config do).
 * eits_real_size tells a binding which one it got.
 *
 * The same sources build twice on a host: with `float` (what a microcontroller runs) and, with
 * EITS_DOUBLE defined, with `double`, so that the narrow width is always judged against the wide
 * one of the same code.
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

/* Of the library that is linked; a mismatch shows in eits_real_size alone, so compare at start. */
#ifdef EITS_DOUBLE
typedef double eits_real;
#else
typedef float eits_real;
#endif

/* Library version, apart from the version of the .eitm format (model.h). */
#define EITS_VERSION_MAJOR 0
#define EITS_VERSION_MINOR 1
#define EITS_VERSION_PATCH 0

/* Every function that can fail returns one of these. How a solve ended is not an error: see
 * eits_info.stop. */
typedef enum eits_status {
    EITS_OK = 0,
    EITS_E_ARGUMENT = -1,        /* a null pointer, or an option out of its documented range */
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
    EITS_E_FRAME_CHANNELS = -11, /* more channels are unusable than the options allow */
    /* the reference or another frame is all zero, or a frame nothing but noise: the front end is
     * dead */
    EITS_E_FRAME_ZERO = -12,
    EITS_E_NO_REFERENCE = -13, /* a frame came before the reference frame was set */
    /* a reference was finished with fewer frames than it needs */
    EITS_E_REFERENCE_SHORT = -14,
    /* a result would not be finite; the outputs were cleared instead */
    EITS_E_NOT_FINITE = -15,
    /* the core was compiled so that its results would have other bits than a model's golden frame:
     * with contraction (compile with -ffp-contract=off), with sums in another order, or where the
     * processor does not round to nearest */
    EITS_E_ARITHMETIC = -16
} eits_status;

/* One line of English for a status; never NULL. For people: programs compare the number, which no
 * later version changes. */
const char *eits_status_text(eits_status status);

/* "MAJOR.MINOR.PATCH" of the library that is linked. */
const char *eits_version_text(void);

/* sizeof(eits_real) of the library that is linked, for bindings: 4 or 8. */
size_t eits_real_size(void);

#ifdef __cplusplus
}
#endif
#endif
