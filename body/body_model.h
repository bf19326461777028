// A body: surface, skeleton and skinning weights in the rest pose.
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "body/pose.h"
#include "body/skinning.h"

namespace hsi4d {

/// Names of bodies: of a SMPL-X file, and the program's own in any shape.
inline constexpr const char* kSmplxName = "smplx";
inline constexpr const char* kProceduralName = "procedural";

/// A body in its rest pose, a T: SMPL-X frame, Y up, x to the body's left, z forward.
struct BodyModel {
  std::string name;                      ///< kSmplxName, kProceduralName
  std::vector<float> vertices;           ///< [V,3] metres
  std::vector<std::int32_t> faces;       ///< [F,3] vertices, counter-clockwise seen from outside
  std::vector<std::string> joint_names;  ///< [J]
  std::vector<int> parents;              ///< [J], −1 for the root, which is joint 0; a joint comes after its parent
  std::vector<double> joints;            ///< [J,3] metres
  SparseWeights weights;                 ///< 4 a vertex

  Index vertex_count() const { return static_cast<Index>(vertices.size() / 3); }
  Index face_count() const { return static_cast<Index>(faces.size() / 3); }
  Index joint_count() const { return static_cast<Index>(parents.size()); }
};

/// Joints of the SMPL-X layout.
inline constexpr Index kSmplxJoints = 55;

/// Names of the 55 joints of the SMPL-X layout, in its order: pelvis, left_hip, …, right_thumb3.
const std::vector<std::string>& smplx_joint_names();

/// Their parents, −1 for the pelvis.
const std::vector<int>& smplx_parents();

/// Number of a joint in smplx_joint_names. Throws InternalError for a name that is not there.
int smplx_joint(std::string_view name);

/// Why `parents` is no tree whose root is joint 0 and in which a joint comes after its parent; empty when it is one.
std::string tree_fault(std::span<const int> parents);

/// Posed vertices: linear blend skinning of the rest pose, in double.
///
/// @return  [V,3] metres, world
/// Throws InternalError when the pose has another number of joints.
std::vector<double> pose_vertices(const BodyModel& body, const BodyPose& pose);

}  // namespace hsi4d
