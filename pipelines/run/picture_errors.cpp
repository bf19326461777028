#include "pipelines/run/picture_errors.h"

#include <algorithm>
#include <optional>
#include <vector>

#include "pipelines/draw/frame_images.h"
#include "pipelines/metrics/background_errors.h"
#include "pipelines/metrics/sequence_errors.h"

namespace hsi4d {

namespace {

/// 1 where neither masks nor drawn people are.
Image background_beside(const StatePicture& picture, const ClipFrame& frame) {
  constexpr float kHardlyHuman = 0.02F;
  Image background = background_of(frame);
  for (int y = 0; y < background.height(); ++y) {
    for (int x = 0; x < background.width(); ++x) {
      const auto is_at = [x, y](const Image& silhouette) { return silhouette(0, y, x) > kHardlyHuman; };
      if (is_at(picture.silhouette) || std::any_of(picture.others.begin(), picture.others.end(), is_at))
        background(0, y, x) = 0;
    }
  }
  return background;
}

}  // namespace

MetricValues picture_errors(const StatePicture& picture, const ClipFrame& frame) {
  const Image foreground = foreground_of(frame);
  MetricValues errors = image_errors(picture.image, frame.target, &foreground);
  const MetricValues background = background_errors(picture.image, frame.target, background_beside(picture, frame));
  errors.insert(errors.end(), background.begin(), background.end());
  std::vector<FrameMetrics> ious;  // of the people that masks show
  for (std::size_t p = 0; p <= picture.others.size(); ++p) {
    const std::optional<double> iou =
        mask_iou(p == 0 ? picture.silhouette : picture.others[p - 1], frame.person_mask(p));
    if (iou) ious.push_back({0, {{"silhouette_iou", *iou}}});
  }
  const MetricValues mean = mean_errors(ious);
  errors.insert(errors.end(), mean.begin(), mean.end());
  return errors;
}

}  // namespace hsi4d
