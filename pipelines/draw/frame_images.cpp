#include "pipelines/draw/frame_images.h"

#include <algorithm>
#include <cmath>
#include <functional>

#include "core/mask_image.h"
#include "pipelines/draw/report_images.h"

namespace hsi4d {

namespace {

/// Pixels of `mask` at or above the threshold, grown by `margin` pixels to all sides, are set in `covered`.
void add_covered(const Image& mask, double threshold, int margin, Image& covered) {
  const int height = mask.height(), width = mask.width();
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      if (static_cast<double>(mask(0, y, x)) < threshold) continue;
      for (int i = std::max(0, y - margin); i <= std::min(height - 1, y + margin); ++i) {
        std::fill(covered.row(0, i) + std::max(0, x - margin), covered.row(0, i) + std::min(width, x + margin + 1),
                  1.0F);
      }
    }
  }
}

}  // namespace

void add_covered(const ClipFrame& frame, const DataSettings& data, Image& covered) {
  add_covered(frame.human_mask, data.mask_threshold, data.mask_margin_px, covered);
  for (const auto* masks : {&frame.object_masks, &frame.other_masks}) {
    for (const Image& mask : *masks) add_covered(mask, data.mask_threshold, data.mask_margin_px, covered);
  }
}

Image background_of(const ClipFrame& frame) {
  const int width = frame.target.width(), height = frame.target.height();
  DataSettings wide;
  wide.mask_threshold = 0.1;
  wide.mask_margin_px = std::max(width, height) / 64;
  Image covered(1, height, width);
  add_covered(frame, wide, covered);
  Image background = complement(covered);
  hide_unseen(frame, background);
  return background;
}

Image foreground_of(const ClipFrame& frame) {
  Image result = frame.human_mask;
  for (const auto* masks : {&frame.object_masks, &frame.other_masks}) {
    for (const Image& mask : *masks) {
      for (int y = 0; y < result.height(); ++y) {
        for (int x = 0; x < result.width(); ++x) result(0, y, x) = std::max(result(0, y, x), mask(0, y, x));
      }
    }
  }
  return result;
}

void hide_unseen(const ClipFrame& frame, Image& image) {
  if (frame.seen.empty()) return;
  for (int c = 0; c < image.channels(); ++c) {
    for (int y = 0; y < image.height(); ++y) {
      const float* const seen = frame.seen.row(0, y);
      std::transform(image.row(c, y), image.row(c, y) + image.width(), seen, image.row(c, y), std::multiplies());
    }
  }
}

Image difference_image(const Image& a, const Image& b) {
  Image result(a.channels(), a.height(), a.width());
  for (int c = 0; c < a.channels(); ++c) {
    for (int y = 0; y < a.height(); ++y) {
      for (int x = 0; x < a.width(); ++x)
        result(c, y, x) = static_cast<float>(kDifferenceGain) * std::fabs(a(c, y, x) - b(c, y, x));
    }
  }
  return result;
}

template <class S>
Image to_image(const ConstArray<S>& array) {
  Image image(static_cast<int>(array.shape.planes), static_cast<int>(array.shape.rows),
              static_cast<int>(array.shape.cols));
  for (int c = 0; c < image.channels(); ++c) {
    for (int y = 0; y < image.height(); ++y) {
      for (int x = 0; x < image.width(); ++x) image(c, y, x) = static_cast<float>(array(c, y, x));
    }
  }
  return image;
}

template Image to_image(const ConstArray<float>&);
template Image to_image(const ConstArray<double>&);

}  // namespace hsi4d
