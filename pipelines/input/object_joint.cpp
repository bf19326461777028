#include "pipelines/input/object_joint.h"

#include <cmath>
#include <limits>

#include "core/check.h"

namespace hsi4d {

ObjectJoint object_joint(const JointSettings& settings, std::optional<Index> parent) {
  HSI4D_CHECK(settings.type != JointType::kFree, "an object without a joint");
  constexpr double kAny = std::numeric_limits<double>::infinity();
  const bool is_limited = !settings.limits.empty();
  return {settings.type,
          parent,
          Vector3<double>(settings.axis.data()).normalized(),
          Vector3<double>(settings.origin.data()),
          is_limited ? settings.limits[0] : -kAny,
          is_limited ? settings.limits[1] : kAny};
}

Rigid<double> on_joint(const ObjectJoint& joint, double q) {
  if (joint.type == JointType::kSlide) return {joint.rest.rotation, joint.rest.translation + q * joint.axis};
  const Matrix3<double> turn = so3_exp(Vector3<double>(q * joint.axis));
  return {turn * joint.rest.rotation, joint.origin + turn * (joint.rest.translation - joint.origin)};
}

double joint_value(const ObjectJoint& joint, const Rigid<double>& parent_from_object) {
  if (joint.type == JointType::kSlide) return joint.axis.dot(parent_from_object.translation - joint.rest.translation);
  const Matrix3<double> turn = parent_from_object.rotation * joint.rest.rotation.transpose();
  // The turn R = exp(q a) times the least: tr(exp(q a)ᵀ R) = s sin q + c cos q + aᵀ R a is largest at that q.
  const double s = axial(turn).dot(joint.axis), c = turn.trace() - joint.axis.dot(turn * joint.axis);
  return std::atan2(s, c);
}

Rigid<double> world_from_parent(const ObjectJoint& joint, std::span<const ObjectPose> objects) {
  return joint.parent ? rigid_of(objects[static_cast<std::size_t>(*joint.parent)]) : Rigid<double>();
}

Rigid<double> parent_from_object(const ObjectJoint& joint, std::span<const ObjectPose> objects, std::size_t object) {
  return compose(inverse(world_from_parent(joint, objects)), rigid_of(objects[object]));
}

}  // namespace hsi4d
