// The body of oiio.h. Compiles against OpenImageIO 2.4 and later.

#include "oiio.h"

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <memory>
#include <string>

#include <OpenImageIO/imageio.h>

#define FACE extern "C" __attribute__((visibility("default")))

namespace {

void say(char *message, size_t size, const std::string &text) {
    if (message && size > 0) std::snprintf(message, size, "%s", text.c_str());
}

// OpenImageIO starts one thread per core when it first has work to share. The renderer has its own threads and
// reads a few images, one after another; two threads keep decoding quick without another crowd on the machine.
void prepare() {
    static const bool ready = [] {
        OIIO::attribute("threads", 2);
        OIIO::attribute("exr_threads", 2);
        return true;
    }();
    (void)ready;
}

// Runs the body; an exception becomes the failure code and its message.
template<class Body> int32_t guarded(char *message, size_t size, Body body) noexcept {
    try {
        prepare();
        return body();
    } catch (const std::exception &error) {
        say(message, size, error.what());
    } catch (...) {
        say(message, size, "unknown C++ exception");
    }
    return YARNRAY_OIIO_FAILED;
}

std::string reason(std::string text, const char *otherwise) {
    while (!text.empty() && (text.back() == '\n' || text.back() == ' ')) text.pop_back();
    return text.empty() ? otherwise : text;
}

// Integer samples carry the sRGB curve unless the file says that they are linear.
bool is_srgb_encoded(const OIIO::ImageSpec &spec) {
    if (spec.format.is_floating_point()) return false;
    const std::string space(spec.get_string_attribute("oiio:ColorSpace", "sRGB"));
    return space.compare(0, 3, "lin") != 0 && space.compare(0, 3, "Lin") != 0 && space != "scene_linear";
}

} // namespace

FACE int32_t yarnray_oiio_version(void) {
    try {
        return OIIO::openimageio_version();
    } catch (...) {
        return 0;
    }
}

FACE int32_t yarnray_oiio_can_write(const char *path) {
    try {
        const bool known = OIIO::ImageOutput::create(std::string(path)) != nullptr;
        OIIO::geterror(); // an unread error is printed when the process ends
        return known;
    } catch (...) {
        return 0;
    }
}

FACE int32_t yarnray_oiio_read(const char *path, uint64_t sample_limit, YarnrayOiioImage *image, char *message,
                               size_t message_size) {
    std::memset(image, 0, sizeof *image);
    const int32_t code = guarded(message, message_size, [&]() -> int32_t {
        auto input = OIIO::ImageInput::open(std::string(path));
        if (!input) {
            say(message, message_size, reason(OIIO::geterror(), "no reader knows this format"));
            return YARNRAY_OIIO_FAILED;
        }
        const OIIO::ImageSpec spec = input->spec();
        if (spec.deep || spec.depth > 1 || spec.width <= 0 || spec.height <= 0 || spec.nchannels <= 0) {
            say(message, message_size, "only flat pictures can be read: no deep or volume image, no empty one");
            return YARNRAY_OIIO_FAILED;
        }
        image->width = spec.width;
        image->height = spec.height;
        image->channels = spec.nchannels;
        // Each factor is below 2^31, so this product fits; the next one is checked by division.
        const uint64_t pixels = uint64_t(spec.width) * uint64_t(spec.height);
        if (pixels > sample_limit / uint64_t(spec.nchannels)) {
            say(message, message_size, "too large");
            return YARNRAY_OIIO_TOO_LARGE;
        }
        image->x = spec.x - spec.full_x;
        image->y = spec.y - spec.full_y;
        image->display_width = spec.full_width;
        image->display_height = spec.full_height;
        image->alpha_channel = spec.alpha_channel;
        image->srgb_encoded = is_srgb_encoded(spec);

        std::string names;
        for (int channel = 0; channel < spec.nchannels; ++channel) {
            const bool named = size_t(channel) < spec.channelnames.size();
            names += named ? spec.channelnames[size_t(channel)].c_str() : "";
            names.push_back('\0');
        }
        image->names = static_cast<char *>(std::malloc(names.size()));
        // Zeros, so that what a damaged file leaves out is not what this process had in memory before.
        image->data = static_cast<float *>(std::calloc(size_t(pixels) * size_t(spec.nchannels), sizeof(float)));
        if (!image->names || !image->data) {
            say(message, message_size, "out of memory");
            return YARNRAY_OIIO_FAILED;
        }
        std::memcpy(image->names, names.data(), names.size());
        image->names_size = names.size();
        if (!input->read_image(0, 0, 0, spec.nchannels, OIIO::TypeDesc::FLOAT, image->data)) {
            say(message, message_size, reason(input->geterror(), "the pixels cannot be read"));
            return YARNRAY_OIIO_FAILED;
        }
        input->close();
        return YARNRAY_OIIO_DONE;
    });
    if (code != YARNRAY_OIIO_DONE) {
        const int32_t width = image->width, height = image->height, channels = image->channels;
        yarnray_oiio_free(image);
        image->width = width, image->height = height, image->channels = channels;
    }
    return code;
}

FACE void yarnray_oiio_free(YarnrayOiioImage *image) {
    std::free(image->names);
    std::free(image->data);
    std::memset(image, 0, sizeof *image);
}

FACE int32_t yarnray_oiio_write(const char *path, int32_t width, int32_t height, int32_t channels, const float *data,
                                int32_t sample, char *message, size_t message_size) {
    return guarded(message, message_size, [&]() -> int32_t {
        auto output = OIIO::ImageOutput::create(std::string(path));
        if (!output) {
            say(message, message_size, reason(OIIO::geterror(), "no writer knows this format"));
            return YARNRAY_OIIO_FAILED;
        }
        const auto format = sample == YARNRAY_OIIO_U8     ? OIIO::TypeDesc::UINT8
                            : sample == YARNRAY_OIIO_HALF ? OIIO::TypeDesc::HALF
                                                          : OIIO::TypeDesc::FLOAT;
        OIIO::ImageSpec spec(width, height, channels, format);
        spec.attribute("oiio:ColorSpace", sample == YARNRAY_OIIO_U8 ? "sRGB" : "Linear");
        spec.attribute("CompressionQuality", 95); // the JPEG default of 75 shows its blocks in fine yarn
        if (!output->open(std::string(path), spec) || !output->write_image(OIIO::TypeDesc::FLOAT, data)
            || !output->close()) {
            say(message, message_size, reason(output->geterror(), "the pixels cannot be written"));
            return YARNRAY_OIIO_FAILED;
        }
        return YARNRAY_OIIO_DONE;
    });
}
