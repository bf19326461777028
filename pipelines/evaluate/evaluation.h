// What `hsi4d evaluate` measures of one run or motion: errors against a truth where there is one, and what needs none.
#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "pipelines/config/data_settings.h"
#include "pipelines/evaluate/foreign_motion.h"
#include "pipelines/evaluate/protocols.h"
#include "pipelines/evaluate/tracks.h"
#include "pipelines/metrics/solid.h"
#include "pipelines/record/summary.h"
#include "splat/gaussians.h"

namespace hsi4d {

/// What is measured, and by what. Paths; empty: not given.
struct EvaluationSettings {
  std::string truth;             ///< what a motion is compared with; empty: what the run's config names, if anything
  std::string data;              ///< a dataset or run in whose scene the motions are, with its objects and avatar
  std::string body_model;        ///< joints and vertices are those of this body, in each motion's own shape
  std::string truth_body_model;  ///< of the truth, where it is another one with the same vertices
  std::string avatar;
  std::string surface, occupancy, scene;  ///< what is solid: a mesh, a grid, what Gaussians show; one at most
  std::string objects;                    ///< poses of objects in the scene, beside a motion
  std::vector<std::pair<std::string, std::string>> object_surfaces;  ///< meshes of objects, by name
  MotionAlign align = MotionAlign::kNone;  ///< how a motion is laid on frame 0 of the truth or the data
  /// What files of other programs leave open; of the truth only what its file does not say.
  std::optional<double> from_rate = {};
  std::optional<UpAxis> up = {};
  int person = 0;
  std::optional<double> frame_rate = {};  ///< to measure at
  Protocol protocol = Protocol::kNone;
  std::vector<Index> foot_points = {};  ///< four points of the body by their numbers; empty: EvaluatedBody::foot_points
  Index aligned_frames = kAlignedFrames;  ///< that a protocol with objects lays on the truth together
};

/// What one input came to.
struct Evaluation {
  std::string name, truth;  ///< no truth: ""
  Index frames = 0;
  double frame_rate = 0;
  bool has_objects = false;                 ///< something is moved in the clip: its motion, truth or data say so
  MetricValues values;                      ///< means over frames 1 to T, in no order
  std::vector<FrameMetrics> per_frame;      ///< of frames 1 to T
  std::vector<std::string> notes;           ///< what was found or taken, for people
  std::string surface;                      ///< by what penetration was measured; empty: it was not
  std::string protocol;                     ///< that was followed beside; empty: none
  std::vector<std::vector<double>> joints;  ///< [T+1][J,3] metres, world
};

/// Measures one input. @param clip  a file of embeddings (pipelines/metrics/clip_embeddings.h); empty: none
///
/// Throws UserError or DataError with one message for whatever is wrong with settings and files.
Evaluation evaluate(const EvaluationSettings& settings, const std::string& input, const std::string& clip);

/// A motion on its body, in its scene.
struct MotionInScene {
  Track track;
  RestSkeleton skeleton;
  std::vector<Gaussians> objects;  ///< in the track's order, relative to their centroids; empty: not known
  Solid solid;                     ///< without a distance: not known
};

/// Reads one input as evaluate() does, without measuring anything. Throws as that.
MotionInScene motion_in_scene(const EvaluationSettings& settings, const std::string& input);

/// The folders that tell scene, objects and avatar, the first that does: the input itself where it is one, `data`,
/// `truth`, and what the config of a run names as its truth.
std::vector<std::string> data_folders(const EvaluationSettings& settings, const std::string& input);

}  // namespace hsi4d
