// What of a motion can be judged without truth: whether hands touch objects, and how far feet slide.
#pragma once

#include <span>
#include <vector>

#include "body/avatar.h"
#include "pipelines/input/state.h"
#include "pipelines/metrics/metric_facts.h"
#include "splat/gaussians.h"

namespace hsi4d {

/// Contact of hands and objects in each state; nothing where there are no objects:
///
///   contact_share        1 where a hand's joint (wrists and fingers) is nearer than kContactDistance to the centre of
///                        a Gaussian of an object, else 0
///   contact_distance_mm  1000 · mean over C of |h − μ|: C the Gaussians h of the hands that are nearer than that to an
///                        object, μ the nearest centre (as the loss `contact`); only where C is not empty
///
/// @param objects  in the states' order, relative to their centroids
std::vector<MetricValues> contact_by_frame(const Avatar& avatar, const std::vector<const Gaussians*>& objects,
                                           const std::vector<SceneState>& states);

/// contact_share alone, of a body of which the joints are known.
/// @param joints  [T][J,3] metres, world, in the order of SMPL-X
/// @param states  where the objects are
std::vector<MetricValues> contact_share_by_frame(const std::vector<std::vector<double>>& joints,
                                                 const std::vector<const Gaussians*>& objects,
                                                 const std::vector<SceneState>& states);

/// foot_sliding_mm (optim/standing_feet.h) of each frame since the one before; none in frame 0, by which it is known
/// how high feet stand, and none where no foot stands.
/// @param joints      [T][J,3] metres, world
/// @param frame_rate  frames a second
std::vector<MetricValues> sliding_by_frame(const std::vector<std::vector<double>>& joints, double frame_rate);

/// floor_drift_mm of each frame: 1000 · |z of the lowest ankle or ball of a foot − the same in frame 0|; none in frame
/// 0. Large where the floor is lost, or feet leave it on purpose.
/// @param joints  [T][J,3] metres, world
std::vector<MetricValues> floor_drift_by_frame(const std::vector<std::vector<double>>& joints);

/// The mean of each metric over those frames after the first that have it.
MetricValues mean_after_first(const std::vector<MetricValues>& by_frame);

}  // namespace hsi4d
