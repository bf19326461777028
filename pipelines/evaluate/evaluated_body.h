// The body that a motion is measured on: an avatar's, or a SMPL-X model in the motion's shape.
#pragma once

#include <array>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "body/avatar.h"
#include "body/smplx_file.h"
#include "optim/protocols/human_object_metrics.h"
#include "pipelines/evaluate/tracks.h"

namespace hsi4d {

/// Points of a body's feet: left toe, left heel, right toe, right heel.
struct FootPoints {
  std::array<Index, 4> rows = {};
  std::string words;  ///< what they are, for people
};

/// Where the big toes and heels are among the 10475 vertices of SMPL-X, as its public implementation names them. Those
/// of SMPL and SMPL-H, 3216, 3387, 6617 and 6787, are the four of the evaluations on EMDB and RICH.
inline constexpr std::array<Index, 4> kSmplxFeet = {5770, 8846, 8463, 8635};
inline constexpr Index kSmplxVertices = 10475;

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
  /// The triangles of these points; none of an avatar.
  Triangles faces() const;

  /// How many points a body has, each by its number: vertices, or Gaussians, of an avatar all of them.
  Index point_count() const;
  /// Where some of them are, [P,3] metres, world, in each pose. Throws InternalError for a number that is not there.
  std::vector<std::vector<double>> points(const std::vector<SceneState>& states, std::span<const Index> rows) const;
  /// kSmplxFeet of a model with as many vertices as SMPL-X; of another body, in its rest pose, the foremost and the
  /// hindmost of the points that follow an ankle or the ball of its foot most. Throws UserError where none does.
  FootPoints foot_points() const;

 private:
  /// What `of` makes of the vertices of each pose of a model; a few poses at once are in memory.
  template <class F>
  std::vector<std::vector<double>> of_vertices(const std::vector<SceneState>& states, const F& of) const;

  RestSkeleton skeleton_;
  std::optional<Avatar> avatar_;
  std::shared_ptr<const SmplxModel> model_;
  std::vector<double> betas_;
};

}  // namespace hsi4d
