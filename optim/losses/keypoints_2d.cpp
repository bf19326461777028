// L = (1/K) Σ c ρ(|p − q|²), 0 for what is not before the camera: p a point of the body as the camera sees it, q where
// a detector found it, pixels, c how sure the detector is.   ρ: squared r²; huber r² up to the scale s, then 2 s |r| −
// s²; geman_mcclure s² r² / (s² + r²) [Geman and McClure 1987; SMPLify uses it for keypoints].
#include "autodiff/map.h"
#include "optim/losses/image_points.h"
#include "optim/losses/list.h"

namespace hsi4d {

namespace {

struct KeypointsSettings {
  RobustKernel kernel = RobustKernel::kGemanMcClure;
  double scale_px = 30;
  double min_confidence = 0.3;
};

void describe(ConfigFields& fields, KeypointsSettings& settings) {
  fields.choice("kernel", settings.kernel, kPointKernels,
                "Of a distance: geman_mcclure, by which one far beyond scale_px no longer pulls; huber, constant "
                "pull; its square");
  fields.number("scale_px", settings.scale_px, {.above = 0, .max = 1e6},
                "Distance up to which the kernel is nearly the square, pixels of the image that is drawn");
  fields.number("min_confidence", settings.min_confidence, {.min = 0, .max = 1},
                "Confidence below which a point does not count");
}

}  // namespace

LossTerm keypoints_2d_loss() {
  LossTerm term =
      needing({LossInput::kKeypoints},
              make_loss_term<KeypointsSettings>(
                  "keypoints_2d", "Distance between points of the body in the image and those that a detector found",
                  [](const auto& in, const KeypointsSettings& settings) {
                    return mean_robust_distance(in.keypoints, in.keypoints_target, settings.kernel,
                                                static_cast<float>(settings.scale_px),
                                                static_cast<float>(settings.min_confidence));
                  }));
  term.description.weight = kPointWeight;
  return term;
}

}  // namespace hsi4d
