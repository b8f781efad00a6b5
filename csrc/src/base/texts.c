/* Numbers in words. Written by tables/make_tables.py from tables/diagnostics.toml. */
#include "eitskin/diagnostics.h"

const char *eits_diagnostic_text(eits_diagnostic diagnostic)
{
    switch (diagnostic) {
    case EITS_DIAGNOSTIC_SATURATED:
        return "saturated";
    case EITS_DIAGNOSTIC_ELECTRODE_OPEN:
        return "electrode open";
    case EITS_DIAGNOSTIC_BRIDGED:
        return "electrodes bridged";
    case EITS_DIAGNOSTIC_OUTLIER:
        return "outlier";
    case EITS_DIAGNOSTIC_ELECTRODE_NOISY:
        return "electrode noisy";
    case EITS_DIAGNOSTIC_MODEL_MISMATCH:
        return "model mismatch";
    case EITS_DIAGNOSTIC_STALE_REFERENCE:
        return "stale reference";
    case EITS_DIAGNOSTIC_CROWDED:
        return "crowded";
    case EITS_DIAGNOSTIC_UNLIKE_MODEL:
        return "unlike the model";
    }
    return "unknown diagnostic";
}
