// Contacts that somebody has annotated: in this frame this part of the body touches that place.
#pragma once

#include <optional>
#include <vector>

#include "body/skinning.h"
#include "core/rotation.h"

namespace hsi4d {

/// A contact in a frame.
struct AnnotatedContact {
  Index frame = 0;  ///< of the clip; in a MotionStart of its frames
  std::vector<Index> joints =
      {};            ///< of the SMPL-X layout: the surface that follows one of them touches; none: `vertex`
  Index vertex = 0;  ///< of the body that the avatar was made on
  std::optional<Index> object = {};  ///< what is touched, in the clip's order; none: the scene
  /// Where, metres: in the object's frame, or in the world; none: of the object whatever is nearest.
  std::optional<Vector3<double>> place = {};
  double weight = 1;  ///< how much it counts
};

/// The points of a human that may be what touches, ascending: the vertex, or those whose largest weight (of equal ones
/// the first) is that of one of the joints.
/// @param weights  of the vertices, or, for contacts of joints, of the avatar's Gaussians
std::vector<Index> touching_rows(const AnnotatedContact& contact, const SparseWeights& weights);

}  // namespace hsi4d
