// libhsi4d_images.so: the only file that includes OpenImageIO. It links nothing of this project.
#include <OpenImageIO/imageio.h>

#include "core/image_codec.h"

namespace hsi4d {
namespace {

/// OpenImageIO keeps errors until asked and prints what nobody asked for; its own name of the file is ours already.
std::string error_of(const OIIO::ImageInput* input) {
  std::string text = input != nullptr && input->has_error() ? input->geterror() : OIIO::geterror();
  while (text.ends_with('\n')) text.pop_back();
  return text.empty() ? "no reason given" : text;
}

OIIO::TypeDesc type_of(PackedType type) {
  if (type == PackedType::kUint8) return OIIO::TypeDesc::UINT8;
  return type == PackedType::kUint16 ? OIIO::TypeDesc::UINT16 : OIIO::TypeDesc::FLOAT;
}

/// Of other numbers than whole ones of 8 and 16 bits, float.
PackedType packed_type(OIIO::TypeDesc type) {
  if (type == OIIO::TypeDesc::UINT8) return PackedType::kUint8;
  return type == OIIO::TypeDesc::UINT16 ? PackedType::kUint16 : PackedType::kFloat;
}

std::string read_opened(OIIO::ImageInput& input, const FactsCheck& check, PackedImage& image) {
  const OIIO::ImageSpec spec = input.spec();
  check({spec.width, spec.height, spec.nchannels, spec.deep || spec.depth > 1});
  image = {spec.width, spec.height, spec.nchannels, packed_type(spec.format), {}};
  const OIIO::TypeDesc type = type_of(image.type);
  image.values.resize(static_cast<size_t>(spec.image_pixels()) * static_cast<size_t>(spec.nchannels) * type.size());
  const bool done = input.read_image(0, 0, 0, -1, type, image.values.data());
  return done && !input.has_error() ? "" : error_of(&input);  // some readers leave only a note of damage
}

std::string read_image_file(const std::string& path, const FactsCheck& check, PackedImage& image) {
  OIIO::ImageSpec options;
  options.attribute("oiio:UnassociatedAlpha", 1);
  const std::unique_ptr<OIIO::ImageInput> input = OIIO::ImageInput::open(path, &options);
  return input ? read_opened(*input, check, image) : error_of(nullptr);
}

}  // namespace
}  // namespace hsi4d

extern "C" __attribute__((visibility("default"))) hsi4d::ReadByCodec hsi4d_image_codec() {
  return hsi4d::read_image_file;
}
