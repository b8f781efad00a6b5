/* The link as files. "link_in.bin" has the bytes from the host, in records of u32 time_us, u32 size
 * and bytes. Each is delivered when the board's clock reaches its time; a record without bytes ends
 * the run. "link_out.bin" gets the bytes from the board. */
#include "mps2.h"

#include <string.h>

enum { MAX_BYTES = 768 * 1024 };

static uint8_t input[MAX_BYTES];
static size_t input_bytes, at, left; /* left: bytes of the present record */
static bool over;
static FILE *output;

void mps2_link_start(void)
{
    input_bytes = mps2_load("link_in.bin", input, sizeof input);
    output = fopen("link_out.bin", "wb");
    if (output == NULL)
        mps2_fail("link_out.bin: cannot be written");
}

static bool write_bytes(void *ctx, const uint8_t *bytes, size_t size)
{
    (void)ctx;
    mps2_hold_time();
    if (fwrite(bytes, 1, size, output) != size)
        mps2_fail("link_out.bin: cannot be written");
    mps2_release_time();
    return true;
}

static size_t read_bytes(void *ctx, uint8_t *bytes, size_t room)
{
    uint32_t head[2];
    if (left == 0 && !over) {
        if (at + sizeof head > input_bytes) {
            over = true;
            return 0;
        }
        memcpy(head, input + at, sizeof head);
        if ((int32_t)(mps2_time_us(ctx) - head[0]) < 0)
            return 0;
        at += sizeof head;
        left = head[1];
        over = left == 0;
        if (left > input_bytes - at)
            mps2_fail("link_in.bin: length");
    }
    const size_t size = left < room ? left : room;
    memcpy(bytes, input + at, size);
    at += size;
    left -= size;
    return size;
}

bool mps2_link_ended(void *ctx)
{
    (void)ctx;
    return over && left == 0;
}

const fw_link_ops mps2_link_ops = {
    .write = write_bytes, .read = read_bytes, .ended = mps2_link_ended};
