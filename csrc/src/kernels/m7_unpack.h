/* Convert stored numbers to floats on a Cortex-M7, eight per turn; `turns` is at least 1. Only m7.c
 * includes this file. Every conversion is exact. */
#ifndef EITSKIN_M7_UNPACK_H
#define EITSKIN_M7_UNPACK_H

static void unpack_f32(const void *from, float *out, uint32_t turns)
{
    __asm__ volatile("1:\n\t"
                     "vldmia %[from]!, {s0-s7}\n\t"
                     "subs %[turns], #1\n\t"
                     "vstmia %[out]!, {s0-s7}\n\t"
                     "bne 1b\n\t"
                     : [from] "+r"(from), [out] "+r"(out), [turns] "+l"(turns)
                     :
                     : LOW_S, "cc", "memory");
}

#define HALVES(S, LOW, HIGH) \
    "vcvtb.f32.f16 s" #LOW ", s" #S "\n\tvcvtt.f32.f16 s" #HIGH ", s" #S "\n\t"

static void unpack_f16(const void *from, float *out, uint32_t turns)
{
    __asm__ volatile("1:\n\t"
                     "vldmia %[from]!, {s0-s3}\n\t" HALVES(0, 8, 9) HALVES(1, 10, 11)
                         HALVES(2, 12, 13) HALVES(3, 14, 15) "subs %[turns], #1\n\t"
                                                             "vstmia %[out]!, {s8-s15}\n\t"
                                                             "bne 1b\n\t"
                     : [from] "+r"(from), [out] "+r"(out), [turns] "+l"(turns)
                     :
                     : LOW_S, "cc", "memory");
}

#define TO_FLOAT(S) "vcvt.f32.s32 s" #S ", s" #S "\n\t"
#define EIGHT_TO_FLOAT \
    TO_FLOAT(0) TO_FLOAT(1) TO_FLOAT(2) TO_FLOAT(3) TO_FLOAT(4) TO_FLOAT(5) TO_FLOAT(6) TO_FLOAT(7)

#define SHORTS(W, S, T)                                                             \
    "sxth %[low], %[" #W "]\n\tasr %[" #W "], %[" #W "], #16\n\tvmov s" #S ", s" #T \
    ", %[low], %[" #W "]\n\t"

static void unpack_i16(const void *from, float *out, uint32_t turns)
{
    uint32_t a, b, low;
    __asm__ volatile("1:\n\t"
                     "ldrd %[a], %[b], [%[from]], #8\n\t" SHORTS(a, 0, 1)
                         SHORTS(b, 2, 3) "ldrd %[a], %[b], [%[from]], #8\n\t" SHORTS(a, 4, 5)
                             SHORTS(b, 6, 7) EIGHT_TO_FLOAT "subs %[turns], #1\n\t"
                                                            "vstmia %[out]!, {s0-s7}\n\t"
                                                            "bne 1b\n\t"
                     : [from] "+r"(from), [out] "+r"(out), [turns] "+l"(turns), [a] "=&r"(a),
                       [b] "=&r"(b), [low] "=&r"(low)
                     :
                     : LOW_S, "cc", "memory");
}

#define BYTES(W, S, T, U, V)                                                                 \
    "sxtb %[low], %[" #W "]\n\tsxtb %[high], %[" #W "], ror #8\n\tvmov s" #S ", s" #T        \
    ", %[low], %[high]\n\t"                                                                  \
    "sxtb %[low], %[" #W "], ror #16\n\tasr %[" #W "], %[" #W "], #24\n\tvmov s" #U ", s" #V \
    ", %[low], %[" #W "]\n\t"

static void unpack_i8(const void *from, float *out, uint32_t turns)
{
    uint32_t a, b, low, high;
    __asm__ volatile("1:\n\t"
                     "ldrd %[a], %[b], [%[from]], #8\n\t" BYTES(a, 0, 1, 2, 3) BYTES(b, 4, 5, 6, 7)
                         EIGHT_TO_FLOAT "subs %[turns], #1\n\t"
                                        "vstmia %[out]!, {s0-s7}\n\t"
                                        "bne 1b\n\t"
                     : [from] "+r"(from), [out] "+r"(out), [turns] "+l"(turns), [a] "=&r"(a),
                       [b] "=&r"(b), [low] "=&r"(low), [high] "=&r"(high)
                     :
                     : LOW_S, "cc", "memory");
}

/* `first` and `count` are multiples of eight, so that no storage type begins within a word. */
static void own_unpack(const eits_matrix *matrix, size_t first, size_t count, float *out)
{
    const uint32_t turns = (uint32_t)(count / 8);
    const uint8_t *data = matrix->data;
    if (turns == 0)
        return;
    switch (matrix->storage) {
    case EITS_STORAGE_F32:
        unpack_f32(data + 4 * first, out, turns);
        break;
    case EITS_STORAGE_F16:
        unpack_f16(data + 2 * first, out, turns);
        break;
    case EITS_STORAGE_I16:
        unpack_i16(data + 2 * first, out, turns);
        break;
    case EITS_STORAGE_I8:
        unpack_i8(data + first, out, turns);
        break;
    }
}

#endif
