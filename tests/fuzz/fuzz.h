/* Functions that the fuzz targets share. A target is LLVMFuzzerTestOneInput of its file; clang's
 * libFuzzer calls it with bytes of its own making, replay.c with files, under any compiler. */
#ifndef EITSKIN_FUZZ_H
#define EITSKIN_FUZZ_H

#include "eitskin/eitskin.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Ends the run; libFuzzer then keeps the input. */
#define MUST(holds)                                                           \
    do {                                                                      \
        if (!(holds)) {                                                       \
            fprintf(stderr, "%s:%d: must: %s\n", __FILE__, __LINE__, #holds); \
            abort();                                                          \
        }                                                                     \
    } while (0)

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

/* libFuzzer's own mutation; nothing in a replay. */
size_t LLVMFuzzerMutate(uint8_t *data, size_t size, size_t room);

/* Read the input from its front; past its end there are zeros. */
typedef struct fuzz_bytes {
    const uint8_t *at, *end;
} fuzz_bytes;
uint8_t fuzz_u8(fuzz_bytes *b);
uint32_t fuzz_u32(fuzz_bytes *b);
float fuzz_f32(fuzz_bytes *b);

/* Notes a result. replay.c adds results up by name and compares the sums with sums.txt, because a
 * wrong number may violate none of the checks. A fuzzer does nothing here. All NaN count as one. */
void fuzz_note(const char *name, const void *bytes, size_t size);
void fuzz_note_reals(const char *name, const eits_real *numbers, size_t count);
void fuzz_note_floats(const char *name, const uint8_t *bytes, size_t count);

/* The sums, if they are wanted: of each name one over what the inputs gave, in any order. What is
 * made before the first input counts as one. */
enum { FUZZ_SUMS = 16 };
typedef struct fuzz_sum {
    const char *name;
    uint32_t input, all;
} fuzz_sum;
extern fuzz_sum fuzz_sums[FUZZ_SUMS + 1]; /* the last without a name */
extern int fuzz_sums_wanted;
void fuzz_end_input(void);

/* Checks the results after eits_reconstruct on `ctx` returned `status`: all numbers finite, the
 * image zero on an error, certificates not negative, the residual no worse than that of zero,
 * limits kept. `frame_macs`: what the frame stage alone may have cost. */
void fuzz_check_result(const eits_context *ctx, eits_status status, uint64_t frame_macs);

/* Checks the touches that eits_find_touches gave. */
void fuzz_check_touches(const eits_context *ctx, const eits_touch *touches, uint32_t count);

/* Room for a workspace, from a 64-byte boundary. */
enum { FUZZ_WORKSPACE = 1 << 20 };
void *fuzz_workspace(int which); /* 0 or 1 */

#endif
