// The camera of a clip's first frame, chosen so that it sees as much of the human as possible.   [method.md, §5]
//
//   candidates on spheres about c, above the pelvis (or between it and what it faces), that face the human but not
//   squarely; of each the joints are counted whose pixels show the human: D the depth of everything, D_H that of the
//   human alone, both where the transmittance falls below ½, |D − D_H| < tolerance
#pragma once

#include <optional>
#include <vector>

#include "core/camera.h"
#include "core/observer.h"
#include "pipelines/config/camera_selection_settings.h"
#include "pipelines/draw/image_of_scene.h"
#include "pipelines/input/scene_setup.h"
#include "splat/render_settings.h"

namespace hsi4d {

/// A candidate and what it sees.
struct CandidateView {
  double radius_m = 0, azimuth_deg = 0, elevation_deg = 0;  ///< about the centre; azimuth from the human's heading
  Rigid<double> camera_from_world;
  Index visible = 0;  ///< of the first 22 joints
  /// Mean opacity of the image; measured with by_cover alone, of those with the most visible joints.
  std::optional<double> cover = {};
};

/// By less than this images are covered alike, as a share.
inline constexpr double kCoverStep = 0.05;

/// The chosen camera, and all candidates, best first.
struct CameraChoice {
  Camera camera;
  std::vector<CandidateView> candidates;
};

/// The horizontal direction in which a body faces: its forward axis, turned by global_orient.
/// Throws UserError when it lies down, so that there is none.
Vector3<double> heading_of(const BodyPose& pose);

/// What the candidates look at, metres, world: over the pelvis; or over the middle between it and the farthest Gaussian
/// of the objects along the heading.
Vector3<double> view_center(const SceneSetup& setup, const CameraSelectionSettings& settings);

/// The candidates, by radius, elevation and azimuth; nothing is counted yet.
std::vector<CandidateView> candidate_views(const SceneSetup& setup, const CameraSelectionSettings& settings);

/// How many joints of the human in frame 0 `camera` sees, as above.
Index count_visible(const SceneSetup& setup, const Camera& camera, const CameraSelectionSettings& settings,
                    const RenderSettings& render);

/// Tries all candidates. The best one has the most visible joints; of equals it is, with by_cover, one whose image is
/// covered most, in steps of kCoverStep; of these it is the nearest to the horizon, and of these the first.
/// [paper, C.3, without by_cover]
///
/// @param intrinsics  whose size and focal lengths the camera has; none: those of the settings
/// Throws UserError when no joint is visible from anywhere, Interrupted when asked to stop.
CameraChoice select_camera(const SceneSetup& setup, const CameraSelectionSettings& settings,
                           const RenderSettings& render, const std::optional<Camera>& intrinsics = {},
                           const Observer& observer = {});

/// Everything in the state of frame 0, as Gaussians to render: scene, objects, human.
struct FirstFrame {
  PosedGaussians all, human;
};
FirstFrame first_frame(const SceneSetup& setup, const Vector3<double>& camera_center);

}  // namespace hsi4d
