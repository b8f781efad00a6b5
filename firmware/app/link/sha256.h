/* SHA-256 (FIPS 180-4), so that a user can compare what the board holds with a file. */
#ifndef FW_SHA256_H
#define FW_SHA256_H

#include <stddef.h>
#include <stdint.h>

void fw_sha256(const uint8_t *bytes, size_t size, uint8_t digest[32]);

#endif
