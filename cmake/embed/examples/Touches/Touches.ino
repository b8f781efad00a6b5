// The frame that every model carries for its self-test, from voltages to touches. Make
// eitskin_model.h with  scripts/embed OUT --model MODEL.eitm  and
// give your frame to eits_reconstruct in place of the golden one.
#include <eitskin.h>
#include <eitskin_model.h>

static uint8_t workspace[EITSKIN_MODEL_WORKSPACE] __attribute__((aligned(16)));
static eits_model model;
static eits_context *skin;

void setup()
{
    Serial.begin(115200);
    eits_status status = eits_model_open(&model, eitskin_model, sizeof eitskin_model);
    if (status == EITS_OK)
        status = eits_init(workspace, sizeof workspace, &model, &skin);
    if (status == EITS_OK)
        status = eits_reference_set(skin, model.golden.reference, model.n_rows);
    Serial.println(eits_status_text(status));
}

void loop()
{
    eits_touch touches[EITS_MAX_TOUCHES];
    uint32_t count = 0;
    if (eits_reconstruct(skin, model.golden.frame, model.n_rows, NULL, NULL) == EITS_OK)
        eits_find_touches(skin, touches, EITS_MAX_TOUCHES, &count);
    for (uint32_t k = 0; k < count; ++k) {
        Serial.print(touches[k].x_mm);
        Serial.print(" ");
        Serial.println(touches[k].y_mm);
    }
}
