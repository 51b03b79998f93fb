/* The plain C face of OpenImageIO: all that yarnray asks of it, and nothing of C++.
 *
 * Every function that can fail returns one of the codes below and, unless it is YARNRAY_OIIO_DONE, puts a message
 * that ends in NUL into `message` (`message_size` bytes, cut if longer). No C++ exception leaves.
 * Rows run from the top of the picture to the bottom, pixels from left to right, the channels of a pixel together. */
#ifndef YARNRAY_OIIO_H
#define YARNRAY_OIIO_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define YARNRAY_OIIO_DONE 0
#define YARNRAY_OIIO_FAILED 1
#define YARNRAY_OIIO_TOO_LARGE 2

#define YARNRAY_OIIO_U8 0
#define YARNRAY_OIIO_FLOAT 1

typedef struct YarnrayOiioImage {
    int32_t width, height, channels;
    int32_t x, y;                          /* first pixel, seen from the corner of the display window */
    int32_t display_width, display_height; /* pixels */
    int32_t alpha_channel;                 /* -1: none; colours are associated with it */
    int32_t srgb_encoded;                  /* 1: integer samples that still carry the sRGB curve */
    size_t names_size;                     /* bytes in `names` */
    char *names;                           /* one name per channel, each ended by NUL */
    float *data;                           /* width x height x channels */
} YarnrayOiioImage;

/* The version of the library that is loaded: major x 10000 + minor x 100 + patch. */
int32_t yarnray_oiio_version(void);

/* 1 if a file with this name's extension could be written, else 0. Opens nothing. */
int32_t yarnray_oiio_can_write(const char *path);

/* Reads the first image of a file. Nothing is allocated for pixels if there are more than `sample_limit` samples;
 * then width, height and channels are set all the same. What it allocates, yarnray_oiio_free releases. */
int32_t yarnray_oiio_read(const char *path, uint64_t sample_limit, YarnrayOiioImage *image, char *message,
                          size_t message_size);

/* Releases what yarnray_oiio_read put into `image`. Harmless on an image of zeros. */
void yarnray_oiio_free(YarnrayOiioImage *image);

/* Writes width x height x channels floats in the format that the extension names, as samples of kind `sample`
 * (YARNRAY_OIIO_U8: 0 to 1 become 0 to 255). A failed write may leave a damaged file behind. */
int32_t yarnray_oiio_write(const char *path, int32_t width, int32_t height, int32_t channels, const float *data,
                           int32_t sample, char *message, size_t message_size);

/* A texture: a file in OpenImageIO's cache, tiled and with smaller and smaller copies of itself, linear, red green blue. */
typedef struct YarnrayOiioTexture YarnrayOiioTexture;

/* Opens a texture. A file that is no mipmapped, tiled picture of linear colours is made into one, in the file `copy`,
 * which must stay until the texture is closed, unless it has more than `sample_limit` samples. `size` gets width and height. */
int32_t yarnray_oiio_texture_open(const char *path, const char *copy, uint64_t sample_limit,
                                  YarnrayOiioTexture **texture, int32_t size[2], char *message, size_t message_size);

/* The colour at (u, v), of which (0, 0) is the lower left corner and the picture repeats beyond 0 to 1, filtered over
 * `width` in the same units. From any number of threads. 1 if it could be read, else 0. */
int32_t yarnray_oiio_texture_sample(const YarnrayOiioTexture *texture, float u, float v, float width, float rgb[3]);

/* Closes a texture. */
void yarnray_oiio_texture_close(YarnrayOiioTexture *texture);

/* Bytes of pixels that the cache of all textures holds now. */
int64_t yarnray_oiio_texture_bytes(void);

#ifdef __cplusplus
}
#endif

#endif
