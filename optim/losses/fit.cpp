// L = mean over the frames that move of Σ_j |Ĵ_j − J_j|²: the first 22 joints stay where the stage found them, m². With
// `joints` "mean" in place of the sum the mean over their 66 coordinates.
// [method, stage 3: Eq. 15]
#include <array>

#include "autodiff/difference.h"
#include "autodiff/elementwise.h"
#include "optim/losses/list.h"

namespace hsi4d {

namespace {

enum class OverJoints { kSum, kMean };

constexpr std::array<ConfigChoice<OverJoints>, 2> kOverJoints = {
    {{OverJoints::kSum, "sum"}, {OverJoints::kMean, "mean"}}};

struct FitSettings {
  OverJoints joints = OverJoints::kSum;
};

void describe(ConfigFields& fields, FitSettings& settings) {
  fields.choice("joints", settings.joints, kOverJoints,
                "What of a frame counts: the sum of 22 squared distances, or the mean of 66 squared differences");
}

}  // namespace

LossTerm fit_loss() {
  return needing({LossInput::kMotion},
                 make_loss_term<FitSettings>(
                     "fit", "How far the joints are from where the stage found them",
                     [](const auto& in, const FitSettings& settings) {
                       // Frames that stand still add nothing to the sum.
                       const Shape shape = in.joints.shape();
                       const Index counted = settings.joints == OverJoints::kSum ? shape.count() : shape.rows;
                       return l2(in.joints, in.joints_start) *
                              (static_cast<double>(counted) / static_cast<double>(in.motion->moving_frames()));
                     }));
}

}  // namespace hsi4d
