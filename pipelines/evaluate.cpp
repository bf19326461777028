#include "pipelines/evaluate.h"

#include <algorithm>
#include <optional>

#include "core/check.h"
#include "optim/metrics.h"

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

void add_object_errors(MetricValues& errors, const FrameState& estimate, const FrameState& truth) {
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
}

std::optional<double> jitter_of(std::span<const FrameState> states, double rate) {
  std::vector<std::span<const double>> joints;
  for (const FrameState& state : states) {
    if (state.joints.empty()) return std::nullopt;
    joints.emplace_back(state.joints);
  }
  return jitter(joints, rate);
}

}  // namespace

MetricValues frame_errors(const FrameState& estimate, const FrameState& truth) {
  MetricValues errors;
  if (!estimate.joints.empty() && !truth.joints.empty()) add_body_errors(errors, estimate, truth);
  if (!estimate.world_from_object.empty() && !truth.world_from_object.empty())
    add_object_errors(errors, estimate, truth);
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
  }
  errors.emplace_back("ssim", image_ssim(image, target));
  return errors;
}

std::vector<FrameMetrics> sequence_errors(std::span<const FrameState> estimate, std::span<const FrameState> truth) {
  HSI4D_CHECK_EQ(estimate.size(), truth.size());
  std::vector<FrameMetrics> per_frame;
  for (size_t t = 1; t < truth.size(); ++t)
    per_frame.push_back({static_cast<int>(t), frame_errors(estimate[t], truth[t])});
  return per_frame;
}

MetricValues mean_errors(std::span<const FrameMetrics> per_frame) {
  MetricValues sums;
  std::vector<double> counts;
  for (const FrameMetrics& frame : per_frame) {
    for (const auto& [name, value] : frame.values) {
      const auto at = std::find_if(sums.begin(), sums.end(), [&](const auto& sum) { return sum.first == name; });
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

MetricValues sequence_summary(std::span<const FrameState> estimate, std::span<const FrameState> truth, double rate) {
  MetricValues errors = mean_errors(sequence_errors(estimate, truth));
  const std::optional<double> trembling = jitter_of(estimate, rate);
  if (trembling) errors.emplace_back("jitter", *trembling);
  return errors;
}

}  // namespace hsi4d
