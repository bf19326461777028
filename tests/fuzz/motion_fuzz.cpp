// Motions: AMASS's files, SMPL, SMPL-H and SMPL-X, whole and in parts. What is taken has poses of SMPL-X.
#include <cmath>

#include "body/body_model.h"
#include "body/motion_edit.h"
#include "body/motion_io.h"
#include "core/npz.h"
#include "tests/fuzz/archive_list.h"

namespace hsi4d::fuzz::motion_fuzz {

namespace {

std::vector<float> halves(int64_t count) { return std::vector<float>(static_cast<std::size_t>(count), 0.5F); }

/// Two frames of AMASS: poses of one array.
Bytes whole_motion(int64_t numbers, const char* model) {
  NpzWriter file;
  file.add<double>("trans", {2, 3}, {0, 1, 2, 3, 4, 5});
  file.add<float>("poses", {2, numbers}, halves(2 * numbers));
  file.add<double>("betas", {2, 3}, {1, 2, 3, 4, 5, 6});
  file.add_text("surface_model_type", model);
  file.add_scalar("mocap_framerate", 60.0);
  return file.encode();
}

Bytes motion_in_parts() {
  NpzWriter file;
  file.add<float>("transl", {1, 3}, {0, 1, 2});
  file.add<float>("global_orient", {1, 3}, {0, 1, 2});
  file.add<float>("body_pose", {1, 63}, halves(63));
  file.add<float>("pose_jaw", {1, 3}, halves(3));
  file.add<float>("leye_pose", {1, 3}, halves(3));
  file.add<float>("right_hand_pose", {1, 45}, halves(45));
  file.add<double>("pelvis_rest", {3}, {0, 1, 0});
  file.add<double>("betas", {1, 2}, {1, 2});
  file.add_text("gender", "neutral");
  return file.encode();
}

void check_motion(const Motion& motion) {
  HSI4D_CHECK(!motion.poses.empty(), "a motion without frames was taken");
  HSI4D_CHECK(motion.frame_rate >= kSlowestMotion && motion.frame_rate <= kFastestMotion, "a rate beyond its limits");
  for (const BodyPose& pose : motion.poses) {
    HSI4D_CHECK_EQ(pose.axis_angle.size(), static_cast<std::size_t>(3 * kSmplxJoints));
    HSI4D_CHECK(pose.transl.allFinite(), "a translation that is not finite was taken");
    for (const double x : pose.axis_angle) HSI4D_CHECK(std::isfinite(x), "an angle that is not finite was taken");
  }
}

}  // namespace

std::vector<Bytes> corpus() {
  return {list_of(whole_motion(72, "smpl")), list_of(whole_motion(165, "")), list_of(whole_motion(156, "SMPL-H")),
          list_of(motion_in_parts()), motion_in_parts()};
}

bool accepts(std::span<const uint8_t> file) {
  return is_read([&] {
    const Motion motion = decode_motion(archive_of(file), "fuzz.npz");
    check_motion(motion);
    const double rate = 2.0 / 3.0 * motion.frame_rate;
    if (rate >= kSlowestMotion) check_motion(resampled(motion, rate));
  });
}

const Target target("motion", corpus, accepts);

}  // namespace hsi4d::fuzz::motion_fuzz
