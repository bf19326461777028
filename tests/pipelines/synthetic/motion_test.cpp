#include "pipelines/synthetic/motion.h"

#include <algorithm>
#include <map>
#include <numbers>
#include <optional>

#include <catch2/catch.hpp>

#include "body/kinematics.h"
#include "body/natural_pose.h"
#include "body/procedural_body.h"
#include "core/check.h"
#include "core/rotation.h"
#include "optim/solid/mesh_distance.h"
#include "pipelines/input/body_files.h"
#include "pipelines/synthetic/dataset.h"
#include "pipelines/synthetic/faults.h"
#include "pipelines/synthetic/render.h"

namespace motion_test {

using namespace hsi4d;

namespace {

using Vector = Vector3<double>;

constexpr double kDegree = std::numbers::pi / 180;

Vector row(const std::vector<double>& values, std::size_t i) {
  return {values[3 * i], values[3 * i + 1], values[3 * i + 2]};
}

double degrees_between(const Matrix3<double>& a, const Matrix3<double>& b) {
  return so3_log(Matrix3<double>(a.transpose() * b)).norm() / kDegree;
}

const BodyModel& body() {
  static const BodyModel model = procedural_body();
  return model;
}

std::string pair_name(SyntheticMotionKind motion, SyntheticObjectKind object) {
  return std::string(choice_name<SyntheticMotionKind>(kSyntheticMotionKinds, motion)) + " with " +
         std::string(choice_name<SyntheticObjectKind>(kSyntheticObjectKinds, object));
}

/// What can be done where: a motion with one of its objects, at a place of a scene or at none.
struct Act {
  std::string name;
  SyntheticMotionKind motion;
  SyntheticObjectKind object;
  const ScenePlace* place;
  SyntheticSceneKind scene;
};

std::vector<Act> all_acts() {
  std::vector<Act> acts;
  for (const auto& motion : kSyntheticMotionKinds)
    for (const SyntheticObjectKind object : objects_of(motion.value)) {
      const std::string name = pair_name(motion.value, object);
      const std::optional<PlaceUse> use = use_of(motion.value);
      if (!use) acts.push_back({name, motion.value, object, nullptr, SyntheticSceneKind::kLivingRoom});
      for (const auto& scene : kSyntheticSceneKinds)
        for (const ScenePlace& place : places_of(scene.value))
          if (find_place(scene.value, motion.value, place.name) != nullptr)
            acts.push_back({name + " at " + scene.name + "/" + place.name, motion.value, object, &place, scene.value});
    }
  return acts;
}

/// Calls visit(name, motion, object, clip) for every motion with each of its objects at each of its places: 5 s at 15
/// frames a second.
template <class F>
void for_all_clips(const F& visit) {
  for (const Act& act : all_acts()) {
    const SyntheticObject object = synthetic_object(act.object, 600, 0);
    ClipSettings settings{75, 15, 64, 1, act.motion};
    settings.place = act.place;
    visit(act.name, act.motion, object, synthetic_clip(body(), object, settings));
  }
}

/// Feet follow the belt or go along on the slide.
bool has_moving_ground(SyntheticMotionKind motion) {
  return motion == SyntheticMotionKind::kRun || motion == SyntheticMotionKind::kSlide;
}

/// Joints of all frames.
std::vector<std::vector<double>> joints_of(const SyntheticClip& clip) {
  std::vector<std::vector<double>> joints;
  for (const BodyPose& pose : clip.motion.poses) joints.push_back(pose_joints(body(), pose));
  return joints;
}

/// The clip of docs/synthetic.md that moves as much as the demo asks for.
SyntheticSettings demo_clip() {
  SyntheticSettings settings;
  settings.scene = SyntheticSceneKind::kGarden;
  settings.motion = SyntheticMotionKind::kWalk;
  settings.frames = 16;
  settings.size_px = 512;
  return settings;
}

double sum_of(const Image& image) {
  double sum = 0;
  for (int y = 0; y < image.height(); ++y)
    for (int x = 0; x < image.width(); ++x) sum += double(image(0, y, x));
  return sum;
}

}  // namespace

TEST_CASE("eight frames move as much as can be followed, and no more") {
  const SyntheticObject object = synthetic_object(SyntheticObjectKind::kWateringCan, 1500, 0);
  const SyntheticSettings defaults;
  const SyntheticClip clip =
      synthetic_clip(body(), object, {defaults.frames, defaults.frame_rate, 256, 1, defaults.motion});
  REQUIRE(clip.motion.poses.size() == 8);
  const auto joint_turn = [&](std::size_t a, std::size_t b, Index joint) {
    return degrees_between(so3_exp(clip.motion.poses[a].rotation_of(joint)),
                           so3_exp(clip.motion.poses[b].rotation_of(joint)));
  };
  const auto root_way = [&](std::size_t a, std::size_t b) {
    return (clip.motion.poses[a].transl - clip.motion.poses[b].transl).norm();
  };
  const auto camera_way = [&](std::size_t a, std::size_t b) {
    return (camera_center_world(clip.cameras[a]) - camera_center_world(clip.cameras[b])).norm();
  };
  const auto camera_turn = [&](std::size_t a, std::size_t b) {
    return degrees_between(clip.cameras[a].camera_from_world.rotation, clip.cameras[b].camera_from_world.rotation);
  };
  for (std::size_t t = 1; t < 8; ++t) {
    INFO("frame " << t);
    CHECK(root_way(t - 1, t) <= 0.04);
    CHECK((clip.object[t].translation - clip.object[t - 1].translation).norm() <= 0.05);
    CHECK(camera_way(t - 1, t) <= 0.015);
    CHECK(camera_turn(t - 1, t) <= 0.4);
    for (Index joint = 0; joint < kSmplxJoints; ++joint) {
      INFO(body().joint_names[static_cast<std::size_t>(joint)]);
      CHECK(joint_turn(t - 1, t, joint) <= 12);
    }
  }
  CHECK(root_way(0, 7) > 0.15);
  CHECK((clip.object[7].translation - clip.object[0].translation).norm() > 0.2);
  CHECK(degrees_between(clip.object[0].rotation, clip.object[7].rotation) > 15);
  CHECK(camera_way(0, 7) > 0.09);
  CHECK(camera_turn(0, 7) > 2);
  for (const char* name :
       {"left_knee", "right_shoulder", "left_shoulder", "right_elbow", "right_wrist", "left_index1"}) {
    INFO(name);
    CHECK(joint_turn(0, 7, smplx_joint(name)) > 10);
  }
}

TEST_CASE("the clip keeps its feet on the floor, its object in reach, and runs on for any number of frames") {
  const SyntheticObject object = synthetic_object(SyntheticObjectKind::kBox, 300, 0);
  const SyntheticClip clip = synthetic_clip(body(), object, {75, 10, 64, 1, SyntheticMotionKind::kPour});
  const auto start = pose_joints(body(), clip.motion.poses[0]);
  for (std::size_t t = 0; t < 75; ++t) {
    INFO("frame " << t);
    const auto joints = pose_joints(body(), clip.motion.poses[t]);
    for (const char* name : {"left_ankle", "right_ankle", "left_foot", "right_foot"}) {
      const std::size_t joint = static_cast<std::size_t>(smplx_joint(name));
      CHECK((row(joints, joint) - row(start, joint)).norm() < 1e-9);
    }
    CHECK(clip.object[t].translation.z() > 0.7);
  }
  for (std::size_t t = 0; t <= 60; ++t) {  // forwards and backwards
    INFO("frame " << t);
    CHECK((clip.motion.poses[t].transl - clip.motion.poses[60 - t].transl).norm() < 1e-9);
  }
  const Vector3<double> base = clip.object[0].translation - Vector3<double>(0, 0, object.above_ground);
  CHECK(std::abs(base.z() - clip.plan.support.z()) < 1e-9);  // it stands on the table
  CHECK(so3_exp(so3_log(clip.object[0].rotation)).col(2).isApprox(Vector3<double>::UnitZ(), 1e-9));
}

TEST_CASE("planted feet stay where they are in every motion") {
  for_all_clips([](const std::string& name, SyntheticMotionKind motion, const auto&, const SyntheticClip& clip) {
    INFO(name);
    if (has_moving_ground(motion)) return;
    const auto joints = joints_of(clip);
    for (const char* foot : {"left_foot", "right_foot"}) {
      INFO(foot);
      const auto joint = static_cast<std::size_t>(smplx_joint(foot));
      const double ground = row(joints[0], joint).z();
      Vector planted = row(joints[0], joint);
      double worst = 0, lowest = 1, highest = 0;
      int steps = 0;
      bool was_planted = true;
      for (std::size_t t = 0; t < joints.size(); ++t) {
        const Vector at = row(joints[t], joint);
        lowest = std::min(lowest, at.z());
        highest = std::max(highest, at.z());
        const bool is_planted = at.z() < ground + 0.001;
        if (is_planted && !was_planted) {
          planted = at;
          ++steps;
        }
        if (is_planted) worst = std::max(worst, (at - planted).norm());
        was_planted = is_planted;
      }
      CHECK(worst < 0.005);
      CHECK(lowest > ground - 0.001);
      const bool walks = motion == SyntheticMotionKind::kWalk || motion == SyntheticMotionKind::kPush ||
                         motion == SyntheticMotionKind::kRoll;
      CHECK(steps >= (walks ? 2 : 0));
      CHECK((walks ? highest > ground + 0.02 : steps == 0));
    }
  });
}

TEST_CASE("people of other shapes walk and sit on their own feet") {
  for (const std::vector<double>& shape : {std::vector<double>{2, 1, 1}, std::vector<double>{-2, -1, -1}}) {
    BodySettings settings;
    settings.shape = shape;
    const BodyModel person = rest_body(settings);
    for (const SyntheticMotionKind motion : {SyntheticMotionKind::kWalk, SyntheticMotionKind::kSit}) {
      const SyntheticObjectKind kind =
          motion == SyntheticMotionKind::kSit ? SyntheticObjectKind::kOfficeChair : SyntheticObjectKind::kWateringCan;
      INFO(pair_name(motion, kind) << ", height " << shape[0]);
      const SyntheticClip clip = synthetic_clip(person, synthetic_object(kind, 600, 0), {45, 15, 64, 1, motion});
      const auto foot = static_cast<std::size_t>(smplx_joint("left_foot"));
      const double ground = row(pose_joints(person, clip.motion.poses[0]), foot).z();
      for (std::size_t t = 1; t < clip.motion.poses.size(); ++t) {
        const Vector before = row(pose_joints(person, clip.motion.poses[t - 1]), foot);
        const Vector at = row(pose_joints(person, clip.motion.poses[t]), foot);
        INFO("frame " << t);
        CHECK(at.z() > ground - 0.002);
        if (at.z() < ground + 0.001 && before.z() < ground + 0.001) CHECK((at - before).norm() < 0.005);
      }
    }
  }
}

TEST_CASE("steps are as long as those of people") {
  const SyntheticObject none = synthetic_object(SyntheticObjectKind::kNone, 600, 0);
  const SyntheticClip clip = synthetic_clip(body(), none, {120, 30, 64, 1, SyntheticMotionKind::kWalk});
  const auto joints = joints_of(clip);
  double longest = 0;
  for (const auto& frame : joints)
    longest = std::max(longest, (row(frame, static_cast<std::size_t>(smplx_joint("left_ankle"))) -
                                 row(frame, static_cast<std::size_t>(smplx_joint("right_ankle"))))
                                    .norm());
  CHECK(longest > 0.25);
  CHECK(longest < 0.75);
}

TEST_CASE("hands are at the object that they hold") {
  for_all_clips([](const std::string& name, SyntheticMotionKind motion, const SyntheticObject& object,
                   const SyntheticClip& clip) {
    const bool holds = motion != SyntheticMotionKind::kSit && motion != SyntheticMotionKind::kRoll &&
                       motion != SyntheticMotionKind::kPlay;
    if (!object.exists() || !holds) return;
    INFO(name);
    const FigureSizes sizes = figure_sizes(body());
    for (std::size_t t = 0; t < clip.object.size(); ++t) {
      const double seconds = double(t) / 15;
      if (motion == SyntheticMotionKind::kLift && seconds < 0.56) continue;  // it reaches for it
      if (motion == SyntheticMotionKind::kPutDown && seconds > 1.85 && seconds < 4.15) continue;
      INFO("frame " << t);
      for (const std::size_t side : {0U, 1U}) {
        if (!object.hands[side]) continue;
        const int wrist = smplx_joint(side == 0 ? "left_wrist" : "right_wrist");
        const Vector palm = transform_point(joint_frame(body(), clip.motion.poses[t], wrist), sizes.palm[side]);
        CHECK((palm - transform_point(clip.object[t], object.hands[side]->point)).norm() < 0.01);
      }
    }
  });
}

TEST_CASE("what is put down stays on the table while the hands are away, and is taken up again") {
  for (const SyntheticObjectKind kind : objects_of(SyntheticMotionKind::kPutDown)) {
    const SyntheticObject object = synthetic_object(kind, 600, 0);
    INFO(pair_name(SyntheticMotionKind::kPutDown, kind));
    const SyntheticClip clip = synthetic_clip(body(), object, {61, 10, 64, 1, SyntheticMotionKind::kPutDown});
    CHECK(clip.plan.has_screen);
    for (std::size_t t = 19; t <= 41; ++t) CHECK(clip.object[t].translation == clip.object[30].translation);
    const Vector foot = clip.object[30].translation - Vector(0, 0, object.above_ground);
    CHECK(foot.z() == Approx(clip.plan.support.z()).margin(1e-9));
    const int wrist = smplx_joint("right_wrist");
    const Vector palm =
        transform_point(joint_frame(body(), clip.motion.poses[30], wrist), figure_sizes(body()).palm[kRight]);
    CHECK((palm - transform_point(clip.object[30], object.hands[kRight]->point)).norm() > 0.2);
    for (const std::size_t t : {0U, 60U}) CHECK(clip.object[t].translation.z() > clip.object[30].translation.z() + 0.3);
  }
}

TEST_CASE("joints stay within their ranges but for a few degrees") {
  for_all_clips([](const std::string& name, SyntheticMotionKind motion, const auto&, const SyntheticClip& clip) {
    INFO(name);
    int beyond = 0, all = 0;
    double worst = 0;
    std::string where;
    for (std::size_t t = 0; t < clip.motion.poses.size(); ++t) {
      for (const NaturalJoint& joint : natural_joints()) {
        const Matrix3<double> rotation = so3_exp(clip.motion.poses[t].rotation_of(smplx_joint(joint.name)));
        const Vector angles = twist_and_swing(rotation, joint.twist_axis) / kDegree;
        double excess = 0;
        for (int axis = 0; axis < 3; ++axis)
          excess = std::max({excess, angles[axis] - joint.high[axis], joint.low[axis] - angles[axis]});
        ++all;
        beyond += excess > 0 ? 1 : 0;
        if (excess > worst) where = joint.name + (" in frame " + std::to_string(t));
        worst = std::max(worst, excess);
      }
    }
    INFO(where << "; " << beyond << " of " << all << " beyond");
    const double allowed = motion == SyntheticMotionKind::kPour    ? 75  // the wrist over a tilted handle
                           : motion == SyntheticMotionKind::kWater ? 60
                                                                   : 25;
    CHECK(worst < allowed);
    CHECK(beyond < 0.05 * all);
  });
}

TEST_CASE("nothing goes through the floor and nothing moves faster than people do") {
  for_all_clips(
      [](const std::string& name, SyntheticMotionKind, const SyntheticObject& object, const SyntheticClip& clip) {
        INFO(name);
        for (std::size_t t = 0; t < clip.motion.poses.size(); t += 7) {
          const std::vector<double> vertices = pose_vertices(body(), clip.motion.poses[t]);
          double lowest = 1;
          for (std::size_t i = 2; i < vertices.size(); i += 3) lowest = std::min(lowest, vertices[i]);
          INFO("frame " << t);
          CHECK(lowest > -0.015);
          for (std::size_t i = 0; i < object.gaussians.means.size(); i += 3) {
            const Vector mean{double(object.gaussians.means[i]), double(object.gaussians.means[i + 1]),
                              double(object.gaussians.means[i + 2])};
            lowest = std::min(lowest, transform_point(clip.object[t], mean).z());
          }
          CHECK(lowest > -0.015);
        }
        const auto joints = joints_of(clip);
        double fastest = 0, root = 0, thing = 0;
        for (std::size_t t = 1; t < joints.size(); ++t) {
          for (std::size_t j = 0; j < 22; ++j)
            fastest = std::max(fastest, (row(joints[t], j) - row(joints[t - 1], j)).norm());
          root = std::max(root, (row(joints[t], 0) - row(joints[t - 1], 0)).norm());
          if (object.exists())
            thing = std::max(thing, (clip.object[t].translation - clip.object[t - 1].translation).norm());
        }
        CHECK(fastest * 15 < 3);
        CHECK(root * 15 < 1.1);
        CHECK(thing * 15 < 1.6);
      });
}

TEST_CASE("feet on a treadmill go with its belt") {
  const ScenePlace& place = places_of(SyntheticSceneKind::kGym)[0];
  ClipSettings settings{60, 30, 64, 1, SyntheticMotionKind::kRun};
  settings.place = &place;
  const SyntheticClip clip = synthetic_clip(body(), synthetic_object(SyntheticObjectKind::kNone, 60, 0), settings);
  const auto joints = joints_of(clip);
  const Vector ahead = place.ground.direction({0, 1, 0});
  for (const char* foot : {"left_foot", "right_foot"}) {
    const auto joint = static_cast<std::size_t>(smplx_joint(foot));
    double lowest = 1;
    for (const auto& frame : joints) lowest = std::min(lowest, row(frame, joint).z());
    int on_belt = 0;
    for (std::size_t t = 1; t < joints.size(); ++t) {
      const Vector before = row(joints[t - 1], joint), at = row(joints[t], joint);
      if (before.z() > lowest + 0.001 || at.z() > lowest + 0.001) continue;
      ++on_belt;
      const Vector way = (at - before) * 30;
      CHECK(dot(way, ahead) == Approx(-1.05).margin(0.02));
      CHECK((way - ahead * dot(way, ahead)).norm() < 0.02);
    }
    CHECK(on_belt > 12);
  }
}

TEST_CASE("nobody goes through what is solid at a place") {
  for (const Act& act : all_acts()) {
    if (act.place == nullptr) continue;
    INFO(act.name);
    const SyntheticObject object = synthetic_object(act.object, 600, 0);
    ClipSettings settings{26, 5, 64, 1, act.motion};
    settings.place = act.place;
    const SyntheticClip clip = synthetic_clip(body(), object, settings);
    SyntheticSettings of_scene;
    of_scene.scene = act.scene;
    const MeshDistance solids(synthetic_solids(of_scene, clip.plan), 0.1);
    double deepest = 0;
    std::size_t where = 0, frame = 0;
    for (std::size_t t = 0; t < clip.motion.poses.size(); t += 5) {
      const std::vector<double> vertices = pose_vertices(body(), clip.motion.poses[t]);
      for (std::size_t i = 0; i < vertices.size(); i += 12) {
        const double deep = -solids.at({vertices[i], vertices[i + 1], vertices[i + 2]});
        if (deep > deepest) {
          deepest = deep;
          where = i / 3;
          frame = t;
        }
      }
    }
    INFO("vertex " << where << " in frame " << frame);
    CHECK(deepest < 0.06);
  }
}

TEST_CASE("a motion refuses an object that it makes no sense with") {
  const SyntheticObject none = synthetic_object(SyntheticObjectKind::kNone, 600, 0);
  CHECK_THROWS_MATCHES(synthetic_clip(body(), none, {2, 10, 64, 1, SyntheticMotionKind::kPush}), UserError,
                       Catch::Matchers::Message("the motion push needs an object: office_chair, shopping_cart, mower"));
  CHECK_NOTHROW(synthetic_clip(body(), none, {2, 10, 64, 1, SyntheticMotionKind::kWave}));
  CHECK(synthetic_clip(body(), none, {2, 10, 64, 1, SyntheticMotionKind::kWave}).object.empty());
}

TEST_CASE("a nearer camera looks at the same place from the same side") {
  const SyntheticObject can = synthetic_object(SyntheticObjectKind::kWateringCan, 600, 0);
  ClipSettings settings{2, 10, 64, 1, SyntheticMotionKind::kWalk};
  const SyntheticClip usual = synthetic_clip(body(), can, settings);
  const Viewpoint from = first_viewpoint(settings);
  settings.camera_distance = 0.5;
  const SyntheticClip near = synthetic_clip(body(), can, settings);
  const Vector3<double> eye = camera_center_world(near.cameras[0]);
  CHECK((eye - from.target - 0.5 * (from.eye - from.target)).norm() < 1e-12);
  CHECK((near.cameras[0].camera_from_world.rotation - usual.cameras[0].camera_from_world.rotation).norm() < 1e-12);
  const Vector3<double> way = camera_center_world(near.cameras[1]) - eye,
                        usual_way = camera_center_world(usual.cameras[1]) - camera_center_world(usual.cameras[0]);
  CHECK((way - usual_way).norm() < 1e-12);  // it drifts as far
  CHECK(near.cameras[0].fx == usual.cameras[0].fx);
  SyntheticSettings described;
  described.camera_distance = 0.36;
  CHECK(clip_settings(described).camera_distance == 0.36);
}

TEST_CASE("the clip for the demo moves as much as it has to") {
  const SyntheticSettings settings = demo_clip();
  const SyntheticObject object = synthetic_object(settings);
  const SyntheticClip clip = synthetic_clip(body(), object, clip_settings(settings));
  const auto joints = joints_of(clip);
  CHECK((row(joints[15], 0) - row(joints[0], 0)).norm() >= 0.5);
  CHECK((clip.object[15].translation - clip.object[0].translation).norm() >= 0.3);
  CHECK(degrees_between(clip.object[0].rotation, clip.object[15].rotation) >= 45);
  CHECK((camera_center_world(clip.cameras[15]) - camera_center_world(clip.cameras[0])).norm() >= 0.15);
  CHECK(degrees_between(clip.cameras[0].camera_from_world.rotation, clip.cameras[15].camera_from_world.rotation) >= 3);
  for (std::size_t t = 1; t < 16; ++t) {  // steps that a local optimiser can follow
    INFO("frame " << t);
    CHECK((row(joints[t], 0) - row(joints[t - 1], 0)).norm() < 0.055);
    CHECK((clip.object[t].translation - clip.object[t - 1].translation).norm() < 0.075);
    CHECK(degrees_between(clip.object[t].rotation, clip.object[t - 1].rotation) < 7);
    CHECK((camera_center_world(clip.cameras[t]) - camera_center_world(clip.cameras[t - 1])).norm() < 0.015);
  }
}

TEST_CASE("in the clip for the demo the hand hides part of the object") {
  SyntheticSettings settings = demo_clip();
  settings.size_px = 160;
  settings.object_gaussians = 600;
  const SyntheticObject object = synthetic_object(settings);
  const SyntheticClip clip = synthetic_clip(body(), object, clip_settings(settings));
  AvatarSettings avatar_settings;
  avatar_settings.gaussians = 3000;
  const Avatar avatar = surface_avatar(body(), avatar_settings), handless = with_faded_hands(avatar, 1);
  const RenderSettings render = video_render_settings();
  int hidden = 0;
  for (std::size_t t = 0; t < 16; ++t) {
    const auto seen = [&](const Avatar& human) {
      const Gaussians backdrop = selected(object.gaussians, std::vector<Index>{0});
      return sum_of(SyntheticRenderer(backdrop, object.gaussians, human, render)
                        .frame(clip.motion.poses[t], clip.object[t], clip.cameras[t], 1)
                        .object_mask);
    };
    hidden += seen(avatar) < 0.97 * seen(handless) ? 1 : 0;
  }
  INFO(hidden);
  CHECK(hidden >= 4);
}

TEST_CASE("the screen hides what is put down, and nothing of it before") {
  SyntheticSettings settings = demo_clip();
  settings.scene = SyntheticSceneKind::kTerrace;
  settings.motion = SyntheticMotionKind::kPutDown;
  settings.object = SyntheticObjectKind::kVase;
  settings.frames = 61;
  settings.size_px = 96;
  settings.scene_gaussians = 6000;
  settings.object_gaussians = 600;
  const SyntheticObject object = synthetic_object(settings);
  const SyntheticClip clip = synthetic_clip(body(), object, clip_settings(settings));
  AvatarSettings avatar_settings;
  avatar_settings.gaussians = 1000;
  const Gaussians scene = synthetic_scene(settings, clip.plan);
  const Avatar avatar = surface_avatar(body(), avatar_settings);
  const RenderSettings render = video_render_settings();
  const SyntheticRenderer renderer(scene, object.gaussians, avatar, render);
  const auto shown = [&](std::size_t t) {
    return sum_of(renderer.frame(clip.motion.poses[t], clip.object[t], clip.cameras[t], 1).object_mask);
  };
  const double before = shown(0);
  CHECK(before > 50);  // pixels
  for (const std::size_t t : {18U, 30U, 42U}) CHECK(shown(t) < 0.02 * before);
  CHECK(shown(60) > 0.8 * before);
}

}  // namespace motion_test
