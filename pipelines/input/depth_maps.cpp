#include "pipelines/input/depth_maps.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "core/check.h"
#include "core/exr.h"
#include "core/image_io.h"
#include "core/log.h"
#include "core/npz.h"
#include "core/parallel.h"
#include "core/size_text.h"
#include "core/text.h"
#include "pipelines/input/clip.h"

namespace hsi4d {

namespace {

namespace fs = std::filesystem;

constexpr std::array<const char*, 4> kEndings = {".png", ".exr", ".npy", ".npz"};
constexpr std::array<const char*, 3> kArrays = {"depth", "disparity", "confidence"};

/// A spread that is rounding alone, of the largest number.
constexpr double kLeastSpread = 1e-6;

// ---- Files ----

/// The file of a frame in a folder; empty: none.
fs::path file_of(const fs::path& folder, const std::string& frame) {
  fs::path found;
  for (const char* ending : kEndings) {
    const fs::path file = folder / (fs::path(frame).stem().string() + ending);
    if (!fs::exists(file)) continue;
    if (!found.empty())
      throw DataError(found.string() + ", " + file.string() + ": both are of the frame \"" + frame + "\"; remove one");
    found = file;
  }
  return found;
}

/// Files of all frames, some of which may be missing, but not all.
/// @param what  "depth map"
std::vector<fs::path> files_of(const fs::path& folder, const FrameSource& frames, const char* what) {
  if (!fs::is_directory(folder)) throw UserError(folder.string() + ": is no folder of " + what + "s");
  std::vector<fs::path> files;
  for (const std::string& name : frames.names()) files.push_back(file_of(folder, name));
  if (std::all_of(files.begin(), files.end(), [](const fs::path& file) { return file.empty(); }))
    throw DataError(folder.string() + ": has no " + what + " for any of " + std::to_string(frames.count()) +
                    " frames; allowed: a file has the name of its frame, the first \"" +
                    fs::path(frames.names().front()).stem().string() + "\", and ends in " +
                    joined(std::vector<std::string>(kEndings.begin(), kEndings.end()), " or "));
  return files;
}

// ---- What is in one ----

bool begins_with(const Bytes& file, std::string_view magic) {
  return file.size() >= magic.size() && std::equal(magic.begin(), magic.end(), file.begin(),
                                                   [](char a, uint8_t b) { return static_cast<uint8_t>(a) == b; });
}

/// One plane of an image whose planes are all alike.
Image only_plane(const Image& image, const std::string& name) {
  const auto is_first = [&image](int c) { return take_channels(image, c, 1) == take_channels(image, 0, 1); };
  if (image.channels() == 1 || (image.channels() == 3 && is_first(1) && is_first(2))) return take_channels(image, 0, 1);
  throw DataError(name + ": has " + std::to_string(image.channels()) +
                  " channels; allowed: a grey picture, of one channel or three alike");
}

Image plane_of(const Layers& layers) {
  for (const char* name : {"Z", "Y"}) {
    if (layers.find(name) >= 0) return layers.select({name});
  }
  return layers.names.size() == 1 ? layers.planes : only_plane(layers.select({"R", "G", "B"}), layers.source);
}

Image image_of(const NpyArray& array, const ImageLimits& limits) {
  std::vector<std::int64_t> shape = array.shape();
  while (shape.size() > 2 && shape.front() == 1) shape.erase(shape.begin());
  while (shape.size() > 2 && shape.back() == 1) shape.pop_back();
  if (shape.size() != 2 || shape[0] < 1 || shape[1] < 1)
    throw DataError(array.source() + ": has shape " + shape_text(array.shape()) + "; allowed: [H,W]");
  check_image_size(array.source(), 1, shape[0], shape[1], limits);
  return from_interleaved(array.as<float>(), static_cast<int>(shape[0]), static_cast<int>(shape[1]), 1);
}

const NpyArray& array_of(const Npz& archive) {
  if (archive.names().size() == 1) return archive.array(archive.names().front());
  std::vector<std::string> found;
  for (const char* name : kArrays) {
    if (archive.has(name)) found.emplace_back(name);
  }
  if (found.size() == 1) return archive.array(found.front());
  throw DataError(archive.source() + ": holds " + (archive.names().empty() ? "no arrays" : joined(archive.names())) +
                  "; allowed: one array, or one of the names " +
                  joined(std::vector<std::string>(kArrays.begin(), kArrays.end())));
}

// ---- Of the camera's size ----

void check_shape(const Image& map, const Camera& camera, const std::string& name) {
  const double across = static_cast<double>(map.width()) / camera.width,
               down = static_cast<double>(map.height()) / camera.height;
  const double least = std::min({map.width(), map.height(), camera.width, camera.height});
  if (std::abs(across / down - 1) <= 1 / least) return;
  throw DataError(name + ": is " + size_text(map) + " pixels, the camera's image " + size_text(camera) +
                  "; allowed: any size of its shape");
}

/// Each pixel by the nearest: depths across an edge have no mean.
Image nearest(const Image& map, const Camera& camera) {
  Image result(1, camera.height, camera.width);
  for (int y = 0; y < camera.height; ++y) {
    const auto from_y = static_cast<int>((2 * std::int64_t{y} + 1) * map.height() / (2 * std::int64_t{camera.height}));
    for (int x = 0; x < camera.width; ++x) {
      const auto from_x = static_cast<int>((2 * std::int64_t{x} + 1) * map.width() / (2 * std::int64_t{camera.width}));
      result(0, y, x) = map(0, from_y, from_x);
    }
  }
  return result;
}

Image read_plane(const fs::path& file, const Camera& camera) {
  const Image map = decode_depth_map(read_file(file.string()), file.string());
  check_shape(map, camera, file.string());
  return nearest(map, camera);
}

/// Weights, the largest 1.
Image read_weights(const fs::path& file, const Camera& camera) {
  Image weights = read_plane(file, camera);
  float largest = 0;
  for (float& weight : weights.data()) {
    if (!std::isfinite(weight)) weight = 0;
    if (weight < 0)
      throw DataError(file.string() + ": a confidence of " + number_text(weight) + "; allowed: 0 and more");
    largest = std::max(largest, weight);
  }
  for (float& weight : weights.data()) weight = largest > 0 ? weight / largest : 0;
  return weights;
}

struct MapStatistics {
  double weight = 0, mean = 0, spread = 0, largest = 0;
};

/// Of what is known.
MapStatistics statistics_of(const Image& values, const Image& weights) {
  MapStatistics m;
  const auto each = [&](auto use) {
    for (int y = 0; y < values.height(); ++y) {
      for (int x = 0; x < values.width(); ++x)
        use(static_cast<double>(weights(0, y, x)), static_cast<double>(values(0, y, x)));
    }
  };
  each([&m](double w, double value) {
    m.weight += w;
    m.mean += w * value;
    m.largest = std::max(m.largest, w > 0 ? std::abs(value) : 0);
  });
  if (m.weight == 0) return m;
  m.mean /= m.weight;
  each([&m](double w, double value) { m.spread += w * (value - m.mean) * (value - m.mean); });
  m.spread = std::sqrt(m.spread / m.weight);
  return m;
}

/// Gives what is known mean 0 and standard deviation 1. Empty where it has none.
DepthMap standardised(Image values, Image weights) {
  for (int y = 0; y < values.height(); ++y) {
    for (int x = 0; x < values.width(); ++x) {
      if (std::isfinite(values(0, y, x)) && values(0, y, x) != 0) continue;
      values(0, y, x) = weights(0, y, x) = 0;
    }
  }
  const MapStatistics m = statistics_of(values, weights);
  if (!(m.spread > kLeastSpread * m.largest)) return {};
  for (int y = 0; y < values.height(); ++y) {
    for (int x = 0; x < values.width(); ++x) {
      const double value = (static_cast<double>(values(0, y, x)) - m.mean) / m.spread;
      values(0, y, x) = weights(0, y, x) > 0 ? static_cast<float>(value) : 0;
    }
  }
  return {std::move(values), std::move(weights)};
}

}  // namespace

DepthMaps find_depth_maps(const DataSettings& data, const FrameSource& frames) {
  DepthMaps maps;
  maps.files = files_of(data.depth_maps, frames, "depth map");
  std::vector<Index> missing;
  for (Index t = 0; t < frames.count(); ++t) {
    if (maps.files[static_cast<std::size_t>(t)].empty()) missing.push_back(t);
  }
  if (!missing.empty())
    log_warning(data.depth_maps.string() + ": has no depth map for " + std::to_string(missing.size()) + " of " +
                std::to_string(frames.count()) + " frames; the loss depth_map is off there");
  if (data.depth_confidence.empty()) return maps;
  maps.confidences = files_of(data.depth_confidence, frames, "confidence");
  for (std::size_t t = 0; t < maps.files.size(); ++t) {
    if (!maps.files[t].empty() && maps.confidences[t].empty())
      throw DataError(data.depth_confidence.string() + ": has no file for the depth map " + maps.files[t].string() +
                      "; allowed: one for each");
  }
  return maps;
}

Image decode_depth_map(Bytes file, const std::string& name, const ImageLimits& limits) {
  if (begins_with(file, "\x93NUMPY")) {
    const NpyResult result = decode_npy(std::move(file), name);
    if (!result.array) throw DataError(name + ": " + result.unread_reason);
    return image_of(*result.array, limits);
  }
  if (begins_with(file, "PK")) return image_of(array_of(Npz::decode(file, name, limits.max_bytes)), limits);
  if (begins_with(file, "\x76\x2f\x31\x01")) return plane_of(decode_layers(file, name, limits));
  return only_plane(decode_image(file, name, limits), name);
}

DepthMap read_depth_map(const DepthMaps& maps, const Camera& camera, Index frame) {
  const auto t = static_cast<std::size_t>(frame);
  const fs::path& file = maps.files.at(t);
  if (file.empty()) return {};
  Image weights;
  if (maps.confidences.empty()) {
    weights = Image(1, camera.height, camera.width);
    for (int y = 0; y < camera.height; ++y) std::fill_n(weights.row(0, y), camera.width, 1.0F);
  } else {
    weights = read_weights(maps.confidences[t], camera);
  }
  return standardised(read_plane(file, camera), std::move(weights));
}

void check_depth_maps(const DepthMaps& maps, const Camera& camera) {
  std::vector<char> is_idle(maps.files.size(), 0);  // there, and says nothing
  parallel_for(std::ssize(maps.files), 1, [&](Index begin, Index end) {
    for (Index t = begin; t < end; ++t) {
      const auto at = static_cast<std::size_t>(t);
      is_idle[at] = !maps.files[at].empty() && read_depth_map(maps, camera, t).values.empty() ? 1 : 0;
    }
  });
  std::vector<Index> idle;
  Index given = 0;
  for (std::size_t t = 0; t < is_idle.size(); ++t) {
    if (is_idle[t] != 0) idle.push_back(static_cast<Index>(t));
    given += maps.files[t].empty() ? 0 : 1;
  }
  if (idle.empty()) return;
  const std::string text = maps.files[static_cast<std::size_t>(idle.front())].string() +
                           ": says nothing of depths: all that is known of it is one number";
  if (std::ssize(idle) == given) throw DataError(text + ", as in all other depth maps");
  log_warning(text + "; the loss depth_map is off in " + (idle.size() == 1 ? "frame " : "frames ") +
              frame_ranges(idle));
}

}  // namespace hsi4d
