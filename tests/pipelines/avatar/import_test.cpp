#include "pipelines/avatar/import.h"

#include <cmath>

#include <catch2/catch.hpp>

#include "body/procedural_body.h"
#include "core/check.h"
#include "pipelines/draw/posed_avatar.h"
#include "pipelines/synthetic/object.h"
#include "splat/files/io_ply.h"
#include "tests/support/measures.h"
#include "tests/support/temporary_folder.h"

namespace import_test {

using namespace hsi4d;
using namespace hsi4d::test;
using Catch::Contains;

namespace {

const BodyModel& body() {
  static const BodyModel made = procedural_body();
  return made;
}

const Avatar& avatar() {
  static const Avatar made = surface_avatar(body(), {.gaussians = 3000});
  return made;
}

std::vector<double> dense(const SparseWeights& w) {
  std::vector<double> result(static_cast<std::size_t>(w.vertices * w.joints), 0.0);
  for (Index i = 0; i < w.vertices * w.per_vertex; ++i) {
    const auto at = static_cast<std::size_t>(i);
    result[static_cast<std::size_t>(i / w.per_vertex * w.joints + w.indices[at])] += w.weights[at];
  }
  return result;
}

}  // namespace

TEST_CASE("an avatar that goes through a PLY comes back by import") {
  const TemporaryFolder folder;
  write_ply("a.ply", rest_gaussians(avatar()));
  const AvatarImport import = import_avatar(read_ply("a.ply").gaussians, body(), "a.ply");
  CHECK(import.avatar.means == avatar().means);
  CHECK(import.avatar.quats == avatar().quats);
  CHECK(import.avatar.log_scales == avatar().log_scales);
  CHECK(import.avatar.opacity_logits == avatar().opacity_logits);
  CHECK(import.avatar.parents == avatar().parents);
  CHECK(import.avatar.joints == avatar().joints);
  for (std::size_t i = 0; i < avatar().colors.size(); ++i)
    REQUIRE(std::abs(import.avatar.colors[i] - avatar().colors[i]) < 1e-6F);
  CHECK(import.avatar.weights.per_vertex == 4);
  CHECK(largest_difference(dense(import.avatar.weights), dense(avatar().weights)) < 1e-4);
  CHECK(import.largest_distance < 1e-6);
  CHECK(import.far == 0);
  CHECK_FALSE(import.lost_views);
}

TEST_CASE("Gaussians off the surface follow the part that they are nearest to") {
  Gaussians g = rest_gaussians(avatar());
  // Outwards by a centimetre, as clothes are: z of each quaternion's frame is the normal.
  for (Index i = 0; i < g.count(); ++i) {
    const float* q = g.quats.data() + 4 * i;
    const float normal[3] = {2 * (q[1] * q[3] + q[0] * q[2]), 2 * (q[2] * q[3] - q[0] * q[1]),
                             1 - 2 * (q[1] * q[1] + q[2] * q[2])};
    for (Index c = 0; c < 3; ++c) g.means[static_cast<std::size_t>(3 * i + c)] += 0.01F * normal[c];
  }
  const AvatarImport import = import_avatar(g, body(), "a.ply");
  CHECK(import.mean_distance == Approx(0.01).epsilon(0.05));
  CHECK(import.largest_distance < 0.0101);
  const std::vector<double> found = dense(import.avatar.weights), expected = dense(avatar().weights);
  Index same = 0;
  for (Index i = 0; i < g.count(); ++i) {
    double difference = 0;
    for (Index j = 0; j < 55; ++j) {
      const auto at = static_cast<std::size_t>(55 * i + j);
      difference += std::abs(found[at] - expected[at]) / 2;
    }
    same += difference < 0.1 ? 1 : 0;
  }
  CHECK(100 * same > 95 * g.count());  // between fingers and in armpits another part is nearer
}

TEST_CASE("an import keeps the origin, holds colours at 0 and tells what is lost") {
  Gaussians g = rest_gaussians(avatar());
  g.origin_world = {0, -0.5, 0};
  for (std::size_t i = 1; i < g.means.size(); i += 3) g.means[i] += 0.5F;
  g.sh[0] = -9;
  g = with_sh_degree(g, 2);
  CHECK_FALSE(import_avatar(g, body(), "a.ply").lost_views);
  g.sh[8] = 0.25F;
  const AvatarImport import = import_avatar(g, body(), "a.ply");
  CHECK(import.lost_views);
  CHECK(import.largest_distance < 1e-6);
  CHECK(import.avatar.colors[0] == 0);
  CHECK(import.avatar.colors[5] == Approx(avatar().colors[5]).margin(1e-6));
}

TEST_CASE("Gaussians in another unit or place are no avatar of the body") {
  Gaussians g = rest_gaussians(avatar());
  for (float& x : g.means) x *= 100;
  CHECK_THROWS_WITH(import_avatar(g, body(), "a.ply"),
                    Contains("a.ply: ") && Contains("of 3000 Gaussians are more than 0.15 m from the body") &&
                        Contains("they have to be in its rest pose"));
  CHECK_THROWS_WITH(import_avatar(Gaussians{}, body(), "a.ply"), "a.ply: holds no Gaussians");
}

TEST_CASE("Gaussians that cover little of the body are no avatar of it") {
  CHECK(import_avatar(rest_gaussians(avatar()), body(), "a.ply").covered > 0.999);
  // A watering can of 30 cm about the origin, all of it near the trunk.
  Gaussians can = synthetic_object(SyntheticObjectKind::kWateringCan, 500, 1).gaussians;
  CHECK_THROWS_WITH(import_avatar(can, body(), "can.ply"),
                    Contains("can.ply: is no avatar: only ") && Contains("allowed: 40 % or more, in its rest pose"));
  // A body without legs is warned of, no more.
  Gaussians upper;
  const Gaussians whole = rest_gaussians(avatar());
  for (std::size_t i = 0; i < static_cast<std::size_t>(whole.count()); ++i) {
    if (whole.means[3 * i + 1] < -0.4F) continue;
    const auto take = [&](std::vector<float>& to, const std::vector<float>& from, std::size_t width) {
      to.insert(to.end(), from.begin() + static_cast<std::ptrdiff_t>(i * width),
                from.begin() + static_cast<std::ptrdiff_t>((i + 1) * width));
    };
    take(upper.means, whole.means, 3);
    take(upper.quats, whole.quats, 4);
    take(upper.log_scales, whole.log_scales, 3);
    take(upper.opacity_logits, whole.opacity_logits, 1);
    take(upper.sh, whole.sh, 3);
  }
  const double covered = import_avatar(upper, body(), "a.ply").covered;
  CHECK(covered > kLeastCovered);
  CHECK(covered < kWellCovered);
  Gaussians far = upper;
  for (float& x : far.means) x = 1e30F;
  CHECK(covered_share(far.means, body()) == 0);
}

}  // namespace import_test
