// Config section `data`: the files that a run reads.
#pragma once

#include <array>
#include <filesystem>
#include <string>
#include <vector>

#include "core/config.h"
#include "core/lens.h"

namespace hsi4d {

/// How an object moves: freely, turning about an axis, or sliding along one.
enum class JointType { kFree, kHinge, kSlide };

inline constexpr std::array<ConfigChoice<JointType>, 3> kJointTypes = {
    {{JointType::kFree, "free"}, {JointType::kHinge, "hinge"}, {JointType::kSlide, "slide"}}};

/// The joint of an object (pipelines/input/object_joint.h).
struct JointSettings {
  JointType type = JointType::kFree;
  std::string parent;                        ///< an object that is named before; empty: the scene
  std::array<double, 3> axis = {0, 0, 1};    ///< in the parent's frame, of any length
  std::array<double, 3> origin = {0, 0, 0};  ///< a point of a hinge's axis there, metres
  std::vector<double> limits;                ///< low, high, radians or metres from frame 0; empty: none
};

/// One rigid object.
struct ObjectSettings {
  std::filesystem::path gaussians;
  /// What is known of it in frame 0 where hsi4d makes its masks; at most one. Empty: what the state of frame 0 shows.
  std::filesystem::path first_mask = {};
  std::vector<double> first_box = {}, first_clicks = {};  ///< x0, y0, x1, y1; x, y of each; pixels of the video
  JointSettings joint = {};
};

/// Whether something is said of where an object is in frame 0.
bool has_hint(const ObjectSettings& object);

/// How an estimated motion is laid on the human of frame 0.
enum class MotionAlign { kHeading, kRotation, kNone };

inline constexpr std::array<ConfigChoice<MotionAlign>, 3> kMotionAligns = {
    {{MotionAlign::kHeading, "heading"}, {MotionAlign::kRotation, "rotation"}, {MotionAlign::kNone, "none"}}};

/// A person beside the first one, whose files `data` itself names.
struct PersonSettings {
  std::filesystem::path avatar, initial, motion{}, keypoints{};  ///< as in DataSettings
};

/// How the lens of the video bends.
struct LensSettings {
  Lens lens;
  bool estimate_k1 = false;  ///< k1 is what frame 0 says, found as the run begins
};

/// The inputs of a run. Relative paths are relative to the file that names them.
struct DataSettings {
  std::filesystem::path scene;
  ConfigMap<ObjectSettings> objects;  ///< by name
  ConfigMap<PersonSettings> people;   ///< beside the first one, by name
  std::filesystem::path avatar;
  std::filesystem::path frames;
  std::filesystem::path masks;
  std::filesystem::path camera;
  LensSettings lens;
  std::filesystem::path initial;
  std::filesystem::path motion;  ///< poses estimated from the video; empty: those of `initial`, if it has some
  MotionAlign motion_align = MotionAlign::kHeading;
  std::filesystem::path keypoints;         ///< points of the human that a detector found; empty: none
  std::filesystem::path keypoint_joints;   ///< which joints these stand for; empty: as the file says
  std::filesystem::path tracks;            ///< points that a tracker followed through the video; empty: none
  std::filesystem::path depth_maps;        ///< depths that an estimator found, a file for each frame; empty: none
  std::filesystem::path depth_confidence;  ///< how sure it was, likewise; empty: alike everywhere
  std::filesystem::path contacts;          ///< what the human touches, as somebody annotated it; empty: nobody did
  std::filesystem::path truth;
  std::filesystem::path surface;  ///< a mesh of what is solid, to measure penetration by; empty: not measured
  double video_rate = 0;          ///< frames a second of the video; 0: what its file says
  double frame_rate = 0;          ///< frames a second that are kept; 0: all
  double mask_threshold = 0.5;
  int mask_margin_px = 1;
};

/// The inputs as they would be with one of data.people for the first person, without objects and other people.
DataSettings data_of_person(const DataSettings& data, const PersonSettings& person);

/// The motion of a person beside the first one, in a folder of truth or results: "motion_of_NAME.npz".
std::string motion_file_of(const std::string& person);

/// The video of a dataset, where it is one file.
inline constexpr const char* kDatasetVideo = "video.mp4";

/// The inputs in a dataset's folder, as `hsi4d synth` lays them out: scene.ply, objects/NAME.ply, avatar.safetensors,
/// people/NAME/ with the avatar.safetensors and initial.json of people beside the first one, video.mp4 (or frames/
/// where there is none), masks/, camera.json, initial.json, truth/ and truth/surface.ply (none where they are missing),
/// and keypoints.json where that has been added. Paths are absolute.
DataSettings dataset_inputs(const std::filesystem::path& folder);

/// Describe the sections: every setting with its range.
void describe(ConfigFields& fields, JointSettings& settings);
void describe(ConfigFields& fields, ObjectSettings& settings);
void describe(ConfigFields& fields, PersonSettings& settings);
void describe(ConfigFields& fields, LensSettings& settings);
void describe(ConfigFields& fields, DataSettings& settings);

}  // namespace hsi4d
