// L = mean over adjacent frames, some of which move, of Σ_j |Δᵏ J_j|², of the first 22 joints, m²: Δ J = J_{t+1} − J_t
// with `order` 1, by which the method asks for small steps; 2 asks for steps that are alike, 3 for their changes to be.
// With `frames` "sum" in place of the mean the sum over these frames.
// [method, stage 3]
#include <algorithm>
#include <array>

#include "autodiff/elementwise.h"
#include "autodiff/matrix.h"
#include "autodiff/reduce.h"
#include "optim/losses/list.h"

namespace hsi4d {

namespace {

enum class OverFrames { kMean, kSum };

constexpr std::array<ConfigChoice<OverFrames>, 2> kOverFrames = {
    {{OverFrames::kMean, "mean"}, {OverFrames::kSum, "sum"}}};

struct SmoothSettings {
  int order = 1;
  OverFrames frames = OverFrames::kMean;
};

void describe(ConfigFields& fields, SmoothSettings& settings) {
  fields.integer("order", settings.order, {.min = 1, .max = 3},
                 "Of the differences between frames: 1 steps, 2 changes of steps, 3 changes of these");
  fields.choice("frames", settings.frames, kOverFrames,
                "What of the frames counts: the mean, or the sum, which weighs more the longer the sequence is");
}

}  // namespace

LossTerm smooth_loss() {
  return needing(
      {LossInput::kMotion},
      make_loss_term<SmoothSettings>(
          "smooth", "How far joints go between adjacent frames", [](const auto& in, const SmoothSettings& settings) {
            // Differences between frames that stand say nothing.
            const Index first = std::max<Index>(0, in.motion->still_frames - settings.order);
            auto steps = slice_rows(in.joints, first, in.joints.shape().rows - first);
            if (in.given(in.joints_after)) {
              const Index after = std::min<Index>(settings.order, in.joints_after.shape().rows);
              const std::array parts = {steps, slice_rows(in.joints_after, 0, after)};
              steps = concat_rows(std::span(parts.begin(), parts.end()));
            }
            if (steps.shape().rows <= settings.order) return decltype(in.joints){};
            for (int k = 0; k < settings.order; ++k) {
              const Index rows = steps.shape().rows - 1;
              steps = slice_rows(steps, 1, rows) - slice_rows(steps, 0, rows);
            }
            const double counted = settings.frames == OverFrames::kMean ? static_cast<double>(steps.shape().rows) : 1;
            return sum(square(steps)) * (1 / counted);
          }));
}

}  // namespace hsi4d
