#include "optim/motion_metrics.h"

#include <algorithm>

#include "core/check.h"
#include "optim/metrics.h"

namespace hsi4d {
namespace {

Vector3<double> joint_of(std::span<const double> joints, Index j) { return Vector3<double>(joints.data() + 3 * j); }

Index joints_of_motion(std::span<const double> joints) {
  HSI4D_CHECK(!joints.empty() && joints.size() % 3 == 0,
              "joints are [J,3], not " + std::to_string(joints.size()) + " numbers");
  return std::min(kMetricJoints, static_cast<Index>(joints.size()) / 3);
}

/// Differences of differences: exact for a motion that stands far from the origin.
Vector3<double> second_difference(JointFrames joints, std::size_t t, Index j) {
  const Vector3<double> here = joint_of(joints[t], j);
  return (joint_of(joints[t + 1], j) - here) - (here - joint_of(joints[t - 1], j));
}

double frame_distance(std::span<const double> a, std::span<const double> b, bool root_relative) {
  HSI4D_CHECK_EQ(a.size(), b.size());
  const Index count = joints_of_motion(a);
  const Vector3<double> apart =
      root_relative ? Vector3<double>(joint_of(a, 0) - joint_of(b, 0)) : Vector3<double>(Vector3<double>::Zero());
  double sum = 0;
  for (Index j = 0; j < count; ++j) sum += (joint_of(a, j) - joint_of(b, j) - apart).norm();
  return sum / static_cast<double>(count);
}

}  // namespace

std::vector<double> acceleration_errors(JointFrames joints, JointFrames truth, double rate) {
  HSI4D_CHECK_EQ(joints.size(), truth.size());
  std::vector<double> errors;
  if (joints.size() < 3) return errors;
  const Index count = joints_of_motion(joints[0]);
  for (std::size_t t = 0; t < joints.size(); ++t) {
    HSI4D_CHECK_EQ(joints[t].size(), joints[0].size());
    HSI4D_CHECK_EQ(truth[t].size(), joints[0].size());
  }
  for (std::size_t t = 1; t + 1 < joints.size(); ++t) {
    double sum = 0;
    for (Index j = 0; j < count; ++j) sum += (second_difference(joints, t, j) - second_difference(truth, t, j)).norm();
    errors.push_back(sum * rate * rate / static_cast<double>(count));
  }
  return errors;
}

std::optional<double> pairwise_distance_mm(std::span<const std::vector<std::span<const double>>> motions,
                                           bool root_relative) {
  if (motions.size() < 2) return std::nullopt;
  std::size_t frames = motions[0].size();
  for (const auto& motion : motions) frames = std::min(frames, motion.size());
  if (frames == 0) return std::nullopt;
  double sum = 0;
  for (std::size_t a = 0; a < motions.size(); ++a) {
    for (std::size_t b = a + 1; b < motions.size(); ++b) {
      for (std::size_t t = 0; t < frames; ++t) sum += frame_distance(motions[a][t], motions[b][t], root_relative);
    }
  }
  const auto pairs = static_cast<double>(motions.size() * (motions.size() - 1) / 2);
  return kMillimetres * sum / (pairs * static_cast<double>(frames));
}

}  // namespace hsi4d
