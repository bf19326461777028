#include "splat/render/reachable.h"

#include <cmath>
#include <limits>
#include <random>

#include <catch2/catch.hpp>

#include "tests/support/seeds.h"
#include "tests/support/taped_splats.h"

namespace reachable_test {

using namespace hsi4d;
using namespace hsi4d::test;

namespace {

constexpr CameraReach kReach = {0.15, 0.08};

SplatView view_of_scene(const SplatScene& scene) { return {scene.camera, Vector3<double>::Zero(), scene.settings}; }

SplatScene with_rows(SplatScene scene, const std::vector<Index>& rows) {
  const Gaussians some = selected(scene.gaussians(), rows);
  scene.means = some.means;
  scene.quats = some.quats;
  scene.log_scales = some.log_scales;
  scene.opacity_logits = some.opacity_logits;
  scene.sh = some.sh;
  return scene;
}

std::vector<Index> others(const std::vector<Index>& rows, Index count) {
  std::vector<Index> left;
  auto next = rows.begin();
  for (Index n = 0; n < count; ++n) {
    if (next != rows.end() && *next == n) {
      ++next;
    } else {
      left.push_back(n);
    }
  }
  return left;
}

/// Six numbers on the edge of what is reached, in a random direction each.
std::vector<float> furthest_update(std::mt19937_64& random, const CameraReach& reach) {
  std::normal_distribution<double> normal;
  Vector6<double> xi;
  for (Index i = 0; i < 6; ++i) xi[i] = normal(random);
  xi.head<3>() *= 0.999 * reach.translation / xi.head<3>().norm();
  xi.tail<3>() *= 0.999 * reach.rotation / xi.tail<3>().norm();
  return {xi.data(), xi.data() + 6};
}

/// Gaussians all around a camera that stands among them: most cannot be seen.
SplatScene all_around(std::uint64_t seed) {
  SplatScene scene = random_splats(2000, seed, {60, 44});
  std::mt19937_64 random(seed);
  std::normal_distribution<float> normal;
  for (float& x : scene.means) x = 4 * normal(random);
  for (float& s : scene.log_scales) s = -2.5F + normal(random);
  return scene;
}

}  // namespace

TEST_CASE("Gaussians that are not reachable are drawn from no camera within reach") {
  const std::uint64_t seed = fresh_seed();
  INFO("seed " << seed);
  std::mt19937_64 random(seed);
  for (SplatScene scene : {all_around(seed), behind_and_beside(seed), near_plane(seed), needles(60, 1e4, seed),
                           off_centre(100, seed), broken_numbers(seed)}) {
    for (const SettingsVariant& variant : settings_variants()) {
      SplatScene varied = scene;
      variant.apply(varied.settings);
      const std::vector<Index> rows = reachable_rows(varied.gaussians(), view_of_scene(varied), kReach);
      const std::vector<Index> left = others(rows, varied.count());
      INFO(scene.name << ", " << variant.name << ": " << left.size() << " of " << varied.count() << " left out");
      if (varied.settings.alpha_min == 0) CHECK(left.empty());
      if (left.empty()) continue;
      TapedSplats<float> taped(with_rows(varied, left), cotangent_of(varied.camera));
      for (int trial = 0; trial < 5; ++trial) {
        taped.tape.set(taped.xi, furthest_update(random, kReach));
        taped.tape.forward(taped.loss);
        CHECK(taped.rendered.counters->fragments == 0);  // INRIA's squares are listed, and nothing in them is drawn
      }
    }
  }
}

TEST_CASE("what is not reachable changes no bit of the image, and is most of a scene around the camera") {
  const SplatScene scene = all_around(7);
  const std::vector<Index> rows = reachable_rows(scene.gaussians(), view_of_scene(scene), {});
  CHECK(rows.size() < 800);
  const SplatCotangent cotangent = cotangent_of(scene.camera);
  TapedSplats<float> whole(scene, cotangent), some(with_rows(scene, rows), cotangent);
  whole.run();
  some.run();
  CHECK(whole.value(whole.rendered.image) == some.value(some.rendered.image));
  CHECK(whole.rendered.counters->visible == some.rendered.counters->visible);
  CHECK(static_cast<double>(rows.size()) < 1.3 * static_cast<double>(some.rendered.counters->visible));
  CHECK(relative_l2(some.gradient(some.xi), whole.gradient(whole.xi)) < 1e-6);
  CHECK(reachable_rows(scene.gaussians(), view_of_scene(scene), {0.1, 0.1}).size() > rows.size());
}

TEST_CASE("a Gaussian whose numbers are not finite counts as reachable") {
  SplatScene scene = all_around(3);
  const float nan = std::numeric_limits<float>::quiet_NaN(), inf = std::numeric_limits<float>::infinity();
  scene.means[0] = nan;
  scene.means[3] = inf;
  scene.log_scales[6] = inf;
  const std::vector<Index> rows = reachable_rows(scene.gaussians(), view_of_scene(scene), kReach);
  CHECK(std::find(rows.begin(), rows.end(), 0) != rows.end());
}

}  // namespace reachable_test
