/* The whole way from a model file to touches, with the frame that every model carries for its
 * self-test. Use: minimal MODEL.eitm */
#include <eitskin/eitskin.h>
#include <stdio.h>
#include <stdlib.h>

/* The bytes of a file in memory aligned to 16 bytes, as a model has to be; NULL if unreadable. */
static void *read_file(const char *path, size_t *size)
{
    FILE *file = fopen(path, "rb");
    if (file == NULL || fseek(file, 0, SEEK_END) != 0)
        return NULL;
    *size = (size_t)ftell(file);
    rewind(file);
    void *bytes = aligned_alloc(EITS_MODEL_ALIGNMENT, EITS_ALIGN16(*size));
    if (bytes != NULL && fread(bytes, 1, *size, file) != *size) {
        free(bytes);
        bytes = NULL;
    }
    fclose(file);
    return bytes;
}

/* `count` voltages of the model, float, as the core's scalars. */
static eits_real *as_frame(const float *voltage_v, uint32_t count)
{
    eits_real *frame = malloc(count * sizeof *frame);
    for (uint32_t i = 0; frame != NULL && i < count; ++i)
        frame[i] = voltage_v[i];
    return frame;
}

static int failed(const char *what, eits_status status)
{
    fprintf(stderr, "%s: %s\n", what, eits_status_text(status));
    return 1;
}

static int find_touches(const eits_model *model, eits_context *skin)
{
    eits_real *reference = as_frame(model->golden.reference, model->n_rows);
    eits_real *frame = as_frame(model->golden.frame, model->n_rows);
    eits_touch touch[EITS_MAX_TOUCHES];
    uint32_t count = 0;
    eits_status status = reference == NULL || frame == NULL ? EITS_E_ARGUMENT : EITS_OK;
    if (status ==
        EITS_OK) /* one untouched frame; eits_reference_begin takes many, and their noise */
        status = eits_reference_set(skin, reference, model->n_rows);
    if (status == EITS_OK)
        status = eits_reconstruct(skin, frame, model->n_rows, NULL, NULL);
    if (status == EITS_OK)
        status = eits_find_touches(skin, touch, EITS_MAX_TOUCHES, &count);
    for (uint32_t k = 0; k < count; ++k)
        printf("touch %u: (%.1f, %.1f) mm, radius %.1f mm\n", (unsigned)touch[k].id,
               (double)touch[k].x_mm, (double)touch[k].y_mm, (double)touch[k].radius_mm);
    free(frame);
    free(reference);
    return status == EITS_OK ? 0 : failed("frame", status);
}

int main(int argc, char **argv)
{
    size_t size = 0;
    void *blob = argc == 2 ? read_file(argv[1], &size) : NULL;
    if (blob == NULL) {
        fprintf(stderr, "use: minimal MODEL.eitm\n");
        return 2;
    }
    eits_model model;
    eits_status status = eits_model_open(&model, blob, size);
    if (status != EITS_OK)
        return failed(argv[1], status);

    const size_t bytes = eits_workspace_size(&model, 1);
    void *workspace = aligned_alloc(16, EITS_ALIGN16(bytes));
    eits_context *skin = NULL;
    status = eits_init(workspace, bytes, &model, &skin);
    if (status != EITS_OK)
        return failed("workspace", status);
    const int result = find_touches(&model, skin);
    free(workspace);
    free(blob);
    return result;
}
