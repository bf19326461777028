#include "body/motion_edit.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <limits>
#include <map>

#include "body/body_model.h"
#include "core/quaternion.h"
#include "core/rotation.h"
#include "core/text.h"

namespace hsi4d {

namespace {

/// Frames that a folder may lack in a row.
constexpr std::int64_t kLongestGap = 1000;

/// Numbers of a file's name: FRAME and PERSON.
struct NameNumbers {
  std::int64_t frame = -1;
  std::int64_t person = 0;
};

NameNumbers numbers_of(const std::string& stem) {
  NameNumbers found;
  bool has_frame = false;
  for (std::size_t i = 0; i < stem.size();) {
    std::int64_t number = 0;
    const auto [end, fault] = std::from_chars(stem.data() + i, stem.data() + stem.size(), number);
    const bool is_digit = stem[i] >= '0' && stem[i] <= '9';
    if (!is_digit || fault != std::errc()) {
      ++i;
      continue;
    }
    if (has_frame) {
      found.person = number;
      break;
    }
    found.frame = number;
    has_frame = true;
    i = static_cast<std::size_t>(end - stem.data());
  }
  return found;
}

struct FolderFiles {
  std::map<std::int64_t, std::string> by_frame;  ///< of one person
  std::set<std::int64_t> others;                 ///< of whom there are files too
  bool begin_with_one = false;                   ///< the least number of a frame, of anybody's files, is 1
};

FolderFiles files_of(const std::string& folder, int person) {
  std::error_code error;
  std::vector<std::string> paths;
  for (const auto& entry : std::filesystem::directory_iterator(folder, error)) {
    if (entry.path().extension() == ".npz" && !is_hidden(entry.path().string())) paths.push_back(entry.path().string());
  }
  if (error) throw UserError(folder + ": cannot be read as a folder: " + error.message());
  std::sort(paths.begin(), paths.end());
  FolderFiles files;
  std::int64_t least = std::numeric_limits<std::int64_t>::max();
  for (const std::string& path : paths) {
    const NameNumbers numbers = numbers_of(std::filesystem::path(path).stem().string());
    if (numbers.frame < 0) continue;
    least = std::min<std::int64_t>(least, numbers.frame);
    if (numbers.person != person) {
      files.others.insert(numbers.person);
      continue;
    }
    const auto [place, is_new] = files.by_frame.emplace(numbers.frame, path);
    if (!is_new) {
      throw DataError(path + ": is of frame " + std::to_string(numbers.frame) + ", as is " + place->second);
    }
  }
  files.begin_with_one = least == 1;
  if (files.by_frame.empty()) {
    throw UserError(folder + ": holds no file FRAME.npz or FRAME_PERSON.npz of person " + std::to_string(person));
  }
  return files;
}

/// The parameters of a frame. Other programs write other things by the same names of files.
SmplxSequence read_pose_file(const std::string& path) {
  SmplxSequence sequence = read_smplx_sequence(path);
  for (const auto& [track, name] :
       {std::pair{&sequence.global_orient, "global_orient"}, {&sequence.body_pose, "body_pose"}}) {
    if (track->is_given()) continue;
    throw DataError(path + ": has no array '" + name + "', which every file of SMPLer-X has");
  }
  return sequence;
}

void check_rate(double frame_rate) {
  HSI4D_CHECK(frame_rate > 0 && std::isfinite(frame_rate), std::to_string(frame_rate) + " Hz");
}

}  // namespace

BodyPose interpolated(const BodyPose& a, const BodyPose& b, double u) {
  HSI4D_CHECK_EQ(a.joints(), b.joints());
  if (u == 0) return a;
  if (u == 1) return b;
  BodyPose pose = a;
  pose.transl = a.transl + u * (b.transl - a.transl);
  for (Index j = 0; j < a.joints(); ++j) {
    if (a.rotation_of(j) == b.rotation_of(j)) continue;
    const Vector4<double> q = slerp(quaternion_exp(a.rotation_of(j)), quaternion_exp(b.rotation_of(j)), u);
    pose.set_rotation(j, quaternion_log(q));
  }
  return pose;
}

Motion resampled(const Motion& motion, double frame_rate) {
  HSI4D_CHECK(!motion.poses.empty(), "a motion without frames");
  check_rate(motion.frame_rate);
  check_rate(frame_rate);
  Motion result = motion;
  result.frame_rate = frame_rate;
  result.first_frame = motion.first_frame / motion.frame_rate * frame_rate;
  result.poses.clear();
  const double step = motion.frame_rate / frame_rate;  // frames of `motion` from one frame to the next
  const auto last = static_cast<double>(motion.poses.size() - 1);
  // A last frame that rounding puts just after the end, or beside a frame, is meant to be there.
  constexpr double kSame = 1e-9;
  const double frames = std::floor((last + kSame * (last + 1)) / step) + 1;
  if (frames > kMostFrames) {
    throw UserError("a motion of " + std::to_string(motion.poses.size()) + " frames, " +
                    number_text(motion.frame_rate) + " a second, has " + rounded(frames, 4) + " frames at " +
                    rounded(frame_rate, 6) + " a second; allowed: at most " + rounded(kMostFrames, 7));
  }
  for (std::size_t k = 0; static_cast<double>(k) * step <= last + kSame * (last + 1); ++k) {
    const double at = std::min(static_cast<double>(k) * step, last);
    const double nearest = std::round(at);
    if (std::abs(at - nearest) <= kSame * (last + 1)) {
      result.poses.push_back(motion.poses[static_cast<std::size_t>(nearest)]);
      continue;
    }
    const auto before = static_cast<std::size_t>(at);
    result.poses.push_back(
        interpolated(motion.poses[before], motion.poses[before + 1], at - static_cast<double>(before)));
  }
  return result;
}

Motion transformed(const Motion& motion, const std::vector<Rigid<double>>& to_from,
                   const Vector3<double>& pelvis_rest) {
  HSI4D_CHECK_EQ(motion.poses.size(), to_from.size());
  Motion result = motion;
  for (std::size_t t = 0; t < to_from.size(); ++t) {
    BodyPose& pose = result.poses[t];
    const Matrix3<double>& r = to_from[t].rotation;
    pose.transl = r * (pose.transl + pelvis_rest) - pelvis_rest + to_from[t].translation;
    pose.set_rotation(0, so3_log(Matrix3<double>(r * so3_exp(pose.rotation_of(0)))));
  }
  return result;
}

Motion transformed(const Motion& motion, const Rigid<double>& to_from, const Vector3<double>& pelvis_rest) {
  return transformed(motion, std::vector<Rigid<double>>(motion.poses.size(), to_from), pelvis_rest);
}

Rigid<double> z_up_from_y_up() {
  Rigid<double> turn;
  turn.rotation << 1, 0, 0, 0, 0, -1, 0, 1, 0;
  return turn;
}

Motion with_pelvis(const Motion& motion, const Vector3<double>& from, const Vector3<double>& to) {
  Motion result = motion;
  result.pelvis_rest = to;
  if (from == to) return result;
  for (BodyPose& pose : result.poses) pose.transl += from - to;
  return result;
}

Motion for_body(const Motion& motion, std::string_view name, const Vector3<double>& pelvis) {
  const Vector3<double>& unsaid = name == kProceduralName ? kSmplxPelvis : pelvis;
  return with_pelvis(motion, motion.pelvis_rest.value_or(unsaid), pelvis);
}

Motion for_body(const Motion& motion, const BodyModel& body) {
  return for_body(motion, body.name, pelvis_of(body.joints));
}

Motion for_body(const Motion& motion, const Avatar& avatar) {
  return for_body(motion, avatar.body, pelvis_of(avatar.joints));
}

Vector3<double> pelvis_of(std::span<const double> joints) {
  HSI4D_CHECK(joints.size() >= 3, "a body without joints");
  return {joints[0], joints[1], joints[2]};
}

Motion with_hand_means(const Motion& motion, const SmplxModel& model) {
  Motion result = motion;
  for (BodyPose& pose : result.poses) {
    HSI4D_CHECK_EQ(pose.joints(), kSmplxJoints);
    for (std::size_t side = 0; side < 2; ++side) {
      const std::vector<double>& mean = model.hands[side].mean;
      const std::size_t first = static_cast<std::size_t>(3 * kFirstHandJoint + kHandNumbers * static_cast<Index>(side));
      for (std::size_t i = 0; i < mean.size(); ++i) pose.axis_angle[first + i] += mean[i];
    }
  }
  return result;
}

Motion motion_of(const SmplxSequence& sequence, double frame_rate) {
  check_rate(frame_rate);
  struct Run {
    const SmplxTrack& track;
    Index joint;
    const char* name;
  };
  const Run runs[] = {{sequence.global_orient, 0, "global_orient"},
                      {sequence.body_pose, 1, "body_pose"},
                      {sequence.jaw_pose, 22, "jaw_pose"},
                      {sequence.leye_pose, 23, "leye_pose"},
                      {sequence.reye_pose, 24, "reye_pose"},
                      {sequence.left_hand_pose, kFirstHandJoint, "left_hand_pose"},
                      {sequence.right_hand_pose, kFirstHandJoint + kHandJoints, "right_hand_pose"}};
  Motion motion;
  motion.frame_rate = frame_rate;
  motion.poses.assign(static_cast<std::size_t>(sequence.frames), rest_pose(kSmplxJoints));
  for (const Run& run : runs) {
    const bool is_hand = run.joint >= kFirstHandJoint;
    if (is_hand && run.track.is_given() && run.track.width != kHandNumbers) {
      throw DataError(sequence.source + ": array '" + run.name + "': has " + std::to_string(run.track.width) +
                      " numbers a frame; of a motion's hand 45 are needed");
    }
    for (Index t = 0; run.track.is_given() && t < sequence.frames; ++t) {
      const std::span<const double> from = run.track.at(t);
      std::copy(from.begin(), from.end(), motion.poses[static_cast<std::size_t>(t)].axis_angle.begin() + 3 * run.joint);
    }
  }
  for (Index t = 0; t < sequence.frames; ++t) {
    if (!sequence.transl.is_given()) break;
    const std::span<const double> from = sequence.transl.at(t);
    motion.poses[static_cast<std::size_t>(t)].transl = {from[0], from[1], from[2]};
  }
  const auto width = static_cast<std::size_t>(sequence.betas.width);
  motion.betas.assign(width, 0.0);
  for (std::size_t i = 0; i < sequence.betas.numbers.size(); ++i) {
    motion.betas[i % width] += sequence.betas.numbers[i] / static_cast<double>(sequence.betas.rows);
  }
  return motion;
}

PoseFolder read_pose_folder(const std::string& folder, double frame_rate, int person) {
  PoseFolder result;
  const FolderFiles found = files_of(folder, person);
  const auto& files = found.by_frame;
  result.other_people = found.others;
  result.counts_from_one = found.begin_with_one;
  result.motion.first_frame = static_cast<double>(files.begin()->first - (found.begin_with_one ? 1 : 0));
  result.motion.frame_rate = frame_rate;
  result.files = static_cast<Index>(files.size());
  std::vector<BodyPose>& poses = result.motion.poses;
  std::int64_t before = -1;
  for (const auto& [frame, path] : files) {
    const Motion one = motion_of(read_pose_file(path), frame_rate);
    if (one.poses.size() != 1) {
      throw DataError(path + ": has " + std::to_string(one.poses.size()) + " frames; a file of a folder has one");
    }
    if (poses.empty()) result.motion.betas.assign(one.betas.size(), 0.0);
    if (one.betas.size() != result.motion.betas.size()) {
      throw DataError(path + ": has " + std::to_string(one.betas.size()) + " betas; the files before it have " +
                      std::to_string(result.motion.betas.size()));
    }
    for (std::size_t i = 0; i < one.betas.size(); ++i) {
      result.motion.betas[i] += one.betas[i] / static_cast<double>(files.size());
    }
    if (!poses.empty()) {
      const BodyPose last = poses.back();
      if (frame - before > kLongestGap) {
        throw DataError(path + ": is of frame " + std::to_string(frame) + ", the one before it of frame " +
                        std::to_string(before) + "; allowed: " + std::to_string(kLongestGap) + " frames later");
      }
      const auto gap = static_cast<double>(frame - before);
      for (std::int64_t missing = before + 1; missing < frame; ++missing) {
        poses.push_back(interpolated(last, one.poses[0], static_cast<double>(missing - before) / gap));
        ++result.filled;
      }
    }
    poses.push_back(one.poses[0]);
    before = frame;
  }
  return result;
}

}  // namespace hsi4d
