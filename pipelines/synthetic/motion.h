// What happens in a synthetic clip: a person does something with an object while the camera drifts. Everything is a
// function of time; frames sample it.
//
// pour, lift, put_down, sit, lean, wave and open are keyframes (synthetic_keys.cpp): kClipSeconds long, then backwards,
// and forwards again, for as many frames as are wanted. walk and push go around in a circle from footstep to footstep
// (synthetic_walk.cpp) and never end. sit_on, lean_on, reach, wipe and water are keyframes at a place of the scene
// (synthetic_place_keys.cpp), run, slide, play and roll functions of time (synthetic_flow.cpp).
//
// Seven steps of `pour` at 10 frames a second are the lift alone, at rest at both ends: between two of them the root
// moves at most 4 cm, a joint turns at most 12 degrees, the object moves at most 5 cm and the camera 1.5 cm and 0.4
// degrees, which a local optimiser can follow. A lower frame rate makes the same clip harder.
#pragma once

#include <vector>

#include "body/body_model.h"
#include "body/motion_io.h"
#include "core/camera.h"
#include "core/rigid.h"
#include "pipelines/synthetic/figure.h"
#include "pipelines/synthetic/object.h"
#include "pipelines/synthetic/scene.h"
#include "pipelines/synthetic/variation.h"

namespace hsi4d {

/// Length of the keyframed motions before they turn back, seconds.
inline constexpr double kClipSeconds = 3;

struct ClipSettings {
  Index frames = 8;
  double frame_rate = 10;   ///< frames a second
  int size_px = 256;        ///< width and height of a frame
  double camera_drift = 1;  ///< how far the camera moves: 0 stands, 1 as designed
  SyntheticMotionKind motion = SyntheticMotionKind::kPour;
  double camera_distance = 1;         ///< of the camera from what it looks at first, of that as designed
  const ScenePlace* place = nullptr;  ///< where it is done, of motions that need one
  ClipVariation variation = {};
};

/// The clip that the settings ask for; of several, which follow one another, all frames.
ClipSettings clip_settings(const SyntheticSettings& settings);

/// Where a camera stands and looks at first.
struct Viewpoint {
  Vector3<double> eye, target;  ///< metres
  double focal = 1;             ///< widths of the image
  double turn = 0;              ///< of its drift about z, radians; 0: that of one that looks along +y
};

/// Where the camera stands at first: as its motion and its distance say.
Viewpoint first_viewpoint(const ClipSettings& settings);

/// The camera after so many seconds of drift.
Camera camera_at(const Viewpoint& view, double seconds, const ClipSettings& settings);

/// The exact state of every frame.
struct SyntheticClip {
  Motion motion;
  std::vector<Rigid<double>> object;  ///< world_from_object, a frame; empty without an object
  std::vector<Motion> others{};       ///< of the people beside the first one
  std::vector<Camera> cameras;
  ScenePlan plan;  ///< what has to stand where
};

/// Makes the clip. Legs and arms follow feet and hands by two-bone inverse kinematics; planted feet stay where they
/// are; a carried object is fixed to the right wrist.
///
/// @param body  in the SMPL-X layout
/// Throws InternalError when the body has other joints or there is no frame; UserError when the motion makes no sense
/// with the object.
SyntheticClip synthetic_clip(const BodyModel& body, const SyntheticObject& object, const ClipSettings& settings);

/// The motion of a person beside the first one of a clip, on as many frames.
/// @param settings  of that clip
Motion motion_beside(const BodyModel& body, const SyntheticPerson& person, const SyntheticClip& first,
                     const ClipSettings& settings);

/// World rotation and position of a joint of a posed body: the frame that things in the hand are fixed to.
Rigid<double> joint_frame(const BodyModel& body, const BodyPose& pose, int joint);

/// One line of what a motion is.
const char* motion_summary(SyntheticMotionKind motion);

}  // namespace hsi4d
