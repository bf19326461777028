#include "body/avatar_directions.h"

#include <catch2/catch.hpp>

#include "body/procedural_body.h"
#include "core/random.h"

namespace avatar_directions_test {

using namespace hsi4d;

namespace {

constexpr Index kBetas = 10;

/// An avatar with a Gaussian on each vertex of a body.
Avatar avatar_on_vertices(const BodyModel& body) {
  AvatarSettings settings;
  settings.gaussians = body.vertex_count();
  Avatar avatar = surface_avatar(body, settings);
  avatar.means = body.vertices;
  return avatar;
}

template <class T>
double largest_difference(const std::vector<T>& a, const std::vector<T>& b) {
  REQUIRE(a.size() == b.size());
  double largest = 0;
  for (std::size_t i = 0; i < a.size(); ++i) largest = std::max(largest, static_cast<double>(std::abs(a[i] - b[i])));
  return largest;
}

}  // namespace

TEST_CASE("an avatar on the vertices of a body follows its betas as the body does") {
  const SmplxModel model = procedural_smplx(kBetas);
  RandomSequence random(5);
  std::vector<double> made(kBetas), more(kBetas), both(kBetas);
  for (std::size_t b = 0; b < kBetas; ++b) {
    made[b] = random.uniform(-1, 1), more[b] = random.uniform(-2, 2);
    both[b] = made[b] + more[b];
  }
  Avatar avatar = avatar_on_vertices(rest_body(model, made));
  const AvatarDirections shape = avatar_directions(avatar, model, made);
  CHECK(shape.betas == kBetas);
  const BodyModel expected = rest_body(model, both);
  const std::vector<double> joints_before = avatar.joints;
  add_betas(shape, more, avatar);
  CHECK(largest_difference(avatar.means, expected.vertices) < 2e-6);
  CHECK(largest_difference(avatar.joints, expected.joints) < 2e-6);
  CHECK(largest_difference(joints_before, avatar.joints) > 0.01);
  const std::vector<double> none(kBetas, 0.0);
  const std::vector<float> before = avatar.means;
  add_betas(shape, none, avatar);
  CHECK(avatar.means == before);
}

}  // namespace avatar_directions_test
