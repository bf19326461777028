// The body that a motion is measured on: an avatar's, or a SMPL-X model in the motion's shape.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "body/avatar.h"
#include "body/smplx_file.h"
#include "pipelines/evaluate/tracks.h"

namespace hsi4d {

/// A skeleton, and what stands for the body's vertices.
class EvaluatedBody {
 public:
  /// An avatar; the track is moved to stand on it, z up. Errors as read_avatar.
  static EvaluatedBody of_avatar(const std::string& file, Track& track);
  /// A body model in the track's own shape; the track is moved to stand on it, z up. Errors as read_smplx.
  static EvaluatedBody of_model(const std::string& file, Track& track);

  const RestSkeleton& skeleton() const { return skeleton_; }
  /// Null of a model.
  const Avatar* avatar() const { return avatar_ ? &*avatar_ : nullptr; }

  /// Where the points that are looked at are, [P,3] metres, world, in each pose: all vertices of a model with its pose
  /// correctives, the chosen Gaussians of an avatar (measured_points).
  std::vector<std::vector<double>> points(const std::vector<SceneState>& states) const;

 private:
  RestSkeleton skeleton_;
  std::optional<Avatar> avatar_;
  std::shared_ptr<const SmplxModel> model_;
  std::vector<double> betas_;
};

}  // namespace hsi4d
