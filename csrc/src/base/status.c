#include "eitskin/types.h"

/* The switch has no default, so that the compiler reports a new status that has no case. */
const char *eits_status_text(eits_status status)
{
    switch (status) {
    case EITS_OK:
        return "ok";
    case EITS_E_ARGUMENT:
        return "an argument is null or out of range, or another call has to come first";
    case EITS_E_WORKSPACE:
        return "the workspace is too small or not 16-byte aligned";
    case EITS_E_MODEL_TRUNCATED:
        return "the model ends before the size that its header states";
    case EITS_E_MODEL_MAGIC:
        return "this is not an .eitm model";
    case EITS_E_MODEL_VERSION:
        return "the model has a newer major version than this library reads";
    case EITS_E_MODEL_CRC:
        return "the model's checksum does not fit its content";
    case EITS_E_MODEL_SECTION:
        return "a section of the model is missing, misplaced or of the wrong size";
    case EITS_E_MODEL_VALUE:
        return "a number inside the model is out of range";
    case EITS_E_MODEL_ALIGNMENT:
        return "the model does not start at a 16-byte boundary";
    case EITS_E_FRAME_LENGTH:
        return "the frame's length is not the number of rows of the protocol";
    case EITS_E_FRAME_ROWS:
        return "too many rows of the frame are unusable";
    case EITS_E_FRAME_ZERO:
        return "all voltages are zero; is the skin driven and connected?";
    case EITS_E_NO_REFERENCE:
        return "no reference frame has been set";
    case EITS_E_REFERENCE_SHORT:
        return "the reference has too few frames";
    case EITS_E_NOT_FINITE:
        return "the result would not be finite";
    case EITS_E_ARITHMETIC:
        return "the core's arithmetic has other bits; compile it with -ffp-contract=off, round to "
               "nearest";
    case EITS_E_REFERENCE_TOUCHED:
        return "something landed, moved or lifted on the skin while the reference was taken; leave "
               "the skin untouched and take it again";
    }
    return "unknown status";
}

/* Two macros are needed, so that the number is put in before it becomes text. */
#define TEXT_OF(x) #x
#define TEXT(x)    TEXT_OF(x)

const char *eits_version_text(void)
{
    return TEXT(EITS_VERSION_MAJOR) "." TEXT(EITS_VERSION_MINOR) "." TEXT(EITS_VERSION_PATCH);
}

size_t eits_real_size(void)
{
    return sizeof(eits_real);
}
