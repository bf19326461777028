// configs/pose_prior.npz, the prior that tools/train_pose_prior makes of the generated motions.
#include <string>
#include <vector>

#include <catch2/catch.hpp>

#include "body/kinematics.h"
#include "body/pose_prior.h"
#include "body/procedural_body.h"
#include "core/rotation.h"
#include "pipelines/synthetic/motion.h"
#include "pipelines/synthetic/noise.h"

namespace shipped_prior_test {

using namespace hsi4d;

namespace {

const BodyModel& body() {
  static const BodyModel model = procedural_body();
  return model;
}

/// The motion with each body's 21 joints as the prior's latents of it say.
Motion projected(const PosePrior& prior, Motion motion) {
  constexpr auto kNumbers = static_cast<std::size_t>(3 * kBodyPoseJoints);
  Tape<double> tape;
  const Var<double> z = tape.parameter("z", shape_of(1, prior.latents()));
  const Var<double> rotations = prior.decode(z);
  for (BodyPose& pose : motion.poses) {
    tape.set(z, prior.encode(std::span(pose.axis_angle).subspan(3, kNumbers)));
    tape.forward(rotations);
    for (Index j = 0; j < kBodyPoseJoints; ++j) {
      const double* x = tape.value(rotations).row(j);
      Matrix3<double> r;
      r << x[0], x[1], x[2], x[3], x[4], x[5], x[6], x[7], x[8];
      pose.set_rotation(j + 1, so3_log(r));
    }
  }
  return motion;
}

/// Mean distance of 22 joints in all frames but the first, mm.
double distance_mm(const Motion& a, const Motion& b) {
  double sum = 0;
  for (std::size_t t = 1; t < a.poses.size(); ++t) {
    const std::vector<double> x = pose_joints(body(), a.poses[t]), y = pose_joints(body(), b.poses[t]);
    for (std::size_t i = 0; i < 66; i += 3)
      sum += (Vector3<double>(x.data() + i) - Vector3<double>(y.data() + i)).norm() / 22;
  }
  return 1000 * sum / static_cast<double>(a.poses.size() - 1);
}

}  // namespace

TEST_CASE("the shipped prior knows the generated motions, and brings disturbed poses nearer to them") {
  const PosePrior prior = read_pose_prior(std::string(HSI4D_SOURCE_DIR) + "/configs/pose_prior.npz");
  CHECK(prior.name() == "vposer");
  REQUIRE(prior.latents() == 32);
  SyntheticSettings settings;
  settings.pose_noise_deg = 8;
  settings.root_noise_deg = settings.root_noise_m = 0;
  for (const auto& [motion, thing] : {std::pair{SyntheticMotionKind::kWalk, SyntheticObjectKind::kBox},
                                      {SyntheticMotionKind::kPour, SyntheticObjectKind::kWateringCan},
                                      {SyntheticMotionKind::kSit, SyntheticObjectKind::kOfficeChair},
                                      {SyntheticMotionKind::kWave, SyntheticObjectKind::kGuitar}}) {
    INFO(choice_name<SyntheticMotionKind>(kSyntheticMotionKinds, motion));
    const SyntheticObject object = synthetic_object(thing, 600, 0);
    const Motion truth = synthetic_clip(body(), object, {40, 10, 64, 1, motion}).motion;
    const Motion disturbed = disturbed_motion(truth, settings);
    const double exact = distance_mm(projected(prior, truth), truth), off = distance_mm(disturbed, truth),
                 left = distance_mm(projected(prior, disturbed), truth);
    INFO("off by " << off << " mm, projected " << left << "; exact poses " << exact);
    CHECK(exact < 0.5 * off);
    CHECK(left < 0.8 * off);
  }
}

}  // namespace shipped_prior_test
