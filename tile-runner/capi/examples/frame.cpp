// The same from C++, in place: the clean pixels replace the noisy ones.
#include <cinttypes>
#include <cstddef>
#include <cstdio>
#include <exception>
#include <vector>

#include <linpred.hpp>

#include "scene.h" // stands for the renderer

int main()
{
    const std::size_t width = SCENE_WIDTH, height = SCENE_HEIGHT;
    std::vector<float> colour, variance, albedo, normal, depth;
    for (std::uint32_t y = 0; y < height; ++y) {
        for (std::uint32_t x = 0; x < width; ++x) {
            const scene_pixel pixel = scene_render(x, y);
            colour.insert(colour.end(), pixel.colour, pixel.colour + 3);
            variance.insert(variance.end(), pixel.variance, pixel.variance + 3);
            albedo.insert(albedo.end(), pixel.albedo, pixel.albedo + 3);
            normal.insert(normal.end(), pixel.normal, pixel.normal + 3);
            depth.push_back(pixel.depth);
        }
    }
    try {
        linpred_options options = LINPRED_OPTIONS_INIT;
        options.quality = LINPRED_QUALITY_HIGH;
        linpred::Denoiser denoiser;
        denoiser.setOptions(options);
        denoiser.setImage("colour", colour.data(), LINPRED_FORMAT_FLOAT3, width, height);
        denoiser.setImage("variance", variance.data(), LINPRED_FORMAT_FLOAT3, width, height);
        denoiser.setImage("albedo", albedo.data(), LINPRED_FORMAT_FLOAT3, width, height);
        denoiser.setImage("normal", normal.data(), LINPRED_FORMAT_FLOAT3, width, height);
        denoiser.setImage("depth", depth.data(), LINPRED_FORMAT_FLOAT, width, height);
        denoiser.setOutput("colour", colour.data(), LINPRED_FORMAT_FLOAT3, width, height);
        denoiser.execute();
        std::fprintf(stderr, "%" PRIu64 " models\n", denoiser.report().models);
    } catch (const std::exception &error) {
        std::fprintf(stderr, "linpred: %s\n", error.what());
        return 1;
    }
    std::printf("%016" PRIx64 "\n", scene_checksum(SCENE_CHECKSUM, colour.data(), colour.size()));
}
