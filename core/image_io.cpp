#include "core/image_io.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <memory>
#include <string_view>

#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/imageio.h>

#include "core/check.h"
#include "core/exr.h"
#include "core/png.h"

namespace hsi4d {
namespace {

enum class FileKind { png, jpeg, exr, other };

FileKind kind_of(std::span<const uint8_t> start) {
  const std::string_view text(reinterpret_cast<const char*>(start.data()), start.size());
  if (text.starts_with("\x89PNG\r\n\x1a\n")) return FileKind::png;
  if (text.starts_with("\xff\xd8\xff")) return FileKind::jpeg;
  if (text.starts_with("\x76\x2f\x31\x01")) return FileKind::exr;
  return FileKind::other;
}

[[noreturn]] void fail(const std::string& name, const std::string& reason) { throw DataError(name + ": " + reason); }

/// OpenImageIO keeps errors until asked and prints what nobody asked for; its own name of the file is ours already.
std::string error_of(const OIIO::ImageInput* input) {
  std::string text = input != nullptr && input->has_error() ? input->geterror() : OIIO::geterror();
  while (text.ends_with('\n')) text.pop_back();
  return text.empty() ? "no reason given" : text;
}

template <class Number>
Image read_as(OIIO::ImageInput& input, const std::string& name, OIIO::TypeDesc type, float scale) {
  const OIIO::ImageSpec spec = input.spec();
  std::vector<Number> values(static_cast<size_t>(spec.image_pixels()) * static_cast<size_t>(spec.nchannels));
  // read_image takes and clears 64 MB for any image, ten times a small JPEG's own cost.
  const bool as_is = spec.tile_width == 0 && spec.format == type && spec.channelformats.empty();
  const bool done = as_is ? input.read_native_scanlines(0, 0, spec.y, spec.y + spec.height, spec.z, values.data())
                          : input.read_image(0, 0, 0, -1, type, values.data());
  // A truncated JPEG is filled with grey and leaves only a note behind.
  if (!done || input.has_error()) fail(name, "cannot be decoded: " + error_of(&input));
  Image image(spec.nchannels, spec.height, spec.width);
  for (int c = 0; c < spec.nchannels; ++c) {
    for (int y = 0; y < spec.height; ++y) {
      const Number* in = values.data() + (int64_t{y} * spec.width) * spec.nchannels + c;
      float* out = image.row(c, y);
      for (int x = 0; x < spec.width; ++x) out[x] = static_cast<float>(in[int64_t{x} * spec.nchannels]) / scale;
    }
  }
  return image;
}

Image read_opened(OIIO::ImageInput& input, const std::string& name, int64_t file_bytes, const ImageLimits& limits) {
  const OIIO::ImageSpec& spec = input.spec();
  if (spec.deep || spec.depth > 1) fail(name, "holds deep or volume data, which is not read");
  if (spec.width < 1 || spec.height < 1 || spec.nchannels < 1) fail(name, "has no pixels");
  check_image_size(name, spec.nchannels, spec.height, spec.width, limits);
  check_packed_size(name, spec.height, spec.width, file_bytes);
  if (spec.format == OIIO::TypeDesc::UINT8) return read_as<uint8_t>(input, name, OIIO::TypeDesc::UINT8, 255.0f);
  if (spec.format == OIIO::TypeDesc::UINT16) return read_as<uint16_t>(input, name, OIIO::TypeDesc::UINT16, 65535.0f);
  return read_as<float>(input, name, OIIO::TypeDesc::FLOAT, 1.0f);
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
  fail(name, "cannot be decoded: it has no JPEG frame");
}

Image decode_jpeg(std::span<const uint8_t> file, const std::string& name, const ImageLimits& limits) {
  check_jpeg_size(file, name, limits);
  OIIO::Filesystem::IOMemReader reader(file.data(), file.size());
  const std::unique_ptr<OIIO::ImageInput> input = OIIO::ImageInput::create("jpeg");
  HSI4D_CHECK(input != nullptr, "OpenImageIO reads no JPEG: " + error_of(nullptr));
  OIIO::ImageSpec spec;
  if (!input->set_ioproxy(&reader) || !input->open(name, spec)) {
    fail(name, "cannot be decoded: " + error_of(input.get()));
  }
  return read_opened(*input, name, std::ssize(file), limits);
}

Image decode_exr(std::span<const uint8_t> file, const std::string& name, const ImageLimits& limits) {
  const Layers layers = decode_layers(file, name, limits);
  const bool grey = layers.find("R") < 0 && layers.find("Y") >= 0;
  std::vector<std::string> wanted = grey ? std::vector<std::string>{"Y"} : std::vector<std::string>{"R", "G", "B"};
  if (layers.find("A") >= 0) wanted.emplace_back("A");
  return layers.select(wanted);
}

Image read_other(const std::string& path, const ImageLimits& limits) {
  OIIO::ImageSpec options;
  options.attribute("oiio:UnassociatedAlpha", 1);
  const std::unique_ptr<OIIO::ImageInput> input = OIIO::ImageInput::open(path, &options);
  if (!input) fail(path, "cannot be decoded: " + error_of(nullptr));
  std::error_code error;
  const auto file_bytes = std::filesystem::file_size(path, error);
  if (error) fail(path, "has no length: " + error.message());
  return read_opened(*input, path, static_cast<int64_t>(file_bytes), limits);
}

std::string ending_of(const std::string& path) {
  const size_t dot = path.find_last_of("./");
  std::string ending = dot == std::string::npos || path[dot] != '.' ? "" : path.substr(dot);
  std::ranges::transform(ending, ending.begin(), [](char c) { return 'A' <= c && c <= 'Z' ? char(c + 32) : c; });
  return ending;
}

/// Interleaved, clamped to [0, 1], scaled to the largest Number and rounded to nearest.
template <class Number>
std::vector<Number> quantise(const std::string& path, const Image& image) {
  constexpr double kLargest = std::numeric_limits<Number>::max();
  std::vector<Number> result;
  result.reserve(static_cast<size_t>(image.height()) * image.width() * image.channels());
  for (int y = 0; y < image.height(); ++y) {
    for (int x = 0; x < image.width(); ++x) {
      for (int c = 0; c < image.channels(); ++c) {
        const double value = image(c, y, x);
        if (std::isnan(value)) {
          fail(path, "the number at row " + std::to_string(y) + ", column " + std::to_string(x) + ", channel " +
                         std::to_string(c) + " is NaN, which this format cannot hold");
        }
        result.push_back(static_cast<Number>(std::clamp(value, 0.0, 1.0) * kLargest + 0.5));
      }
    }
  }
  return result;
}

/// The first of OpenImageIO's complaints, or "".
std::string write_packed(OIIO::ImageOutput& output, const std::string& path, const OIIO::ImageSpec& spec,
                         const void* values) {
  if (!output.open(path, spec)) return output.geterror();
  if (!output.write_image(spec.format, values)) return output.geterror();
  return output.close() ? "" : output.geterror();
}

Bytes encode_packed(const std::string& path, const char* format, const OIIO::ImageSpec& spec, const void* values) {
  Bytes content;
  OIIO::Filesystem::IOVecOutput writer(content);
  const std::unique_ptr<OIIO::ImageOutput> output = OIIO::ImageOutput::create(format);
  HSI4D_CHECK(output != nullptr && output->set_ioproxy(&writer), std::string("OpenImageIO writes no ") + format);
  const std::string error = write_packed(*output, path, spec, values);
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

OIIO::ImageSpec packed_spec(const Image& image, OIIO::TypeDesc type) {
  OIIO::ImageSpec spec(image.width(), image.height(), image.channels(), type);
  if (image.channels() == 2) spec.channelnames = {"Y", "A"};
  spec.alpha_channel = image.channels() % 2 == 0 ? image.channels() - 1 : -1;
  spec.attribute("oiio:UnassociatedAlpha", 1);
  return spec;
}

/// Only runs are sought: eight times faster than zlib's level 6, and rendered images and masks become no larger.
OIIO::ImageSpec png_spec(const Image& image, OIIO::TypeDesc type) {
  OIIO::ImageSpec spec = packed_spec(image, type);
  spec.attribute("compression", "rle");
  spec.attribute("png:compressionLevel", 1);
  return spec;
}

Bytes encode_png(const std::string& path, const Image& image, int bits) {
  check_channels(path, image, {1, 2, 3, 4}, "1 to 4");
  if (bits == 8) {
    return encode_packed(path, "png", png_spec(image, OIIO::TypeDesc::UINT8), quantise<uint8_t>(path, image).data());
  }
  if (bits == 16) {
    return encode_packed(path, "png", png_spec(image, OIIO::TypeDesc::UINT16), quantise<uint16_t>(path, image).data());
  }
  throw UserError(path + ": PNG with " + std::to_string(bits) + " bits; 8 and 16 are allowed");
}

Bytes encode_jpeg(const std::string& path, const Image& image, const ImageFormat& format) {
  const int quality = format.jpeg_quality;
  check_channels(path, image, {1, 3}, "1 or 3");
  if (quality < 1 || quality > 100) {
    throw UserError(path + ": JPEG with quality " + std::to_string(quality) + "; 1 to 100 is allowed");
  }
  OIIO::ImageSpec spec = packed_spec(image, OIIO::TypeDesc::UINT8);
  spec.attribute("Compression", "jpeg:" + std::to_string(quality));
  spec.attribute("jpeg:subsampling", format.jpeg_half_color ? "4:2:0" : "4:4:4");
  return encode_packed(path, "jpeg", spec, quantise<uint8_t>(path, image).data());
}

Bytes encode_exr(const std::string& path, const Image& image, bool as_half) {
  check_channels(path, image, {1, 2, 3, 4}, "1 to 4 (write_layers takes any number)");
  const std::array<std::vector<std::string>, 4> names = {{{"Y"}, {"Y", "A"}, {"R", "G", "B"}, {"R", "G", "B", "A"}}};
  const Layers layers{names[image.channels() - 1], image, path};
  return encode_layers(path, layers, as_half ? ExrPixels::half : ExrPixels::float32);
}

}  // namespace

Image decode_image(std::span<const uint8_t> file, const std::string& name, const ImageLimits& limits) {
  switch (kind_of(file)) {
    case FileKind::png:
      return decode_png(file, name, limits);
    case FileKind::jpeg:
      return decode_jpeg(file, name, limits);
    case FileKind::exr:
      return decode_exr(file, name, limits);
    case FileKind::other:
      break;
  }
  fail(name, "is not a PNG, JPEG or OpenEXR file");
}

Image read_image(const std::string& path, const ImageLimits& limits) {
  const Bytes start = read_file_start(path, 8);
  if (start.empty()) fail(path, "is empty");
  return kind_of(start) == FileKind::other ? read_other(path, limits) : decode_image(read_file(path), path, limits);
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
