/* S'v and S x on a context: the two products that take most of a frame's time, n_pixels x rank and
 * nonzeros x rank multiply-accumulates. The callers count them. */
#include "context/products.h"
#include "base/arithmetic.h"

void eits_apply_t(const eits_context *ctx, const eits_real *v, eits_real *out)
{
    const eits_matrix *s = &ctx->model->sensitivity;
    /* Panels are floats, unpacked once; without them every product unpacks. */
    if (ctx->columns.panels != NULL)
        ctx->kernels->mul_t_panels(s, ctx->columns.panels, NULL, s->cols, v, out);
    else
        ctx->kernels->mul_t(s, NULL, s->cols, v, out);
}

uint32_t eits_apply(const eits_context *ctx, const eits_scratch *scratch, const eits_real *x,
                    eits_real *out)
{
    const eits_matrix *s = &ctx->model->sensitivity;
    /* An image has tens of non-zeros among hundreds of pixels. */
    const uint32_t count = eits_list_nonzeros(ctx->kernels, s, x, scratch->index, scratch->value);
    ctx->kernels->mul(s, scratch->index, scratch->value, count, out);
    return count;
}
