#include "pipelines/synthetic/variation.h"

#include <set>

#include <catch2/catch.hpp>

#include "body/procedural_body.h"
#include "core/check.h"
#include "pipelines/synthetic/motion.h"

namespace variation_test {

using namespace hsi4d;

namespace {

SyntheticSettings watering() {
  SyntheticSettings settings;
  settings.scene = SyntheticSceneKind::kGreenhouse;
  settings.motion = SyntheticMotionKind::kWater;
  settings.frames = 4;
  settings.variation = 1;
  return settings;
}

SyntheticClip clip_of(const SyntheticSettings& settings) {
  static const BodyModel body = procedural_body();
  static const SyntheticObject can = synthetic_object(SyntheticObjectKind::kWateringCan, 300, 0);
  return synthetic_clip(body, can, clip_settings(settings));
}

}  // namespace

TEST_CASE("seeds of a varied clip are other videos") {
  std::set<double> roots, eyes, objects;
  for (int seed = 0; seed < 5; ++seed) {
    SyntheticSettings settings = watering();
    settings.seed = seed;
    const SyntheticClip clip = clip_of(settings);
    roots.insert(clip.motion.poses[2].transl[0]);
    objects.insert(clip.object[2].translation[2]);
    eyes.insert(camera_center_world(clip.cameras[0])[0]);
    const ClipVariation varied = clip_variation(settings);
    CHECK(varied.speed >= 0.85);
    CHECK(varied.speed <= 1.15);
    CHECK(varied.begin <= 0.4);
  }
  CHECK(roots.size() == 5);
  CHECK(objects.size() == 5);
  CHECK(eyes.size() == 5);
}

TEST_CASE("without variation the seed changes neither motion nor camera nor clothes") {
  SyntheticSettings settings = watering();
  settings.variation = 0;
  const SyntheticClip one = clip_of(settings);
  settings.seed = 7;
  const SyntheticClip other = clip_of(settings);
  for (std::size_t t = 0; t < 4; ++t) {
    CHECK(one.motion.poses[t].transl == other.motion.poses[t].transl);
    CHECK(one.object[t].translation == other.object[t].translation);
    CHECK(camera_center_world(one.cameras[t]) == camera_center_world(other.cameras[t]));
  }
  const Avatar avatar = surface_avatar(procedural_body(), {.gaussians = 400});
  CHECK(in_other_clothes(avatar, settings).colors == avatar.colors);
  settings.variation = 1;
  const Avatar dressed = in_other_clothes(avatar, settings);
  int changed = 0, heads = 0;
  for (std::size_t i = 0; i < 400; ++i) {
    const bool is_other = dressed.colors[3 * i] != avatar.colors[3 * i];
    changed += is_other ? 1 : 0;
    if (avatar.means[3 * i + 1] > avatar.joints[3 * 15 + 1] + 0.02) heads += is_other ? 1 : 0;
  }
  CHECK(changed > 80);
  CHECK(heads == 0);
}

TEST_CASE("a varied light comes from another side and is no light without variation") {
  SyntheticSettings settings;
  const Light even = [](const auto&, const auto&) { return 0.8; };
  const Vector3<double> at(0, 0, 0), left(-1, 0, 0), right(1, 0, 0);
  CHECK(from_another_side(even, settings)(at, left) == 0.8);
  settings.variation = 1;
  settings.seed = 3;
  const Light varied = from_another_side(even, settings);
  CHECK(varied(at, left) / varied(at, right) != Approx(1).margin(1e-3));
  CHECK(varied(at, left) > 0.3);
  CHECK(varied(at, left) < 1.3);
}

}  // namespace variation_test
