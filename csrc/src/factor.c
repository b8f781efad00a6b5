#include "factor.h"

#include "kernels.h"
#include "vec.h"

static eits_real *row(const eits_context *ctx, uint32_t i)
{
    return ctx->factor + EITS_TRIANGLE(i);
}

void eits_factor_forward(const eits_context *ctx, uint32_t count, const eits_real *b, eits_real *w)
{
    for (uint32_t i = 0; i < count; ++i)
        w[i] = (b[i] - eits_dot(ctx, row(ctx, i), w, i)) / row(ctx, i)[i];
}

void eits_factor_back(const eits_context *ctx, uint32_t count, eits_real *w, eits_real *d)
{
    for (uint32_t i = count; i-- > 0;) {
        d[i] = w[i] / row(ctx, i)[i];
        eits_axpy(ctx, w, -d[i], row(ctx, i), i);
    }
}

void eits_factor_append(eits_context *ctx, uint32_t count, const eits_real *w, eits_real left)
{
    eits_copy(row(ctx, count), w, count);
    row(ctx, count)[count] = eits_sqrt(left);
}

/* Without row `place` the rows below reach one column too far; rotations of neighbouring columns bring them back. */
void eits_factor_drop(eits_context *ctx, uint32_t count, uint32_t place)
{
    for (uint32_t c = place; c + 1 < count; ++c) {
        const eits_real *top = row(ctx, c + 1);
        const eits_real a = top[c], b = top[c + 1];
        const eits_real length = eits_sqrt(eits_fma(a, a, b * b));
        const eits_real cosine = length > 0 ? a / length : 1, sine = length > 0 ? b / length : 0;
        for (uint32_t i = c + 1; i < count; ++i) {
            eits_real *r = row(ctx, i);
            const eits_real left = r[c], right = r[c + 1];
            r[c] = eits_fma(cosine, left, sine * right);
            r[c + 1] = eits_fma(cosine, right, -sine * left);
        }
    }
    for (uint32_t i = place; i + 1 < count; ++i) /* each row moves up, and is one shorter */
        eits_copy(row(ctx, i), row(ctx, i + 1), i + 1);
}
