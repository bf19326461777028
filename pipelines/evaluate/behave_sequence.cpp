#include "pipelines/evaluate/behave_sequence.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <map>

#include "body/motion_edit.h"
#include "body/pose_layout.h"
#include "core/check.h"
#include "core/npz.h"
#include "core/rotation.h"
#include "core/text.h"
#include "pipelines/input/body_files.h"

namespace hsi4d {

namespace {

constexpr const char* kHumanFile = "smpl_fit_all.npz";
constexpr const char* kObjectFile = "object_fit_all.npz";
constexpr double kLatestSecond = 1e5;

/// "t0012.033" in seconds. Throws DataError for another text.
double seconds_of(const NpyArray& array, const std::string& text) {
  double seconds = 0;
  const char* const end = text.data() + text.size();
  const bool begins = text.size() > 1 && text[0] == 't' && text[1] >= '0' && text[1] <= '9';
  if (begins) {
    const auto [after, error] = std::from_chars(text.data() + 1, end, seconds, std::chars_format::fixed);
    if (error == std::errc() && after == end && seconds <= kLatestSecond) return seconds;
  }
  throw DataError(array.source() + ": holds \"" + with_escapes(text) + "\"; allowed: times like t0012.033");
}

/// The rows of a file by the frame that they are of, counted at kBehaveRate from second 0.
std::map<Index, std::size_t> read_frame_rows(const Npz& file, std::size_t rows) {
  const NpyArray& array = file.array("frame_times");
  const std::vector<std::string> texts = array.require_shape({static_cast<std::int64_t>(rows)}).strings();
  std::map<Index, std::size_t> by_frame;
  for (std::size_t row = 0; row < rows; ++row) {
    const auto frame = static_cast<Index>(std::llround(seconds_of(array, texts[row]) * kBehaveRate));
    if (!by_frame.empty() && by_frame.rbegin()->first >= frame)
      throw DataError(array.source() + ": \"" + with_escapes(texts[row]) + "\" follows \"" +
                      with_escapes(texts[row - 1]) + "\"; allowed: later times, 1/" + number_text(kBehaveRate) +
                      " s apart at least");
    by_frame.emplace(frame, row);
  }
  return by_frame;
}

std::vector<double> finite_rows(const Npz& file, const char* name, std::int64_t rows) {
  const NpyArray& array = file.array(name);
  std::vector<double> numbers = array.require_shape({rows, 3}).as<double>();
  const auto bad =
      std::find_if(numbers.begin(), numbers.end(), [](double x) { return !(std::fabs(x) <= kLargestPlace); });
  if (bad != numbers.end())
    throw DataError(array.source() + ": frame " + std::to_string((bad - numbers.begin()) / 3) +
                    " has a number that is not finite, or beyond 1e7");
  return numbers;
}

/// The object's poses, a row each.
std::vector<Rigid<double>> object_rows(const Npz& file) {
  const auto& shape = file.array("angles").shape();
  const std::int64_t rows = shape.empty() ? 0 : shape[0];
  const std::vector<double> angles = finite_rows(file, "angles", rows), places = finite_rows(file, "trans", rows);
  std::vector<Rigid<double>> poses;
  for (std::size_t i = 0; i < angles.size(); i += 3)
    poses.push_back({so3_exp(Vector3<double>(angles.data() + i)), Vector3<double>(places.data() + i)});
  return poses;
}

/// Rows of one frame that both files have.
struct CommonFrame {
  Index frame = 0;
  std::size_t human = 0, object = 0;
};

/// What the files hold.
struct BehaveRows {
  Motion motion;
  std::vector<Rigid<double>> objects = {};  // empty: there is none
  std::vector<CommonFrame> frames = {};

  Rigid<double> object_at(const CommonFrame& at) const {
    return objects.empty() ? Rigid<double>() : objects[at.object];
  }
};

BehaveRows read_rows(const std::string& human_file, const std::string& object_file) {
  BehaveRows rows{.motion = read_motion_with_warnings(human_file)};
  const std::map<Index, std::size_t> humans = read_frame_rows(Npz::read(human_file), rows.motion.poses.size());
  if (!std::filesystem::exists(object_file)) {
    for (const auto& [frame, row] : humans) rows.frames.push_back({frame, row, 0});
    return rows;
  }
  const Npz file = Npz::read(object_file);
  rows.objects = object_rows(file);
  const std::map<Index, std::size_t> objects = read_frame_rows(file, rows.objects.size());
  for (const auto& [frame, row] : humans) {
    if (const auto found = objects.find(frame); found != objects.end())
      rows.frames.push_back({frame, row, found->second});
  }
  if (rows.frames.empty()) throw DataError(object_file + ": has no frame_times in common with " + kHumanFile);
  return rows;
}

ObjectPose as_pose(const Rigid<double>& pose) { return {so3_log(pose.rotation), pose.translation}; }

/// z up where −y is up in a camera's frame: (x, y, z) → (x, z, −y).
Rigid<double> z_up_from_camera() {
  Rigid<double> turn;
  turn.rotation << 1, 0, 0, 0, 0, 1, 0, -1, 0;
  return turn;
}

void add_frame(const BodyPose& body, const Rigid<double>& object, bool is_good, Track& track) {
  track.motion.poses.push_back(body);
  track.object_poses.push_back({as_pose(compose(z_up_from_camera(), object))});
  track.good_frames.push_back(is_good);
}

}  // namespace

bool is_behave_sequence(const std::string& folder) {
  return std::filesystem::exists(std::filesystem::path(folder) / kHumanFile);
}

Track read_behave_sequence(const std::string& folder, const std::string& object) {
  const std::filesystem::path path = folder;
  const std::string human_file = (path / kHumanFile).string();
  const BehaveRows rows = read_rows(human_file, (path / kObjectFile).string());
  Track track;
  track.name = folder;
  track.motion = rows.motion;
  track.motion.poses.clear();
  add_frame(rows.motion.poses[rows.frames[0].human], rows.object_at(rows.frames[0]), true, track);
  for (std::size_t i = 1; i < rows.frames.size(); ++i) {
    const CommonFrame &from = rows.frames[i - 1], &to = rows.frames[i];
    const Index steps = to.frame - from.frame;
    if (steps > kLongestGap + 1)
      throw DataError(human_file + ": " + std::to_string(steps - 1) + " frames in a row are missing after frame " +
                      std::to_string(from.frame) + "; allowed: " + std::to_string(kLongestGap));
    for (Index k = 1; k <= steps; ++k) {
      const double u = static_cast<double>(k) / static_cast<double>(steps);
      add_frame(interpolated(rows.motion.poses[from.human], rows.motion.poses[to.human], u),
                between_poses(rows.object_at(from), rows.object_at(to), u), k == steps, track);
    }
  }
  track.motion.frame_rate = kBehaveRate;
  track.motion.says_frame_rate = true;
  track.motion = transformed(track.motion, z_up_from_camera(), rows.motion.pelvis_rest.value_or(kSmplxPelvis));
  if (rows.objects.empty()) {
    track.object_poses.clear();
  } else {
    track.objects = {object};
    track.objects_are_of_meshes = true;
  }
  track.world = "a sequence of BEHAVE, in its camera's frame: z is up as far as the camera was level";
  const auto filled = std::count(track.good_frames.begin(), track.good_frames.end(), false);
  if (filled > 0) track.world += "; " + std::to_string(filled) + " frames that it leaves out are interpolated";
  return track;
}

}  // namespace hsi4d
