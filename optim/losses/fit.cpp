// L = mean over the frames that move of Σ_j |Ĵ_j − J_j|²: the first 22 joints stay where the stage found them, m². With
// `joints` "mean" in place of the sum the mean over their 66 coordinates.
// [method, stage 3: Eq. 15]
//
// With `by_sigma` a joint stays as firmly as it is known to be there. With d = Ĵ_j − J_j, the camera's axis n, and the
// joint's sigmas across the view and along it,
//
//   r² = (|d|² − (n·d)²)/σ_across² + (n·d)²/σ_along²
//   L  = (1 cm)² mean over the frames that move of Σ_j s² r_j²/(s² + r_j²)
//
// Beyond `scale`, s sigmas, there is hardly a pull: a joint that the others and the frames around want so far off was
// found in a wrong place. A joint of which nothing is known has none. One that nobody looked at has σ = 1 cm.
#include <algorithm>
#include <array>
#include <cmath>

#include "autodiff/difference.h"
#include "autodiff/elementwise.h"
#include "autodiff/map.h"
#include "autodiff/matrix.h"
#include "autodiff/tape_rows.h"
#include "optim/losses/list.h"

namespace hsi4d {

namespace {

enum class OverJoints { kSum, kMean };

constexpr std::array<ConfigChoice<OverJoints>, 2> kOverJoints = {
    {{OverJoints::kSum, "sum"}, {OverJoints::kMean, "mean"}}};

constexpr double kUsualSigma = 0.01;   // metres: with it both forms weigh alike
constexpr double kLeastSigma = 0.003;  // metres: bodies are not exact enough for less

struct FitSettings {
  OverJoints joints = OverJoints::kSum;
  bool by_sigma = false;
  double scale = 3;
};

void describe(ConfigFields& fields, FitSettings& settings) {
  fields.choice("joints", settings.joints, kOverJoints,
                "What of a frame counts: the sum of 22 squared distances, or the mean of 66 squared differences");
  fields.boolean("by_sigma", settings.by_sigma,
                 "Joints stay as firmly as the images say where they are, and let go where they are far off");
  fields.number("scale", settings.scale, {.above = 0, .max = 1e6},
                "by_sigma: sigmas beyond which there is hardly a pull");
  fields.rule({"joints", "by_sigma"}, [&settings]() -> std::string {
    return settings.by_sigma && settings.joints == OverJoints::kMean ? "by_sigma counts the sum over joints" : "";
  });
  fields.rule({"scale", "by_sigma"}, [&settings]() -> std::string {
    return !settings.by_sigma && settings.scale != FitSettings().scale ? "only by_sigma reads it" : "";
  });
}

/// How much a square of metres counts.
double weight_of(double sigma) {
  if (std::isnan(sigma)) return 1;
  const double share = kUsualSigma / std::max(sigma, kLeastSigma);
  return share * share;
}

template <class S>
Var<S> fit_by_sigma(const LossInputs<S>& in, double scale) {
  Tape<S>& tape = in.joints.owner();
  const ConstArray<S> sigma = tape.value(in.joints_sigma);
  const Index frames = in.joints.shape().rows, joints = in.joints.shape().cols / 3;
  std::vector<double> weights;  // across and along, by frame and joint
  std::vector<std::uint32_t> frame_of;
  for (Index i = 0; i < 2 * frames * joints; ++i)
    weights.push_back(weight_of(static_cast<double>(sigma(i / (2 * joints), i % (2 * joints)))));
  for (Index i = 0; i < frames * joints; ++i) frame_of.push_back(static_cast<std::uint32_t>(i / joints));
  const Var<S> d = reshape(in.joints - in.joints_start, frames * joints, 3);
  const Var<S> n = gather_rows(in.view_axes, frame_of), w = constant_rows(tape, "weights", weights, 2);
  const S far = static_cast<S>(scale * scale * kUsualSigma * kUsualSigma);
  const auto col = [](Var<S> x, Index c) { return slice_cols(x, c, 1); };
  return sum_over({col(d, 0), col(d, 1), col(d, 2), col(n, 0), col(n, 1), col(n, 2), col(w, 0), col(w, 1)},
                  [far](auto x, auto y, auto z, auto n_x, auto n_y, auto n_z, auto across, auto along) {
                    const auto depth = x * n_x + y * n_y + z * n_z;
                    const auto r2 = across * (x * x + y * y + z * z - depth * depth) + along * depth * depth;
                    return far * r2 / (far + r2);
                  }) *
         (1 / static_cast<double>(in.motion->moving_frames()));
}

std::vector<LossInput> inputs_of(const FitSettings& settings) {
  if (settings.by_sigma) return {LossInput::kMotion, LossInput::kSigmas};
  return {LossInput::kMotion};
}

}  // namespace

LossTerm fit_loss() {
  return needing<FitSettings>(
      inputs_of, make_loss_term<FitSettings>(
                     "fit", "How far the joints are from where the stage found them",
                     [](const auto& in, const FitSettings& settings) {
                       if (settings.by_sigma && in.gives(LossInput::kSigmas)) return fit_by_sigma(in, settings.scale);
                       // Frames that stand still add nothing to the sum.
                       const Shape shape = in.joints.shape();
                       const Index counted = settings.joints == OverJoints::kSum ? shape.count() : shape.rows;
                       return l2(in.joints, in.joints_start) *
                              (static_cast<double>(counted) / static_cast<double>(in.motion->moving_frames()));
                     }));
}

}  // namespace hsi4d
