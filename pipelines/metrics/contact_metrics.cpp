#include "pipelines/metrics/contact_metrics.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "body/kinematics.h"
#include "core/check.h"
#include "core/parallel.h"
#include "core/rotation.h"
#include "optim/metrics.h"
#include "optim/motion_start.h"
#include "optim/object_centres.h"
#include "optim/standing_feet.h"
#include "pipelines/metrics/sequence_errors.h"

namespace hsi4d {

namespace {

constexpr Index kPointGrain = 64;
constexpr double kApart = -1;  // in place of a distance

bool is_a_hand_joint_near(std::span<const double> joints, const ObjectCentres& centres,
                          std::span<const Rigid<double>> world_from_object) {
  for (Index j = 0; j < std::ssize(joints) / 3; ++j) {
    if (is_hand_joint(j) &&
        centres.nearest(Vector3<double>(joints.data() + 3 * j), world_from_object, kContactDistance))
      return true;
  }
  return false;
}

/// Distances of the hands' Gaussians to the objects, metres; kApart where none is near.
/// @param rows  of the hands' Gaussians
std::vector<double> hand_distances(const MotionStart& motion, const std::vector<Index>& rows,
                                   const ObjectCentres& centres, std::span<const Rigid<double>> world_from_object) {
  std::vector<double> distances(rows.size(), kApart);
  parallel_for(std::ssize(rows), kPointGrain, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i) {
      const auto at = static_cast<std::size_t>(i);
      const auto found =
          centres.nearest(motion.place(BodyPoint{kFirstFrame, rows[at]}), world_from_object, kContactDistance);
      if (found) distances[at] = found->distance;
    }
  });
  return distances;
}

/// z of the lowest ankle or ball of a foot, metres.
double lowest_foot(const std::vector<double>& joints) {
  double lowest = std::numeric_limits<double>::infinity();
  for (Index joint = 0; 3 * joint + 2 < std::ssize(joints); ++joint) {
    if (is_foot_joint(joint)) lowest = std::min(lowest, joints[static_cast<std::size_t>(3 * joint + 2)]);
  }
  return lowest;
}

}  // namespace

std::vector<MetricValues> contact_by_frame(const Avatar& avatar, const std::vector<const Gaussians*>& objects,
                                           const std::vector<SceneState>& states) {
  std::vector<MetricValues> by_frame(states.size());
  if (objects.empty()) return by_frame;
  const ObjectCentres centres(objects);
  const std::vector<Index> hands = rows_of_joints(avatar.weights, is_hand_joint);
  for (std::size_t t = 0; t < states.size(); ++t) {
    MotionStart motion;
    motion.avatar = &avatar;
    motion.first_body = pose_skeleton(avatar, states[t].body);
    const std::vector<Rigid<double>> poses = rigids_of(states[t].objects);
    by_frame[t].emplace_back("contact_share", is_a_hand_joint_near(motion.first_body.joints, centres, poses) ? 1 : 0);
    double sum = 0;
    Index count = 0;
    for (const double distance : hand_distances(motion, hands, centres, poses)) {
      if (distance == kApart) continue;
      sum += distance;
      ++count;
    }
    if (count > 0) by_frame[t].emplace_back("contact_distance_mm", kMillimetres * sum / static_cast<double>(count));
  }
  return by_frame;
}

std::vector<MetricValues> contact_share_by_frame(const std::vector<std::vector<double>>& joints,
                                                 const std::vector<const Gaussians*>& objects,
                                                 const std::vector<SceneState>& states) {
  HSI4D_CHECK_EQ(joints.size(), states.size());
  std::vector<MetricValues> by_frame(states.size());
  if (objects.empty()) return by_frame;
  const ObjectCentres centres(objects);
  for (std::size_t t = 0; t < states.size(); ++t)
    by_frame[t].emplace_back("contact_share",
                             is_a_hand_joint_near(joints[t], centres, rigids_of(states[t].objects)) ? 1 : 0);
  return by_frame;
}

std::vector<MetricValues> sliding_by_frame(const std::vector<std::vector<double>>& joints, double frame_rate) {
  std::vector<MetricValues> by_frame(joints.size());
  for (std::size_t t = 1; t < joints.size(); ++t) {
    const std::optional<double> sliding = foot_sliding_mm(joints[t - 1], joints[t], joints.front(), frame_rate);
    if (sliding) by_frame[t].emplace_back("foot_sliding_mm", *sliding);
  }
  return by_frame;
}

std::vector<MetricValues> floor_drift_by_frame(const std::vector<std::vector<double>>& joints) {
  std::vector<MetricValues> by_frame(joints.size());
  for (std::size_t t = 1; t < joints.size(); ++t)
    by_frame[t].emplace_back("floor_drift_mm",
                             kMillimetres * std::abs(lowest_foot(joints[t]) - lowest_foot(joints[0])));
  return by_frame;
}

MetricValues mean_after_first(const std::vector<MetricValues>& by_frame) {
  std::vector<FrameMetrics> frames;
  for (std::size_t t = 1; t < by_frame.size(); ++t) frames.push_back({static_cast<int>(t), by_frame[t]});
  return mean_errors(frames);
}

}  // namespace hsi4d
