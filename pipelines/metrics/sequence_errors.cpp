#include "pipelines/metrics/sequence_errors.h"

#include <algorithm>
#include <optional>

#include "core/check.h"
#include "core/mask_image.h"
#include "optim/metrics.h"
#include "optim/motion_metrics.h"

namespace hsi4d {
namespace {

void add_body_errors(MetricValues& errors, const FrameState& estimate, const FrameState& truth) {
  errors.emplace_back("mpjpe_mm", mpjpe_mm(estimate.joints, truth.joints));
  errors.emplace_back("pa_mpjpe_mm", pa_mpjpe_mm(estimate.joints, truth.joints));
  errors.emplace_back("world_mpjpe_mm", world_mpjpe_mm(estimate.joints, truth.joints));
  if (truth.camera_from_world) {
    const WorldErrorParts parts = world_error_parts(estimate.joints, truth.joints, truth.camera_from_world->rotation);
    errors.emplace_back("world_mpjpe_image_mm", parts.image_mm);
    errors.emplace_back("world_mpjpe_depth_mm", parts.depth_mm);
  }
  errors.emplace_back("root_translation_mm", root_translation_mm(estimate.joints, truth.joints));
}

void add_object_errors(MetricValues& errors, const FrameState& estimate, const FrameState& truth,
                       const ObjectPoints* points) {
  HSI4D_CHECK_EQ(estimate.world_from_object.size(), truth.world_from_object.size());
  const size_t count = truth.world_from_object.size();
  PoseError sum;
  for (size_t i = 0; i < count; ++i) {
    const PoseError error = object_error(estimate.world_from_object[i], truth.world_from_object[i]);
    sum.translation_cm += error.translation_cm;
    sum.rotation_deg += error.rotation_deg;
  }
  errors.emplace_back("object_translation_cm", sum.translation_cm / static_cast<double>(count));
  errors.emplace_back("object_rotation_deg", sum.rotation_deg / static_cast<double>(count));
  if (points == nullptr) return;
  HSI4D_CHECK_EQ(points->objects(), static_cast<Index>(count));
  ObjectPointErrors of_points;
  for (size_t i = 0; i < count; ++i) {
    const ObjectPointErrors error =
        points->errors(static_cast<Index>(i), estimate.world_from_object[i], truth.world_from_object[i]);
    of_points.add_cm += error.add_cm;
    of_points.add_s_cm += error.add_s_cm;
  }
  errors.emplace_back("object_add_cm", of_points.add_cm / static_cast<double>(count));
  errors.emplace_back("object_add_s_cm", of_points.add_s_cm / static_cast<double>(count));
}

/// The joints of all frames; nothing where one has no body.
std::vector<std::span<const double>> joints_of(std::span<const FrameState> states) {
  std::vector<std::span<const double>> joints;
  for (const FrameState& state : states) {
    if (state.joints.empty()) return {};
    joints.emplace_back(state.joints);
  }
  return joints;
}

/// Adds acceleration_error to frames 1 to T−1 of T+1.
void add_acceleration_errors(std::span<const FrameState> estimate, std::span<const FrameState> truth, double rate,
                             std::vector<FrameMetrics>& per_frame) {
  const std::vector<std::span<const double>> joints = joints_of(estimate), true_joints = joints_of(truth);
  if (joints.empty() || true_joints.empty()) return;
  const std::vector<double> errors = acceleration_errors(joints, true_joints, rate);
  for (size_t i = 0; i < errors.size(); ++i) per_frame[i].values.emplace_back("acceleration_error", errors[i]);
}

}  // namespace

MetricValues frame_errors(const FrameState& estimate, const FrameState& truth, const ObjectPoints* points) {
  MetricValues errors;
  if (!estimate.joints.empty() && !truth.joints.empty()) add_body_errors(errors, estimate, truth);
  if (!estimate.world_from_object.empty() && !truth.world_from_object.empty())
    add_object_errors(errors, estimate, truth, points);
  if (!estimate.camera_from_world || !truth.camera_from_world) return errors;
  const PoseError camera = camera_error(*estimate.camera_from_world, *truth.camera_from_world);
  errors.emplace_back("camera_translation_cm", camera.translation_cm);
  errors.emplace_back("camera_rotation_deg", camera.rotation_deg);
  return errors;
}

MetricValues image_errors(const Image& image, const Image& target, const Image* foreground) {
  MetricValues errors = {{"psnr_db", psnr_db(image, target)}};
  if (foreground != nullptr) {
    const std::optional<double> part = psnr_db(image, target, *foreground);
    if (part) errors.emplace_back("psnr_foreground_db", *part);
    const std::optional<double> rest = psnr_db(image, target, complement(*foreground));
    if (rest) errors.emplace_back("psnr_background_db", *rest);
  }
  errors.emplace_back("ssim", image_ssim(image, target));
  return errors;
}

std::vector<FrameMetrics> sequence_errors(std::span<const FrameState> estimate, std::span<const FrameState> truth,
                                          double rate, const ObjectPoints* points) {
  HSI4D_CHECK_EQ(estimate.size(), truth.size());
  std::vector<FrameMetrics> per_frame;
  for (size_t t = 1; t < truth.size(); ++t)
    per_frame.push_back({static_cast<int>(t), frame_errors(estimate[t], truth[t], points)});
  add_acceleration_errors(estimate, truth, rate, per_frame);
  return per_frame;
}

MetricValues mean_errors(std::span<const FrameMetrics> per_frame) {
  MetricValues sums;
  std::vector<double> counts;
  for (const FrameMetrics& frame : per_frame) {
    for (const auto& [name, value] : frame.values) {
      const auto at =
          std::find_if(sums.begin(), sums.end(), [&name = name](const auto& sum) { return sum.first == name; });
      const auto i = static_cast<size_t>(at - sums.begin());
      if (at == sums.end()) {
        sums.emplace_back(name, 0.0);
        counts.push_back(0);
      }
      sums[i].second += value;
      counts[i] += 1;
    }
  }
  for (size_t i = 0; i < sums.size(); ++i) sums[i].second /= counts[i];
  return sums;
}

MetricValues motion_jitter(std::span<const FrameState> states, double rate) {
  const std::optional<double> trembling = jitter(joints_of(states), rate);
  return trembling ? MetricValues{{"jitter", *trembling}} : MetricValues{};
}

MetricValues sequence_summary(std::span<const FrameState> estimate, std::span<const FrameState> truth, double rate,
                              const ObjectPoints* points) {
  MetricValues errors = mean_errors(sequence_errors(estimate, truth, rate, points));
  const MetricValues trembling = motion_jitter(estimate, rate);
  errors.insert(errors.end(), trembling.begin(), trembling.end());
  return errors;
}

}  // namespace hsi4d
