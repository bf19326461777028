#include "core/png.h"

#include <algorithm>
#include <csetjmp>
#include <cstdio>
#include <cstring>
#include <new>
#include <png.h>
#include <string_view>
#include <utility>
#include <vector>
#include <zlib.h>

#include "core/check.h"
#include "core/screen_colors.h"

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

/// A byte for each index, however few bits the file has.
bool choose_indices(Decoder& decoder) {
  if (setjmp(png_jmpbuf(decoder.png)) != 0) return false;
  png_set_packing(decoder.png);
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

/// libpng's objects of a file that is written, and the file so far.
struct Encoder {
  Bytes file;
  bool has_memory = true;
  png_structp png = nullptr;
  png_infop info = nullptr;

  ~Encoder() { png_destroy_write_struct(&png, &info); }
};

[[noreturn]] void on_write_error(png_structp png, png_const_charp) { png_longjmp(png, 1); }

void on_write(png_structp png, png_bytep data, size_t count) {
  Encoder& encoder = *static_cast<Encoder*>(png_get_io_ptr(png));
  try {
    encoder.file.insert(encoder.file.end(), data, data + count);
  } catch (const std::bad_alloc&) {
    encoder.has_memory = false;
  }
  if (!encoder.has_memory) png_error(png, "out of memory");
}

void on_flush(png_structp) {}

bool write_pixels(Encoder& encoder, const PackedImage& image, png_bytepp rows) {
  constexpr int kColors[] = {PNG_COLOR_TYPE_GRAY, PNG_COLOR_TYPE_GRAY_ALPHA, PNG_COLOR_TYPE_RGB, PNG_COLOR_TYPE_RGBA};
  encoder.png = png_create_write_struct(PNG_LIBPNG_VER_STRING, &encoder, on_write_error, on_warning);
  if (encoder.png == nullptr) return false;
  if (setjmp(png_jmpbuf(encoder.png)) != 0) return false;
  encoder.info = png_create_info_struct(encoder.png);
  if (encoder.info == nullptr) return false;
  png_set_write_fn(encoder.png, &encoder, on_write, on_flush);
  // Only runs are sought: eight times faster than zlib's level 6, and rendered images and masks become no larger.
  png_set_compression_level(encoder.png, 1);
  png_set_compression_strategy(encoder.png, Z_RLE);
  png_set_IHDR(encoder.png, encoder.info, static_cast<png_uint_32>(image.width), static_cast<png_uint_32>(image.height),
               image.type == PackedType::kUint16 ? 16 : 8, kColors[image.channels - 1], PNG_INTERLACE_NONE,
               PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
  png_write_info(encoder.png, encoder.info);
  png_set_swap(encoder.png);
  png_write_image(encoder.png, rows);
  png_write_end(encoder.png, nullptr);
  return true;
}

/// Where each row begins.
std::vector<png_bytep> row_pointers(Bytes& values, size_t row_bytes, size_t height) {
  std::vector<png_bytep> rows(height);
  for (size_t y = 0; y < height; ++y) rows[y] = values.data() + y * row_bytes;
  return rows;
}

std::size_t big_endian(std::span<const uint8_t> four) {
  std::size_t value = 0;
  for (const uint8_t byte : four) value = value << 8 | byte;
  return value;
}

/// The content of the first chunk of this type before the pixels; empty where there is none.
std::span<const uint8_t> chunk_before_pixels(std::span<const uint8_t> file, std::string_view wanted) {
  constexpr std::size_t kSignature = 8, kHead = 8, kChecksum = 4;
  for (std::size_t at = kSignature; at + kHead <= file.size();) {
    const std::size_t length = big_endian(file.subspan(at, 4));
    const std::string_view type(reinterpret_cast<const char*>(file.data()) + at + 4, 4);
    const std::size_t rest = file.size() - at - kHead;
    if (type == wanted) return file.subspan(at + kHead, std::min(length, rest));
    if (type == "IDAT" || length > rest) return {};
    at += kHead + length + kChecksum;
  }
  return {};
}

/// Refuses colours that sRGB's transfer and primaries would show wrongly.
void check_cicp(std::span<const uint8_t> file, const std::string& name) {
  constexpr uint8_t kPq = 16, kHlg = 18;
  const std::span<const uint8_t> cicp = chunk_before_pixels(file, "cICP");
  if (cicp.size() != 4) return;
  const uint8_t primaries = cicp[0], transfer = cicp[1];
  const auto refuse = [&name](const char* what, uint8_t number, const char* words) {
    throw DataError(name + ": has the " + what + " " + std::to_string(number) + words +
                    " by its chunk cICP (numbers of H.273); allowed are colours of sRGB, BT.709 or BT.601");
  };
  if (!has_number(kScreenTransfers, transfer))
    refuse("transfer", transfer, transfer == kPq ? " (PQ, HDR)" : transfer == kHlg ? " (HLG, HDR)" : "");
  if (!has_number(kScreenPrimaries, primaries))
    refuse("primaries", primaries, primaries == 9 ? " (BT.2020)" : primaries == 12 ? " (Display P3)" : "");
}

[[noreturn]] void fail_png(const std::string& name, const Decoder& decoder) {
  throw DataError(name + ": cannot be decoded as PNG: " + decoder.error);
}

/// Opaque where the file does not say otherwise.
std::vector<PaletteColor> palette_of(Decoder& decoder) {
  png_colorp colors = nullptr;
  png_bytep alphas = nullptr;
  int count = 0, alpha_count = 0;
  png_get_PLTE(decoder.png, decoder.info, &colors, &count);
  png_get_tRNS(decoder.png, decoder.info, &alphas, &alpha_count, nullptr);
  std::vector<PaletteColor> palette;
  for (int i = 0; i < count; ++i)
    palette.push_back({colors[i].red, colors[i].green, colors[i].blue, i < alpha_count ? alphas[i] : uint8_t{255}});
  return palette;
}

}  // namespace

bool is_png(std::span<const uint8_t> start) {
  return start.size() >= 8 && std::memcmp(start.data(), "\x89PNG\r\n\x1a\n", 8) == 0;
}

std::string wide_profile(std::span<const uint8_t> start) {
  const std::span<const uint8_t> profile = chunk_before_pixels(start, "iCCP");
  const auto end = std::find(profile.begin(), profile.end(), uint8_t{0});
  const std::string name(profile.begin(), end);
  for (const char* wide : {"P3", "Adobe", "ProPhoto", "2020", "2100", "Wide"}) {
    if (name.find(wide) != std::string::npos) return name;
  }
  return "";
}

PaletteImage decode_palette(std::span<const uint8_t> file, const std::string& name, const ImageLimits& limits) {
  Decoder decoder{.content = file};
  if (!read_header(decoder)) fail_png(name, decoder);
  if (png_get_color_type(decoder.png, decoder.info) != PNG_COLOR_TYPE_PALETTE) return {};
  const int64_t height = png_get_image_height(decoder.png, decoder.info);
  const int64_t width = png_get_image_width(decoder.png, decoder.info);
  check_image_size(name, 1, height, width, limits);
  check_packed_size(name, height, width, std::ssize(file));
  if (!choose_indices(decoder)) fail_png(name, decoder);
  PaletteImage image{static_cast<int>(width), static_cast<int>(height), {}, palette_of(decoder)};
  image.indices.resize(static_cast<size_t>(width) * static_cast<size_t>(height));
  std::vector<png_bytep> rows = row_pointers(image.indices, static_cast<size_t>(width), static_cast<size_t>(height));
  if (!read_pixels(decoder, rows.data())) fail_png(name, decoder);
  return image;
}

Image decode_png(std::span<const uint8_t> file, const std::string& name, const ImageLimits& limits) {
  Decoder decoder{.content = file};
  if (!read_header(decoder)) fail_png(name, decoder);
  check_cicp(file, name);
  const int64_t height = png_get_image_height(decoder.png, decoder.info);
  const int64_t width = png_get_image_width(decoder.png, decoder.info);
  check_image_size(name, png_get_channels(decoder.png, decoder.info), height, width, limits);
  check_packed_size(name, height, width, std::ssize(file));
  if (!choose_expansions(decoder)) fail_png(name, decoder);
  const int channels = png_get_channels(decoder.png, decoder.info);  // a palette's pixels have three or four
  check_image_size(name, channels, height, width, limits);
  const bool wide = png_get_bit_depth(decoder.png, decoder.info) == 16;
  PackedImage packed{
      static_cast<int>(width), static_cast<int>(height), channels, wide ? PackedType::kUint16 : PackedType::kUint8, {}};
  const size_t row_bytes = png_get_rowbytes(decoder.png, decoder.info);
  packed.values.resize(row_bytes * static_cast<size_t>(height));
  std::vector<png_bytep> rows = row_pointers(packed.values, row_bytes, static_cast<size_t>(height));
  if (!read_pixels(decoder, rows.data())) fail_png(name, decoder);
  return unpacked(packed);
}

Bytes encode_png(PackedImage image) {  // libpng wants pointers to what it could change
  Encoder encoder;
  const auto height = static_cast<size_t>(image.height);
  std::vector<png_bytep> rows = row_pointers(image.values, image.values.size() / height, height);
  const bool done = write_pixels(encoder, image, rows.data());
  if (!encoder.has_memory) throw std::bad_alloc();
  HSI4D_CHECK(done, "libpng writes no image of these sizes");
  return std::move(encoder.file);
}

}  // namespace hsi4d
