#include "pipelines/synthetic/light.h"

#include <cmath>

#include <catch2/catch.hpp>

#include "body/procedural_body.h"
#include "core/parallel.h"
#include "core/rotation.h"
#include "pipelines/synthetic/faults.h"
#include "pipelines/synthetic/motion.h"

namespace light_test {

using namespace hsi4d;

namespace {

using Vector = Vector3<double>;

const BodyModel& body() {
  static const BodyModel model = procedural_body();
  return model;
}

Avatar small_avatar() {
  AvatarSettings settings;
  settings.gaussians = 800;
  return surface_avatar(body(), settings);
}

double mean_of(const std::vector<float>& values) {
  double sum = 0;
  for (const float x : values) sum += double(x);
  return sum / double(values.size());
}

SyntheticFrame frame_of(float grey, float human) {
  SyntheticFrame frame{Image(3, 20, 20), Image(1, 20, 20), Image()};
  for (int y = 0; y < 20; ++y)
    for (int x = 0; x < 20; ++x) {
      for (int c = 0; c < 3; ++c) frame.color(c, y, x) = grey * static_cast<float>(x) / 20;
      frame.human_mask(0, y, x) = x < 10 ? human : 0;
    }
  return frame;
}

}  // namespace

TEST_CASE("a ball over a floor darkens what is below it and less what is beside it") {
  const std::vector<Occluder> ball = {{Vector(0, 0, 0.1), 0.1}};
  const Vector up = Vector::UnitZ();
  const double below = light_left(ball, Vector(0, 0, 0), up, 1), beside = light_left(ball, Vector(0.2, -0.2, 0), up, 1);
  CHECK(below < 0.5);
  CHECK(beside > below + 0.3);
  CHECK(light_left(ball, Vector(3, -3, 0), up, 1) > 0.99);
  CHECK(light_left(ball, Vector(0, 0, 0), up, 0) == 1);
  CHECK(light_left(ball, Vector(0, 0, 0), up, 0.5) == Approx(1 - 0.5 * (1 - below)));
  CHECK(light_left(ball, Vector(0, 0, 0), -up, 1) == 1);  // it faces away
  // the light comes from -x and -y, so the shadow falls to +x and +y
  CHECK(light_left(ball, Vector(0.09, 0.13, 0), up, 1) < light_left(ball, Vector(-0.09, -0.13, 0), up, 1) - 0.05);
  const std::vector<Occluder> high = {{Vector(0, 0, 1), 0.1}};
  CHECK(light_left(high, Vector(0, 0, 0), up, 1) > below + 0.2);  // softer from farther away
}

TEST_CASE("balls cover the body and the object") {
  BodyPose pose = rest_pose(kSmplxJoints);
  pose.set_rotation(0, {std::acos(-1.0) / 2, 0, 0});
  pose.transl = {1, 2, 3};
  const auto balls = body_occluders(body(), pose);
  CHECK(balls.size() > 30);
  const std::vector<double> vertices = pose_vertices(body(), pose);
  double farthest = 0;
  for (std::size_t i = 0; i < vertices.size(); i += 30) {
    double nearest = 10;
    for (const Occluder& ball : balls)
      nearest = std::min(nearest, (Vector(vertices.data() + i) - ball.center).norm() - ball.radius);
    farthest = std::max(farthest, nearest);
  }
  CHECK(farthest < 0.16);  // fingers of stretched arms
  const SyntheticObject object = synthetic_object(SyntheticObjectKind::kGuitar, 1000, 0);
  const auto cover = object_occluders(object.gaussians);
  CHECK(cover.size() == 24);
  for (std::size_t i = 0; i < object.gaussians.means.size(); i += 3) {
    const float* m = object.gaussians.means.data() + i;
    double nearest = 10;
    for (const Occluder& ball : cover)
      nearest =
          std::min(nearest, (Vector(double(m[0]), double(m[1]), double(m[2])) - ball.center).norm() - ball.radius);
    if (nearest > 0.06) FAIL("a Gaussian is " << nearest << " m from every ball");
  }
  CHECK(object_occluders({}).empty());
}

TEST_CASE("the shadow moves with the body and is the same for any number of threads") {
  const Gaussians scene = synthetic_scene(SyntheticSceneKind::kLivingRoom, 3000, {}, 0);
  const SyntheticObject none = synthetic_object(SyntheticObjectKind::kNone, 100, 0);
  const SyntheticClip clip = synthetic_clip(body(), none, {16, 10, 64, 1, SyntheticMotionKind::kWalk});
  const auto shadow_of = [&](std::size_t t) {
    return shadowed_scene(scene, body_occluders(body(), clip.motion.poses[t]), Vector(0, -2, 1.4), 0.8);
  };
  Gaussians one, three;
  with_threads(1, [&] { one = shadow_of(0); });
  with_threads(3, [&] { three = shadow_of(0); });
  CHECK(one.sh == three.sh);
  CHECK(one.means == scene.means);
  CHECK(one.sh != scene.sh);
  CHECK(mean_of(one.sh) < mean_of(scene.sh));
  CHECK(one.sh != shadow_of(15).sh);
}

TEST_CASE("shading follows the direction of surfaces") {
  const Avatar avatar = small_avatar();
  BodyPose pose = rest_pose(kSmplxJoints);
  CHECK(shaded_avatar(avatar, pose, 0).colors == avatar.colors);
  const Avatar lit = shaded_avatar(avatar, pose, 1);
  CHECK(lit.means == avatar.means);
  CHECK(lit.colors != avatar.colors);
  pose.set_rotation(0, {0, 0, 3});  // turned around: other sides are bright
  CHECK(shaded_avatar(avatar, pose, 1).colors != lit.colors);
  const SyntheticObject object = synthetic_object(SyntheticObjectKind::kBox, 300, 0);
  const Gaussians still = shaded_object(object, Rigid<double>(), 1);  // as it stands, nothing changes
  for (std::size_t i = 0; i < still.sh.size(); ++i) CHECK(still.sh[i] == Approx(object.gaussians.sh[i]).margin(1e-5));
  Rigid<double> turned;
  turned.rotation = so3_exp(Vector(1.5, 0, 0));
  CHECK(shaded_object(object, turned, 1).sh != still.sh);
}

TEST_CASE("the filmed human has other Gaussians and nearly the same colours") {
  const Avatar tracked = small_avatar();
  SyntheticSettings settings;
  settings.avatar_gaussians = 800;
  CHECK(filmed_avatar(body(), tracked, settings).means == tracked.means);
  settings.avatar_difference = 1;
  const Avatar filmed = filmed_avatar(body(), tracked, settings);
  CHECK(filmed.count() == 1120);
  CHECK(std::abs(mean_of(filmed.colors) - mean_of(tracked.colors)) < 0.05);
  settings.seed = 1;
  CHECK(filmed_avatar(body(), tracked, settings).colors != filmed.colors);
}

TEST_CASE("hands fade and colours change as far as is asked for") {
  const Avatar avatar = small_avatar();
  CHECK(with_faded_hands(avatar, 0).opacity_logits == avatar.opacity_logits);
  const Avatar faded = with_faded_hands(avatar, 1);
  int gone = 0;
  for (std::size_t i = 0; i < faded.opacity_logits.size(); ++i) {
    if (faded.opacity_logits[i] == avatar.opacity_logits[i]) continue;
    CHECK(faded.opacity_logits[i] == -20);
    CHECK(std::abs(avatar.means[3 * i]) > 0.5F);  // of stretched arms
    ++gone;
  }
  CHECK(gone > 100);
  CHECK(hands_gone(0) == 0);
  CHECK(hands_gone(0.5) == 1);
  CHECK(hands_gone(1) == 0);
  CHECK(with_changed_colors(avatar, 0).colors == avatar.colors);
  const double before = mean_of(avatar.colors);
  CHECK(mean_of(with_changed_colors(avatar, 0.5).colors) < before - 0.03);
  CHECK(mean_of(with_changed_colors(avatar, 1).colors) < mean_of(with_changed_colors(avatar, 0.5).colors) - 0.03);
}

TEST_CASE("what was hidden shows something else afterwards") {
  RevealedContent revealed(1, 7);
  SyntheticFrame first = frame_of(0.8F, 1);
  const Image before = first.color;
  revealed.apply(first);
  CHECK(first.color == before);  // nothing is revealed yet
  SyntheticFrame second = frame_of(0.8F, 0);
  revealed.apply(second);
  double changed = 0;
  for (int y = 0; y < 20; ++y)
    for (int x = 0; x < 20; ++x) {
      const double difference = std::abs(double(second.color(0, y, x) - before(0, y, x)));
      if (x >= 10) CHECK(difference == 0);
      changed += difference;
    }
  CHECK(changed / 200 > 0.03);
  SyntheticFrame third = frame_of(0.8F, 0);
  revealed.apply(third);
  CHECK(third.color == second.color);  // it stays where it is
  SyntheticFrame off = frame_of(0.8F, 0);
  RevealedContent(0, 7).apply(off);
  CHECK(off.color == before);
}

}  // namespace light_test
