#include "pipelines/locate/first_picture.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "core/check.h"
#include "core/file.h"
#include "core/image_io.h"
#include "core/mask_image.h"
#include "core/size_text.h"
#include "core/video.h"
#include "pipelines/draw/frame_images.h"
#include "pipelines/input/frame_source.h"

namespace hsi4d {

namespace {

namespace fs = std::filesystem;

constexpr int kPixelsOfMargin = 256;  // a mask grows by a pixel for so many of the longer side

void check_colors(const Image& image, const std::string& place) {
  if (image.channels() < 3)
    throw DataError(place + ": has " + std::to_string(image.channels()) + " channels; allowed: colours, 3");
  const std::span<const float> numbers = image.data();
  if (!std::all_of(numbers.begin(), numbers.end(), [](float value) { return std::isfinite(value); }))
    throw DataError(place + ": holds a number that is not finite; allowed: finite ones");
}

/// The mask of one thing; an empty image where `entry` holds none of the picture.
Image read_mask_of(const fs::path& entry, const std::string& name) {
  if (fs::is_directory(entry)) {
    const fs::path file = (entry / name).replace_extension(".png");
    return fs::exists(file) ? read_mask_image(file.string()) : Image();
  }
  if (is_video_name(entry.string())) return mask_of(VideoReader(entry.string()).read(0), entry.string() + ": frame 0");
  return entry.extension() == ".png" ? read_mask_image(entry.string()) : Image();
}

}  // namespace

FirstPicture read_first_picture(const fs::path& path) {
  FirstPicture picture{path.string(), path.filename().string(), {}, {}};
  Image image;
  if (fs::is_directory(path)) {
    const FrameSource frames(path, {});
    picture.place = frames.place(0);
    picture.name = frames.names().front();
    image = frames.read(0);
  } else if (is_video_name(path.string())) {
    picture.place += ": frame 0";
    picture.name = "0000.png";
    image = VideoReader(path.string()).read(0);
  } else {
    image = read_image(path.string());
    check_opaque(image, picture.place, "a frame");
  }
  check_colors(image, picture.place);
  picture.color = take_channels(image, 0, 3);
  return picture;
}

void leave_out_masks(const fs::path& folder, FirstPicture& picture) {
  if (!fs::is_directory(folder)) throw UserError(folder.string() + ": is no folder of masks");
  std::vector<fs::path> entries;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder)) {
    if (!is_hidden(entry.path().string())) entries.push_back(entry.path());
  }
  std::sort(entries.begin(), entries.end());
  const int height = picture.color.height(), width = picture.color.width();
  ClipFrame masks;
  for (const fs::path& entry : entries) {
    Image mask = read_mask_of(entry, picture.name);
    if (mask.empty()) continue;
    if (mask.height() != height || mask.width() != width)
      throw DataError(entry.string() + ": its mask is " + size_text(mask) + " pixels, the frame " +
                      size_text(width, height));
    masks.object_masks.push_back(std::move(mask));
  }
  if (masks.object_masks.empty())
    throw UserError(folder.string() + ": holds no mask of " + picture.name + "; allowed: THING/" +
                    fs::path(picture.name).replace_extension(".png").string() + ", THING.png or THING.mp4");
  DataSettings settings;
  settings.mask_margin_px = (std::max(height, width) + kPixelsOfMargin - 1) / kPixelsOfMargin;
  masks.human_mask = masks.object_masks.back();
  masks.object_masks.pop_back();
  Image covered(1, height, width);
  add_covered(masks, settings, covered);
  picture.weight = complement(covered);
  const std::span<const float> numbers = picture.weight.data();
  if (std::none_of(numbers.begin(), numbers.end(), [](float value) { return value > 0; }))
    throw UserError(folder.string() + ": the masks cover all of " + picture.place + "; nothing is left to compare");
}

}  // namespace hsi4d
