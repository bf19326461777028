#include "pipelines/scan/density.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "core/check.h"
#include "core/parallel.h"
#include "core/quaternion.h"
#include "core/random.h"
#include "splat/density.h"

namespace hsi4d {

namespace {

double opacity_of(float logit) { return 1 / (1 + std::exp(-static_cast<double>(logit))); }
float logit_of(double opacity) { return static_cast<float>(std::log(opacity / (1 - opacity))); }

/// Random numbers of one purpose in one iteration.
Random random_of(std::int64_t seed, const char* purpose, Index iteration) {
  constexpr std::uint64_t kGolden = 0x9E3779B97F4A7C15u;
  return Random(static_cast<std::uint64_t>(seed),
                random_stream(purpose) + kGolden * static_cast<std::uint64_t>(iteration));
}

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

template <class T>
void copy_row(std::vector<T>& values, Index from, Index to, Index columns) {
  std::copy_n(values.begin() + from * columns, columns, values.begin() + to * columns);
}

/// Room for more rows at the end.
void grow(ScanState& state, Index rows) {
  Gaussians& g = state.gaussians;
  const auto columns = state.columns();
  std::size_t i = 0;
  for (std::vector<float>* values : {&g.means, &g.quats, &g.log_scales, &g.opacity_logits, &g.sh})
    values->resize(static_cast<std::size_t>(rows * columns[i++]));
  for (i = 0; i < kScanGroups; ++i) {
    if (!state.moments[i].steps.empty()) state.moments[i].resize(rows, columns[i]);
  }
}

/// Row `to` becomes what row `from` is.
void join(ScanState& state, Index from, Index to) {
  Gaussians& g = state.gaussians;
  const auto columns = state.columns();
  std::size_t i = 0;
  for (std::vector<float>* values : {&g.means, &g.quats, &g.log_scales, &g.opacity_logits, &g.sh})
    copy_row(*values, from, to, columns[i++]);
}

void forget_moments(ScanState& state, Index row) {
  const auto columns = state.columns();
  for (std::size_t i = 0; i < kScanGroups; ++i) {
    if (!state.moments[i].steps.empty()) state.moments[i].clear_row(row, columns[i]);
  }
}

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
    const SharedShape shape = shared_shape(opacity_of(g.opacity_logits[row]), copies[row]);
    g.opacity_logits[row] = logit_of(std::clamp(shape.opacity, std::max(least_opacity, 1e-6), 1 - 1e-6));
    for (std::size_t k = 0; k < 3; ++k) g.log_scales[3 * row + k] += static_cast<float>(std::log(shape.scale));
    forget_moments(state, static_cast<Index>(row));
  }
  for (std::size_t i = 0; i < joining.size(); ++i) {
    join(state, host[i], joining[i]);
    forget_moments(state, joining[i]);
  }
  return std::ssize(joining);
}

std::vector<double> opacities_of(const Gaussians& gaussians) {
  std::vector<double> opacities;
  for (const float logit : gaussians.opacity_logits) opacities.push_back(opacity_of(logit));
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
  return let_join(faint, weights, random_of(seed, "scan.moved", state.iteration), settings.least_opacity, state);
}

Index add_some(const DensitySettings& settings, std::int64_t seed, ScanState& state) {
  const Index before = state.gaussians.count();
  const auto grown = static_cast<Index>(std::ceil(settings.growth * static_cast<double>(before)));
  const Index after = std::max(before, std::min(settings.most, grown));
  if (after == before) return 0;
  const std::vector<double> weights = opacities_of(state.gaussians);
  if (!RowDraw(weights).is_possible()) return 0;
  grow(state, after);
  std::vector<Index> added(static_cast<std::size_t>(after - before));
  std::iota(added.begin(), added.end(), before);
  return let_join(added, weights, random_of(seed, "scan.added", state.iteration), settings.least_opacity, state);
}

}  // namespace

DensityChange change_density(const DensitySettings& settings, std::int64_t seed, ScanState& state) {
  DensityChange change;
  change.moved = move_faint(settings, seed, state);
  change.added = add_some(settings, seed, state);
  return change;
}

bool changes_density_after(const DensitySettings& settings, Index iteration) {
  const Index done = iteration + 1;
  return settings.method == DensityMethod::kMcmc && done > settings.from && done < settings.until &&
         done % settings.every == 0;
}

void add_noise(const DensitySettings& settings, std::int64_t seed, Index iteration, double rate,
               const Gaussians& shapes, float* means) {
  if (settings.method != DensityMethod::kMcmc || settings.noise == 0) return;
  constexpr double kSteepness = 100, kFaint = 0.005;
  constexpr double kStill = 1e-5;                                                // shares of noise below: none
  const float still = logit_of(kFaint + std::log(1 / kStill - 1) / kSteepness);  // what is as opaque stands still
  const double scale = settings.noise * rate;
  const Random random = random_of(seed, "scan.noise", iteration);
  parallel_for(shapes.count(), 4096, [&](Index begin, Index end) {
    for (Index row = begin; row < end; ++row) {
      const auto at = static_cast<std::size_t>(row);
      if (!(shapes.opacity_logits[at] < still)) continue;
      const double share = 1 / (1 + std::exp(kSteepness * (opacity_of(shapes.opacity_logits[at]) - kFaint)));
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
