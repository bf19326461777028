// Points of the human that a detector found in the pictures of a video, and the joints that they stand for.
//
// Read are, as docs/formats.md has them:
//   F.json  {"format": "hsi4d keypoints", ...}, one person
//   F.json  results of COCO: [{"image_id": 3, "keypoints": [x, y, c, ...]}...]
//   DIR/    of OpenPose: NAME_keypoints.json a frame, {"people": [{"pose_keypoints_2d": [x, y, c, ...]}...]}
#pragma once

#include <array>
#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "core/linear.h"
#include "pipelines/config/data_settings.h"
#include "pipelines/input/frame_source.h"

namespace hsi4d {

/// Confidence from which a point counts as found.
inline constexpr double kFoundConfidence = 0.5;

/// Score below which a person counts as doubtful in a frame.
inline constexpr double kDoubtfulScore = 0.5;

/// A point as a detector found it.
struct Keypoint {
  double x = 0, y = 0;    ///< shares of the image's width and height, from its upper left corner
  double confidence = 0;  ///< 0 to 1; 0: it was not found
  /// Where it is in space, metres, in the camera's axes from any origin; none: the file does not say.
  std::optional<Vector3<double>> landmark = {};
};

/// Joints (smplx_joint_names) with weights that sum to 1: the point is their mean.
using KeypointJoints = std::vector<std::pair<int, double>>;

/// The way from one point to another, or between middles of points: points with weights that sum to 0.
using Bone = std::vector<std::pair<int, double>>;

/// Points of one person. Those that stand for no joint (a nose, an ear) are left out.
struct Keypoints {
  std::vector<KeypointJoints> joints;         ///< by point
  std::vector<std::vector<Keypoint>> frames;  ///< [frame][point], of the frames that the clip keeps
  std::vector<double> scores;  ///< [frame] how well the person was found, 0 to 1; empty: the file does not say

  bool has_landmarks() const;
};

/// Bones of the body between points that stand for one joint each: from each of joints 1 to 21 to the next one up the
/// skeleton that there is, across hips and shoulders, and from the middle of the hips to that of the shoulders.
std::vector<Bone> bones_of(const std::vector<KeypointJoints>& joints);

/// A person in one picture as the file has it: (x, y, confidence) by point, pixels. Empty: nobody.
using FoundPerson = std::vector<std::array<double, 3>>;

/// What a file of keypoints holds.
struct FoundKeypoints {
  std::vector<std::vector<FoundPerson>> frames;  ///< [frame][person], all persons with the same points
  std::vector<FoundPerson> landmarks;            ///< [frame] of the one person, (x, y, z); empty: there are none
  std::vector<double> scores;                    ///< [frame] of the one person, 0 to 1; empty: there are none
  std::vector<KeypointJoints> joints;            ///< by point, empty where it stands for no joint
  std::array<double, 2> size = {0, 0};           ///< of the pictures, pixels; 0: that of the video's
  bool lacks_empty_frames = false;               ///< frames without persons are not in the file
};

/// Reads text in one of the formats that are one file.
/// @param name    what messages call it
/// @param joints  by point, in place of those that the format or the number of points says; empty: none given
/// Throws DataError naming line and position: no such format, numbers that are missing or out of range, a set of points
/// that is not known.
FoundKeypoints parse_keypoints(const std::string& text, const std::string& name,
                               const std::vector<KeypointJoints>& joints = {});

/// Reads a file that says for each point of a detector which joints it stands for: a list of names of joints, of
/// {"NAME": weight, ...}, and null. Throws DataError naming line and position.
std::vector<KeypointJoints> parse_keypoint_joints(const std::string& text, const std::string& name);

/// The files of data.keypoints: itself, or of a folder OpenPose's, by name. Empty: none. Throws UserError for a folder
/// that cannot be read, DataError for names of different lengths, whose order is not that of their numbers.
std::vector<std::filesystem::path> keypoint_files(const std::filesystem::path& keypoints);

/// Reads data.keypoints. Of several persons the one is followed whom the detector is surest of in the first picture
/// that has some, then the nearest to where that one was, which the log tells.
/// Throws UserError or DataError naming the file: missing, damaged, as above, another number of frames than the video,
/// pictures of another shape.
Keypoints read_keypoints(const DataSettings& data, const FrameSource& frames);

}  // namespace hsi4d
