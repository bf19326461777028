#include "pipelines/draw/report_images.h"

#include <algorithm>
#include <charconv>
#include <filesystem>
#include <map>
#include <optional>
#include <system_error>
#include <utility>

#include "core/check.h"
#include "core/image_io.h"
#include "core/parallel.h"

namespace hsi4d {
namespace {

namespace fs = std::filesystem;

/// How images are written: the video and its reconstruction, and the others, which are looked at less closely.
struct Packing {
  int quality = 0;         // of JPEG; 0: files as they are
  int compared_parts = 4;  // quarters of the width
  int other_parts = 4;
};

/// From the best to the smallest.
constexpr std::array<Packing, 6> kPackings = {{{}, {90, 4, 4}, {85, 4, 2}, {80, 4, 2}, {75, 4, 2}, {70, 3, 2}}};

constexpr int kLeastWidth = 160;  // pixels, below which no image is shrunk
constexpr size_t kSampledFrames = 5;

/// "0007_render.png" -> 7 and the place of "render" in kFrameKinds.
std::optional<std::pair<int, size_t>> parse_image_name(const std::string& name) {
  const size_t bar = name.find('_');
  if (bar == std::string::npos || bar < 4 || !name.ends_with(".png")) return std::nullopt;
  int frame = 0;
  const auto [end, error] = std::from_chars(name.data(), name.data() + bar, frame);
  if (error != std::errc() || end != name.data() + bar || frame < 0) return std::nullopt;
  const std::string kind = name.substr(bar + 1, name.size() - bar - 5);
  const auto* const at = std::find(kFrameKinds.begin(), kFrameKinds.end(), kind);
  if (at == kFrameKinds.end()) return std::nullopt;
  return std::pair(frame, static_cast<size_t>(at - kFrameKinds.begin()));
}

/// The files of a frame, "" where there is none.
struct FrameFiles {
  int frame = 0;
  std::array<std::string, kFrameKinds.size()> names;
};

std::vector<FrameFiles> find_images(const fs::path& folder) {
  std::map<int, FrameFiles> files;
  std::error_code error;
  for (fs::directory_iterator it(folder, error), end; !error && it != end; it.increment(error)) {
    const auto parsed = parse_image_name(it->path().filename().string());
    if (!parsed) continue;
    files[parsed->first].frame = parsed->first;
    files[parsed->first].names[parsed->second] = it->path().string();
  }
  std::vector<FrameFiles> frames;
  for (auto& [frame, names] : files) frames.push_back(std::move(names));
  return frames;
}

Image shrunk(const Image& image, int quarters) {
  const int width = std::max(std::min(image.width(), kLeastWidth), image.width() * quarters / 4);
  if (width == image.width()) return image;
  return resize_area(image, std::max(1, static_cast<int>(int64_t{image.height()} * width / image.width())), width);
}

/// A file of frames/ as the report has it; nothing where it is no image.
std::optional<Bytes> packed_file(const std::string& path, size_t kind, const Packing& packing) {
  Bytes file = read_file(path);
  if (image_mime(file) != "image/png") return std::nullopt;
  if (packing.quality == 0) return file;
  try {
    Image image = decode_image(file, path);
    if (image.channels() != 1 && image.channels() != 3) return file;
    image = shrunk(image, kind < kNeededKinds ? packing.compared_parts : packing.other_parts);
    return encode_image("report.jpg", image, {.jpeg_quality = packing.quality, .jpeg_half_color = true});
  } catch (const DataError&) {
    return std::nullopt;
  }
}

/// The bytes that frames take in a packing, told from some of them.
size_t expected_bytes(const std::vector<FrameFiles>& frames, const Packing& packing) {
  const size_t step = (frames.size() + kSampledFrames - 1) / kSampledFrames;
  size_t bytes = 0, sampled = 0;
  for (size_t f = step / 2; f < frames.size(); f += step, ++sampled) {
    for (size_t k = 0; k < kFrameKinds.size(); ++k) {
      if (!frames[f].names[k].empty()) bytes += packed_file(frames[f].names[k], k, packing).value_or(Bytes{}).size();
    }
  }
  return bytes * frames.size() / sampled;
}

/// The best packing that is small enough, or the smallest, and what it takes.
std::pair<Packing, size_t> choose_packing(const std::vector<FrameFiles>& frames, const ImageBudget& budget) {
  size_t bytes = 0;
  for (const Packing& packing : kPackings) {
    bytes = expected_bytes(frames, packing);
    if (bytes <= budget.wanted) return {packing, bytes};
  }
  return {kPackings.back(), bytes};
}

void thin_out(std::vector<FrameFiles>& frames, size_t bytes, size_t most, std::vector<std::string>& notes) {
  const size_t step = (bytes + most - 1) / most;
  if (step <= 1) return;
  notes.push_back("Of " + std::to_string(frames.size()) + " frames with images every " + std::to_string(step) +
                  "th is shown, to keep this file small.");
  std::vector<FrameFiles> kept;
  for (size_t f = 0; f < frames.size(); f += step) kept.push_back(std::move(frames[f]));
  frames = std::move(kept);
}

void tell_missing(const std::vector<FrameFiles>& frames, const std::vector<FrameImages>& images,
                  std::vector<std::string>& notes) {
  for (size_t k = 0; k < kFrameKinds.size(); ++k) {
    size_t missing = 0;
    for (size_t f = 0; f < frames.size(); ++f) {
      if (frames[f].names[k].empty()) {
        ++missing;
      } else if (images[f].files[k].empty()) {
        notes.push_back("frames/" + fs::path(frames[f].names[k]).filename().string() + " is not a PNG image.");
      }
    }
    if (missing > 0 && k < kNeededKinds)
      notes.push_back("Of " + std::to_string(frames.size()) + " frames " + std::to_string(missing) +
                      " have no image of the kind \"" + std::string(kFrameKinds[k]) + "\".");
  }
}

}  // namespace

std::vector<FrameImages> read_frame_images(const std::string& folder, std::vector<std::string>& notes,
                                           const ImageBudget& budget) {
  std::vector<FrameFiles> frames = find_images(folder);
  if (frames.empty()) {
    notes.emplace_back("There are no images in frames/.");
    return {};
  }
  const auto [packing, bytes] = choose_packing(frames, budget);
  thin_out(frames, bytes, budget.most, notes);
  std::vector<FrameImages> images(frames.size());
  run_chunks(std::ssize(frames), [&, packing = packing](Index f) {
    const auto at = static_cast<size_t>(f);
    images[at].frame = frames[at].frame;
    for (size_t k = 0; k < kFrameKinds.size(); ++k) {
      if (!frames[at].names[k].empty())
        images[at].files[k] = packed_file(frames[at].names[k], k, packing).value_or(Bytes{});
    }
  });
  tell_missing(frames, images, notes);
  return images;
}

std::string_view image_mime(const Bytes& file) {
  const auto begins_with = [&file](std::initializer_list<uint8_t> start) {
    return file.size() > start.size() && std::equal(start.begin(), start.end(), file.begin());
  };
  if (begins_with({0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n'})) return "image/png";
  if (begins_with({0xff, 0xd8, 0xff})) return "image/jpeg";
  return "";
}

}  // namespace hsi4d
