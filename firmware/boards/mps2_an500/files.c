/* Files from the folder in which QEMU runs. */
#include "mps2.h"

#include <stdlib.h>

size_t mps2_load(const char *name, void *bytes, size_t room)
{
    FILE *const file = fopen(name, "rb");
    if (file == NULL)
        return 0;
    const size_t size = fread(bytes, 1, room, file);
    if (fgetc(file) != EOF)
        mps2_fail(name);
    fclose(file);
    return size;
}

void mps2_fail(const char *what)
{
    printf("mps2_an500: %s\n", what);
    exit(1);
}
