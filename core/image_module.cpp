// libhsi4d_images.so: the only file that includes OpenImageIO. It links nothing of this project.
#include <OpenImageIO/filesystem.h>
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
  // read_image takes and clears 64 MB for any image, ten times a small JPEG's own cost.
  const bool as_is = spec.tile_width == 0 && spec.format == type && spec.channelformats.empty();
  const bool done = as_is ? input.read_native_scanlines(0, 0, spec.y, spec.y + spec.height, spec.z, image.values.data())
                          : input.read_image(0, 0, 0, -1, type, image.values.data());
  // A truncated JPEG is filled with grey and leaves only a note behind.
  return done && !input.has_error() ? "" : error_of(&input);
}

std::string read_image_file(const std::string& path, const FactsCheck& check, PackedImage& image) {
  OIIO::ImageSpec options;
  options.attribute("oiio:UnassociatedAlpha", 1);
  const std::unique_ptr<OIIO::ImageInput> input = OIIO::ImageInput::open(path, &options);
  return input ? read_opened(*input, check, image) : error_of(nullptr);
}

std::string read_jpeg(std::span<const uint8_t> file, const std::string& name, const FactsCheck& check,
                      PackedImage& image) {
  OIIO::Filesystem::IOMemReader reader(file.data(), file.size());
  const std::unique_ptr<OIIO::ImageInput> input = OIIO::ImageInput::create("jpeg");
  if (input == nullptr) return "OpenImageIO reads no JPEG: " + error_of(nullptr);
  OIIO::ImageSpec spec;
  if (!input->set_ioproxy(&reader) || !input->open(name, spec)) return error_of(input.get());
  return read_opened(*input, check, image);
}

std::string write(const std::string& format, const PackedImage& image, const CodecOptions& options, Bytes& file) {
  OIIO::ImageSpec spec(image.width, image.height, image.channels, type_of(image.type));
  if (image.channels == 2) spec.channelnames = {"Y", "A"};
  spec.alpha_channel = image.channels % 2 == 0 ? image.channels - 1 : -1;
  spec.attribute("oiio:UnassociatedAlpha", 1);
  for (const auto& [name, text] : options.texts) spec.attribute(name, text);
  for (const auto& [name, number] : options.numbers) spec.attribute(name, number);
  OIIO::Filesystem::IOVecOutput writer(file);
  const std::unique_ptr<OIIO::ImageOutput> output = OIIO::ImageOutput::create(format);
  if (output == nullptr || !output->set_ioproxy(&writer)) return "OpenImageIO writes no " + format;
  if (!output->open(format, spec) || !output->write_image(spec.format, image.values.data()) || !output->close()) {
    const std::string text = output->geterror();
    return text.empty() ? "no reason given" : text;
  }
  return "";
}

}  // namespace
}  // namespace hsi4d

extern "C" __attribute__((visibility("default"))) const hsi4d::ImageCodec* hsi4d_image_codec() {
  static constexpr hsi4d::ImageCodec codec = {hsi4d::read_image_file, hsi4d::read_jpeg, hsi4d::write};
  return &codec;
}
