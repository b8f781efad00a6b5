/* Every input of an archive into a fuzz target: the kept corpus as a test, under any compiler. With
 * sums, also that what came out is what it was: replay ARCHIVE [SUMS NAME]. */
#include "fuzz.h"

size_t LLVMFuzzerMutate(uint8_t *data, size_t size, size_t room)
{
    (void)data, (void)room;
    return size;
}

static void replay(const uint8_t *bytes, size_t size, const char *name)
{
    uint8_t *exact = malloc(size > 0 ? size : 1); /* so that a byte too far is seen */
    if (exact == NULL)
        abort();
    memcpy(exact, bytes, size);
    fprintf(stderr, "%s\n", name);
    (void)LLVMFuzzerTestOneInput(exact, size);
    fuzz_end_input();
    free(exact);
}

/* The next `count` bytes of the archive as a number. */
static uint32_t number(fuzz_bytes *archive, int count)
{
    uint32_t value = 0;
    for (int i = 0; i < count; ++i)
        value |= (uint32_t)fuzz_u8(archive) << 8 * i;
    return value;
}

/* The inputs of a zip whose members are stored, not compressed, as corpus.py writes them: a header
 * of 30 bytes before each, name and input. Returns how many; -1 for anything else. */
static int replay_all(fuzz_bytes archive)
{
    enum { MEMBER = 0x04034b50, DIRECTORY = 0x02014b50 };
    for (int inputs = 0;; ++inputs) {
        const uint32_t kind = number(&archive, 4);
        if (kind == DIRECTORY)
            return inputs;
        (void)number(&archive, 2); /* the version that wrote it */
        const uint32_t flags = number(&archive, 2), compression = number(&archive, 2);
        (void)number(&archive, 4), (void)number(&archive, 4); /* time, CRC-32 */
        const uint32_t stored = number(&archive, 4), size = number(&archive, 4);
        const uint32_t name_length = number(&archive, 2), extra = number(&archive, 2);
        char name[128];
        if (kind != MEMBER || flags != 0 || compression != 0 || stored != size || extra != 0 ||
            name_length >= sizeof name || name_length + size > (size_t)(archive.end - archive.at))
            return -1;
        memcpy(name, archive.at, name_length);
        name[name_length] = '\0';
        replay(archive.at + name_length, size, name);
        archive.at += name_length + size;
    }
}

/* Whether the file has these sums of the target, and no others. */
static int same_sums(const char *path, const char *target)
{
    char of[32], name[32];
    uint32_t value;
    int wrong = 0, right = 0;
    FILE *file = fopen(path, "r");
    while (file != NULL && fscanf(file, "%31s %31s %x", of, name, &value) == 3) {
        const fuzz_sum *sum = fuzz_sums;
        while (sum->name != NULL && strcmp(sum->name, name) != 0)
            ++sum;
        if (strcmp(of, target) != 0)
            continue;
        if (sum->name != NULL && sum->all == value)
            ++right;
        else
            ++wrong;
    }
    if (file != NULL)
        fclose(file);
    for (const fuzz_sum *sum = fuzz_sums; sum->name != NULL; ++sum)
        --right;
    if (wrong == 0 && right == 0)
        return 1;
    printf("%s: other results than before. Where that is meant, its lines are\n", path);
    for (const fuzz_sum *sum = fuzz_sums; sum->name != NULL; ++sum)
        printf("%s %s 0x%08X\n", target, sum->name, sum->all);
    return 0;
}

int main(int argc, char **argv)
{
    static uint8_t room[1 << 24];
    FILE *file = argc > 1 ? fopen(argv[1], "rb") : NULL;
    const size_t size = file != NULL ? fread(room, 1, sizeof room, file) : 0;
    if (file != NULL)
        fclose(file);
    fuzz_sums_wanted = argc > 3;
    const int inputs = size < sizeof room ? replay_all((fuzz_bytes){room, room + size}) : -1;
    printf("%d inputs\n", inputs);
    return inputs > 0 && (argc <= 3 || same_sums(argv[2], argv[3])) ? 0 : 1;
}
