// linpred, a Monte Carlo render denoiser: linpred.h for C++11, with exceptions for codes. MIT or Apache-2.0, at your choice.
#ifndef LINPRED_HPP
#define LINPRED_HPP

#include <cstddef>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <utility>

#include "linpred.h"

namespace linpred {

/// What a call failed with.
class Error : public std::runtime_error {
public:
    Error(linpred_status status, const char *message) : std::runtime_error(message), code(status) {}

    linpred_status status() const noexcept { return code; }

private:
    linpred_status code;
};

/// A denoiser. What is called here is called there by the name that it has in linpred.h, and throws an Error for a code. The rest of linpred.h takes get().
class Denoiser {
public:
    Denoiser() : handle(linpred_new()) {}
    ~Denoiser() { linpred_free(&handle); }
    Denoiser(Denoiser &&other) noexcept : handle(other.handle) { other.handle = nullptr; }
    Denoiser &operator=(Denoiser &&other) noexcept
    {
        std::swap(handle, other.handle);
        return *this;
    }
    Denoiser(const Denoiser &) = delete;
    Denoiser &operator=(const Denoiser &) = delete;

    linpred_denoiser *get() const noexcept { return handle; }

    void setOptions(const linpred_options &options) { check(linpred_set_options(handle, &options)); }

    void setImage(const char *name, const void *data, linpred_format format, std::size_t width, std::size_t height,
                  std::size_t byteOffset = 0, std::size_t pixelStride = 0, std::size_t rowStride = 0)
    {
        check(linpred_set_image(handle, name, data, format, width, height, byteOffset, pixelStride, rowStride));
    }

    void setOutput(const char *name, void *data, linpred_format format, std::size_t width, std::size_t height,
                   std::size_t byteOffset = 0, std::size_t pixelStride = 0, std::size_t rowStride = 0)
    {
        check(linpred_set_output(handle, name, data, format, width, height, byteOffset, pixelStride, rowStride));
    }

    void setProgress(linpred_progress_function function, void *user)
    {
        check(linpred_set_progress(handle, function, user));
    }

    void execute() { check(linpred_execute(handle)); }

    /// Fills `map`, of the colour's size, with the samples that each pixel should get next, and returns what it gives.
    linpred_sample_summary sampleMap(const linpred_sample_goal &goal, std::uint32_t *map, std::size_t width,
                                     std::size_t height, std::size_t byteOffset = 0, std::size_t pixelStride = 0,
                                     std::size_t rowStride = 0)
    {
        linpred_sample_summary summary = LINPRED_SAMPLE_SUMMARY_INIT;
        check(linpred_sample_map(handle, &goal, map, width, height, byteOffset, pixelStride, rowStride, &summary));
        return summary;
    }

    linpred_sample_summary sampleMapFile(const std::string &input, const std::string &output,
                                         const linpred_sample_goal &goal)
    {
        linpred_sample_summary summary = LINPRED_SAMPLE_SUMMARY_INIT;
        check(linpred_sample_map_file(handle, input.c_str(), output.c_str(), &goal, nullptr, &summary));
        return summary;
    }

    void denoiseFile(const std::string &input, const std::string &output)
    {
        check(linpred_denoise_file(handle, input.c_str(), output.c_str(), nullptr));
    }

    linpred_report report() const
    {
        linpred_report report = LINPRED_REPORT_INIT;
        check(linpred_get_report(handle, &report));
        return report;
    }

    /// Throws what another call of linpred.h returned, with the message of this denoiser.
    void check(linpred_status status) const
    {
        if (status != LINPRED_OK) {
            throw Error(status, linpred_message(handle));
        }
    }

private:
    linpred_denoiser *handle;
};

} // namespace linpred

#endif
