// Where body and objects were in the frames that a stage sees, when it began: by it loss terms choose what they compare
// (hands near an object, feet that stand), once, before the first iteration.
#pragma once

#include <array>
#include <functional>
#include <optional>
#include <vector>

#include "body/avatar.h"
#include "core/rigid.h"
#include "optim/annotated_contact.h"
#include "splat/gaussians.h"

namespace hsi4d {

/// In place of a frame: the clip's first, which may be long before those that a stage sees.
inline constexpr Index kFirstFrame = -1;

/// The points of a human: the avatar's Gaussians, or the vertices of the body that it was made on.
enum class BodySet { kGaussians, kVertices };

/// A point of the human in a frame.
struct BodyPoint {
  Index frame = 0, row = 0;
  BodySet of = BodySet::kGaussians;
  Vector3<double> offset = Vector3<double>::Zero();  ///< from the point, at rest, metres
};

/// Points at rest, and the joints that they follow.
struct RestPoints {
  const std::vector<float>* places = nullptr;  ///< [N,3] metres
  const SparseWeights* weights = nullptr;
};

/// A Gaussian of an object in a frame.
struct ObjectPoint {
  Index frame = 0, object = 0, row = 0;
  Vector3<double> offset = Vector3<double>::Zero();  ///< from its centre, in the object's frame, metres
};

/// F frames: the first `still_frames` are behind the stage and stay as they are, the others move.
struct MotionStart {
  const Avatar* avatar = nullptr;
  /// The body that the avatar was made on, with its joints; null: not known, or not asked for.
  const BodyModel* mesh = nullptr;
  std::vector<const Gaussians*> objects;                          ///< relative to their centroids
  const Gaussians* scene = nullptr;                               ///< null: none is known
  Vector3<double> first_camera_center = Vector3<double>::Zero();  ///< of the clip's first frame, metres, world
  Index still_frames = 1;
  double frame_rate = 10;         ///< frames a second
  PosedJoints first_body;         ///< in the clip's first frame
  std::vector<PosedJoints> body;  ///< [F]
  /// [F+A][O], in the A frames that follow, too, where the stages before left them, as LossInputs::joints_after.
  std::vector<std::vector<Rigid<double>>> world_from_object = {};
  /// How far the lower foot goes up and down in the estimate of the whole clip (lower_foot_range), metres; none: there
  /// is no estimate.
  std::optional<double> foot_range = {};
  std::optional<std::vector<AnnotatedContact>> contacts = {};  ///< in frames that move; none: nobody annotated any

  Index frames() const { return static_cast<Index>(body.size()); }
  Index moving_frames() const { return frames() - still_frames; }
  Index frames_with_objects() const { return std::ssize(world_from_object); }

  const PosedJoints& body_in(Index frame) const {
    return frame == kFirstFrame ? first_body : body[static_cast<std::size_t>(frame)];
  }
  /// Throws InternalError for vertices of a body that is not there.
  RestPoints rest_points(BodySet of) const;
  /// Where the point was, metres, world: a Gaussian's centre, or a vertex.
  Vector3<double> place(const BodyPoint& point) const;
  Vector3<double> place(const ObjectPoint& point) const;
};

/// The wrists of the SMPL-X layout, left and right.
inline constexpr std::array<Index, 2> kWristJoints = {20, 21};

/// The hand of a joint that is its wrist or of its fingers: 0 the left one, 1 the right one.
std::optional<std::size_t> hand_of_joint(Index joint);

/// Joints of the SMPL-X layout that are hands (wrists and fingers), and feet (ankles and balls).
inline bool is_hand_joint(Index joint) { return hand_of_joint(joint).has_value(); }
bool is_foot_joint(Index joint);

/// Points whose largest weight (of equal ones the first) is that of such a joint, ascending: a part of the human on any
/// mesh.   [method.md, stage 3: hand vertices]
std::vector<Index> rows_of_joints(const SparseWeights& weights, const std::function<bool(Index joint)>& is_part);

}  // namespace hsi4d
