#include "pipelines/run/pixel_filter.h"

#include <algorithm>
#include <cmath>

#include "core/golden_section.h"
#include "optim/metrics.h"
#include "pipelines/draw/frame_images.h"
#include "pipelines/run/reconstruct_stage.h"

namespace hsi4d {

namespace {

constexpr int kSteps = 12;          // of the first look at all widths
constexpr int kMarginPx = 2;        // around silhouettes
constexpr double kFineness = 1000;  // steps of what is told in a squared pixel
constexpr double kFinest = 0.25 / kFineness;

/// Pixels that the masks of frame 0 show, and those around; all where there are none.
Image looked_at(const RunConfig& config, const ClipFrame& frame) {
  DataSettings data = config.data;
  data.mask_margin_px = kMarginPx;
  Image pixels(1, frame.target.height(), frame.target.width());
  add_covered(frame, data, pixels);
  const auto is_set = [](float x) { return x > 0; };
  if (std::none_of(pixels.data().begin(), pixels.data().end(), is_set)) {
    for (int y = 0; y < pixels.height(); ++y) std::fill_n(pixels.row(0, y), pixels.width(), 1.0F);
  }
  return pixels;
}

/// Frame 0 beside its drawings with one filter after another.
class Comparison {
 public:
  Comparison(const RunConfig& config, const Clip& clip)
      : config_(config), clip_(clip), frame_(read_frame(clip, 0)), pixels_(looked_at(config, frame_)) {
    colors_.nets = first_nets(config, clip);
  }

  /// @param width  standard deviation, pixels
  double psnr_db(double width) {
    config_.render.blur = width * width;
    return *hsi4d::psnr_db(render_state(config_, clip_, clip_.first, colors_), frame_.target, pixels_);
  }

 private:
  RunConfig config_;
  const Clip& clip_;
  ClipFrame frame_;
  Image pixels_;
  ColorState colors_;
};

}  // namespace

PixelFilter estimated_pixel_filter(const RunConfig& config, const Clip& clip) {
  Comparison comparison(config, clip);
  const auto [low, high] = bracket_of_largest(
      {0, kWidestFilter}, kSteps, [&](double width) { return comparison.psnr_db(width); },
      [](const Bracket& b) { return b.high * b.high - b.low * b.low <= kFinest; });
  const double width = 0.5 * (low + high), blur = std::round(width * width * kFineness) / kFineness;
  return {blur, comparison.psnr_db(std::sqrt(blur)), high >= kWidestFilter};
}

}  // namespace hsi4d
