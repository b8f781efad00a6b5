/* The header that Arduino looks for. */
#include "eitskin/eitskin.h"
