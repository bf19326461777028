#include "optim/protocols/world_motion_metrics.h"

#include <algorithm>
#include <cmath>

#include "core/check.h"
#include "optim/metrics.h"
#include "optim/similarity.h"

namespace hsi4d {
namespace {

Vector3<double> frame_point(std::span<const double> points, std::size_t p) {
  return Vector3<double>(points.data() + 3 * p);
}

void check_frames(JointFrames points, JointFrames truth) {
  HSI4D_CHECK_EQ(points.size(), truth.size());
  for (std::size_t t = 0; t < points.size(); ++t) {
    HSI4D_CHECK(!points[t].empty() && points[t].size() % 3 == 0,
                "points are [P,3], not " + std::to_string(points[t].size()) + " numbers");
    HSI4D_CHECK_EQ(points[t].size(), points[0].size());
    HSI4D_CHECK_EQ(truth[t].size(), points[0].size());
  }
}

/// The first `count` points of each frame.
std::vector<std::span<const double>> first_points(JointFrames frames, Index count) {
  std::vector<std::span<const double>> first;
  for (const std::span<const double> frame : frames)
    first.push_back(frame.first(std::min(frame.size(), static_cast<std::size_t>(3 * count))));
  return first;
}

}  // namespace

std::vector<double> piecewise_mpjpe_mm(JointFrames joints, JointFrames truth, Index piece, Index aligned) {
  check_frames(joints, truth);
  HSI4D_CHECK(piece > 0 && aligned > 0, "a piece needs frames");
  const auto own = first_points(joints, kMetricJoints), its = first_points(truth, kMetricJoints);
  std::vector<double> errors;
  for (std::size_t begin = 0; begin < own.size(); begin += static_cast<std::size_t>(piece)) {
    const std::size_t count = std::min(own.size() - begin, static_cast<std::size_t>(piece));
    const std::size_t laid = std::min(count, static_cast<std::size_t>(aligned));
    const Similarity fit =
        fit_similarity(std::span(own).subspan(begin, laid), std::span(its).subspan(begin, laid), FitScale::kFree);
    for (std::size_t t = begin; t < begin + count; ++t) {
      const std::size_t points = own[t].size() / 3;
      double sum = 0;
      for (std::size_t j = 0; j < points; ++j) sum += (fit(frame_point(own[t], j)) - frame_point(its[t], j)).norm();
      errors.push_back(kMillimetres * sum / static_cast<double>(points));
    }
  }
  return errors;
}

std::optional<std::vector<double>> root_way_errors_percent(JointFrames joints, JointFrames truth) {
  check_frames(joints, truth);
  const auto own = first_points(joints, 1), its = first_points(truth, 1);
  double way = 0;
  for (std::size_t t = 1; t < its.size(); ++t) way += (frame_point(its[t], 0) - frame_point(its[t - 1], 0)).norm();
  if (way == 0) return std::nullopt;
  const Similarity fit = fit_similarity(own, its, FitScale::kOne);
  std::vector<double> errors;
  for (std::size_t t = 0; t < own.size(); ++t)
    errors.push_back(100 * (fit(frame_point(own[t], 0)) - frame_point(its[t], 0)).norm() / way);
  return errors;
}

std::optional<double> standing_step_mm(JointFrames points, JointFrames truth) {
  check_frames(points, truth);
  double sum = 0;
  Index standing = 0;
  for (std::size_t t = 1; t < points.size(); ++t) {
    for (std::size_t p = 0; p < points[t].size() / 3; ++p) {
      const double step = (frame_point(truth[t], p) - frame_point(truth[t - 1], p)).norm();
      if (step >= kStandingStep) continue;  // a step that is not a number counts, and gives none
      sum += std::isnan(step) ? step : (frame_point(points[t], p) - frame_point(points[t - 1], p)).norm();
      ++standing;
    }
  }
  if (standing == 0) return std::nullopt;
  return kMillimetres * sum / static_cast<double>(standing);
}

}  // namespace hsi4d
