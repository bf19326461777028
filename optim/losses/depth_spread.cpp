// L = mean over the pixels of √(Σ w (z/d − 1)² + floor²) − floor: how far from the depth d that the picture shows what
// is seen there is, in front and behind, of that depth; 0 where it is not known. Σ w (z/d − 1)² is a sum of moments, Σ
// w z²/d² − 2 Σ w z/d + Σ w.
#include "autodiff/elementwise.h"
#include "autodiff/map.h"
#include "autodiff/matrix.h"
#include "optim/losses/list.h"

namespace hsi4d {

namespace {

struct DepthSpreadSettings {
  double floor = 0.002;  // in float moments tell 0.0006 from 0
};

void describe(ConfigFields& fields, DepthSpreadSettings& settings) {
  fields.number("floor", settings.floor, {.min = 0.001, .max = 1},
                "Below so large a share of the depth the loss grows by the square");
}

}  // namespace

LossTerm depth_spread_loss() {
  return needing({LossInput::kDepths},
                 make_loss_term<DepthSpreadSettings>(
                     "depth_spread", "How far from the pictures' depths what is seen there is, of the depth",
                     [](const auto& in, const DepthSpreadSettings& settings) {
                       const auto least = static_cast<float>(settings.floor);
                       const auto first = slice_planes(in.depth_moments, 0, 1);
                       const auto second = slice_planes(in.depth_moments, 1, 1);
                       const auto total = sum_over({first, second, in.transmittance, in.depth_target},
                                                   [least](auto m1, auto m2, auto t, auto d) {
                                                     const auto known = max(d, 1e-6f);
                                                     const auto spread = (m2 / known - 2 * m1) / known + (1 - t);
                                                     const auto r = sqrt(max(spread, 0.f) + least * least) - least;
                                                     return select(d <= 0.f, 0.f, r);  // NaN is told
                                                   });
                       return total * (1 / static_cast<double>(in.depth_target.shape().count()));
                     }));
}

}  // namespace hsi4d
