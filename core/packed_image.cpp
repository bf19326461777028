#include "core/packed_image.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

#include "core/check.h"

namespace hsi4d {
namespace {

template <class Number>
Image unpacked_as(const PackedImage& packed, float scale) {
  Image image(packed.channels, packed.height, packed.width);
  const int64_t pixel = packed.channels;
  std::vector<Number> row(static_cast<size_t>(packed.width * pixel));
  for (int y = 0; y < packed.height; ++y) {
    std::memcpy(row.data(), packed.values.data() + static_cast<size_t>(y) * row.size() * sizeof(Number),
                row.size() * sizeof(Number));
    for (int c = 0; c < packed.channels; ++c) {
      float* out = image.row(c, y);
      for (int x = 0; x < packed.width; ++x) {
        out[x] = static_cast<float>(row[static_cast<size_t>(x * pixel + c)]) / scale;
      }
    }
  }
  return image;
}

template <class Number>
Bytes packed_as(const std::string& name, const Image& image) {
  constexpr double kLargest = std::numeric_limits<Number>::max();
  std::vector<Number> numbers;
  numbers.reserve(static_cast<size_t>(image.height()) * image.width() * image.channels());
  for (int y = 0; y < image.height(); ++y) {
    for (int x = 0; x < image.width(); ++x) {
      for (int c = 0; c < image.channels(); ++c) {
        const double value = image(c, y, x);
        if (std::isnan(value)) {
          throw DataError(name + ": the number at row " + std::to_string(y) + ", column " + std::to_string(x) +
                          ", channel " + std::to_string(c) + " is NaN, which this format cannot hold");
        }
        numbers.push_back(static_cast<Number>(std::clamp(value, 0.0, 1.0) * kLargest + 0.5));
      }
    }
  }
  Bytes values(numbers.size() * sizeof(Number));
  std::memcpy(values.data(), numbers.data(), values.size());
  return values;
}

}  // namespace

Image unpacked(const PackedImage& packed) {
  if (packed.type == PackedType::kUint8) return unpacked_as<uint8_t>(packed, 255.0f);
  if (packed.type == PackedType::kUint16) return unpacked_as<uint16_t>(packed, 65535.0f);
  return unpacked_as<float>(packed, 1.0f);
}

PackedImage packed(const std::string& name, const Image& image, PackedType type) {
  PackedImage result{image.width(), image.height(), image.channels(), type, {}};
  result.values = type == PackedType::kUint8 ? packed_as<uint8_t>(name, image) : packed_as<uint16_t>(name, image);
  return result;
}

void check_packed_size(const std::string& name, int64_t height, int64_t width, int64_t file_bytes) {
  // Deflate packs 1032 to 1, JPEG 1024 to 1, at best; eight pixels a byte at worst. OpenEXR's DWAB is below that but
  // for images of one colour that are wider than 16384 pixels.
  constexpr int64_t kDensest = 2048 * 8;
  if (height * width <= kDensest * file_bytes) return;
  throw DataError(name + ": its header claims " + std::to_string(width) + " x " + std::to_string(height) +
                  " pixels, more than its " + std::to_string(file_bytes) + " bytes can hold");
}

}  // namespace hsi4d
