#include "pipelines/scan/density_adc.h"

#include <algorithm>
#include <cmath>

#include "core/check.h"
#include "core/parallel.h"
#include "core/quaternion.h"
#include "pipelines/scan/density_rows.h"

namespace hsi4d {

namespace {

constexpr double kShrunk = 1.6;  // two of a half as wide as what they are in place of [Kerbl et al. 2023]

double largest_scale(const Gaussians& g, std::size_t row) {
  const float* const logs = g.log_scales.data() + 3 * row;
  return std::exp(static_cast<double>(*std::max_element(logs, logs + 3)));
}

/// Rows whose gradient is above the bound, at most `most` of them: those of the largest, in the order of rows.
std::vector<Index> moving_rows(const ScanState& state, double bound, Index most) {
  std::vector<Index> rows;
  const auto mean = [&state](Index row) {
    const auto at = static_cast<std::size_t>(row);
    return static_cast<double>(state.gradient_sums[at]) / std::max(1, state.gradient_counts[at]);
  };
  for (Index row = 0; row < std::ssize(state.gradient_sums); ++row) {
    if (mean(row) > bound) rows.push_back(row);
  }
  if (std::ssize(rows) <= most) return rows;
  std::stable_sort(rows.begin(), rows.end(), [&mean](Index a, Index b) { return mean(a) > mean(b); });
  rows.resize(static_cast<std::size_t>(most));
  std::sort(rows.begin(), rows.end());
  return rows;
}

/// A row goes to a place drawn from it, and becomes smaller.
void become_part(Gaussians& g, std::size_t row, const Random& random, std::uint64_t draw) {
  const auto [first, second] = random.normal_pair(2 * draw);
  Vector3<double> way(first, second, random.normal(2 * draw + 1));
  for (std::size_t k = 0; k < 3; ++k) {
    float& log = g.log_scales[3 * row + k];
    way[static_cast<Index>(k)] *= std::exp(static_cast<double>(log));
    log -= static_cast<float>(std::log(kShrunk));
  }
  way = quaternion_to_matrix(Vector4<double>(Vector4<float>(g.quats.data() + 4 * row).cast<double>())) * way;
  for (std::size_t k = 0; k < 3; ++k) g.means[3 * row + k] += static_cast<float>(way[static_cast<Index>(k)]);
}

Index add_where_much_moves(const DensitySettings& settings, std::int64_t seed, double extent, ScanState& state) {
  const Index before = state.gaussians.count();
  const std::vector<Index> rows = moving_rows(state, settings.gradient, std::max<Index>(0, settings.most - before));
  const Random random = density_random(seed, "scan.split", state.iteration);
  resize_rows(state, before + std::ssize(rows));
  Index to = before;
  for (const Index row : rows) {
    copy_row(state, row, to);
    const auto parent = static_cast<std::size_t>(row), child = static_cast<std::size_t>(to++);
    if (largest_scale(state.gaussians, parent) <= settings.split_size * extent) continue;
    become_part(state.gaussians, parent, random, 2 * parent);
    become_part(state.gaussians, child, random, 2 * parent + 1);
    forget_moments(state, row);
  }
  return std::ssize(rows);
}

/// Whether a reset has fallen due since the change before this one.
bool resets_at(const DensitySettings& settings, Index done) {
  return done / settings.reset_every != (done - settings.every) / settings.reset_every;
}

/// Whether a change before this one was a reset.
bool has_reset_before(const DensitySettings& settings, Index done) {
  const Index first = (settings.from / settings.every + 1) * settings.every;
  for (Index change = first; change < done; change += settings.every) {
    if (resets_at(settings, change)) return true;
  }
  return false;
}

Index prune(const DensitySettings& settings, double extent, ScanState& state) {
  const Gaussians& g = state.gaussians;
  const bool had_reset = has_reset_before(settings, state.iteration);
  std::vector<bool> keeps;
  for (std::size_t row = 0; row < g.opacity_logits.size(); ++row) {
    const bool is_faint = opacity_of_logit(g.opacity_logits[row]) < settings.least_opacity;
    keeps.push_back(!is_faint && !(had_reset && largest_scale(g, row) > settings.most_size * extent));
  }
  const auto kept = std::count(keeps.begin(), keeps.end(), true), all = std::ssize(keeps);
  if (kept == 0 || kept == all) return 0;
  keep_rows(state, keeps);
  return all - kept;
}

void reset_opacities(const DensitySettings& settings, ScanState& state) {
  constexpr std::size_t kOpacities = 3;  // the group
  const float most = logit_of_opacity(2 * settings.least_opacity);
  for (float& logit : state.gaussians.opacity_logits) logit = std::min(logit, most);
  RowMoments<float>& moments = state.moments[kOpacities];
  if (moments.steps.empty()) return;
  for (Index row = 0; row < std::ssize(moments.steps); ++row) moments.clear_row(row, 1);
}

}  // namespace

void add_image_gradients(ConstArray<float> d_means, const Camera& camera, ScanState& state) {
  const auto rows = static_cast<std::size_t>(d_means.total_rows());
  HSI4D_CHECK_EQ(std::ssize(state.gaussians.opacity_logits), static_cast<Index>(rows));
  state.gradient_sums.resize(rows);
  state.gradient_counts.resize(rows);
  const float half_width = 0.5F * static_cast<float>(camera.width),
              half_height = 0.5F * static_cast<float>(camera.height);
  parallel_for(d_means.total_rows(), 8192, [&](Index begin, Index end) {
    for (Index row = begin; row < end; ++row) {
      const float* const d = d_means.row(row);
      const float size = std::hypot(d[0] * half_width, d[1] * half_height);
      if (!(size > 0) || !std::isfinite(size)) continue;
      state.gradient_sums[static_cast<std::size_t>(row)] += size;
      ++state.gradient_counts[static_cast<std::size_t>(row)];
    }
  });
}

DensityChange split_and_prune(const DensitySettings& settings, std::int64_t seed, double extent, ScanState& state) {
  DensityChange change;
  change.added = add_where_much_moves(settings, seed, extent, state);
  change.removed = prune(settings, extent, state);
  if (resets_at(settings, state.iteration)) reset_opacities(settings, state);
  state.gradient_sums.clear();
  state.gradient_counts.clear();
  return change;
}

}  // namespace hsi4d
