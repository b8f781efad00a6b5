#include "app/link/sha256.h"

#include <string.h>

enum { BLOCK = 64, ROUNDS = 64, LENGTH_AT = 56 };

/* The constants are the fractional parts of the cube roots of the first 64 primes and of the square
 * roots of the first 8 (FIPS 180-4, 4.2.2 and 5.3.3).
 */
static const uint32_t K[ROUNDS] = {
    0x428a2f98u, 0x71374491u, 0xb5c0fbcfu, 0xe9b5dba5u, 0x3956c25bu, 0x59f111f1u, 0x923f82a4u,
    0xab1c5ed5u, 0xd807aa98u, 0x12835b01u, 0x243185beu, 0x550c7dc3u, 0x72be5d74u, 0x80deb1feu,
    0x9bdc06a7u, 0xc19bf174u, 0xe49b69c1u, 0xefbe4786u, 0x0fc19dc6u, 0x240ca1ccu, 0x2de92c6fu,
    0x4a7484aau, 0x5cb0a9dcu, 0x76f988dau, 0x983e5152u, 0xa831c66du, 0xb00327c8u, 0xbf597fc7u,
    0xc6e00bf3u, 0xd5a79147u, 0x06ca6351u, 0x14292967u, 0x27b70a85u, 0x2e1b2138u, 0x4d2c6dfcu,
    0x53380d13u, 0x650a7354u, 0x766a0abbu, 0x81c2c92eu, 0x92722c85u, 0xa2bfe8a1u, 0xa81a664bu,
    0xc24b8b70u, 0xc76c51a3u, 0xd192e819u, 0xd6990624u, 0xf40e3585u, 0x106aa070u, 0x19a4c116u,
    0x1e376c08u, 0x2748774cu, 0x34b0bcb5u, 0x391c0cb3u, 0x4ed8aa4au, 0x5b9cca4fu, 0x682e6ff3u,
    0x748f82eeu, 0x78a5636fu, 0x84c87814u, 0x8cc70208u, 0x90befffau, 0xa4506cebu, 0xbef9a3f7u,
    0xc67178f2u};
static const uint32_t START[8] = {0x6a09e667u, 0xbb67ae85u, 0x3c6ef372u, 0xa54ff53au,
                                  0x510e527fu, 0x9b05688cu, 0x1f83d9abu, 0x5be0cd19u};

static uint32_t rotate(uint32_t x, unsigned by)
{
    return x >> by | x << (32u - by);
}

static void take_block(uint32_t h[8], const uint8_t *block)
{
    uint32_t w[ROUNDS], v[8];
    for (int t = 0; t < 16; ++t)
        w[t] = (uint32_t)block[4 * t] << 24 | (uint32_t)block[4 * t + 1] << 16 |
               (uint32_t)block[4 * t + 2] << 8 | block[4 * t + 3];
    for (int t = 16; t < ROUNDS; ++t) {
        const uint32_t a = w[t - 15], b = w[t - 2];
        w[t] = w[t - 16] + (rotate(a, 7) ^ rotate(a, 18) ^ a >> 3) + w[t - 7] +
               (rotate(b, 17) ^ rotate(b, 19) ^ b >> 10);
    }
    memcpy(v, h, sizeof v);
    for (int t = 0; t < ROUNDS; ++t) {
        const uint32_t a = v[0], e = v[4];
        const uint32_t one = v[7] + (rotate(e, 6) ^ rotate(e, 11) ^ rotate(e, 25)) +
                             ((e & v[5]) ^ (~e & v[6])) + K[t] + w[t];
        const uint32_t two = (rotate(a, 2) ^ rotate(a, 13) ^ rotate(a, 22)) +
                             ((a & v[1]) ^ (a & v[2]) ^ (v[1] & v[2]));
        memmove(v + 1, v, 7 * sizeof v[0]);
        v[4] += one;
        v[0] = one + two;
    }
    for (int k = 0; k < 8; ++k)
        h[k] += v[k];
}

void fw_sha256(const uint8_t *bytes, size_t size, uint8_t digest[32])
{
    uint32_t h[8];
    uint8_t last[2 * BLOCK] = {0};
    memcpy(h, START, sizeof h);
    size_t at = 0;
    for (; size - at >= BLOCK; at += BLOCK)
        take_block(h, bytes + at);
    /* a one bit, zeros, and the length in bits fill one block or two */
    const size_t rest = size - at, end = rest < LENGTH_AT ? BLOCK : 2 * BLOCK;
    if (rest > 0)
        memcpy(last, bytes + at, rest);
    last[rest] = 0x80;
    const uint64_t bits = (uint64_t)size * 8u;
    for (size_t k = 0; k < 8; ++k)
        last[end - 1u - k] = (uint8_t)(bits >> (8u * k));
    for (at = 0; at < end; at += BLOCK)
        take_block(h, last + at);
    for (size_t k = 0; k < 32; ++k)
        digest[k] = (uint8_t)(h[k / 4u] >> (24u - 8u * (k % 4u)));
}
