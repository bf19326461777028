#include "core/image_io.h"

#include <algorithm>
#include <array>
#include <filesystem>
#include <string_view>

#include "core/check.h"
#include "core/exr.h"
#include "core/image_codec.h"
#include "core/jpeg.h"
#include "core/png.h"
#include "core/text.h"

namespace hsi4d {
namespace {

enum class FileKind { png, jpeg, exr, other };

FileKind image_kind(std::span<const uint8_t> start) {
  const std::string_view text(reinterpret_cast<const char*>(start.data()), start.size());
  if (is_png(start)) return FileKind::png;
  if (text.starts_with("\xff\xd8\xff")) return FileKind::jpeg;
  if (text.starts_with("\x76\x2f\x31\x01")) return FileKind::exr;
  return FileKind::other;
}

[[noreturn]] void fail_image(const std::string& name, const std::string& reason) {
  throw DataError(name + ": " + reason);
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
  const std::string error = image_codec()(path, check_facts(path, file_bytes, limits), packed);
  if (!error.empty()) fail_image(path, "cannot be decoded: " + error);
  return unpacked(packed);
}

std::string ending_of(const std::string& path) {
  const size_t dot = path.find_last_of("./");
  std::string ending = dot == std::string::npos || path[dot] != '.' ? "" : path.substr(dot);
  std::ranges::transform(ending, ending.begin(), [](char c) { return 'A' <= c && c <= 'Z' ? char(c + 32) : c; });
  return ending;
}

void check_channels(const std::string& path, const Image& image, std::initializer_list<int> allowed,
                    const char* allowed_text) {
  if (image.width() < 1 || image.height() < 1) throw UserError(path + ": cannot be written: the image has no pixels");
  if (std::ranges::find(allowed, image.channels()) != allowed.end()) return;
  throw UserError(path + ": cannot be written: the image has " + std::to_string(image.channels()) +
                  " channels; this format takes " + allowed_text);
}

Bytes encode_as_png(const std::string& path, const Image& image, int bits) {
  check_channels(path, image, {1, 2, 3, 4}, "1 to 4");
  if (bits != 8 && bits != 16)
    throw UserError(path + ": PNG with " + std::to_string(bits) + " bits; 8 and 16 are allowed");
  return encode_png(packed(path, image, bits == 8 ? PackedType::kUint8 : PackedType::kUint16));
}

Bytes encode_as_jpeg(const std::string& path, const Image& image, const ImageFormat& format) {
  const int quality = format.jpeg_quality;
  check_channels(path, image, {1, 3}, "1 or 3");
  if (quality < 1 || quality > 100) {
    throw UserError(path + ": JPEG with quality " + std::to_string(quality) + "; 1 to 100 is allowed");
  }
  if (std::max(image.width(), image.height()) > kLargestJpegSide) {
    throw UserError(path + ": a JPEG has at most " + std::to_string(kLargestJpegSide) + " pixels a side, not " +
                    std::to_string(image.width()) + " x " + std::to_string(image.height()));
  }
  return encode_jpeg(packed(path, image, PackedType::kUint8), quality, format.jpeg_half_color);
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

void check_opaque(const Image& image, const std::string& name, const char* what) {
  const int alpha = image.channels() - 1;
  if (image.channels() != 2 && image.channels() != 4) return;
  for (int y = 0; y < image.height(); ++y) {
    for (int x = 0; x < image.width(); ++x) {
      if (image(alpha, y, x) >= 1) continue;
      fail_image(name, "row " + std::to_string(y) + ", column " + std::to_string(x) + " has alpha " +
                           rounded(static_cast<double>(image(alpha, y, x)), 3) + "; " + what + " is opaque");
    }
  }
}

Bytes encode_image(const std::string& path, const Image& image, const ImageFormat& format) {
  const std::string ending = ending_of(path);
  if (ending == ".png") return encode_as_png(path, image, format.png_bits);
  if (ending == ".jpg" || ending == ".jpeg") return encode_as_jpeg(path, image, format);
  if (ending == ".exr") return encode_exr(path, image, format.exr_half);
  throw UserError(path + ": images are written as .png, .jpg, .jpeg or .exr");
}

void write_image(const std::string& path, const Image& image, const ImageFormat& format) {
  write_file(path, encode_image(path, image, format));
}

}  // namespace hsi4d
