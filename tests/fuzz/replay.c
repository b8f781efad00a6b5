/* Every file of a folder into a fuzz target: the kept corpus as a test, under any compiler. With
 * sums, also that what came out is what it was: replay FOLDER [SUMS NAME]. */
#include "fuzz.h"

#include <dirent.h>

size_t LLVMFuzzerMutate(uint8_t *data, size_t size, size_t room)
{
    (void)data, (void)room;
    return size;
}

static int replay(const char *path)
{
    static uint8_t bytes[1 << 16];
    FILE *file = fopen(path, "rb");
    if (file == NULL)
        return 0;
    const size_t size = fread(bytes, 1, sizeof bytes, file);
    fclose(file);
    uint8_t *exact = malloc(size > 0 ? size : 1); /* so that a byte too far is seen */
    if (exact == NULL)
        abort();
    memcpy(exact, bytes, size);
    fprintf(stderr, "%s\n", path);
    (void)LLVMFuzzerTestOneInput(exact, size);
    fuzz_end_input();
    free(exact);
    return 1;
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
    int files = 0;
    fuzz_sums_wanted = argc > 3;
    DIR *folder = argc > 1 ? opendir(argv[1]) : NULL;
    for (struct dirent *entry; folder != NULL && (entry = readdir(folder)) != NULL;) {
        char path[4096];
        if (entry->d_name[0] == '.')
            continue;
        snprintf(path, sizeof path, "%s/%s", argv[1], entry->d_name);
        files += replay(path);
    }
    if (folder != NULL)
        closedir(folder);
    printf("%d inputs\n", files);
    return files > 0 && (argc <= 3 || same_sums(argv[2], argv[3])) ? 0 : 1;
}
