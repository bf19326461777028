// What the report's 3D view shows, in one small file of a run: Gaussians of scene and objects, the body's mesh, and
// the motion of everything by frame.
//
// Numbers are as small as a viewer can bear: positions within boxes of 16 bits, joints' rotations of 16, weights of 8;
// frames are poses, so that a viewer skins the mesh and moves the objects. Units are metres, the world has z up.
#pragma once

#include <string>
#include <vector>

#include "body/body_model.h"
#include "core/safetensors.h"
#include "pipelines/input/clip.h"

namespace hsi4d {

inline constexpr std::string_view kView3dFormat = "hsi4d view3d";
inline constexpr int kView3dVersion = 1;

/// Gaussians that a viewer gets at most, of the scene and of all objects together.
inline constexpr Index kMostSceneSplats = 30000, kMostObjectSplats = 6000;

/// The file (safetensors of the format kView3dFormat); texts `frame_rate` and `objects`, and arrays
///
///   splats/counts I32 [P], boxes F32 [P,2,3], positions U16 [N,3], log_scales U8 [N,3], log_scale_range F32 [2],
///     rotations I8 [N,4], colors U8 [N,4]                       P parts: the scene, then the objects; view3d_splats.h
///   objects/poses F32 [T,O,7]                                   world_from_object: quaternion wxyz, translation
///   cameras/intrinsics F32 [6]: width, height, fx, fy, cx, cy;  cameras/poses F32 [T,7] camera_from_world
///   skeleton/joints F32 [J,3], parents I32 [J]                  in the rest pose
///   body/rotations I16 [T,J,4], translations F32 [T,3]          of the joints in the world, quaternions of 32767
///   truth/rotations, truth/translations                         the same, where the truth is known
///   others/N/joints F32 [J,3], rotations, translations          likewise, of people beside the first one, N from 1
///   mesh/box F32 [2,3], positions U16 [V,3], faces U16 or U32 [F,3], joints U8 [V,4], weights U8 [V,4]    with a body
///
/// Of a joint's rotation R_j, rest place r_j, parent q and translation t:  p_j = p_q + R_q (r_j − r_q),
/// A_j = [R_j | p_j − R_j r_j + t], as in body/kinematics.h.
///
/// @param states  the result by frame, frame 0 included
/// @param body    of the avatar; null: there is none to show
/// Throws InternalError for a body of more than 256 joints.
SafetensorsWriter view3d_file(const Clip& clip, const std::vector<SceneState>& states, const BodyModel* body);

/// Such a file as it is, and what a page has to know of it before it is unpacked.
struct View3d {
  Bytes file;  ///< empty: there is none
  Index frames = 0;
  double frame_rate = 0;  ///< frames a second
  bool has_truth = false;
};

/// Reads one. Throws UserError when it cannot be read, DataError naming it when it is damaged, of another format, or
/// newer.
View3d read_view3d(const std::string& path);

}  // namespace hsi4d
