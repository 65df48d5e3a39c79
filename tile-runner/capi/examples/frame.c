/* Denoises a frame that is in memory, and prints a checksum of its bits. */
#include <inttypes.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>

#include <linpred.h>

#include "scene.h" /* stands for the renderer */

enum { WIDTH = SCENE_WIDTH, HEIGHT = SCENE_HEIGHT };

static bool show(void *user, size_t rows, size_t of)
{
    if (rows == of) {
        fprintf((FILE *)user, "%zu rows\n", rows);
    }
    return true; /* go on */
}

/* An image that lies in the renderer's pixels; 0 if all went well. */
static int set(linpred_denoiser *denoiser, const char *name, int32_t format, scene_pixel *pixels, size_t offset)
{
    return linpred_set_image(denoiser, name, pixels, format, WIDTH, HEIGHT, offset, sizeof *pixels, 0);
}

int main(void)
{
    scene_pixel *pixels = malloc(WIDTH * HEIGHT * sizeof *pixels);
    float *clean = malloc(WIDTH * HEIGHT * 3 * sizeof *clean);
    if (pixels == NULL || clean == NULL) {
        free(clean);
        free(pixels);
        return 1;
    }
    for (uint32_t y = 0; y < HEIGHT; ++y) {
        for (uint32_t x = 0; x < WIDTH; ++x) {
            pixels[y * WIDTH + x] = scene_render(x, y);
        }
    }

    linpred_options options = LINPRED_OPTIONS_INIT;
    options.quality = LINPRED_QUALITY_HIGH;
    linpred_report report = LINPRED_REPORT_INIT;
    linpred_denoiser *denoiser = linpred_new();

    /* Every call returns a code, LINPRED_OK is 0, and the first failure skips the rest. */
    int failed = linpred_set_options(denoiser, &options)
        || linpred_set_progress(denoiser, show, stderr)
        || set(denoiser, "colour", LINPRED_FORMAT_FLOAT3, pixels, offsetof(scene_pixel, colour))
        || set(denoiser, "variance", LINPRED_FORMAT_FLOAT3, pixels, offsetof(scene_pixel, variance))
        || set(denoiser, "albedo", LINPRED_FORMAT_FLOAT3, pixels, offsetof(scene_pixel, albedo))
        || set(denoiser, "normal", LINPRED_FORMAT_FLOAT3, pixels, offsetof(scene_pixel, normal))
        || set(denoiser, "depth", LINPRED_FORMAT_FLOAT, pixels, offsetof(scene_pixel, depth))
        /* strides of 0: nothing lies between pixels or rows */
        || linpred_set_output(denoiser, "colour", clean, LINPRED_FORMAT_FLOAT3, WIDTH, HEIGHT, 0, 0, 0)
        || linpred_execute(denoiser)
        || linpred_get_report(denoiser, &report);

    if (failed) {
        fprintf(stderr, "linpred: %s\n", linpred_message(denoiser));
    } else {
        fprintf(stderr, "%" PRIu64 " models, %" PRIu64 " pixels repaired\n", report.models, report.repaired);
        printf("%016" PRIx64 "\n", scene_checksum(SCENE_CHECKSUM, clean, WIDTH * HEIGHT * 3));
    }
    linpred_free(&denoiser); /* and denoiser is NULL */
    free(clean);
    free(pixels);
    return failed;
}
