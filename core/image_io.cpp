#include "core/image_io.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <limits>
#include <string_view>

#include "core/check.h"
#include "core/exr.h"
#include "core/image_codec.h"
#include "core/png.h"

namespace hsi4d {
namespace {

enum class FileKind { png, jpeg, exr, other };

FileKind image_kind(std::span<const uint8_t> start) {
  const std::string_view text(reinterpret_cast<const char*>(start.data()), start.size());
  if (text.starts_with("\x89PNG\r\n\x1a\n")) return FileKind::png;
  if (text.starts_with("\xff\xd8\xff")) return FileKind::jpeg;
  if (text.starts_with("\x76\x2f\x31\x01")) return FileKind::exr;
  return FileKind::other;
}

[[noreturn]] void fail_image(const std::string& name, const std::string& reason) {
  throw DataError(name + ": " + reason);
}

template <class Number>
Image unpacked_as(const PackedImage& packed, float scale) {
  Image image(packed.channels, packed.height, packed.width);
  const int64_t pixel = packed.channels;
  std::vector<Number> values(packed.values.size() / sizeof(Number));
  std::memcpy(values.data(), packed.values.data(), packed.values.size());
  for (int c = 0; c < packed.channels; ++c) {
    for (int y = 0; y < packed.height; ++y) {
      const Number* in = values.data() + (int64_t{y} * packed.width) * pixel + c;
      float* out = image.row(c, y);
      for (int x = 0; x < packed.width; ++x) out[x] = static_cast<float>(in[x * pixel]) / scale;
    }
  }
  return image;
}

Image unpacked(const PackedImage& packed) {
  if (packed.type == PackedType::kUint8) return unpacked_as<uint8_t>(packed, 255.0f);
  if (packed.type == PackedType::kUint16) return unpacked_as<uint16_t>(packed, 65535.0f);
  return unpacked_as<float>(packed, 1.0f);
}

/// Refuses what is too large, and no image.
FactsCheck check_facts(const std::string& name, int64_t file_bytes, const ImageLimits& limits) {
  return [&name, file_bytes, &limits](const ImageFacts& facts) {
    if (facts.is_volume) fail_image(name, "holds deep or volume data, which is not read");
    if (facts.width < 1 || facts.height < 1 || facts.channels < 1) fail_image(name, "has no pixels");
    check_image_size(name, facts.channels, facts.height, facts.width, limits);
    check_packed_size(name, facts.height, facts.width, file_bytes);
  };
}

/// Refuses by the frame header (ISO 10918-1, B.2.2) what is too large, since opening a progressive JPEG takes its
/// memory.
void check_jpeg_size(std::span<const uint8_t> file, const std::string& name, const ImageLimits& limits) {
  const auto number = [&](size_t at) { return int64_t{file[at]} << 8 | file[at + 1]; };
  size_t at = 2;
  while (at + 9 < file.size()) {
    if (file[at] != 0xff || file[at + 1] == 0x00 || file[at + 1] == 0xff) {
      ++at;  // between markers, as libjpeg has it
      continue;
    }
    const uint8_t marker = file[at + 1];
    if (marker >= 0xc0 && marker <= 0xcf && marker != 0xc4 && marker != 0xc8 && marker != 0xcc) {
      const int64_t height = std::max<int64_t>(1, number(at + 5)), width = std::max<int64_t>(1, number(at + 7));
      check_image_size(name, file[at + 9], height, width, limits);
      return check_packed_size(name, height, width, std::ssize(file));
    }
    const bool alone = marker == 0x01 || (marker >= 0xd0 && marker <= 0xd8);
    at += alone ? 2 : 2 + static_cast<size_t>(number(at + 2));
  }
  fail_image(name, "cannot be decoded: it has no JPEG frame");
}

Image decode_jpeg(std::span<const uint8_t> file, const std::string& name, const ImageLimits& limits) {
  check_jpeg_size(file, name, limits);
  PackedImage packed;
  const std::string error = image_codec().read_jpeg(file, name, check_facts(name, std::ssize(file), limits), packed);
  if (!error.empty()) fail_image(name, "cannot be decoded: " + error);
  return unpacked(packed);
}

Image decode_exr(std::span<const uint8_t> file, const std::string& name, const ImageLimits& limits) {
  const Layers layers = decode_layers(file, name, limits);
  const bool grey = layers.find("R") < 0 && layers.find("Y") >= 0;
  std::vector<std::string> wanted = grey ? std::vector<std::string>{"Y"} : std::vector<std::string>{"R", "G", "B"};
  if (layers.find("A") >= 0) wanted.emplace_back("A");
  return layers.select(wanted);
}

Image read_other(const std::string& path, const ImageLimits& limits) {
  std::error_code no_length;
  const auto file_bytes = static_cast<int64_t>(std::filesystem::file_size(path, no_length));
  if (no_length) fail_image(path, "has no length: " + no_length.message());
  PackedImage packed;
  const std::string error = image_codec().read_file(path, check_facts(path, file_bytes, limits), packed);
  if (!error.empty()) fail_image(path, "cannot be decoded: " + error);
  return unpacked(packed);
}

std::string ending_of(const std::string& path) {
  const size_t dot = path.find_last_of("./");
  std::string ending = dot == std::string::npos || path[dot] != '.' ? "" : path.substr(dot);
  std::ranges::transform(ending, ending.begin(), [](char c) { return 'A' <= c && c <= 'Z' ? char(c + 32) : c; });
  return ending;
}

/// Interleaved, clamped to [0, 1], scaled to the largest Number and rounded to nearest.
template <class Number>
PackedImage packed(const std::string& path, const Image& image) {
  constexpr double kLargest = std::numeric_limits<Number>::max();
  std::vector<Number> numbers;
  numbers.reserve(static_cast<size_t>(image.height()) * image.width() * image.channels());
  for (int y = 0; y < image.height(); ++y) {
    for (int x = 0; x < image.width(); ++x) {
      for (int c = 0; c < image.channels(); ++c) {
        const double value = image(c, y, x);
        if (std::isnan(value)) {
          fail_image(path, "the number at row " + std::to_string(y) + ", column " + std::to_string(x) + ", channel " +
                               std::to_string(c) + " is NaN, which this format cannot hold");
        }
        numbers.push_back(static_cast<Number>(std::clamp(value, 0.0, 1.0) * kLargest + 0.5));
      }
    }
  }
  PackedImage result{image.width(),
                     image.height(),
                     image.channels(),
                     sizeof(Number) == 1 ? PackedType::kUint8 : PackedType::kUint16,
                     {}};
  result.values.resize(numbers.size() * sizeof(Number));
  std::memcpy(result.values.data(), numbers.data(), result.values.size());
  return result;
}

Bytes encode_packed(const std::string& path, const char* format, const PackedImage& image,
                    const CodecOptions& options) {
  Bytes content;
  const std::string error = image_codec().write(format, image, options, content);
  HSI4D_CHECK(error.empty(), path + ": " + error);
  return content;
}

void check_channels(const std::string& path, const Image& image, std::initializer_list<int> allowed,
                    const char* allowed_text) {
  if (image.width() < 1 || image.height() < 1) throw UserError(path + ": cannot be written: the image has no pixels");
  if (std::ranges::find(allowed, image.channels()) != allowed.end()) return;
  throw UserError(path + ": cannot be written: the image has " + std::to_string(image.channels()) +
                  " channels; this format takes " + allowed_text);
}

Bytes encode_png(const std::string& path, const Image& image, int bits) {
  check_channels(path, image, {1, 2, 3, 4}, "1 to 4");
  if (bits != 8 && bits != 16)
    throw UserError(path + ": PNG with " + std::to_string(bits) + " bits; 8 and 16 are allowed");
  // Only runs are sought: eight times faster than zlib's level 6, and rendered images and masks become no larger.
  const CodecOptions options = {{{"compression", "rle"}}, {{"png:compressionLevel", 1}}};
  return encode_packed(path, "png", bits == 8 ? packed<uint8_t>(path, image) : packed<uint16_t>(path, image), options);
}

Bytes encode_jpeg(const std::string& path, const Image& image, const ImageFormat& format) {
  const int quality = format.jpeg_quality;
  check_channels(path, image, {1, 3}, "1 or 3");
  if (quality < 1 || quality > 100) {
    throw UserError(path + ": JPEG with quality " + std::to_string(quality) + "; 1 to 100 is allowed");
  }
  const CodecOptions options = {{{"Compression", "jpeg:" + std::to_string(quality)},
                                 {"jpeg:subsampling", format.jpeg_half_color ? "4:2:0" : "4:4:4"}},
                                {}};
  return encode_packed(path, "jpeg", packed<uint8_t>(path, image), options);
}

Bytes encode_exr(const std::string& path, const Image& image, bool as_half) {
  check_channels(path, image, {1, 2, 3, 4}, "1 to 4 (write_layers takes any number)");
  const std::array<std::vector<std::string>, 4> names = {{{"Y"}, {"Y", "A"}, {"R", "G", "B"}, {"R", "G", "B", "A"}}};
  const Layers layers{names[image.channels() - 1], image, path};
  return encode_layers(path, layers, as_half ? ExrPixels::half : ExrPixels::float32);
}

}  // namespace

Image decode_image(std::span<const uint8_t> file, const std::string& name, const ImageLimits& limits) {
  switch (image_kind(file)) {
    case FileKind::png:
      return decode_png(file, name, limits);
    case FileKind::jpeg:
      return decode_jpeg(file, name, limits);
    case FileKind::exr:
      return decode_exr(file, name, limits);
    case FileKind::other:
      break;
  }
  fail_image(name, "is not a PNG, JPEG or OpenEXR file");
}

Image read_image(const std::string& path, const ImageLimits& limits) {
  const Bytes start = read_file_start(path, 8);
  if (start.empty()) fail_image(path, "is empty");
  return image_kind(start) == FileKind::other ? read_other(path, limits) : decode_image(read_file(path), path, limits);
}

Bytes encode_image(const std::string& path, const Image& image, const ImageFormat& format) {
  const std::string ending = ending_of(path);
  if (ending == ".png") return encode_png(path, image, format.png_bits);
  if (ending == ".jpg" || ending == ".jpeg") return encode_jpeg(path, image, format);
  if (ending == ".exr") return encode_exr(path, image, format.exr_half);
  throw UserError(path + ": images are written as .png, .jpg, .jpeg or .exr");
}

void write_image(const std::string& path, const Image& image, const ImageFormat& format) {
  write_file(path, encode_image(path, image, format));
}

}  // namespace hsi4d
