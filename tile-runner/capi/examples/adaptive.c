/* Renders 4 samples of each pixel, asks where more would help, renders those, denoises, and prints a checksum of the bits. */
#include <inttypes.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>

#include <linpred.h>

#include "scene.h" /* random numbers and the checksum */

enum { WIDTH = 64, HEIGHT = 48, FIRST = 4 };

/* What the renderer keeps of a pixel. */
typedef struct pixel {
    double sum, squares; /* of its samples */
    float colour[3], variance[3];
    float samples;
    uint32_t more; /* samples that it is to get next */
} pixel;

/* The renderer: a light that grows from left to right, with a noisy corner at the lower right. Its numbers have few digits, so that their sums are exact. */
static double sample(uint32_t x, uint32_t y, uint32_t n)
{
    const int random = (int)(256.0f * scene_random((n * HEIGHT + y) * WIDTH + x));
    const int is_noisy = x >= WIDTH / 2 && y >= HEIGHT / 2;
    return (64 + x) / 64.0 * (is_noisy ? random / 128.0 : 1.0 + (random - 128) / 1024.0);
}

/* Renders what `more` asks for. */
static void render(pixel *pixels)
{
    for (uint32_t i = 0; i < WIDTH * HEIGHT; ++i) {
        pixel *const p = &pixels[i];
        for (; p->more > 0; --p->more) {
            const double value = sample(i % WIDTH, i / WIDTH, (uint32_t)p->samples);
            p->sum += value;
            p->squares += value * value;
            p->samples += 1;
        }
        const double n = p->samples;
        for (int c = 0; c < 3; ++c) {
            p->colour[c] = (float)(p->sum / n);
            /* of the mean */
            p->variance[c] = (float)((n * p->squares - p->sum * p->sum) / (n * n * (n - 1)));
        }
    }
}

/* An image that lies in the renderer's pixels; 0 if all went well. */
static int set(linpred_denoiser *denoiser, const char *name, int32_t format, pixel *pixels, size_t offset)
{
    return linpred_set_image(denoiser, name, pixels, format, WIDTH, HEIGHT, offset, sizeof *pixels, 0);
}

/* Asks for the samples that each pixel should get next. */
static int ask(linpred_denoiser *denoiser, pixel *pixels)
{
    linpred_sample_goal goal = LINPRED_SAMPLE_GOAL_INIT;
    linpred_sample_summary summary = LINPRED_SAMPLE_SUMMARY_INIT;
    goal.budget = 8; /* more for each pixel, on average */
    const int failed = linpred_sample_map(
        denoiser, &goal, &pixels->more, WIDTH, HEIGHT, 0, sizeof *pixels, 0, &summary);
    if (!failed) {
        fprintf(stderr, "%" PRIu64 " samples and %" PRIu64 " more, %" PRIu32 " at most; error %.5f, %.5f with them\n",
            summary.samples, summary.added, summary.most, summary.error, summary.error_then);
    }
    return failed;
}

int main(void)
{
    pixel *pixels = calloc(WIDTH * HEIGHT, sizeof *pixels);
    float *clean = malloc(WIDTH * HEIGHT * 3 * sizeof *clean);
    if (pixels == NULL || clean == NULL) {
        free(clean);
        free(pixels);
        return 1;
    }
    for (size_t i = 0; i < WIDTH * HEIGHT; ++i) {
        pixels[i].more = FIRST;
    }
    render(pixels);

    linpred_denoiser *denoiser = linpred_new();
    int failed = set(denoiser, "colour", LINPRED_FORMAT_FLOAT3, pixels, offsetof(pixel, colour))
        || set(denoiser, "variance", LINPRED_FORMAT_FLOAT3, pixels, offsetof(pixel, variance))
        || set(denoiser, "samples", LINPRED_FORMAT_FLOAT, pixels, offsetof(pixel, samples))
        || linpred_set_output(denoiser, "colour", clean, LINPRED_FORMAT_FLOAT3, WIDTH, HEIGHT, 0, 0, 0)
        || ask(denoiser, pixels);
    if (!failed) {
        render(pixels);
        failed = linpred_execute(denoiser);
    }

    if (failed) {
        fprintf(stderr, "linpred: %s\n", linpred_message(denoiser));
    } else {
        printf("%016" PRIx64 "\n", scene_checksum(SCENE_CHECKSUM, clean, WIDTH * HEIGHT * 3));
    }
    linpred_free(&denoiser);
    free(clean);
    free(pixels);
    return failed;
}
