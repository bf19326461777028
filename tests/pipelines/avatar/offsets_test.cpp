#include "pipelines/avatar/offsets.h"

#include <algorithm>
#include <cmath>

#include <catch2/catch.hpp>

#include "body/procedural_body.h"
#include "core/parallel.h"
#include "core/quaternion.h"
#include "tests/support/operator_check.h"

namespace offsets_test {

using namespace hsi4d;
using namespace hsi4d::test;

namespace {

const Avatar& made_avatar() {
  static const Avatar avatar = surface_avatar(procedural_body(), {.gaussians = 6000});
  return avatar;
}

Vector3<double> row(const std::vector<float>& numbers, Index n) {
  return Vector3<float>(numbers.data() + 3 * n).cast<double>();
}

}  // namespace

TEST_CASE("normals of a made avatar are the surface's, outwards") {
  const Avatar& avatar = made_avatar();
  const std::vector<float> normals = outward_normals(avatar);
  Index alike = 0;
  for (Index n = 0; n < avatar.count(); ++n) {
    const float* const q = avatar.quats.data() + 4 * n;
    const Matrix3<double> axes = quaternion_to_matrix(Vector4<double>(q[0], q[1], q[2], q[3]));
    CHECK(std::abs(row(normals, n).norm() - 1) < 1e-5);
    if (row(normals, n).dot(axes.col(2)) > 0.99) ++alike;  // as surface_avatar lays them
  }
  INFO(alike << " of " << avatar.count());
  CHECK(static_cast<double>(alike) > 0.99 * static_cast<double>(avatar.count()));
}

TEST_CASE("a field of offsets is smooth, and the same everywhere where its numbers are") {
  const Avatar& avatar = made_avatar();
  const OffsetField field = offset_field(avatar, 200);
  REQUIRE(field.controls == 200);
  std::vector<float> along(static_cast<std::size_t>(avatar.count()));
  for (std::size_t n = 0; n < along.size(); ++n) {
    double sum = 0;
    for (std::size_t k = 0; k < OffsetField::kNear; ++k) {
      CHECK(field.shares[k][n] >= 0);
      sum += static_cast<double>(field.shares[k][n]);
      along[n] += field.shares[k][n] * std::sin(0.3F * static_cast<float>(field.controls_of[k][n]));
    }
    CHECK(sum == Approx(1).margin(1e-6));
  }
  // Of Gaussians that are a millimetre or so apart none steps by more than a part of what the numbers do.
  for (Index a = 0; a < avatar.count(); ++a) {
    for (Index b = a + 1; b < std::min(avatar.count(), a + 40); ++b) {
      if ((row(avatar.means, a) - row(avatar.means, b)).norm() > 0.003) continue;
      CHECK(std::abs(along[static_cast<std::size_t>(a)] - along[static_cast<std::size_t>(b)]) < 0.5F);
    }
  }
  std::vector<std::vector<float>> shares;
  for (const int threads : {1, 3})
    with_threads(threads, [&] { shares.push_back(offset_field(avatar, 200).shares[1]); });
  CHECK(shares[0] == shares[1]);
}

TEST_CASE("an avatar of fewer Gaussians than numbers has one each") {
  const Avatar few = surface_avatar(procedural_body(), {.gaussians = 3});
  const OffsetField field = offset_field(few);
  CHECK(field.controls == 3);
  for (std::size_t n = 0; n < 3; ++n) {
    float sum = 0;
    for (std::size_t k = 0; k < OffsetField::kNear; ++k) sum += field.shares[k][n];
    CHECK(sum == Approx(1));
  }
}

TEST_CASE("offset_means moves along normals, with its gradients", "[parallel]") {
  const Avatar avatar = surface_avatar(procedural_body(), {.gaussians = 60});
  const OffsetField field = offset_field(avatar, 9);
  check_operator("offset_means", {{"means", shape_of(60, 3)}, {"offsets", shape_of(9, 1)}},
                 [&](const auto& in) { return offset_means(field, in[0], in[1]); });
  Tape<double> tape;
  const Var<double> means = tape.parameter("means", shape_of(60, 3)), offsets = tape.parameter("d", shape_of(9, 1));
  tape.set(means, std::vector<double>(avatar.means.begin(), avatar.means.end()));
  tape.set(offsets, std::vector<double>(9, 0.02));
  const Var<double> moved = offset_means(field, means, offsets);
  tape.forward(moved);
  for (Index n = 0; n < 60; ++n) {
    const Vector3<double> step(tape.value(moved)(n, 0), tape.value(moved)(n, 1), tape.value(moved)(n, 2));
    CHECK((step - row(avatar.means, n) - 0.02 * row(field.normals, n)).norm() < 1e-7);
  }
}

}  // namespace offsets_test
