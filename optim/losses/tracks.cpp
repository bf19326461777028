// L = (1/P) Σ c ρ(|p − q|²), 0 for what is not before the camera: p a point of the human's or an object's surface as
// the camera sees it, whatever is before it, q where a tracker has followed it to, pixels, c how sure it is that the
// point is seen.   ρ: squared r²; huber r² up to the scale s, then 2 s |r| − s²; geman_mcclure s² r² / (s² + r²).
#include "autodiff/map.h"
#include "optim/losses/image_points.h"
#include "optim/losses/list.h"

namespace hsi4d {

namespace {

struct TracksSettings {
  RobustKernel kernel = RobustKernel::kGemanMcClure;
  double scale_px = 10;
  double min_visible = 0.5;
};

void describe(ConfigFields& fields, TracksSettings& settings) {
  fields.choice("kernel", settings.kernel, kPointKernels,
                "Of a distance: geman_mcclure, by which one far beyond scale_px no longer pulls; huber, constant "
                "pull; its square");
  fields.number("scale_px", settings.scale_px, {.above = 0, .max = 1e6},
                "Distance up to which the kernel is nearly the square, pixels of the image that is drawn");
  fields.number("min_visible", settings.min_visible, {.min = 0, .max = 1},
                "Below so much of `visible` a point does not count in a frame");
}

}  // namespace

LossTerm tracks_loss() {
  LossTerm term =
      needing({LossInput::kTracks},
              make_loss_term<TracksSettings>(
                  "tracks", "Distance between points of what moves and where a tracker has followed them to",
                  [](const auto& in, const TracksSettings& settings) {
                    return mean_robust_distance(in.tracks, in.tracks_target, settings.kernel,
                                                static_cast<float>(settings.scale_px),
                                                static_cast<float>(settings.min_visible));
                  }));
  term.description.weight = kPointWeight;
  return term;
}

}  // namespace hsi4d
