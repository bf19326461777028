#include "core/png.h"

#include <csetjmp>
#include <cstdio>
#include <cstring>
#include <png.h>
#include <vector>

#include "core/check.h"

namespace hsi4d {
namespace {

/// libpng's objects and where it stands in the file. Its errors are jumps, so that functions with a setjmp hold plain
/// data only, and the jump passes no C++ object.
struct Decoder {
  std::span<const uint8_t> content;
  size_t position = 0;
  char error[256] = "out of memory";
  png_structp png = nullptr;
  png_infop info = nullptr;

  ~Decoder() { png_destroy_read_struct(&png, &info, nullptr); }
};

[[noreturn]] void on_error(png_structp png, png_const_charp message) {
  Decoder& decoder = *static_cast<Decoder*>(png_get_error_ptr(png));
  std::snprintf(decoder.error, sizeof(decoder.error), "%s", message);
  png_longjmp(png, 1);
}

// Wrong checksums of optional chunks and the like, which change no pixel.
void on_warning(png_structp, png_const_charp) {}

void on_read(png_structp png, png_bytep out, size_t count) {
  Decoder& decoder = *static_cast<Decoder*>(png_get_io_ptr(png));
  if (count > decoder.content.size() - decoder.position) png_error(png, "the file ends early");
  std::memcpy(out, decoder.content.data() + decoder.position, count);
  decoder.position += count;
}

bool read_header(Decoder& decoder) {
  decoder.png = png_create_read_struct(PNG_LIBPNG_VER_STRING, &decoder, on_error, on_warning);
  if (decoder.png == nullptr) return false;
  if (setjmp(png_jmpbuf(decoder.png)) != 0) return false;
  decoder.info = png_create_info_struct(decoder.png);
  if (decoder.info == nullptr) return false;
  png_set_read_fn(decoder.png, &decoder, on_read);
  // Our own limits have the better message.
  png_set_user_limits(decoder.png, PNG_UINT_31_MAX, PNG_UINT_31_MAX);
  // libpng takes a chunk's memory on its word, 8 MB at a time.
  png_set_chunk_malloc_max(decoder.png, decoder.content.size() + 1);
  png_read_info(decoder.png, decoder.info);
  return true;
}

/// Takes the memory of a few rows.
bool choose_expansions(Decoder& decoder) {
  if (setjmp(png_jmpbuf(decoder.png)) != 0) return false;
  png_set_expand(decoder.png);
  png_set_swap(decoder.png);  // 16-bit numbers are big-endian in the file
  png_set_interlace_handling(decoder.png);
  png_read_update_info(decoder.png, decoder.info);
  return true;
}

bool read_pixels(Decoder& decoder, png_bytepp rows) {
  if (setjmp(png_jmpbuf(decoder.png)) != 0) return false;
  png_read_image(decoder.png, rows);
  png_read_end(decoder.png, nullptr);
  return true;
}

template <class Number>
Image planar(const std::vector<uint8_t>& packed, int channels, int height, int width, float largest) {
  Image image(channels, height, width);
  for (int c = 0; c < channels; ++c) {
    for (int y = 0; y < height; ++y) {
      const uint8_t* in = packed.data() + (int64_t{y} * width * channels + c) * int64_t{sizeof(Number)};
      float* out = image.row(c, y);
      for (int x = 0; x < width; ++x) {
        Number number;
        std::memcpy(&number, in + int64_t{x} * channels * int64_t{sizeof(Number)}, sizeof(Number));
        out[x] = static_cast<float>(number) / largest;
      }
    }
  }
  return image;
}

[[noreturn]] void fail_png(const std::string& name, const Decoder& decoder) {
  throw DataError(name + ": cannot be decoded as PNG: " + decoder.error);
}

}  // namespace

void check_packed_size(const std::string& name, int64_t height, int64_t width, int64_t file_bytes) {
  // Deflate packs 1032 to 1, JPEG 1024 to 1, at best; eight pixels a byte at worst. OpenEXR's DWAB is below that but
  // for images of one colour that are wider than 16384 pixels.
  constexpr int64_t kDensest = 2048 * 8;
  if (height * width <= kDensest * file_bytes) return;
  throw DataError(name + ": its header claims " + std::to_string(width) + " x " + std::to_string(height) +
                  " pixels, more than its " + std::to_string(file_bytes) + " bytes can hold");
}

Image decode_png(std::span<const uint8_t> file, const std::string& name, const ImageLimits& limits) {
  Decoder decoder{.content = file};
  if (!read_header(decoder)) fail_png(name, decoder);
  const int64_t height = png_get_image_height(decoder.png, decoder.info);
  const int64_t width = png_get_image_width(decoder.png, decoder.info);
  check_image_size(name, png_get_channels(decoder.png, decoder.info), height, width, limits);
  check_packed_size(name, height, width, std::ssize(file));
  if (!choose_expansions(decoder)) fail_png(name, decoder);
  const int channels = png_get_channels(decoder.png, decoder.info);  // a palette's pixels have three or four
  check_image_size(name, channels, height, width, limits);
  const size_t row_bytes = png_get_rowbytes(decoder.png, decoder.info);
  std::vector<uint8_t> packed(row_bytes * static_cast<size_t>(height));
  std::vector<png_bytep> rows(static_cast<size_t>(height));
  for (size_t y = 0; y < rows.size(); ++y) rows[y] = packed.data() + y * row_bytes;
  if (!read_pixels(decoder, rows.data())) fail_png(name, decoder);
  const int h = static_cast<int>(height), w = static_cast<int>(width);
  if (png_get_bit_depth(decoder.png, decoder.info) == 16) return planar<uint16_t>(packed, channels, h, w, 65535.0f);
  return planar<uint8_t>(packed, channels, h, w, 255.0f);
}

}  // namespace hsi4d
