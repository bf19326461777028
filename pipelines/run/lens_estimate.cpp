#include "pipelines/run/lens_estimate.h"

#include <cmath>

#include "core/golden_section.h"
#include "core/mask_image.h"
#include "optim/metrics.h"
#include "pipelines/draw/frame_images.h"
#include "pipelines/run/reconstruct_stage.h"

namespace hsi4d {

namespace {

constexpr int kBendSteps = 20;         // of the first look
constexpr double kBendFineness = 1e4;  // steps of what is told in a unit of k1

}  // namespace

LensEstimate estimated_lens(const RunConfig& config, const Clip& clip) {
  ColorState colors;
  colors.nets = first_nets(config, clip);
  const Image drawn = render_state(config, clip, clip.first, colors);
  const auto psnr_with = [&](double k1) {
    Clip bent;  // of the video alone: Gaussians are not copied
    bent.camera = clip.camera;
    bent.video = clip.video;
    Lens lens = config.data.lens.lens;
    lens.k1 = k1;
    set_lens(lens, bent);
    const ClipFrame frame = read_frame(bent, 0);
    Image covered(1, frame.target.height(), frame.target.width());
    add_covered(frame, config.data, covered);
    Image background = complement(covered);
    hide_unseen(frame, background);
    return psnr_db(drawn, frame.target, background).value_or(-HUGE_VAL);
  };
  const Bracket found = bracket_of_largest({-kMostBend, kMostBend}, kBendSteps, psnr_with,
                                           [](const Bracket& b) { return b.high - b.low <= 0.25 / kBendFineness; });
  const double k1 = std::round(0.5 * (found.low + found.high) * kBendFineness) / kBendFineness;
  return {k1, psnr_with(k1), found.low <= -kMostBend || found.high >= kMostBend};
}

}  // namespace hsi4d
