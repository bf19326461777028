// A body in motion as a GLB file (glTF 2.0, binary) for viewers: a skinned mesh, its skeleton, an animation.
//
//   scene ─ "world"   z up to glTF's y up
//   │         └ joint nodes, the pelvis on top; translation r_j − r_q of the rest pose, rotation of the motion
//   └ "body"         the mesh; vertices of joint j by inverse bind matrix T(−r_j)
//
// Linear blend skinning by four weights a vertex: pose correctives have no place in such a file.
#pragma once

#include <string>

#include "body/body_model.h"
#include "body/motion_io.h"
#include "core/file.h"

namespace hsi4d {

/// The bytes of such a file. The animation is linear between frames, in glTF that of rotations slerp; frame t is at
/// t / frame_rate seconds. Joints that do not turn have no channel.
///
/// @param body    in its rest pose, of its shape; at most 256 joints
/// @param motion  poses of as many joints, world z up
/// Throws InternalError when there is no frame or no face, joints differ, or the frame rate is not positive.
Bytes encode_glb(const BodyModel& body, const Motion& motion);

/// Writes it. Throws UserError naming the path when that fails.
void write_glb(const std::string& path, const BodyModel& body, const Motion& motion);

}  // namespace hsi4d
