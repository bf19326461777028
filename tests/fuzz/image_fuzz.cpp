// PNG and JPEG.
#include "core/image_io.h"
#include "core/png.h"
#include "tests/fuzz/fuzz.h"
#include "tests/support/crc32.h"
#include "tests/support/palette_png.h"

namespace hsi4d::fuzz::image_fuzz {
namespace {

Image gradient(int channels, int height, int width) {
  Image image(channels, height, width);
  for (int c = 0; c < channels; ++c) {
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) image(c, y, x) = static_cast<float>((c + 3 * y + 5 * x) % 17) / 16;
    }
  }
  return image;
}

uint32_t big_endian(std::span<const uint8_t> bytes) {
  uint32_t value = 0;
  for (const uint8_t byte : bytes.first(4)) value = value << 8 | byte;
  return value;
}

/// With the checksum of every chunk put right, so that mutations get past them.
Bytes repaired_png(std::span<const uint8_t> file) {
  Bytes result(file.begin(), file.end());
  const std::span<uint8_t> bytes(result);
  size_t at = 8;
  while (at + 12 <= bytes.size()) {
    const size_t length = big_endian(bytes.subspan(at));
    if (length > bytes.size() - at - 12) break;
    const uint32_t crc = crc32_of(bytes.subspan(at + 4, length + 4));
    for (size_t i = 0; i < 4; ++i) bytes[at + 8 + length + i] = static_cast<uint8_t>(crc >> (24 - 8 * i));
    at += 12 + length;
  }
  return result;
}

}  // namespace

std::vector<Bytes> corpus() {
  return {
      encode_image("a.png", gradient(3, 5, 7)),
      encode_image("a.png", gradient(2, 9, 3), {.png_bits = 16}),
      encode_image("a.png", gradient(1, 8, 8)),
      encode_image("a.png", gradient(4, 4, 6)),
      encode_image("a.jpg", gradient(3, 17, 19)),
      encode_image("a.jpg", gradient(1, 8, 24), {.jpeg_quality = 30}),
      test::palette_png(3, 2, {0, 1, 2, 2, 1, 0}, {{0, 0, 0, 255}, {128, 0, 0, 255}, {0, 128, 0, 7}}),
  };
}

bool accepts(std::span<const uint8_t> file) {
  const ImageLimits limits{.max_bytes = int64_t{32} << 20};  // what takes long to clear is no finding
  if (is_png(file)) {
    is_read([&] { decode_image(repaired_png(file), "fuzz", limits); });
    is_read([&] { decode_palette(repaired_png(file), "fuzz", limits); });
  }
  return is_read([&] { decode_image(file, "fuzz", limits); });
}

const Target target("image", corpus, accepts);

}  // namespace hsi4d::fuzz::image_fuzz
