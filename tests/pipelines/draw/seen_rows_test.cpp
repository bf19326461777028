#include "pipelines/draw/seen_rows.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <catch2/catch.hpp>

#include "core/gather.h"
#include "pipelines/draw/posed_avatar.h"
#include "pipelines/draw/reference_render.h"
#include "splat/render/sh.h"
#include "tests/support/splat_scenes.h"

namespace seen_rows_test {

using namespace hsi4d;
using namespace hsi4d::test;

namespace {

constexpr double kGolden = 2.399963229728653;  // radians between neighbours of a Fibonacci lattice

/// A ball of radius 1 m about (0, 0, 4), of opaque Gaussians on its surface, about ten above each other.
Gaussians ball(Index count) {
  Gaussians g;
  const float log_scale = static_cast<float>(std::log(4.5 / std::sqrt(static_cast<double>(count))));
  for (Index n = 0; n < count; ++n) {
    const double z = 1 - 2 * (static_cast<double>(n) + 0.5) / static_cast<double>(count);
    const double r = std::sqrt(1 - z * z), angle = kGolden * static_cast<double>(n);
    for (const double x : {r * std::cos(angle), r * std::sin(angle), 4 + z}) g.means.push_back(static_cast<float>(x));
    g.quats.insert(g.quats.end(), {1, 0, 0, 0});
    g.log_scales.insert(g.log_scales.end(), 3, log_scale);
    g.opacity_logits.push_back(5);
    g.sh.insert(g.sh.end(), 3, 0);
  }
  return g;
}

ViewRange view_range(double within_deg) { return {plain_camera({128, 128}), {}, within_deg}; }

/// Angle between the camera's centre and a Gaussian, seen from the ball's, degrees.
double angle_from_camera(const Gaussians& g, Index n) {
  const Vector3<double> out = Vector3<float>(g.means.data() + 3 * n).cast<double>() - Vector3<double>(0, 0, 4);
  return std::acos(std::clamp(-out[2] / out.norm(), -1.0, 1.0)) * 180 / std::numbers::pi;
}

bool holds(const std::vector<Index>& rows, Index n) { return std::binary_search(rows.begin(), rows.end(), n); }

}  // namespace

TEST_CASE("of a ball is seen what faces the camera, and more from around") {
  const Gaussians g = ball(2000);
  const std::vector<Index> narrow = seen_rows({g, {}}, view_range(1)), wide = seen_rows({g, {}}, view_range(25));
  CHECK(std::is_sorted(narrow.begin(), narrow.end()));
  CHECK(std::includes(wide.begin(), wide.end(), narrow.begin(), narrow.end()));
  const double horizon = 75.5;  // of a ball of radius 1 at 4: the angle whose cosine is 1/4
  double facing = 0, facing_seen = 0;
  for (Index n = 0; n < g.count(); ++n) {
    INFO(n << ", " << angle_from_camera(g, n) << " degrees");
    if (angle_from_camera(g, n) > horizon + 45) CHECK_FALSE(holds(narrow, n));
    if (angle_from_camera(g, n) > horizon + 70) CHECK_FALSE(holds(wide, n));
    if (angle_from_camera(g, n) > 45) continue;
    facing += 1;
    facing_seen += holds(narrow, n) ? 1 : 0;
  }
  CHECK(facing_seen > 0.8 * facing);  // some are behind others that are a little nearer
  const double more = static_cast<double>(wide.size()) / static_cast<double>(narrow.size());
  CHECK(more > 1.1);
  CHECK(more < 1.6);
}

TEST_CASE("what is seen weighs as much by brute force") {
  const Gaussians g = ball(300);
  const SceneView view{view_range(0).camera, {}, {}};
  const SceneGradients by_sum = adjoint_reference(
      g, view, [](const SceneGradients& result) { return std::vector<double>(result.rendered.image.size(), 1); });
  const std::vector<Index> rows = seen_rows({g, {}}, view_range(0));
  int decided = 0;
  for (Index n = 0; n < g.count(); ++n) {
    const double weight = by_sum.sh[static_cast<std::size_t>(3 * n)] / kShC0;
    INFO(n << " weighs " << weight << " pixels");
    if (std::fabs(weight - 0.02) < 0.002) continue;  // where one renders as the other, but for a thousandth
    ++decided;
    CHECK(holds(rows, n) == (weight > 0.02));
  }
  CHECK(decided > 290);
  CHECK(rows.size() < 260);
}

TEST_CASE("a part is looked at where its transforms put it") {
  Gaussians g = ball(500);
  const std::vector<Index> there = seen_rows({g, {}}, view_range(5));
  for (Index n = 0; n < g.count(); ++n) g.means[static_cast<std::size_t>(3 * n + 2)] -= 4;  // to the origin
  CHECK(seen_rows(posed_object(g, {{0, 0, 0}, {0, 0, 4}}), view_range(5)) == there);
  const std::vector<Index> turned = seen_rows(posed_object(g, {{0, std::numbers::pi, 0}, {0, 0, 4}}), view_range(5));
  std::vector<Index> both;
  std::set_intersection(there.begin(), there.end(), turned.begin(), turned.end(), std::back_inserter(both));
  CHECK(both.size() < 3 * there.size() / 4);
}

TEST_CASE("of what is out of sight all is kept") {
  Gaussians g = ball(100);
  for (std::size_t i = 2; i < g.means.size(); i += 3) g.means[i] -= 12;  // behind the camera
  CHECK(seen_rows({g, {}}, view_range(10)) == all_rows(100));
}

TEST_CASE("gathered rows are those asked for") {
  const std::vector<int> table = {0, 1, 10, 11, 20, 21};
  const std::vector<Index> rows = {2, 0, 2}, none, beyond = {3};
  CHECK(gathered(table, rows, 2) == std::vector<int>{20, 21, 0, 1, 20, 21});
  CHECK(gathered(table, none, 2).empty());
  CHECK_THROWS_WITH(gathered(table, beyond, 2), Catch::Contains("there is no row 3"));
}

}  // namespace seen_rows_test
