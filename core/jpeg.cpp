#include "core/jpeg.h"

#include <memory>
#include <turbojpeg.h>

#include "core/check.h"

namespace hsi4d {
namespace {

struct Close {
  void operator()(void* codec) const { tjDestroy(codec); }
};
using Codec = std::unique_ptr<void, Close>;

[[noreturn]] void fail_jpeg(const std::string& name, const Codec& codec) {
  throw DataError(name + ": cannot be decoded as JPEG: " + tjGetErrorStr2(codec.get()));
}

/// Inks as Adobe's programs write them, 255 where there is none, to RGB.
PackedImage rgb_of_inks(const PackedImage& inks) {
  PackedImage rgb{inks.width, inks.height, 3, inks.type, {}};
  rgb.values.reserve(inks.values.size() / 4 * 3);
  for (size_t i = 0; i < inks.values.size(); i += 4) {
    for (size_t c = 0; c < 3; ++c) {
      rgb.values.push_back(static_cast<uint8_t>((inks.values[i + c] * inks.values[i + 3] + 127) / 255));
    }
  }
  return rgb;
}

}  // namespace

Image decode_jpeg(std::span<const uint8_t> file, const std::string& name, const ImageLimits& limits) {
  const Codec codec(tjInitDecompress());
  int width = 0, height = 0, subsampling = 0, colors = 0;
  const auto bytes = static_cast<unsigned long>(file.size());
  if (tjDecompressHeader3(codec.get(), file.data(), bytes, &width, &height, &subsampling, &colors) != 0) {
    fail_jpeg(name, codec);
  }
  if (width < 1 || height < 1) throw DataError(name + ": cannot be decoded as JPEG: it has no frame");  // tables alone
  const bool grey = colors == TJCS_GRAY, inks = colors == TJCS_CMYK || colors == TJCS_YCCK;
  PackedImage packed{width, height, grey ? 1 : inks ? 4 : 3, PackedType::kUint8, {}};
  check_image_size(name, packed.channels, height, width, limits);
  check_packed_size(name, height, width, std::ssize(file));
  packed.values.resize(static_cast<size_t>(width) * static_cast<size_t>(height) * static_cast<size_t>(packed.channels));
  const int format = grey ? TJPF_GRAY : inks ? TJPF_CMYK : TJPF_RGB;
  // A truncated file is a warning to libjpeg, which fills the rest with grey.
  if (tjDecompress2(codec.get(), file.data(), bytes, packed.values.data(), width, 0, height, format,
                    TJFLAG_LIMITSCANS) != 0) {
    fail_jpeg(name, codec);
  }
  return unpacked(inks ? rgb_of_inks(packed) : packed);
}

Bytes encode_jpeg(const PackedImage& image, int quality, bool half_color) {
  const Codec codec(tjInitCompress());
  const bool grey = image.channels == 1;
  const int subsampling = grey ? TJSAMP_GRAY : half_color ? TJSAMP_420 : TJSAMP_444;
  Bytes file(tjBufSize(image.width, image.height, subsampling));
  unsigned char* begin = file.data();
  auto size = static_cast<unsigned long>(file.size());
  const int failed =
      tjCompress2(codec.get(), image.values.data(), image.width, 0, image.height, grey ? TJPF_GRAY : TJPF_RGB, &begin,
                  &size, subsampling, quality, TJFLAG_NOREALLOC | TJFLAG_ACCURATEDCT);
  HSI4D_CHECK(failed == 0, tjGetErrorStr2(codec.get()));
  file.resize(size);
  return file;
}

}  // namespace hsi4d
