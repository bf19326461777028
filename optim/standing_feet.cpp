#include "optim/standing_feet.h"

#include "core/check.h"
#include "core/types.h"
#include "optim/metrics.h"
#include "optim/motion_start.h"

namespace hsi4d {

namespace {

Vector3<double> foot_joint(std::span<const double> joints, Index joint) {
  return Vector3<double>(joints.data() + 3 * joint);
}

}  // namespace

bool foot_stands(const Vector3<double>& before, const Vector3<double>& after, double first_height, double frame_rate,
                 const StandingRule& rule) {
  const double highest = first_height + rule.height;
  return before[2] <= highest && after[2] <= highest && (after - before).norm() * frame_rate < rule.speed;
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
