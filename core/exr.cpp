#include "core/exr.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <initializer_list>
#include <set>
#include <sstream>

#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfIO.h>
#include <ImfInputPart.h>
#include <ImfMultiPartInputFile.h>
#include <ImfOutputFile.h>
#include <ImfPartType.h>
#include <half.h>

#include "core/check.h"
#include "core/exr_header.h"
#include "core/packed_image.h"
#include "core/text.h"

namespace hsi4d {
namespace {

namespace exr = OPENEXR_IMF_NAMESPACE;
using Imath::Box2i;

class MemoryInput : public exr::IStream {
 public:
  MemoryInput(std::span<const uint8_t> content, const std::string& name) : IStream(name.c_str()), content_(content) {}

  // OpenEXR expects an exception for a read past the end, false for one that ends there.
  bool read(char out[], int count) override {
    if (count < 0 || static_cast<uint64_t>(count) > content_.size() - position_) {
      throw std::runtime_error("the file ends early");
    }
    std::memcpy(out, content_.data() + position_, static_cast<size_t>(count));
    position_ += static_cast<uint64_t>(count);
    return position_ < content_.size();
  }
  uint64_t tellg() override { return position_; }
  void seekg(uint64_t position) override {
    if (position > content_.size()) throw std::runtime_error("the file ends early");
    position_ = position;
  }

 private:
  std::span<const uint8_t> content_;
  uint64_t position_ = 0;
};

class MemoryOutput : public exr::OStream {
 public:
  explicit MemoryOutput(const std::string& name) : OStream(name.c_str()) {}
  void write(const char in[], int count) override {
    const size_t end = position_ + static_cast<size_t>(count);
    if (end > content_.size()) content_.resize(end);
    std::memcpy(content_.data() + position_, in, static_cast<size_t>(count));
    position_ = end;
  }
  uint64_t tellp() override { return position_; }
  void seekp(uint64_t position) override { position_ = position; }
  Bytes take() { return std::move(content_); }

 private:
  Bytes content_;
  uint64_t position_ = 0;
};

[[noreturn]] void fail_exr(const std::string& name, const std::string& reason) {
  throw DataError(name + ": " + reason);
}

std::string box_text(const Box2i& box) {
  std::ostringstream text;
  text << '(' << box.min.x << ',' << box.min.y << ")-(" << box.max.x << ',' << box.max.y << ')';
  return text.str();
}

int64_t width_of(const Box2i& box) { return int64_t{box.max.x} - box.min.x + 1; }
int64_t height_of(const Box2i& box) { return int64_t{box.max.y} - box.min.y + 1; }

void check_window(const std::string& name, const char* what, const Box2i& box, int64_t channels, int64_t file_bytes,
                  const ImageLimits& limits) {
  const int64_t width = width_of(box), height = height_of(box);
  if (width < 1 || height < 1) fail_exr(name, std::string("its ") + what + " " + box_text(box) + " is empty");
  check_image_size(name, channels, height, width, limits);
  check_packed_size(name, height, width, file_bytes);
}

/// What can be read, and fits in memory.
void check_header(const std::string& name, const exr::MultiPartInputFile& file, int64_t file_bytes,
                  const ImageLimits& limits) {
  if (file.parts() != 1) {
    fail_exr(name, "has " + std::to_string(file.parts()) + " parts; files of one part are read");
  }
  const exr::Header& header = file.header(0);
  if (header.hasType() && exr::isDeepData(header.type())) fail_exr(name, "holds deep data, which is not read");
  int64_t channels = 0;
  for (auto channel = header.channels().begin(); channel != header.channels().end(); ++channel, ++channels) {
    const exr::Channel& c = channel.channel();
    if (c.xSampling != 1 || c.ySampling != 1) {
      fail_exr(name, std::string("channel '") + channel.name() + "' is subsampled " + std::to_string(c.xSampling) +
                         " x " + std::to_string(c.ySampling) + ", which is not read");
    }
  }
  if (channels == 0) fail_exr(name, "has no channels");
  check_window(name, "data window", header.dataWindow(), channels, file_bytes, limits);
  check_window(name, "display window", header.displayWindow(), channels, file_bytes, limits);
  if (!header.dataWindow().intersects(header.displayWindow())) {
    fail_exr(name, "its data window " + box_text(header.dataWindow()) + " lies outside of its display window " +
                       box_text(header.displayWindow()));
  }
}

/// The part of `data` (which covers `data_window`) inside `display_window`, zero elsewhere.
Image place(const Image& data, const Box2i& data_window, const Box2i& display_window) {
  Image result(data.channels(), static_cast<int>(height_of(display_window)),
               static_cast<int>(width_of(display_window)));
  const int left = std::max(data_window.min.x, display_window.min.x);
  const int right = std::min(data_window.max.x, display_window.max.x);
  const int top = std::max(data_window.min.y, display_window.min.y);
  const int bottom = std::min(data_window.max.y, display_window.max.y);
  for (int c = 0; c < data.channels(); ++c) {
    for (int y = top; y <= bottom; ++y) {
      std::copy_n(data.row(c, y - data_window.min.y) + (left - data_window.min.x), right - left + 1,
                  result.row(c, y - display_window.min.y) + (left - display_window.min.x));
    }
  }
  return result;
}

Layers read_part(exr::MultiPartInputFile& file, const std::string& name) {
  const exr::Header& header = file.header(0);
  const Box2i window = header.dataWindow();
  Layers layers{{}, {}, name};
  for (auto c = header.channels().begin(); c != header.channels().end(); ++c) layers.names.emplace_back(c.name());
  Image data(static_cast<int>(layers.names.size()), static_cast<int>(height_of(window)),
             static_cast<int>(width_of(window)));
  exr::FrameBuffer buffer;
  for (int c = 0; c < data.channels(); ++c) {
    buffer.insert(layers.names[c], exr::Slice::Make(exr::FLOAT, data.row(c, 0), window, sizeof(float),
                                                    static_cast<size_t>(data.row_stride()) * sizeof(float)));
  }
  exr::InputPart part(file, 0);
  part.setFrameBuffer(buffer);
  part.readPixels(window.min.y, window.max.y);
  const bool same = window == header.displayWindow();
  layers.planes = same ? std::move(data) : place(data, window, header.displayWindow());
  return layers;
}

bool is_depth(std::string_view name) { return name == "Z" || name.ends_with(".Z"); }

void check_layers(const std::string& name, const Layers& layers) {
  HSI4D_CHECK_EQ(std::ssize(layers.names), layers.planes.channels());
  HSI4D_CHECK(layers.planes.width() > 0 && layers.planes.height() > 0 && !layers.names.empty(), name + ": no pixels");
  std::set<std::string_view> seen;
  for (const std::string& layer : layers.names) {
    HSI4D_CHECK(!layer.empty() && layer.size() <= 255 && layer.find('\0') == std::string::npos,
                name + ": channel name '" + layer + "'");
    HSI4D_CHECK(seen.insert(layer).second, name + ": channel '" + layer + "' is there twice");
  }
}

std::vector<half> half_plane(const std::string& name, const Layers& layers, int c) {
  const Image& planes = layers.planes;
  std::vector<half> result(static_cast<size_t>(planes.plane_stride()));
  for (int y = 0; y < planes.height(); ++y) {
    const float* in = planes.row(c, y);
    for (int x = 0; x < planes.width(); ++x) {
      const half value(in[x]);
      if (value.isInfinity() && std::isfinite(in[x])) {
        fail_exr(name, "channel '" + layers.names[c] + "', row " + std::to_string(y) + ", column " + std::to_string(x) +
                           ": " + std::to_string(in[x]) + " is beyond the range of half, ±65504");
      }
      result[y * planes.row_stride() + x] = value;
    }
  }
  return result;
}

}  // namespace

int Layers::find(std::string_view name) const {
  const auto at = std::ranges::find(names, name);
  return at == names.end() ? -1 : static_cast<int>(at - names.begin());
}

Image Layers::select(std::span<const std::string> wanted) const {
  Image result(static_cast<int>(wanted.size()), planes.height(), planes.width());
  for (size_t i = 0; i < wanted.size(); ++i) {
    const int c = find(wanted[i]);
    if (c < 0) {
      fail_exr(source, "has no channel '" + wanted[i] + "'; there are: " + joined(names));
    }
    const auto plane = planes.data().subspan(c * planes.plane_stride(), planes.plane_stride());
    std::ranges::copy(plane, result.row(static_cast<int>(i), 0));
  }
  return result;
}

Image Layers::select(std::initializer_list<std::string> wanted) const {
  return select(std::span(wanted.begin(), wanted.size()));
}

Layers read_layers(const std::string& path, const ImageLimits& limits) {
  return decode_layers(read_file(path), path, limits);
}

Layers decode_layers(std::span<const uint8_t> file, const std::string& name, const ImageLimits& limits) {
  check_exr_attributes(file, name);
  try {
    MemoryInput stream(file, name);
    // One thread: callers decode several frames at a time. A damaged chunk table is an error, not to be guessed.
    exr::MultiPartInputFile input(stream, 0, false);
    check_header(name, input, std::ssize(file), limits);
    return read_part(input, name);
  } catch (const DataError&) {
    throw;
  } catch (const std::exception& error) {
    fail_exr(name, std::string("cannot be read as OpenEXR: ") + error.what());
  }
}

Bytes encode_layers(const std::string& name, const Layers& layers, ExrPixels pixels) {
  check_layers(name, layers);
  const Image& planes = layers.planes;
  const size_t stride = static_cast<size_t>(planes.row_stride());
  exr::Header header(planes.width(), planes.height());
  header.compression() = exr::ZIP_COMPRESSION;
  exr::FrameBuffer buffer;
  std::vector<std::vector<half>> halves(layers.names.size());
  for (int c = 0; c < planes.channels(); ++c) {
    const bool as_half = pixels == ExrPixels::half && !is_depth(layers.names[c]);
    const exr::PixelType type = as_half ? exr::HALF : exr::FLOAT;
    if (as_half) halves[c] = half_plane(name, layers, c);
    const void* values = as_half ? static_cast<const void*>(halves[c].data()) : planes.row(c, 0);
    const size_t size = as_half ? sizeof(half) : sizeof(float);
    header.channels().insert(layers.names[c], exr::Channel(type));
    buffer.insert(layers.names[c], exr::Slice::Make(type, values, header.dataWindow(), size, stride * size));
  }
  MemoryOutput stream(name);
  {
    exr::OutputFile output(stream, header, 0);
    output.setFrameBuffer(buffer);
    output.writePixels(planes.height());
  }
  return stream.take();
}

void write_layers(const std::string& path, const Layers& layers, ExrPixels pixels) {
  write_file(path, encode_layers(path, layers, pixels));
}

}  // namespace hsi4d
