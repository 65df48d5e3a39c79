/* Denoises a small frame as often as its argument says, by turns as a whole and by rows, each time with a new denoiser. */
#include <stdlib.h>

#include <linpred.h>

enum { SIDE = 20 };

static int32_t read_row(void *user, const linpred_input_row *row)
{
    (void)user;
    for (size_t x = 0; x < row->width; ++x) {
        for (int c = 0; c < 3; ++c) {
            row->colour[c][x] = (float)((x * 7 + row->y * 13) % 5);
        }
    }
    return 0;
}

static int32_t write_row(void *user, const linpred_output_row *row)
{
    (void)user;
    (void)row;
    return 0;
}

static int whole(linpred_denoiser *denoiser)
{
    static float colour[SIDE * SIDE * 3];
    return linpred_set_image(denoiser, "colour", colour, LINPRED_FORMAT_FLOAT3, SIDE, SIDE, 0, 0, 0)
        || linpred_set_image(denoiser, "layer.direct", colour, LINPRED_FORMAT_FLOAT3, SIDE, SIDE, 0, 0, 0)
        || linpred_set_output(denoiser, "colour", colour, LINPRED_FORMAT_FLOAT3, SIDE, SIDE, 0, 0, 0)
        || linpred_execute(denoiser)
        /* and what fails is freed, too */
        || linpred_unset_image(denoiser, "layer.direct")
        || !linpred_set_image(denoiser, "no such image", colour, LINPRED_FORMAT_FLOAT3, SIDE, SIDE, 0, 0, 0);
}

static int rows(linpred_denoiser *denoiser)
{
    linpred_layout layout = LINPRED_LAYOUT_INIT;
    linpred_row_functions functions = LINPRED_ROW_FUNCTIONS_INIT;
    linpred_step step = LINPRED_STEP_INIT;
    layout.width = layout.height = SIDE;
    functions.read_row = read_row;
    functions.write_row = write_row;
    return linpred_run_rows(denoiser, &layout, &functions)
        /* a run that is given up */
        || linpred_start_rows(denoiser, &layout)
        || linpred_next_step(denoiser, &step)
        || linpred_next_step(denoiser, &step);
}

int main(int count, char **arguments)
{
    int failed = count != 2;
    for (int run = 0; !failed && run < atoi(arguments[1]); ++run) {
        linpred_options options = LINPRED_OPTIONS_INIT;
        linpred_denoiser *denoiser = linpred_new();
        options.threads = 2;
        failed = linpred_set_options(denoiser, &options) || whole(denoiser) || rows(denoiser);
        linpred_free(&denoiser);
    }
    return failed;
}
