#include "pipelines/photos/photo.h"

#include <algorithm>
#include <cmath>

#include "core/check.h"
#include "core/file.h"
#include "core/image_io.h"
#include "core/mask_image.h"
#include "core/text.h"

namespace hsi4d {

namespace fs = std::filesystem;

namespace {

void check_size(const Image& image, const Camera& camera, const fs::path& file, const char* what) {
  if (image.width() == camera.width && image.height() == camera.height) return;
  throw DataError(file.string() + ": " + what + " of " + std::to_string(image.width()) + " x " +
                  std::to_string(image.height()) + " pixels; its camera has " + std::to_string(camera.width) + " x " +
                  std::to_string(camera.height));
}

void check_finite(const Image& image, const fs::path& file) {
  for (int y = 0; y < image.height(); ++y) {
    for (int c = 0; c < image.channels(); ++c) {
      const float* const row = image.row(c, y);
      const float* const bad = std::find_if(row, row + image.width(), [](float x) { return !std::isfinite(x); });
      if (bad == row + image.width()) continue;
      throw DataError(file.string() + ": the pixel of row " + std::to_string(y) + " and column " +
                      std::to_string(bad - row) + " is not finite");
    }
  }
}

bool is_exr(const fs::path& file) {
  const Bytes start = read_file_start(file.string(), 4);
  return start == Bytes{0x76, 0x2f, 0x31, 0x01};
}

/// Whether a file is a grey PNG of 16 bits, by its header.
bool is_grey_png_of_16_bits(const fs::path& file) {
  constexpr std::size_t kBits = 24, kColorType = 25;  // in the chunk IHDR
  const Bytes start = read_file_start(file.string(), 26);
  return start.size() == 26 && start[1] == 'P' && start[2] == 'N' && start[3] == 'G' && start[kBits] == 16 &&
         start[kColorType] == 0;
}

/// Camera z of a depth image. Files of whole numbers count units, EXR has the world's.
Image read_depth(const fs::path& file, double unit) {
  const bool is_float = is_exr(file);
  if (!is_float && !is_grey_png_of_16_bits(file))
    throw DataError(file.string() + ": is no depth image that is read; allowed: a grey PNG of 16 bits, OpenEXR");
  constexpr float kSixteenBits = 65535;
  Image depth = read_image(file.string());
  if (depth.channels() != 1)
    throw DataError(file.string() + ": has " + std::to_string(depth.channels()) + " channels; depths have one");
  for (float& z : depth.data()) {
    if (!is_float) z = static_cast<float>(std::round(z * kSixteenBits) * unit);
    if (!(z >= 0 && z <= kLargestDepth))
      throw DataError(file.string() + ": a depth of " + number_text(z) + "; allowed: 0 where it is not known, to " +
                      number_text(kLargestDepth));
  }
  return depth;
}

Image read_photo_mask(const PosedImage& posed) {
  Image mask = read_mask_image(posed.mask.string());
  check_size(mask, posed.camera, posed.mask, "a mask");
  if (!label_greys(mask).empty())
    throw DataError(posed.mask.string() +
                    ": its greys look like numbers of labels; allowed: 0 to 255 for shares, or 0 and 255");
  return mask;
}

Image filled(int height, int width, float number) {
  Image image(1, height, width);
  for (int y = 0; y < height; ++y) std::fill_n(image.row(0, y), width, number);
  return image;
}

/// a b, pixel by pixel; b has one channel.
Image product(Image a, const Image& b) {
  for (int c = 0; c < a.channels(); ++c) {
    for (int y = 0; y < a.height(); ++y) {
      for (int x = 0; x < a.width(); ++x) a(c, y, x) *= b(0, y, x);
    }
  }
  return a;
}

/// a / b, 0 where b is.
Image quotient(Image a, const Image& b) {
  for (int c = 0; c < a.channels(); ++c) {
    for (int y = 0; y < a.height(); ++y) {
      for (int x = 0; x < a.width(); ++x) a(c, y, x) = b(0, y, x) > 0 ? a(c, y, x) / b(0, y, x) : 0.0F;
    }
  }
  return a;
}

/// Resamples colour, alpha and weight by means of what counts and is there: w, w α and w α c.
/// @param resample  makes another image of an image; @param changes_weight  it may leave pixels out
template <class Resample>
void resample_planes(Photo& photo, bool changes_weight, const Resample& resample) {
  const bool has_alpha = !photo.alpha.empty(), has_weight = !photo.weight.empty();
  const int height = photo.color.height(), width = photo.color.width();
  const Image weight = has_weight ? photo.weight : filled(height, width, 1);
  const Image shown = has_alpha ? product(weight, photo.alpha) : weight;
  const Image color_sum = resample(product(photo.color, shown)), shown_sum = resample(shown);
  const Image weight_sum = has_alpha ? resample(weight) : shown_sum;
  photo.color = quotient(color_sum, shown_sum);
  if (has_alpha) photo.alpha = quotient(shown_sum, weight_sum);
  if (has_weight || changes_weight) photo.weight = weight_sum;
}

/// The nearest number of another size: depths across an edge have no mean.
Image nearest(const Image& image, int height, int width) {
  Image result(image.channels(), height, width);
  for (int c = 0; c < image.channels(); ++c) {
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {
        const int row = static_cast<int>((y + 0.5) * image.height() / height);
        const int col = static_cast<int>((x + 0.5) * image.width() / width);
        result(c, y, x) = image(c, row, col);
      }
    }
  }
  return result;
}

void straighten(const Lens& lens, Photo& photo) {
  if (lens.is_straight()) return;
  const auto bilinear = [&](const Image& image) { return straightened(image, photo.camera, lens).image; };
  resample_planes(photo, true, bilinear);
  if (!photo.depth.empty()) photo.depth = straightened(photo.depth, photo.camera, lens, Sampling::kNearest).image;
}

void reduce(int longest_side, Photo& photo) {
  if (longest_side == 0 || std::max(photo.camera.width, photo.camera.height) <= longest_side) return;
  photo.camera = reduced_camera(photo.camera, longest_side);
  const int height = photo.camera.height, width = photo.camera.width;
  resample_planes(photo, false, [&](const Image& image) { return resize_area(image, height, width); });
  if (!photo.depth.empty()) photo.depth = nearest(photo.depth, height, width);
}

/// Colours of three channels, and alpha where there is one.
void take_colors(const Image& read, const fs::path& file, Photo& photo) {
  const bool has_alpha = read.channels() == 2 || read.channels() == 4;
  photo.color = take_channels(read, 0, read.channels() - (has_alpha ? 1 : 0));
  if (photo.color.channels() == 1) {
    Image color(3, read.height(), read.width());
    for (int c = 0; c < 3; ++c) std::copy_n(photo.color.row(0, 0), photo.color.plane_stride(), color.row(c, 0));
    photo.color = std::move(color);
  }
  if (!has_alpha) return;
  photo.alpha = take_channels(read, read.channels() - 1, 1);
  if (is_exr(file)) photo.color = quotient(std::move(photo.color), photo.alpha);
}

}  // namespace

Camera photo_camera(const PosedImage& posed, const PhotoRules& rules) {
  return rules.longest_side > 0 ? reduced_camera(posed.camera, rules.longest_side) : posed.camera;
}

Photo read_photo(const PosedImage& posed, const PhotoRules& rules) {
  Photo photo;
  photo.camera = posed.camera;
  const Image read = read_image(posed.image.string());
  check_size(read, posed.camera, posed.image, "a picture");
  check_finite(read, posed.image);
  take_colors(read, posed.image, photo);
  if (!posed.mask.empty()) {
    Image mask = read_photo_mask(posed);
    if (rules.masks == MaskMeaning::kCounts) {
      photo.weight = std::move(mask);
    } else {
      photo.alpha = photo.alpha.empty() ? std::move(mask) : product(std::move(photo.alpha), mask);
    }
  }
  if (!posed.depth.empty()) {
    photo.depth = read_depth(posed.depth, rules.depth_unit);
    check_size(photo.depth, posed.camera, posed.depth, "depths");
  }
  straighten(posed.lens, photo);
  reduce(rules.longest_side, photo);
  return photo;
}

}  // namespace hsi4d
