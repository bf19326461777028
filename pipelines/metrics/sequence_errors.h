// Errors of a whole sequence against the truth, with the names that summary.json has.
#pragma once

#include <array>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/image.h"
#include "core/rigid.h"
#include "optim/object_points.h"
#include "pipelines/metrics/metric_facts.h"

namespace hsi4d {

/// Where everything that moves is in one frame. What is empty or absent in estimate or truth is not measured.
struct FrameState {
  std::vector<double> joints;                    ///< [J,3] metres, world; empty: no body
  std::vector<Rigid<double>> world_from_object;  ///< objects in a fixed order, about their centroids
  std::optional<Rigid<double>> camera_from_world;
};

/// The errors of one frame: mpjpe_mm, pa_mpjpe_mm, world_mpjpe_mm and its parts in the true camera's view where that is
/// known, root_translation_mm; object_translation_cm, object_rotation_deg and, where points of the objects are given,
/// object_add_cm and object_add_s_cm (means over the objects); camera_translation_cm, camera_rotation_deg.
/// Throws InternalError when the two have different counts of joints or objects.
///
/// @param points  of the objects, in their order; null: not known
MetricValues frame_errors(const FrameState& estimate, const FrameState& truth, const ObjectPoints* points = nullptr);

/// Metrics of a frame's images, in order.
inline constexpr std::array<const char*, 7> kImageMetrics = {
    "psnr_db",         "psnr_foreground_db", "psnr_background_db", "ssim",
    "camera_drift_px", "background_change",  "silhouette_iou"};

/// psnr_db, ssim, and psnr_foreground_db and psnr_background_db where a foreground is given that leaves something to
/// each.
///
/// @param image, target  [3,H,W]
/// @param foreground     [1,H,W] weights, 0 to 1, or null
MetricValues image_errors(const Image& image, const Image& target, const Image* foreground = nullptr);

/// frame_errors of frames 1 to T, with the acceleration_error of those of them that have a frame on either side; frame
/// 0 is given. Throws InternalError when the lengths differ.
/// @param rate    frames a second
/// @param points  as frame_errors
std::vector<FrameMetrics> sequence_errors(std::span<const FrameState> estimate, std::span<const FrameState> truth,
                                          double rate, const ObjectPoints* points = nullptr);

/// The mean of each metric over the frames that have it, in the order of their first appearance.
MetricValues mean_errors(std::span<const FrameMetrics> per_frame);

/// mean_errors of sequence_errors, and `jitter` of the estimate (frame 0 included, as the motion continues it; only for
/// four frames or more, all with a body).
/// @param rate    frames a second
/// @param points  as frame_errors
MetricValues sequence_summary(std::span<const FrameState> estimate, std::span<const FrameState> truth, double rate,
                              const ObjectPoints* points = nullptr);

/// `jitter` of a motion, where it has four frames or more, all with a body; else nothing.
/// @param rate  frames a second
MetricValues motion_jitter(std::span<const FrameState> states, double rate);

}  // namespace hsi4d
