/* Denoises an image row by row, of which no more than some 100 rows are in memory: first by functions that are called, then in a loop of its own. */
#include <inttypes.h>
#include <stdio.h>

#include <linpred.h>

#include "scene.h" /* stands for the renderer */

/* Fills a row that is wanted. */
static int32_t read_row(void *user, const linpred_input_row *row)
{
    (void)user;
    for (size_t x = 0; x < row->width; ++x) {
        const scene_pixel pixel = scene_render((uint32_t)x, (uint32_t)row->y);
        for (int c = 0; c < 3; ++c) {
            row->colour[c][x] = pixel.colour[c];
            row->variance[c][x] = pixel.variance[c];
            row->albedo[c][x] = pixel.albedo[c];
            row->normal[c][x] = pixel.normal[c];
        }
        row->depth[x] = pixel.depth;
    }
    return 0; /* it is filled */
}

/* Takes a denoised row. */
static int32_t write_row(void *user, const linpred_output_row *row)
{
    uint64_t *sum = user;
    for (size_t x = 0; x < row->width; ++x) {
        const float pixel[3] = { row->colour[0][x], row->colour[1][x], row->colour[2][x] };
        *sum = scene_checksum(*sum, pixel, 3);
    }
    return 0; /* it is taken */
}

/* By functions: the library asks for rows and gives rows. */
static int by_functions(linpred_denoiser *denoiser, const linpred_layout *layout, uint64_t *sum)
{
    linpred_row_functions functions = LINPRED_ROW_FUNCTIONS_INIT;
    functions.user = sum;
    functions.read_row = read_row;
    functions.write_row = write_row;
    return linpred_run_rows(denoiser, layout, &functions);
}

/* In a loop: a renderer goes on until the next row is there. */
static int in_a_loop(linpred_denoiser *denoiser, const linpred_layout *layout, uint64_t *sum)
{
    linpred_step step = LINPRED_STEP_INIT;
    int failed = linpred_start_rows(denoiser, layout);
    while (!failed) {
        failed = linpred_next_step(denoiser, &step);
        if (failed || step.kind == LINPRED_STEP_DONE) {
            break;
        }
        if (step.kind == LINPRED_STEP_WANTED) {
            read_row(NULL, step.wanted);
        } else {
            write_row(sum, step.denoised);
        }
    }
    return failed;
}

int main(void)
{
    linpred_options options = LINPRED_OPTIONS_INIT;
    options.quality = LINPRED_QUALITY_HIGH;
    linpred_layout layout = LINPRED_LAYOUT_INIT;
    layout.width = SCENE_WIDTH;
    layout.height = SCENE_HEIGHT;
    layout.variance = LINPRED_VARIANCE_OF_MEAN;
    layout.normal = layout.albedo = layout.depth = LINPRED_FEATURE_PRESENT;

    uint64_t sums[2] = { SCENE_CHECKSUM, SCENE_CHECKSUM };
    linpred_denoiser *denoiser = linpred_new();
    int failed = linpred_set_options(denoiser, &options)
        || by_functions(denoiser, &layout, &sums[0])
        || in_a_loop(denoiser, &layout, &sums[1]);
    if (failed) {
        fprintf(stderr, "linpred: %s\n", linpred_message(denoiser));
    } else {
        printf("%016" PRIx64 "\n%016" PRIx64 "\n", sums[0], sums[1]);
    }
    linpred_free(&denoiser);
    return failed;
}
