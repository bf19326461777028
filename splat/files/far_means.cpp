#include "splat/files/far_means.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "core/text.h"

namespace hsi4d {
namespace {

constexpr double kFinestStep = 1e-5;  // metres; finer ones are seen in no picture, however narrow a Gaussian is

/// From a float to the next one.
double step_at(double x) {
  constexpr int kLeastExponent = std::numeric_limits<float>::min_exponent - 1;
  return std::ldexp(
      1, std::max(x == 0 ? kLeastExponent : std::ilogb(x), kLeastExponent) - (std::numeric_limits<float>::digits - 1));
}

double second_longest(const Gaussians& g, Index n) {
  std::array<float, 3> axes{};
  std::copy_n(g.log_scales.begin() + 3 * n, 3, axes.begin());
  std::sort(axes.begin(), axes.end());
  return std::exp(static_cast<double>(axes[1]));
}

template <class Step>
FarMeans narrower_than(const Step& step, const Vector3<double>& origin, const Gaussians& g) {
  FarMeans far;
  Vector3<double> lower = Vector3<double>::Constant(INFINITY), upper = -lower;
  for (Index n = 0; n < g.count(); ++n) {
    const Vector3<double> mean = Vector3<float>(g.means.data() + 3 * n).cast<double>() + origin;
    lower = lower.cwiseMin(mean);
    upper = upper.cwiseMax(mean);
    const double its = step(mean);
    if (its < kFinestStep || its <= second_longest(g, n)) continue;
    ++far.count;
    far.largest_step = std::max(far.largest_step, its);
  }
  if (far.count > 0) {
    for (int c = 0; c < 3; ++c) far.middle_world[c] = std::round((lower[c] + upper[c]) / 2);
  }
  return far;
}

}  // namespace

FarMeans far_means(const Gaussians& gaussians, const Vector3<double>& origin) {
  return narrower_than([](const Vector3<double>& mean) { return step_at(mean.cwiseAbs().maxCoeff()); }, origin,
                       gaussians);
}

FarMeans means_narrower_than(double step, const Gaussians& gaussians) {
  return narrower_than([step](const Vector3<double>&) { return step; }, gaussians.origin_world, gaussians);
}

std::string far_means_text(const FarMeans& far, Index all, bool is_finer) {
  if (far.count == 0) return "";
  std::string way;
  for (int c = 0; c < 3; ++c)
    way += (c == 0 ? "" : ",") + number_text(far.middle_world[c] == 0 ? 0 : -far.middle_world[c]);
  return std::to_string(far.count) + " of " + std::to_string(all) + " Gaussians are narrower than the steps, up to " +
         rounded(far.largest_step, 3) + " m, that floats have where their means are; `hsi4d convert --translate " +
         way + "` brings them near the origin" +
         (is_finer ? ", by the file's own digits" : "; the file itself has no more digits");
}

}  // namespace hsi4d
