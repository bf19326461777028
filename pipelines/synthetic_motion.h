// What happens in the synthetic clip: a person lifts an object from a table, turns and pours, while the camera drifts.
// Everything is a function of time; frames sample it.
//
// The clip is kClipSeconds long and then runs backwards, and forwards again, for as many frames as are wanted. Seven
// steps at 10 frames a second are the lift alone, at rest at both ends: between two of them the root moves at most
// 4 cm, a joint turns at most 12 degrees, the object moves at most 5 cm and the camera 1.5 cm and 0.4 degrees, which a
// local optimiser can follow. A lower frame rate makes the same clip harder.
#pragma once

#include <vector>

#include "body/body_model.h"
#include "body/motion_io.h"
#include "core/camera.h"
#include "core/rigid.h"
#include "pipelines/synthetic_scene.h"

namespace hsi4d {

/// Length of the motion before it turns back, seconds.
inline constexpr double kClipSeconds = 3;

struct ClipSettings {
  Index frames = 8;
  double frame_rate = 10;   ///< frames a second
  int size_px = 256;        ///< width and height of a frame
  double camera_drift = 1;  ///< how far the camera moves: 0 stands, 1 as designed
};

/// The exact state of every frame.
struct SyntheticClip {
  Motion motion;
  std::vector<Rigid<double>> object;  ///< world_from_object, a frame
  std::vector<Camera> cameras;
  Rigid<double> wrist_from_object;  ///< the same in every frame: the right hand holds the object
  RoomPlan room;                    ///< the table under the object of time 0
};

/// Makes the clip. Feet stay where they are; legs and arms follow by two-bone inverse kinematics.
///
/// @param body  in the SMPL-X layout
/// Throws InternalError when the body has other joints or there is no frame.
SyntheticClip synthetic_clip(const BodyModel& body, const SyntheticObject& object, const ClipSettings& settings);

/// World rotation and position of a joint of a posed body: the frame that things in the hand are fixed to.
Rigid<double> joint_frame(const BodyModel& body, const BodyPose& pose, int joint);

}  // namespace hsi4d
