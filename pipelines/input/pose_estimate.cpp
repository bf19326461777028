#include "pipelines/input/pose_estimate.h"

#include <algorithm>
#include <cmath>

#include "body/motion_edit.h"
#include "core/check.h"
#include "core/log.h"
#include "core/rotation.h"
#include "core/text.h"
#include "pipelines/input/body_files.h"

namespace hsi4d {

namespace {

namespace fs = std::filesystem;

constexpr double kMostBack = 2;       // frames of the motion
constexpr double kSameMoment = 1e-9;  // seconds

/// The pose some frames before a motion begins: its first step, carried back by kMostBack frames at most.
BodyPose pose_before(const Motion& motion, double frames) {
  if (motion.poses.size() == 1) return motion.poses.front();
  return interpolated(motion.poses[0], motion.poses[1], -std::min(frames, kMostBack));
}

/// The pose at a moment of the video, in seconds.
BodyPose pose_at(const Motion& motion, double seconds) {
  const double place =
      std::min(seconds * motion.frame_rate - motion.first_frame, static_cast<double>(motion.poses.size() - 1));
  if (place < 0) return pose_before(motion, -place);
  const auto before = static_cast<std::size_t>(place);
  if (before + 1 == motion.poses.size()) return motion.poses.back();
  return interpolated(motion.poses[before], motion.poses[before + 1], place - static_cast<double>(before));
}

/// Whether a motion of another rate than the video's goes on to the clip's last frame, but for half a frame of its own.
bool covers(const Motion& motion, const FrameSource& frames) {
  if (!motion.says_frame_rate || frames.video_rate() == 0) return false;
  const double end = frames.time(frames.count() - 1);
  return end <= (motion.first_frame + static_cast<double>(motion.poses.size()) - 0.5) / motion.frame_rate;
}

/// Tells of poses from a moment on that would be that of another frame of the video.
void warn_of_rest(const Motion& motion, const fs::path& file, const FrameSource& frames) {
  const double last = (motion.first_frame + static_cast<double>(motion.poses.size() - 1)) / motion.frame_rate,
               end = static_cast<double>(frames.video_count()) / frames.video_rate();
  if (last < end - kSameMoment) return;
  log_warning(file.string() + ": holds " + std::to_string(motion.poses.size()) + " poses at " +
              rounded(motion.frame_rate, 4) + " a second, the video has " + std::to_string(frames.video_count()) +
              " frames at " + rounded(frames.video_rate(), 4) + "; poses after its end are not used");
}

/// Tells of poses that are taken one a frame although their rate says otherwise.
/// @param rate  of the frames that there are as many of
void warn_of_rate(const Motion& motion, const fs::path& file, double rate) {
  constexpr double kAlike = 0.01;
  if (!motion.says_frame_rate || rate <= 0 || std::abs(motion.frame_rate - rate) <= kAlike * rate) return;
  log_warning(file.string() + ": its poses, " + rounded(motion.frame_rate, 4) +
              " a second as it says, are taken one a frame, of which there are " + rounded(rate, 4) +
              " a second, as they are as many");
}

/// Throws DataError for a motion that begins after the clip's last frame: each of its poses would be a guess.
void check_begin(const Motion& motion, const fs::path& file, const FrameSource& frames) {
  const bool has_times = motion.says_frame_rate && frames.video_rate() > 0;
  const Index last_frame = frames.number(frames.count() - 1);
  const double last = motion.first_frame + static_cast<double>(motion.poses.size() - 1),
               seconds = has_times ? frames.time(frames.count() - 1) : 0;
  if (has_times ? motion.first_frame / motion.frame_rate <= seconds + kSameMoment
                : motion.first_frame <= static_cast<double>(last_frame))
    return;
  const auto range = [has_times](double from, double to, double from_s, double to_s) {
    return rounded(from, 8) + " to " + rounded(to, 8) +
           (has_times ? " (" + rounded(from_s, 6) + " to " + rounded(to_s, 6) + " s)" : "");
  };
  throw DataError(file.string() + ": its poses are of frames " +
                  range(motion.first_frame, last, motion.first_frame / motion.frame_rate, last / motion.frame_rate) +
                  " of a video, the clip's frames are " + range(0, static_cast<double>(last_frame), 0, seconds) +
                  "; allowed: a motion that begins with the clip's last frame at the latest");
}

/// The motion from the video's first frame on, where it begins with a whole later one.
Motion from_first_frame(const Motion& motion, const fs::path& file) {
  if (motion.first_frame == 0) return motion;
  log_warning(file.string() + ": begins with frame " + rounded(motion.first_frame, 6) +
              " of the video; the poses before it are a guess, its first step carried back");
  const double missing = std::round(motion.first_frame);
  if (missing != motion.first_frame) return motion;
  Motion whole = motion;
  whole.first_frame = 0;
  whole.poses.clear();
  for (double frame = missing; frame > 0; --frame) whole.poses.push_back(pose_before(motion, frame));
  whole.poses.insert(whole.poses.end(), motion.poses.begin(), motion.poses.end());
  return whole;
}

/// A pose for each frame of the clip.
/// @param or_else  what is allowed beside as many as frames
std::vector<BodyPose> poses_of_frames(const Motion& read, const fs::path& file, const FrameSource& frames,
                                      const char* or_else) {
  const double count = read.first_frame + static_cast<double>(read.poses.size());
  const bool is_of_clip = count == static_cast<double>(frames.count());
  const bool is_by_frame = is_of_clip || count == static_cast<double>(frames.video_count());
  is_by_frame ? warn_of_rate(read, file, is_of_clip ? frames.frame_rate() : frames.video_rate())
              : check_begin(read, file, frames);
  const Motion motion = from_first_frame(read, file);
  if (is_by_frame || !covers(motion, frames)) {
    if (motion.first_frame != 0)
      throw DataError(file.string() + ": begins with frame " + number_text(motion.first_frame) +
                      " of the video; between two frames it can begin only where its rate and the video's are known "
                      "and it goes on to the clip's end");
    return kept_frames(motion.poses, frames, file.string(), "poses", or_else);
  }
  warn_of_rest(motion, file, frames);
  std::vector<BodyPose> poses;
  for (Index t = 0; t < frames.count(); ++t) poses.push_back(pose_at(motion, frames.time(t)));
  return poses;
}

/// The motion in a world with z up, by the axis that lies along the vertical of the human of frame 0.
Motion with_z_up(const Motion& motion, const fs::path& file, const BodyPose& first,
                 const Vector3<double>& pelvis_rest) {
  constexpr double kNear = 0.7;  // of an axis to the vertical
  const Vector3<double> upright = so3_exp(first.rotation_of(0)).row(2);
  const Matrix3<double> root = so3_exp(motion.poses.front().rotation_of(0));
  const double y = dot(Vector3<double>(root.row(1)), upright), z = dot(Vector3<double>(root.row(2)), upright);
  if (-y >= kNear && -y > z)
    throw DataError(
        file.string() +
        ": y points down, by how the body is in frame 0, as in a camera's frame; a motion in a world with z up "
        "is needed, or data.motion_align=rotation where the camera stands still");
  if (y >= kNear && y > z) {
    log_warning(file.string() + ": y is up, as the body is in frame 0: turned to z up");
    return transformed(motion, z_up_from_y_up(), pelvis_rest);
  }
  if (z < kNear)
    log_warning(file.string() + ": no axis is up as the body is in frame 0; z is taken for up, which may be wrong");
  return motion;
}

/// R of world_laid_on.
Matrix3<double> world_turn(const Matrix3<double>& e, const Matrix3<double>& f, MotionAlign align) {
  if (align == MotionAlign::kRotation) return f * e.transpose();
  // The trace of R_z(θ) E Fᵀ is largest, which is 1 + 2 cos of the angle that is left.
  const Matrix3<double> m = e * f.transpose();
  return so3_exp(Vector3<double>(0, 0, std::atan2(m(0, 1) - m(1, 0), m(0, 0) + m(1, 1))));
}

}  // namespace

std::vector<BodyPose> estimated_poses(const Motion& motion, const fs::path& file, const FrameSource& frames) {
  if (motion.poses.size() == 1) return {};
  return poses_of_frames(motion, file, frames, ", or frame 0 alone");
}

std::vector<BodyPose> read_estimate(const fs::path& file, const Avatar& avatar, const FrameSource& frames,
                                    const BodyPose& first, MotionAlign align) {
  Motion motion = read_motion_for(file.string(), avatar);
  if (align != MotionAlign::kRotation) motion = with_z_up(motion, file, first, pelvis_of(avatar.joints));
  return poses_of_frames(motion, file, frames, "");
}

Rigid<double> world_pelvis(const BodyPose& pose, const Vector3<double>& pelvis_rest) {
  return {so3_exp(pose.rotation_of(0)), pelvis_rest + pose.transl};
}

Rigid<double> world_laid_on(const Rigid<double>& from, const Rigid<double>& to, MotionAlign align) {
  if (align == MotionAlign::kNone) return {};
  const Matrix3<double> turn = world_turn(from.rotation, to.rotation, align);
  return {turn, to.translation - turn * from.translation};
}

std::vector<BodyPose> laid_on(std::vector<BodyPose> estimate, const BodyPose& first, const Vector3<double>& pelvis_rest,
                              MotionAlign align) {
  if (align != MotionAlign::kNone) {
    const Rigid<double> to_from =
        world_laid_on(world_pelvis(estimate.front(), pelvis_rest), world_pelvis(first, pelvis_rest), align);
    Motion motion;
    motion.poses = std::move(estimate);
    estimate = transformed(motion, to_from, pelvis_rest).poses;
  }
  estimate.front() = first;
  return estimate;
}

}  // namespace hsi4d
