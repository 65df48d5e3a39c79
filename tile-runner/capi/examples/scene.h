/*
 * Stands for a renderer: tiles in a light that grows from left to right, a floor below and a wall above, with noise of a known variance. Every
 * operation is exact or rounded once, so that any compiler makes the same bits.
 */
#ifndef SCENE_H
#define SCENE_H

#include <stdint.h>
#include <string.h>

enum { SCENE_WIDTH = 64, SCENE_HEIGHT = 48 };

/* What a renderer knows of a pixel. */
typedef struct scene_pixel {
    float colour[3];
    float variance[3]; /* of the colour */
    float albedo[3];
    float normal[3];
    float depth;
} scene_pixel;

/* A number from 0 to 1 that looks random. */
static inline float scene_random(uint32_t n)
{
    n = (n + 1u) * 0x9E3779B9u;
    n = (n ^ (n >> 16)) * 0x7FEB352Du;
    n = (n ^ (n >> 15)) * 0x846CA68Bu;
    return (float)((n ^ (n >> 16)) >> 8) / 16777216.0f;
}

static inline scene_pixel scene_render(uint32_t x, uint32_t y)
{
    scene_pixel pixel;
    const int is_floor = y >= SCENE_HEIGHT / 2;
    const int is_dark = (x / 8 + y / 8) % 2 == 1;
    const float light = 0.5f + (float)x / 128.0f;
    memset(&pixel, 0, sizeof pixel);
    pixel.normal[is_floor ? 1 : 2] = 1.0f;
    pixel.depth = is_floor ? 64.0f - (float)y : 40.0f;
    for (uint32_t c = 0; c < 3; ++c) {
        const float noise = scene_random((y * SCENE_WIDTH + x) * 3 + c);
        pixel.albedo[c] = is_dark ? 0.25f : 0.5f + 0.125f * (float)c;
        /* noise from 0.5 to 1.5, whose variance is 1 / 12 */
        pixel.colour[c] = pixel.albedo[c] * light * (0.5f + noise);
        pixel.variance[c] = (pixel.albedo[c] * light) * (pixel.albedo[c] * light) / 12.0f;
    }
    return pixel;
}

/* FNV-1a, 64 bits, over the bits of floats from the lowest byte up; begin with SCENE_CHECKSUM. */
static const uint64_t SCENE_CHECKSUM = 0xCBF29CE484222325u;

static inline uint64_t scene_checksum(uint64_t sum, const float *values, size_t count)
{
    for (size_t i = 0; i < count; ++i) {
        uint32_t bits;
        memcpy(&bits, &values[i], sizeof bits);
        for (int byte = 0; byte < 4; ++byte) {
            sum = (sum ^ ((bits >> (8 * byte)) & 0xFFu)) * 0x100000001B3u;
        }
    }
    return sum;
}

#endif
