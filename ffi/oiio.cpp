// The body of oiio.h. Compiles against OpenImageIO 2.4 and later.

#include "oiio.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <memory>
#include <string>

#include <OpenImageIO/imagebuf.h>
#include <OpenImageIO/imagebufalgo.h>
#include <OpenImageIO/imageio.h>
#include <OpenImageIO/texture.h>

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
        const auto format = sample == YARNRAY_OIIO_U8 ? OIIO::TypeDesc::UINT8 : OIIO::TypeDesc::FLOAT;
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

// --- textures ---

namespace {

#if OIIO_VERSION >= OIIO_MAKE_VERSION(3, 0, 0)
using SharedSystem = std::shared_ptr<OIIO::TextureSystem>;
SharedSystem make_system() { return OIIO::TextureSystem::create(true); }
#else
using SharedSystem = OIIO::TextureSystem *;
SharedSystem make_system() { return OIIO::TextureSystem::create(true); }
#endif

// One for the process, never destroyed: threads may still look textures up when it ends.
OIIO::TextureSystem &textures() {
    static SharedSystem *const shared = [] {
        auto *system = new SharedSystem(make_system());
        (*system)->attribute("max_memory_MB", 1024.0f);
        return system;
    }();
    return **shared;
}

float linear(float x) { return x <= 0.04045f ? x / 12.92f : std::pow((x + 0.055f) / 1.055f, 2.4f); }

// A copy that the texture system can filter: three linear channels in tiles, with all smaller levels. What is transparent
// is white there: a texture multiplies, and leaves as it is what nobody has drawn on.
bool make_texture(const std::string &path, const std::string &copy, std::string &why) {
    OIIO::ImageSpec as_stored;
    as_stored.attribute("oiio:UnassociatedAlpha", 1);
    OIIO::ImageBuf picture(path, 0, 0, nullptr, &as_stored);
    if (!picture.read(0, 0, true, OIIO::TypeDesc::FLOAT)) {
        why = reason(picture.geterror(), "the pixels cannot be read");
        return false;
    }
    const bool encoded = is_srgb_encoded(picture.nativespec());
    const int alpha = picture.spec().alpha_channel;
    const bool associated = !picture.spec().get_int_attribute("oiio:UnassociatedAlpha");
    const bool grey = picture.nchannels() < 3;
    const int order[3] = {0, grey ? 0 : 1, grey ? 0 : 2};
    OIIO::ImageBuf colours = OIIO::ImageBufAlgo::channels(picture, 3, order, {}, {"R", "G", "B"});
    OIIO::ImageBuf::ConstIterator<float> stored(picture);
    for (OIIO::ImageBuf::Iterator<float> pixel(colours); !pixel.done(); ++pixel, ++stored) {
        const float cover = alpha < 0 ? 1.0f : std::min(std::max(float(stored[alpha]), 0.0f), 1.0f);
        for (int c = 0; c < 3; ++c) {
            const float value = encoded ? linear(pixel[c]) : float(pixel[c]);
            const float own = std::isfinite(value) ? value : 0.0f;
            pixel[c] = (associated ? own : own * cover) + (1.0f - cover);
        }
    }
    OIIO::ImageSpec config;
    config.format = OIIO::TypeDesc::HALF;
    config.attribute("oiio:ColorSpace", "Linear");
    // Not "box", which drops rows of levels whose size is odd.
    config.attribute("maketx:filtername", "triangle");
    if (!OIIO::ImageBufAlgo::make_texture(OIIO::ImageBufAlgo::MakeTxTexture, colours, copy, config)) {
        why = reason(OIIO::geterror(), "no texture can be made of it");
        return false;
    }
    return true;
}

} // namespace

struct YarnrayOiioTexture {
    OIIO::ustring file;
    OIIO::TextureSystem::TextureHandle *handle;
};

FACE int32_t yarnray_oiio_texture_open(const char *path, const char *copy, uint64_t sample_limit,
                                       YarnrayOiioTexture **texture, int32_t size[2], char *message,
                                       size_t message_size) {
    return guarded(message, message_size, [&]() -> int32_t {
        std::string file(path), why;
        auto input = OIIO::ImageInput::open(file);
        if (!input) {
            say(message, message_size, reason(OIIO::geterror(), "no reader knows this format"));
            return YARNRAY_OIIO_FAILED;
        }
        const OIIO::ImageSpec spec = input->spec();
        if (spec.deep || spec.depth > 1 || spec.width <= 0 || spec.height <= 0 || spec.nchannels <= 0) {
            say(message, message_size, "only flat pictures can be textures: no deep or volume image, no empty one");
            return YARNRAY_OIIO_FAILED;
        }
        const bool levels = input->seek_subimage(0, 1);
        input->close();
        OIIO::geterror(); // a file without a second level is no error
        const bool ready = levels && spec.tile_width > 0 && spec.nchannels >= 3 && spec.alpha_channel < 0
                           && !is_srgb_encoded(spec);
        if (!ready) {
            // All of it is read at once, as floats.
            if (uint64_t(spec.width) * uint64_t(spec.height) > sample_limit / uint64_t(spec.nchannels)) {
                say(message, message_size, "too large to be read at once: make tiles and smaller levels of it with maketx");
                return YARNRAY_OIIO_FAILED;
            }
            if (!make_texture(file, copy, why)) {
                say(message, message_size, why);
                return YARNRAY_OIIO_FAILED;
            }
            file = copy;
        }
        const OIIO::ustring name(file);
        auto *handle = textures().get_texture_handle(name);
        if (!handle || !textures().good(handle)) {
            say(message, message_size, reason(textures().geterror(), "the texture cannot be opened"));
            return YARNRAY_OIIO_FAILED;
        }
        size[0] = spec.width;
        size[1] = spec.height;
        *texture = new YarnrayOiioTexture{name, handle};
        return YARNRAY_OIIO_DONE;
    });
}

FACE int32_t yarnray_oiio_texture_sample(const YarnrayOiioTexture *texture, float u, float v, float width,
                                         float rgb[3]) {
    try {
        OIIO::TextureOpt options;
        options.swrap = options.twrap = OIIO::TextureOpt::WrapPeriodic;
        options.interpmode = OIIO::TextureOpt::InterpBilinear;
        // Rows run from the top.
        return textures().texture(texture->handle, nullptr, options, u, 1.0f - v, width, 0.0f, 0.0f, width, 3, rgb);
    } catch (...) {
        return 0;
    }
}

FACE void yarnray_oiio_texture_close(YarnrayOiioTexture *texture) {
    try {
        textures().invalidate(texture->file, true);
        delete texture;
    } catch (...) {
    }
}

FACE int64_t yarnray_oiio_texture_bytes(void) {
    try {
        long long bytes = 0;
        textures().getattribute("stat:cache_memory_used", OIIO::TypeDesc::INT64, &bytes);
        return bytes;
    } catch (...) {
        return 0;
    }
}
