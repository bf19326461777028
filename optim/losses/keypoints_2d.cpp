// L = (1/K) Σ c ρ(|p − q|²), 0 for what is not before the camera: p a point of the body as the camera sees it, q where
// a detector found it, pixels, c how sure the detector is.   ρ: squared r²; huber r² up to the scale s, then 2 s |r| −
// s²; geman_mcclure s² r² / (s² + r²) [Geman and McClure 1987; SMPLify uses it for keypoints].
#include "autodiff/elementwise.h"
#include "autodiff/map.h"
#include "autodiff/matrix.h"
#include "optim/losses/list.h"
#include "optim/losses/robust.h"

namespace hsi4d {

namespace {

enum class Kernel { kGemanMcClure, kHuber, kSquared };

constexpr std::array<ConfigChoice<Kernel>, 3> kKernels = {
    {{Kernel::kGemanMcClure, "geman_mcclure"}, {Kernel::kHuber, "huber"}, {Kernel::kSquared, "squared"}}};

/// As of `center`: an error of 5 px is worth 0.025, as much as a photometric difference of 6 grey levels.
constexpr double kWeight = 1e-3;

struct KeypointsSettings {
  Kernel kernel = Kernel::kGemanMcClure;
  double scale_px = 30;
  double min_confidence = 0.3;
};

void describe(ConfigFields& fields, KeypointsSettings& settings) {
  fields.choice("kernel", settings.kernel, kKernels,
                "Of a distance: geman_mcclure, by which one far beyond scale_px no longer pulls; huber, constant "
                "pull; its square");
  fields.number("scale_px", settings.scale_px, {.above = 0, .max = 1e6},
                "Distance up to which the kernel is nearly the square, pixels of the image that is drawn");
  fields.number("min_confidence", settings.min_confidence, {.min = 0, .max = 1},
                "Confidence below which a point does not count");
}

/// ρ of a squared distance.
template <class T>
T kernel_of(T squared, Kernel kernel, float scale) {
  const float limit = scale * scale;
  if (kernel == Kernel::kSquared) return squared;
  if (kernel == Kernel::kGemanMcClure) return geman_mcclure(squared, limit);
  const T far = max(squared, limit);  // at least the limit: the root has a slope
  return select(value_of(squared) <= static_cast<std::decay_t<decltype(value_of(squared))>>(limit), squared,
                2.0F * scale * sqrt(far) - limit);
}

}  // namespace

LossTerm keypoints_2d_loss() {
  LossTerm term =
      needing({LossInput::kKeypoints},
              make_loss_term<KeypointsSettings>(
                  "keypoints_2d", "Distance between points of the body in the image and those that a detector found",
                  [](const auto& in, const KeypointsSettings& settings) {
                    const auto p = in.keypoints, q = in.keypoints_target;
                    const auto column = [](auto x, Index c) { return slice_cols(x, c, 1); };
                    const auto scale = static_cast<float>(settings.scale_px),
                               least = static_cast<float>(settings.min_confidence);
                    const Kernel kernel = settings.kernel;
                    const auto total =
                        sum_over({column(p, 0), column(p, 1), column(q, 0), column(q, 1), column(q, 2)},
                                 [kernel, scale, least](auto x, auto y, auto target_x, auto target_y, auto confidence) {
                                   const auto squared = square(x - target_x) + square(y - target_y);
                                   const auto zero = confidence * 0.0F;
                                   const bool is_before = value_of(x) != 0.0F || value_of(y) != 0.0F;  // the camera
                                   return select(is_before && value_of(confidence) >= least,
                                                 confidence * kernel_of(squared, kernel, scale), zero);
                                 });
                    return total * (1 / static_cast<double>(p.shape().rows));
                  }));
  term.description.weight = kWeight;
  return term;
}

}  // namespace hsi4d
