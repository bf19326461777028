// Joints of objects: a door turns about its hinge, a drawer slides along its rails. One number a frame says how far.
//
//   parent_from_object(q) = J(q) parent_from_object(0)
//   hinge:  J(q) x = o + exp(q a) (x − o)
//   slide:  J(q) x = x + q a
//
// a is the axis, of length 1, o a point of it, both in the frame of the parent: another object, or the world. q is 0
// where the object is in frame 0 as it is given; radians or metres.
#pragma once

#include <optional>
#include <span>

#include "core/rigid.h"
#include "core/types.h"
#include "pipelines/config/data_settings.h"
#include "pipelines/input/state.h"

namespace hsi4d {

/// The joint of an object.
struct ObjectJoint {
  JointType type = JointType::kHinge;  ///< never kFree
  std::optional<Index> parent = {};    ///< an object before it; none: the scene
  Vector3<double> axis = Vector3<double>::UnitZ();
  Vector3<double> origin = Vector3<double>::Zero();  ///< metres; of a slide without meaning
  double low = 0, high = 0;                          ///< of q
  Rigid<double> rest = {};                           ///< parent_from_object(0)
};

/// The joint that settings describe, which are not of a free object; `rest` is left to the caller.
ObjectJoint object_joint(const JointSettings& settings, std::optional<Index> parent);

/// parent_from_object at q.
Rigid<double> on_joint(const ObjectJoint& joint, double q);

/// The q whose pose is nearest: of a hinge the turn about its axis, from −π to π;
/// of a slide the way along its axis. Limits do not count.
double joint_value(const ObjectJoint& joint, const Rigid<double>& parent_from_object);

/// Where the parent is, of the objects' poses in a frame.
Rigid<double> world_from_parent(const ObjectJoint& joint, std::span<const ObjectPose> objects);
/// How an object on a joint is to its parent in a frame.
Rigid<double> parent_from_object(const ObjectJoint& joint, std::span<const ObjectPose> objects, std::size_t object);

}  // namespace hsi4d
