// The inputs of loss terms over the body's motion: places of joints, of some Gaussians of hands and feet, of objects.
#pragma once

#include "body/kinematics.h"
#include "optim/loss_term.h"
#include "pipelines/input/clip.h"

namespace hsi4d {

/// The M frames that a stage moves, on its tape.
template <class S>
struct MovingFrames {
  Var<S> rotations;           ///< [M·55,9] of all joints, relative to their parents
  PosedSkeleton<S> skeleton;  ///< of the frames
  Var<S> object_transforms;   ///< [O,12] rows [3,4] of world_from_object, of one frame; empty: the objects stand
  Var<S> rest_offsets;        ///< [N,3] of the avatar's means in the rest pose, which betas move; empty: none
};

/// Fills in body_rotations, joints, joints_start, motion, body_points and object_points.
///
/// @param person  whose motion it is
/// @param first   the clip's first frame
/// @param frames  states when the stage begins: some that stand still, then the M that move
/// @param index   in the clip, of the first of these
/// The clip must outlive the inputs.
template <class S>
void give_motion(const MovingFrames<S>& moving, const Clip& clip, std::size_t person, const SceneState& first,
                 const std::vector<SceneState>& frames, Index index, LossInputs<S>& inputs);

/// The motion, with the objects of frames that follow.
std::shared_ptr<const MotionStart> with_objects_after(const MotionStart& motion, std::span<const SceneState> frames);

extern template void give_motion(const MovingFrames<float>&, const Clip&, std::size_t, const SceneState&,
                                 const std::vector<SceneState>&, Index, LossInputs<float>&);
extern template void give_motion(const MovingFrames<double>&, const Clip&, std::size_t, const SceneState&,
                                 const std::vector<SceneState>&, Index, LossInputs<double>&);

}  // namespace hsi4d
