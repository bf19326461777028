#include "pipelines/scan/density.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "core/check.h"
#include "core/parallel.h"
#include "core/quaternion.h"
#include "pipelines/scan/density_adc.h"
#include "pipelines/scan/density_rows.h"
#include "splat/density.h"

namespace hsi4d {

namespace {

/// Draws rows by weight.
class RowDraw {
 public:
  explicit RowDraw(const std::vector<double>& weights) : sums_(weights.size()) {
    std::partial_sum(weights.begin(), weights.end(), sums_.begin());
  }
  bool is_possible() const { return !sums_.empty() && sums_.back() > 0; }
  Index row(double share) const {
    const auto at = std::upper_bound(sums_.begin(), sums_.end(), share * sums_.back());
    return std::min<Index>(at - sums_.begin(), std::ssize(sums_) - 1);
  }

 private:
  std::vector<double> sums_;
};

/// Puts the rows `joining` where rows drawn by `weights` are.
/// @return  how many found a place
Index let_join(const std::vector<Index>& joining, const std::vector<double>& weights, const Random& random,
               double least_opacity, ScanState& state) {
  const RowDraw draw(weights);
  if (!draw.is_possible()) return 0;
  std::vector<Index> host(joining.size());
  std::vector<Index> copies(weights.size(), 1);
  for (std::size_t i = 0; i < joining.size(); ++i) {
    host[i] = draw.row(random.uniform(i));
    Index& count = copies[static_cast<std::size_t>(host[i])];
    count = std::min(count + 1, kMostCopies);
  }
  Gaussians& g = state.gaussians;
  for (std::size_t row = 0; row < copies.size(); ++row) {
    if (copies[row] == 1) continue;
    const SharedShape shape = shared_shape(opacity_of_logit(g.opacity_logits[row]), copies[row]);
    g.opacity_logits[row] = logit_of_opacity(std::clamp(shape.opacity, std::max(least_opacity, 1e-6), 1 - 1e-6));
    for (std::size_t k = 0; k < 3; ++k) g.log_scales[3 * row + k] += static_cast<float>(std::log(shape.scale));
    forget_moments(state, static_cast<Index>(row));
  }
  for (std::size_t i = 0; i < joining.size(); ++i) {
    copy_row(state, host[i], joining[i]);
    forget_moments(state, joining[i]);
  }
  return std::ssize(joining);
}

std::vector<double> opacities_of(const Gaussians& gaussians) {
  std::vector<double> opacities;
  for (const float logit : gaussians.opacity_logits) opacities.push_back(opacity_of_logit(logit));
  return opacities;
}

Index move_faint(const DensitySettings& settings, std::int64_t seed, ScanState& state) {
  std::vector<double> weights = opacities_of(state.gaussians);
  std::vector<Index> faint;
  for (std::size_t row = 0; row < weights.size(); ++row) {
    if (weights[row] > settings.least_opacity) continue;
    faint.push_back(static_cast<Index>(row));
    weights[row] = 0;
  }
  return let_join(faint, weights, density_random(seed, "scan.moved", state.iteration), settings.least_opacity, state);
}

Index add_some(const DensitySettings& settings, std::int64_t seed, ScanState& state) {
  const Index before = state.gaussians.count();
  const auto grown = static_cast<Index>(std::ceil(settings.growth * static_cast<double>(before)));
  const Index after = std::max(before, std::min(settings.most, grown));
  if (after == before) return 0;
  const std::vector<double> weights = opacities_of(state.gaussians);
  if (!RowDraw(weights).is_possible()) return 0;
  resize_rows(state, after);
  std::vector<Index> added(static_cast<std::size_t>(after - before));
  std::iota(added.begin(), added.end(), before);
  return let_join(added, weights, density_random(seed, "scan.added", state.iteration), settings.least_opacity, state);
}

}  // namespace

DensityChange change_density(const DensitySettings& settings, std::int64_t seed, double extent, ScanState& state) {
  if (settings.method == DensityMethod::kAdc) return split_and_prune(settings, seed, extent, state);
  DensityChange change;
  change.moved = move_faint(settings, seed, state);
  change.added = add_some(settings, seed, state);
  return change;
}

bool changes_density_after(const DensitySettings& settings, Index iteration, Index iterations) {
  const Index done = iteration + 1;
  return settings.method != DensityMethod::kNone && done > settings.from && done < settings.until &&
         done < iterations && done % settings.every == 0;
}

void add_noise(const DensitySettings& settings, std::int64_t seed, Index iteration, double rate,
               const Gaussians& shapes, float* means) {
  if (settings.method != DensityMethod::kMcmc || settings.noise == 0) return;
  constexpr double kSteepness = 100, kFaint = 0.005;
  constexpr double kStill = 1e-5;  // shares of noise below: none
  const float still =
      logit_of_opacity(kFaint + std::log(1 / kStill - 1) / kSteepness);  // what is as opaque stands still
  const double scale = settings.noise * rate;
  const Random random = density_random(seed, "scan.noise", iteration);
  parallel_for(shapes.count(), 4096, [&](Index begin, Index end) {
    for (Index row = begin; row < end; ++row) {
      const auto at = static_cast<std::size_t>(row);
      if (!(shapes.opacity_logits[at] < still)) continue;
      const double share = 1 / (1 + std::exp(kSteepness * (opacity_of_logit(shapes.opacity_logits[at]) - kFaint)));
      const auto [first, second] = random.normal_pair(2 * at);
      const Vector3<double> normal(first, second, random.normal(2 * at + 1));
      const Matrix3<double> axes =
          quaternion_to_matrix(Vector4<double>(Vector4<float>(shapes.quats.data() + 4 * at).cast<double>()));
      Vector3<double> local = axes.transpose() * normal;
      for (Index k = 0; k < 3; ++k)
        local[k] *= std::exp(2 * static_cast<double>(shapes.log_scales[3 * at + static_cast<std::size_t>(k)]));
      const Vector3<double> way = axes * local * (scale * share);
      if (!way.allFinite()) continue;
      for (Index k = 0; k < 3; ++k) means[3 * row + k] += static_cast<float>(way[k]);
    }
  });
}

}  // namespace hsi4d
