#include "optim/standing_feet.h"

#include <algorithm>
#include <limits>

#include "core/check.h"
#include "core/types.h"
#include "optim/metrics.h"
#include "optim/motion_start.h"

namespace hsi4d {

namespace {

constexpr Index kFramesBeside = 2;  // of a median, before and after its frame

Vector3<double> foot_joint(std::span<const double> joints, Index joint) {
  return Vector3<double>(joints.data() + 3 * joint);
}

}  // namespace

bool foot_stands(const Vector3<double>& before, const Vector3<double>& after, double first_height, double frame_rate,
                 const StandingRule& rule) {
  const double highest = first_height + rule.height;
  return before[2] <= highest && after[2] <= highest && (after - before).norm() * frame_rate < rule.speed;
}

double lower_foot_range(std::span<const std::vector<double>> joints) {
  HSI4D_CHECK(!joints.empty(), "no frames");
  std::vector<double> heights;
  for (const std::vector<double>& of_frame : joints) {
    double lowest = std::numeric_limits<double>::infinity();
    for (Index j = 0; j < std::ssize(of_frame) / 3; ++j) {
      if (is_foot_joint(j)) lowest = std::min(lowest, foot_joint(of_frame, j)[2]);
    }
    heights.push_back(lowest);
  }
  double low = std::numeric_limits<double>::infinity(), high = -low;
  for (Index t = 0; t < std::ssize(heights); ++t) {
    const Index first = std::max<Index>(0, t - kFramesBeside),
                last = std::min(t + kFramesBeside + 1, std::ssize(heights));
    std::vector<double> near(heights.begin() + first, heights.begin() + last);
    std::nth_element(near.begin(), near.begin() + std::ssize(near) / 2, near.end());
    low = std::min(low, near[near.size() / 2]);
    high = std::max(high, near[near.size() / 2]);
  }
  return high - low;
}

std::optional<double> foot_sliding_mm(std::span<const double> before, std::span<const double> after,
                                      std::span<const double> first, double frame_rate) {
  HSI4D_CHECK_EQ(before.size(), after.size());
  HSI4D_CHECK_EQ(before.size(), first.size());
  double sum = 0;
  Index standing = 0;
  for (Index j = 0; j < static_cast<Index>(before.size()) / 3; ++j) {
    if (!is_foot_joint(j)) continue;
    const Vector3<double> from = foot_joint(before, j), to = foot_joint(after, j);
    if (!foot_stands(from, to, foot_joint(first, j)[2], frame_rate, {})) continue;
    sum += (to - from).head<2>().norm();
    ++standing;
  }
  if (standing == 0) return std::nullopt;
  return kMillimetres * sum / static_cast<double>(standing) * frame_rate / kSlidingRate;
}

}  // namespace hsi4d
