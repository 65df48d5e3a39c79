/*
 * linpred, a Monte Carlo render denoiser: the C interface. docs/c.md shows how it is used.
 *
 * Made by cbindgen from tile-runner/capi/src; a test compares the two. MIT or Apache-2.0, at your choice.
 */

#ifndef LINPRED_H
#define LINPRED_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
/* Each sets the size of a struct, and the default of every member: linpred_options options = LINPRED_OPTIONS_INIT; */
#define LINPRED_OPTIONS_INIT { sizeof(linpred_options), 0, 0, 0, 0, 0 }
#define LINPRED_REPORT_INIT { sizeof(linpred_report), 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0 }
#define LINPRED_LAYOUT_INIT { sizeof(linpred_layout), 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, { 0, 0, 0, 0, 0, 0 } }
#define LINPRED_STEP_INIT { sizeof(linpred_step), 0, 0, NULL, NULL }
#define LINPRED_ROW_FUNCTIONS_INIT { sizeof(linpred_row_functions), NULL, NULL, NULL }
#define LINPRED_FILE_OPTIONS_INIT { sizeof(linpred_file_options), NULL, 0, 0, 0, 0, NULL, NULL, 0, 0, NULL, NULL }
#define LINPRED_SAMPLE_GOAL_INIT { sizeof(linpred_sample_goal), 0, 0 }
#define LINPRED_SAMPLE_SUMMARY_INIT { sizeof(linpred_sample_summary), 0, 0, 0, 0, 0, 0, 0 }


/**
 * The version of the header: with another first or second number, calls may have to be changed.
 */
#define LINPRED_VERSION_MAJOR 0

/**
 * The second number.
 */
#define LINPRED_VERSION_MINOR 1

/**
 * The third number.
 */
#define LINPRED_VERSION_PATCH 0

/**
 * What became of a call. Numbers up to 6 mean what they mean in OIDN.
 */
enum linpred_status
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * All went well.
     */
    LINPRED_OK = 0,
    /**
     * A fault of the library itself, which the message describes. Nothing was lost but this call.
     */
    LINPRED_ERROR_INTERNAL = 1,
    /**
     * An argument, or what was set before, makes no sense.
     */
    LINPRED_ERROR_ARGUMENT = 2,
    /**
     * The call does not fit what was called before.
     */
    LINPRED_ERROR_OPERATION = 3,
    /**
     * It takes more memory than it may use, or than there is; or there are no more threads.
     */
    LINPRED_ERROR_MEMORY = 4,
    /**
     * The progress function asked to stop.
     */
    LINPRED_ERROR_CANCELLED = 6,
    /**
     * The handle is NULL: never made, or freed.
     */
    LINPRED_ERROR_HANDLE = 7,
    /**
     * Another call with this handle is at work: in another thread, or this one comes from a function that it called.
     */
    LINPRED_ERROR_BUSY = 8,
    /**
     * A function of the caller's failed.
     */
    LINPRED_ERROR_CALLBACK = 9,
    /**
     * A file is of a kind that is not denoised.
     */
    LINPRED_ERROR_UNSUPPORTED = 10,
    /**
     * A file contradicts itself or what was asked for, or lacks what is needed.
     */
    LINPRED_ERROR_INPUT = 11,
    /**
     * A file can't be read.
     */
    LINPRED_ERROR_READ = 12,
    /**
     * A file can't be written.
     */
    LINPRED_ERROR_WRITE = 13,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum linpred_status linpred_status;
#else
typedef int32_t linpred_status;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * How well a pixel must be predicted before no new model is built for it.
 */
enum linpred_quality
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * LINPRED_QUALITY_BALANCED, and LINPRED_QUALITY_FAST for maps of samples.
     */
    LINPRED_QUALITY_DEFAULT = 0,
    /**
     * Well by one model.
     */
    LINPRED_QUALITY_FAST = 4,
    /**
     * Well by three.
     */
    LINPRED_QUALITY_BALANCED = 5,
    /**
     * Well by sixteen.
     */
    LINPRED_QUALITY_HIGH = 6,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum linpred_quality linpred_quality;
#else
typedef int32_t linpred_quality;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * Which formulas fit, choose and blend the models.
 */
enum linpred_formulas
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * linpred's own.
     */
    LINPRED_FORMULAS_ROBUST = 0,
    /**
     * Those of Moon et al. 2015 (linear predictions) to the letter, to compare with.
     */
    LINPRED_FORMULAS_LITERAL = 1,
    /**
     * Those of Moon et al. 2014 (weighted local regression) to the letter, likewise; slow.
     */
    LINPRED_FORMULAS_WLR = 2,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum linpred_formulas linpred_formulas;
#else
typedef int32_t linpred_formulas;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * What a pixel is: how many numbers of which kind. The values are OIDN's.
 */
enum linpred_format
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * One float.
     */
    LINPRED_FORMAT_FLOAT = 1,
    /**
     * Three floats.
     */
    LINPRED_FORMAT_FLOAT3 = 3,
    /**
     * Four floats, of which the fourth is neither read nor written.
     */
    LINPRED_FORMAT_FLOAT4 = 4,
    /**
     * One half float.
     */
    LINPRED_FORMAT_HALF = 257,
    /**
     * Three half floats.
     */
    LINPRED_FORMAT_HALF3 = 259,
    /**
     * Four half floats, of which the fourth is neither read nor written.
     */
    LINPRED_FORMAT_HALF4 = 260,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum linpred_format linpred_format;
#else
typedef int32_t linpred_format;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * What is known of the colour's noise.
 */
enum linpred_variance
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * Nothing: it is estimated from the picture.
     */
    LINPRED_VARIANCE_ESTIMATED = 0,
    /**
     * The variance of a pixel's mean.
     */
    LINPRED_VARIANCE_OF_MEAN = 1,
    /**
     * ((a - b) / 2)^2, of the means a and b of either half of the pixel's samples.
     */
    LINPRED_VARIANCE_OF_HALVES = 2,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum linpred_variance linpred_variance;
#else
typedef int32_t linpred_variance;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * Whether rows have a feature.
 */
enum linpred_feature
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * They do not.
     */
    LINPRED_FEATURE_ABSENT = 0,
    /**
     * They do, and its noise is estimated.
     */
    LINPRED_FEATURE_PRESENT = 1,
    /**
     * They do, and have the variance of its mean.
     */
    LINPRED_FEATURE_WITH_VARIANCE = 2,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum linpred_feature linpred_feature;
#else
typedef int32_t linpred_feature;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * What comes next.
 */
enum linpred_step_kind
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * All rows are denoised.
     */
    LINPRED_STEP_DONE = 0,
    /**
     * `wanted` is to be filled.
     */
    LINPRED_STEP_WANTED = 1,
    /**
     * `denoised` is there.
     */
    LINPRED_STEP_DENOISED = 2,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum linpred_step_kind linpred_step_kind;
#else
typedef int32_t linpred_step_kind;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * A denoiser: options, images and what went wrong last. One call at a time may use it; denoisers do not know of one
 * another.
 */
typedef struct linpred_denoiser linpred_denoiser;

/**
 * What to compute, and on what. LINPRED_OPTIONS_INIT sets the size and every default; 0 is the default of each
 * member.
 */
typedef struct linpred_options {
    /**
     * sizeof(linpred_options).
     */
    size_t struct_size;
    /**
     * One of linpred_quality.
     */
    int32_t quality;
    /**
     * One of linpred_formulas. Those of the papers know no quality.
     */
    int32_t formulas;
    /**
     * How many good models predict a pixel before no new one is built for it, up to 65535; 0 leaves it to the
     * quality.
     */
    uint32_t coverage;
    /**
     * Threads that compute, on which no bit depends; 0 takes as many as there are processors.
     */
    uint32_t threads;
    /**
     * Bytes of memory that a run may take beside the caller's images; 0 is 2 GiB.
     */
    uint64_t memory_limit;
} linpred_options;

/**
 * Is told that `rows` rows of `of` are done, `user` as it was given; true goes on, false stops the run, which
 * then returns LINPRED_ERROR_CANCELLED. Called in the thread that called the library, and must return: no exception
 * or longjmp may leave it.
 */
typedef bool (*linpred_progress_function)(void *user, size_t rows, size_t of);

/**
 * What a run did, and what it could leave. LINPRED_REPORT_INIT sets the size.
 */
typedef struct linpred_report {
    /**
     * sizeof(linpred_report).
     */
    size_t struct_size;
    /**
     * Pixels of the image.
     */
    uint64_t pixels;
    /**
     * Pixels of zero variance, and black ones where the features say that nothing is there, passed through as they
     * came.
     */
    uint64_t passed_through;
    /**
     * Pixels with a NaN or infinite colour, predicted from their neighbours.
     */
    uint64_t repaired;
    /**
     * Pixels far brighter than all around by no more than a sample, predicted from their neighbours.
     */
    uint64_t fireflies;
    /**
     * Pixels of an image with variances that have none that is known: theirs is estimated from the picture.
     */
    uint64_t estimated;
    /**
     * Cells of 19 x 19 pixels.
     */
    uint64_t cells;
    /**
     * Of those, the ones that hold no noise: nothing is fitted in them.
     */
    uint64_t cells_skipped;
    /**
     * Blocks of features: a normal, an albedo or a depth each.
     */
    uint64_t feature_blocks;
    /**
     * Of those, the ones with no noise in reach: they are not filtered.
     */
    uint64_t feature_blocks_skipped;
    /**
     * Models that were built.
     */
    uint64_t models;
    /**
     * Samples that half precision cannot hold, which became its largest value.
     */
    uint64_t clamped;
    /**
     * Seconds that threads spent on the cells that were not skipped, added up over the threads.
     */
    double fitting_seconds;
} linpred_report;

/**
 * What rows hold. LINPRED_LAYOUT_INIT sets the size; 0 is the default of each member, but an image has a width and a
 * height.
 */
typedef struct linpred_layout {
    /**
     * sizeof(linpred_layout).
     */
    size_t struct_size;
    /**
     * Columns of the image.
     */
    size_t width;
    /**
     * Rows of the image.
     */
    size_t height;
    /**
     * One of linpred_variance.
     */
    int32_t variance;
    /**
     * One of linpred_feature.
     */
    int32_t normal;
    /**
     * One of linpred_feature.
     */
    int32_t albedo;
    /**
     * One of linpred_feature.
     */
    int32_t depth;
    /**
     * 1 if there is an alpha, 0 to 1, by which the colour is premultiplied.
     */
    int32_t alpha;
    /**
     * More layers of radiance, denoised with the models of the colour: up to 1024.
     */
    uint32_t layers;
    /**
     * Other channels that are no light, denoised likewise: up to 1024.
     */
    uint32_t scalars;
    /**
     * Which of `further` have the variance of their mean, feature i by the bit 1 << i.
     */
    uint32_t further_with_variance;
    /**
     * Features beside those that light may follow (positions in the world, roughness, what another denoiser made): of
     * each its channels, 1 to 3 and 6 in all; 0 behind the last.
     */
    uint32_t further[6];
} linpred_layout;

/**
 * A row to be filled. Every plane has `width` floats; planes that the layout does not ask for are NULL. What they
 * hold before is left over from other rows. The library makes and sizes it: a newer one may have more members
 * behind.
 */
typedef struct linpred_input_row {
    /**
     * Bytes of what the library filled in.
     */
    size_t struct_size;
    /**
     * Which row, from the top.
     */
    size_t y;
    /**
     * Pixels of a row.
     */
    size_t width;
    /**
     * Mean radiance, red green blue.
     */
    float *colour[3];
    /**
     * What the layout says; below 0 or not finite: not known.
     */
    float *variance[3];
    /**
     * Surface normal.
     */
    float *normal[3];
    /**
     * The variance of its mean.
     */
    float *normal_variance[3];
    /**
     * Surface albedo.
     */
    float *albedo[3];
    /**
     * The variance of its mean.
     */
    float *albedo_variance[3];
    /**
     * Distance from the camera.
     */
    float *depth;
    /**
     * The variance of its mean.
     */
    float *depth_variance;
    /**
     * Alpha, 0 to 1.
     */
    float *alpha;
    /**
     * Of layer i red, green and blue at 3 i, 3 i + 1, 3 i + 2.
     */
    float *const *layers;
    /**
     * Channels that are no light.
     */
    float *const *scalars;
    /**
     * The channels of the layout's `further` features, one after the other.
     */
    float *const *further;
    /**
     * The variances of their means; NULL for a channel whose variance is estimated.
     */
    float *const *further_variance;
} linpred_input_row;

/**
 * Fills a row; 0 says that it is filled, anything else ends the run with LINPRED_ERROR_CALLBACK. Must return: no
 * exception or longjmp may leave it.
 */
typedef int32_t (*linpred_read_row_function)(void *user, const struct linpred_input_row *row);

/**
 * A denoised row. Every plane has `width` floats; planes that the layout does not ask for are NULL. The library
 * makes and sizes it: a newer one may have more members behind.
 */
typedef struct linpred_output_row {
    /**
     * Bytes of what the library filled in.
     */
    size_t struct_size;
    /**
     * Which row, from the top.
     */
    size_t y;
    /**
     * Pixels of a row.
     */
    size_t width;
    /**
     * Denoised radiance, red green blue; always finite.
     */
    const float *colour[3];
    /**
     * Estimated mean squared error of the denoised radiance, mean over the channels.
     */
    const float *error;
    /**
     * Half-width of the prediction windows that predicted the pixel, weighted mean, 0 to 9 pixels.
     */
    const float *radius;
    /**
     * Local rank of those models, weighted mean, 0 to 9, or to 15 with further features.
     */
    const float *rank;
    /**
     * Denoised alpha, 0 to 1.
     */
    const float *alpha;
    /**
     * Of layer i red, green and blue at 3 i, 3 i + 1, 3 i + 2.
     */
    const float *const *layers;
    /**
     * Denoised channels that are no light.
     */
    const float *const *scalars;
} linpred_output_row;

/**
 * Takes a denoised row; 0 says that it is taken, anything else ends the run with LINPRED_ERROR_CALLBACK. Must
 * return: no exception or longjmp may leave it.
 */
typedef int32_t (*linpred_write_row_function)(void *user, const struct linpred_output_row *row);

/**
 * Whom to ask for rows and whom to give them. LINPRED_ROW_FUNCTIONS_INIT sets the size.
 */
typedef struct linpred_row_functions {
    /**
     * sizeof(linpred_row_functions).
     */
    size_t struct_size;
    /**
     * What the functions are given.
     */
    void *user;
    /**
     * Is asked for every row, once, from top to bottom. The row is lent for the call.
     */
    linpred_read_row_function read_row;
    /**
     * Is given every row, once, from top to bottom. The row is lent for the call.
     */
    linpred_write_row_function write_row;
} linpred_row_functions;

/**
 * What comes next. LINPRED_STEP_INIT sets the size.
 */
typedef struct linpred_step {
    /**
     * sizeof(linpred_step).
     */
    size_t struct_size;
    /**
     * One of linpred_step_kind.
     */
    int32_t kind;
    /**
     * 0.
     */
    uint32_t reserved;
    /**
     * A row to be filled, until the next call with the denoiser; else NULL.
     */
    const struct linpred_input_row *wanted;
    /**
     * A denoised row, until the next call with the denoiser; else NULL.
     */
    const struct linpred_output_row *denoised;
} linpred_step;

/**
 * What else there is to say of a file. LINPRED_FILE_OPTIONS_INIT sets the size and every default; 0 is the default
 * of each member.
 */
typedef struct linpred_file_options {
    /**
     * sizeof(linpred_file_options).
     */
    size_t struct_size;
    /**
     * The path of the image from the other half of the samples, if the input is from one half; else NULL.
     */
    const char *other_half;
    /**
     * 1 writes the estimated squared error of each pixel beside the colour.
     */
    int32_t error_layer;
    /**
     * 1 writes radius and rank of the models beside the colour.
     */
    int32_t models_layer;
    /**
     * How many samples each pixel has, whatever the file says; 0 leaves it to the file.
     */
    uint32_t samples_per_pixel;
    /**
     * How many strings `features` has.
     */
    uint32_t feature_count;
    /**
     * If the image is a frame of a sequence, paths of `before_count` frames before it that help, so that it does not
     * flicker: the nearest first, at most 8. One that does not exist or cannot help is warned of and left out, with
     * those beyond it. May be NULL if the count is 0; without a frame on either side the image is denoised alone.
     */
    const char *const *before;
    /**
     * Likewise those after it.
     */
    const char *const *after;
    /**
     * How many paths `before` has.
     */
    uint32_t before_count;
    /**
     * How many paths `after` has.
     */
    uint32_t after_count;
    /**
     * Features beside normal, albedo and depth that light may follow, `feature_count` strings as the command's
     * --feature has them: a layer or channel, "P", "P:X,Z" for some of its channels, "P=PVariance" where its variance
     * has a name of its own; or "auto" for those that the renderer is known to write. 1 to 3 channels each, 6 in all.
     * May be NULL if the count is 0.
     */
    const char *const *features;
    /**
     * How what is denoised is stored, as the command's --compression has it: "keep", "zip", "zips", "rle", "piz",
     * "dwaa" or "none". NULL is "keep": as in the input, but with zip where that would lose data of what is added or
     * kept.
     */
    const char *compression;
} linpred_file_options;

/**
 * What a map of samples is to reach: one of the two, or as little as one of them asks for. LINPRED_SAMPLE_GOAL_INIT
 * sets the size.
 */
typedef struct linpred_sample_goal {
    /**
     * sizeof(linpred_sample_goal).
     */
    size_t struct_size;
    /**
     * So many samples more for each pixel, on average: above 0, up to 2^24. The map sums up to it, rounded. 0 sets no
     * bound.
     */
    double budget;
    /**
     * As few samples as it takes until `error_then` of the summary is so small, such as 0.005. 0 sets no target.
     */
    double target_error;
} linpred_sample_goal;

/**
 * What a map of samples gives, and what for. LINPRED_SAMPLE_SUMMARY_INIT sets the size.
 */
typedef struct linpred_sample_summary {
    /**
     * sizeof(linpred_sample_summary).
     */
    size_t struct_size;
    /**
     * Pixels of the image.
     */
    uint64_t pixels;
    /**
     * Samples that they have together.
     */
    uint64_t samples;
    /**
     * Samples that the map gives them together; 0 if the error is as small as it should be already.
     */
    uint64_t added;
    /**
     * The most that one of them gets.
     */
    uint32_t most;
    /**
     * 0.
     */
    uint32_t reserved;
    /**
     * The predicted error of the denoised image: mean over the pixels of the estimated squared error over the mean
     * square of the colour and 0.003.
     */
    double error;
    /**
     * The same once the map is rendered.
     */
    double error_then;
} linpred_sample_summary;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

/**
 * A sentence for a code, in English, which stays where it is; what exactly went wrong says linpred_message(). Any
 * number is allowed.
 */
const char *linpred_status_text(int32_t status);

/**
 * The version of the library, such as "0.1.0".
 */
const char *linpred_version(void);

/**
 * A new denoiser, to be freed by linpred_free(). Never NULL.
 */
struct linpred_denoiser *linpred_new(void);

/**
 * Frees a denoiser and sets the caller's pointer to NULL, so that another call with it is told. A run that was begun
 * is given up. Images are the caller's and stay as they are. LINPRED_ERROR_BUSY, and nothing is freed, while a call
 * is at work.
 *
 * # Safety
 * `denoiser` is NULL or points to NULL or to what linpred_new() gave; no copy of that pointer is used again.
 */
linpred_status linpred_free(struct linpred_denoiser **denoiser);

/**
 * What the last call with this denoiser has to say: what went wrong; after LINPRED_OK warnings, or "no error".
 * English, UTF-8, without a line break at the end. It stays where it is until the next call with the denoiser. With
 * NULL, or while another call is at work, the sentence of that code.
 *
 * # Safety
 * `denoiser` is NULL, or of linpred_new() and not freed.
 */
const char *linpred_message(const struct linpred_denoiser *denoiser);

/**
 * Sets what to compute; NULL sets the defaults. They hold from the next run on.
 *
 * # Safety
 * `denoiser` is NULL, or of linpred_new() and not freed; `options` is NULL or can be read over its size.
 */
linpred_status linpred_set_options(struct linpred_denoiser *denoiser, const struct linpred_options *options);

/**
 * Has `function` told of every row that linpred_execute(), linpred_run_rows() and linpred_denoise_file() have
 * written, and of those that linpred_sample_map() and linpred_sample_map_file() have denoised, up to twice the image's;
 * NULL tells nobody.
 *
 * # Safety
 * `denoiser` is NULL, or of linpred_new() and not freed; `function` can be called with `user` until another is set.
 */
linpred_status linpred_set_progress(struct linpred_denoiser *denoiser, linpred_progress_function function, void *user);

/**
 * Fills in what the last run did that came to its end. LINPRED_ERROR_OPERATION if there is none.
 *
 * # Safety
 * `denoiser` is NULL, or of linpred_new() and not freed; `report` is NULL or can be written over its size.
 */
linpred_status linpred_get_report(struct linpred_denoiser *denoiser, struct linpred_report *report);

/**
 * Sets an image to be read. Its pixels are the caller's: nothing is copied, and linpred_execute() reads them. Pixel
 * x of row y begins at `data` + `byte_offset` + y * `row_stride` + x * `pixel_stride`, at any address; strides of 0
 * say that nothing lies between pixels or rows.
 *
 * Names of three channels: "colour" (or "color": linear radiance, the one that must be set), "variance" (of a
 * pixel's mean; below 0 or not finite: not known), or in its place "half_a" and "half_b" (the means of either half
 * of a pixel's samples), "normal", "albedo", "layer.NAME" (more radiance, denoised with the models of the colour),
 * "normal_variance", "albedo_variance". Of one channel: "depth", "depth_variance", "alpha" (0 to 1, the colour is
 * premultiplied), "samples" (how many a pixel has, for linpred_sample_map()), "scalar.NAME" (what is no light: masks,
 * motion). Of one channel or three, as the format says: "feature.NAME" (what else light may follow: positions in the
 * world, roughness, what another denoiser made; all have 6 channels at most), "feature_variance.NAME" (of its mean;
 * estimated if it is not set). Pixels of the colour that are not finite are predicted from their neighbours, and
 * counted in the report.
 *
 * # Safety
 * `denoiser` is NULL, or of linpred_new() and not freed; `name` is NULL or ends with a zero. The pixels can be read,
 * and nobody else writes them, in every linpred_execute() and linpred_sample_map() until the image is set anew or
 * unset.
 */
linpred_status linpred_set_image(struct linpred_denoiser *denoiser,
                                 const char *name,
                                 const void *data,
                                 int32_t format,
                                 size_t width,
                                 size_t height,
                                 size_t byte_offset,
                                 size_t pixel_stride,
                                 size_t row_stride);

/**
 * Sets where a result goes; arguments as for linpred_set_image(). It may be the memory of an image that is read:
 * with the same strides and the same start, or elsewhere in the same pixels, since a row is written once those up to
 * it have been read. Half formats hold up to 65504: what is beyond becomes that and is counted in the report.
 *
 * Names of three channels: "colour" (or "color", "output"), "layer.NAME". Of one channel: "alpha", "scalar.NAME",
 * "error" (estimated mean squared error of the pixel, mean over the channels), "radius" and "rank" (of the models
 * behind it). Layers, scalars and alpha need images of the same names.
 *
 * # Safety
 * `denoiser` is NULL, or of linpred_new() and not freed; `name` is NULL or ends with a zero. The pixels can be
 * written, and nobody else uses them, in every linpred_execute() until the output is set anew or unset.
 */
linpred_status linpred_set_output(struct linpred_denoiser *denoiser,
                                  const char *name,
                                  void *data,
                                  int32_t format,
                                  size_t width,
                                  size_t height,
                                  size_t byte_offset,
                                  size_t pixel_stride,
                                  size_t row_stride);

/**
 * Takes back linpred_set_image(). An image that was not set is no error.
 *
 * # Safety
 * `denoiser` is NULL, or of linpred_new() and not freed; `name` is NULL or ends with a zero.
 */
linpred_status linpred_unset_image(struct linpred_denoiser *denoiser, const char *name);

/**
 * Takes back linpred_set_output(). An output that was not set is no error.
 *
 * # Safety
 * `denoiser` is NULL, or of linpred_new() and not freed; `name` is NULL or ends with a zero.
 */
linpred_status linpred_unset_output(struct linpred_denoiser *denoiser, const char *name);

/**
 * Denoises the images into the outputs, and returns when that is done. All images have the size of the colour. It
 * can be called again: with the same images, whose pixels may have changed, or with others. After a failure on the
 * way outputs hold rows of either kind.
 *
 * # Safety
 * `denoiser` is NULL, or of linpred_new() and not freed; what the images and outputs were set to is there, as
 * linpred_set_image() and linpred_set_output() say.
 */
linpred_status linpred_execute(struct linpred_denoiser *denoiser);

/**
 * Denoises an image whose rows come from a function and go to another, for images larger than memory: no more than
 * some 100 rows are in memory. The functions are called in this thread.
 *
 * # Safety
 * `denoiser` is NULL, or of linpred_new() and not freed; `layout` and `functions` are NULL or can be read over their
 * sizes. The functions can be called with `user`, and write nothing beyond the planes of a row.
 */
linpred_status linpred_run_rows(struct linpred_denoiser *denoiser,
                                const struct linpred_layout *layout,
                                const struct linpred_row_functions *functions);

/**
 * Begins a run that a loop of the caller's takes step by step, for images larger than memory or rows that become
 * ready in their own time: no more than some 100 rows are in memory. The options that are set now hold.
 *
 * # Safety
 * `denoiser` is NULL, or of linpred_new() and not freed; `layout` is NULL or can be read over its size.
 */
linpred_status linpred_start_rows(struct linpred_denoiser *denoiser, const struct linpred_layout *layout);

/**
 * Goes on to the next step: a row that was wanted is taken now, as it was filled. Rows are wanted from top to
 * bottom, each once, and come out so some 90 rows later. The run ends with LINPRED_STEP_DONE, or with a failure.
 *
 * # Safety
 * `denoiser` is NULL, or of linpred_new() and not freed; `step` is NULL or can be written over its size. Nothing is
 * written beyond the planes of a wanted row.
 */
linpred_status linpred_next_step(struct linpred_denoiser *denoiser, struct linpred_step *step);

/**
 * Gives up a run that linpred_start_rows() began, if there is one.
 *
 * # Safety
 * `denoiser` is NULL, or of linpred_new() and not freed.
 */
linpred_status linpred_stop_rows(struct linpred_denoiser *denoiser);

/**
 * Denoises an EXR file into another, as the command `linpred denoise` does; `options` may be NULL. The output
 * appears whole or not at all. After LINPRED_OK linpred_message() has the warnings about the input, a line each, or
 * "no error". Paths are the system's bytes, on Windows UTF-8.
 *
 * # Safety
 * `denoiser` is NULL, or of linpred_new() and not freed; paths are NULL or end with a zero; `options` is NULL or can
 * be read over its size, and its lists over their counts.
 */
linpred_status linpred_denoise_file(struct linpred_denoiser *denoiser,
                                    const char *input,
                                    const char *output,
                                    const struct linpred_file_options *options);

/**
 * Makes the map of samples of an EXR file into another, as the command `linpred sample-map` does: its channel
 * "samples" says how many more each pixel should get. The file states how many samples its pixels have, or
 * `samples_per_pixel` of the options does, which have no layers for a map; `options` and `summary` may be NULL. The
 * output appears whole or not at all. After LINPRED_OK linpred_message() has the warnings about the input, a line
 * each, or "no error". Paths are the system's bytes, on Windows UTF-8.
 *
 * # Safety
 * `denoiser` is NULL, or of linpred_new() and not freed; paths are NULL or end with a zero; `goal`, `options` and
 * `summary` are NULL or can be read, `summary` also written, over their sizes.
 */
linpred_status linpred_sample_map_file(struct linpred_denoiser *denoiser,
                                       const char *input,
                                       const char *output,
                                       const struct linpred_sample_goal *goal,
                                       const struct linpred_file_options *options,
                                       struct linpred_sample_summary *summary);

/**
 * Fills `map` with the samples that each pixel should get next, so that the denoised image is best for what they
 * cost. The images are those of linpred_execute(), and "samples" must be one of them; outputs, layers and scalars play
 * no part. With "variance" or halves the map is better: the images are denoised twice.
 *
 * Pixel x of row y of the map is the uint32_t at `map` + `byte_offset` + y * `row_stride` + x * `pixel_stride`, in
 * bytes, at any address; strides of 0 say that nothing lies between. It has the size of the colour, and may be the
 * memory of any image: it is written once all is read, and after a failure it is as it was. `summary` may be NULL.
 * If the target is met already, the map is all 0, and so is `added` of the summary; that is no error.
 *
 * Beside what a run takes, up to 64 bytes of memory for each pixel.
 *
 * # Safety
 * `denoiser` is NULL, or of linpred_new() and not freed; what the images were set to is there, as
 * linpred_set_image() says; `goal` and `summary` are NULL or can be read, `summary` also written, over their sizes;
 * `map` is NULL, or its pixels can be written, and nobody else uses them.
 */
linpred_status linpred_sample_map(struct linpred_denoiser *denoiser,
                                  const struct linpred_sample_goal *goal,
                                  uint32_t *map,
                                  size_t width,
                                  size_t height,
                                  size_t byte_offset,
                                  size_t pixel_stride,
                                  size_t row_stride,
                                  struct linpred_sample_summary *summary);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* LINPRED_H */
