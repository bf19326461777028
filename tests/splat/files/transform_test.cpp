#include "splat/files/transform.h"

#include <cmath>
#include <numbers>

#include <catch2/catch.hpp>

#include "core/check.h"
#include "core/rotation.h"
#include "splat/files/sh_rotation.h"
#include "splat/reference/reference.h"
#include "splat/sh_basis.h"
#include "tests/support/measures.h"
#include "tests/support/splat_files.h"
#include "tests/support/splat_scenes.h"

namespace transform_test {

using namespace hsi4d;
using namespace hsi4d::test;
using Catch::Matchers::Message;

namespace {

std::vector<Matrix3<double>> rotations() {
  std::vector<Matrix3<double>> all = {Matrix3<double>::Identity()};
  for (const Vector3<double>& axis_angle :
       {Vector3<double>(std::numbers::pi / 2, 0, 0), Vector3<double>(0, 0, std::numbers::pi),
        Vector3<double>(0.3, -1.2, 2.5), Vector3<double>(1e-7, 2e-7, -3e-7), Vector3<double>(-2, 0.1, 0.7)})
    all.push_back(so3_exp(axis_angle));
  return all;
}

std::vector<Vector3<double>> directions() {
  std::vector<Vector3<double>> all = {{1, 0, 0}, {0, 1, 0}, {0, 0, -1}};
  for (int i = 0; i < 40; ++i)
    all.push_back(Vector3<double>(std::sin(1.7 * i), std::cos(2.3 * i + 1), std::sin(0.9 * i + 2)).normalized());
  return all;
}

/// Σ Y sh of Gaussian n, channel c, seen along r.
double seen(const Gaussians& g, Index n, int c, const Vector3<double>& r) {
  std::array<double, 16> basis{};
  sh_basis(g.sh_degree, r[0], r[1], r[2], basis.data());
  double sum = 0;
  for (int k = 0; k < g.sh_coefficients(); ++k)
    sum += basis[static_cast<std::size_t>(k)] *
           static_cast<double>(g.sh[static_cast<std::size_t>((n * g.sh_coefficients() + k) * 3 + c)]);
  return sum;
}

const Similarity kSome = {1.7, so3_exp(Vector3<double>(0.3, -1.2, 2.5)), {10, -20, 0.5}};

}  // namespace

TEST_CASE("the matrices that rotate harmonics rotate the basis, are orthogonal and a group") {
  double rotates = 0, orthogonal = 0, group = 0;
  const auto all = rotations();
  for (const Matrix3<double>& r : all) {
    const ShRotation d(r, 3);
    for (const Vector3<double>& direction : directions()) {
      std::array<double, 16> from{}, to{};
      const Vector3<double> turned = r * direction;
      sh_basis(3, direction[0], direction[1], direction[2], from.data());
      sh_basis(3, turned[0], turned[1], turned[2], to.data());
      for (int l = 0; l <= 3; ++l) {
        for (int i = 0; i < 2 * l + 1; ++i) {
          double sum = 0;
          for (int k = 0; k < 2 * l + 1; ++k) sum += d.entry(l, i, k) * from[static_cast<std::size_t>(l * l + k)];
          rotates = larger(rotates, std::fabs(sum - to[static_cast<std::size_t>(l * l + i)]));
        }
      }
    }
    for (const Matrix3<double>& other : all) {
      const ShRotation e(other, 3), product(r * other, 3);
      for (int l = 0; l <= 3; ++l) {
        for (int i = 0; i < 2 * l + 1; ++i) {
          for (int j = 0; j < 2 * l + 1; ++j) {
            double gram = 0, both = 0;
            for (int k = 0; k < 2 * l + 1; ++k) {
              gram += d.entry(l, k, i) * d.entry(l, k, j);
              both += d.entry(l, i, k) * e.entry(l, k, j);
            }
            orthogonal = larger(orthogonal, std::fabs(gram - (i == j ? 1 : 0)));
            group = larger(group, std::fabs(both - product.entry(l, i, j)));
          }
        }
      }
    }
  }
  CHECK(rotates < 1e-13);
  CHECK(orthogonal < 1e-12);
  CHECK(group < 1e-12);
}

TEST_CASE("degree 1 turns as a vector does") {
  const Matrix3<double> r = so3_exp(Vector3<double>(0.3, -1.2, 2.5));
  const ShRotation d(r, 1);
  // Y_1 = c (−y, z, −x)
  const std::array<int, 3> axis = {1, 2, 0};
  const std::array<double, 3> sign = {-1, 1, -1};
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t j = 0; j < 3; ++j)
      CHECK(std::fabs(d.entry(1, static_cast<int>(i), static_cast<int>(j)) - sign[i] * sign[j] * r(axis[i], axis[j])) <
            1e-15);
  }
}

TEST_CASE("a Gaussian that is turned shows in the turned direction what it showed before") {
  for (int degree = 0; degree <= 3; ++degree) {
    const Gaussians g = plain_gaussians(5, degree);
    for (const Matrix3<double>& r : rotations()) {
      const Gaussians turned = transformed(g, {2, r, {1, 2, 3}});
      double largest = 0;
      for (Index n = 0; n < g.count(); ++n) {
        for (const Vector3<double>& direction : directions()) {
          for (int c = 0; c < 3; ++c)
            largest = larger(largest, std::fabs(seen(turned, n, c, r * direction) - seen(g, n, c, direction)));
        }
      }
      CHECK(largest < 1e-6);
    }
  }
}

TEST_CASE("a similarity moves means, axes and the origin") {
  Gaussians g = plain_gaussians(20, 1);
  g.origin_world = {1000, -2000, 3e6};
  const Gaussians moved = transformed(g, kSome);
  for (Index n = 0; n < g.count(); ++n) {
    const auto world = [n](const Gaussians& of) {
      const float* m = of.means.data() + 3 * n;
      return Vector3<double>(of.origin_world + Vector3<double>(m[0], m[1], m[2]));
    };
    CHECK((world(moved) - transform_point(kSome, world(g))).norm() < 1e-6);  // although 3e6 m away
    const auto axes = [n](const Gaussians& of) {
      const float* q = of.quats.data() + 4 * n;
      Matrix3<double> m = quaternion_to_matrix(Vector4<double>(q[0], q[1], q[2], q[3]));
      for (int c = 0; c < 3; ++c)
        m.col(c) *= std::exp(static_cast<double>(of.log_scales[static_cast<std::size_t>(3 * n + c)]));
      return m;
    };
    const Matrix3<double> expected = kSome.scale * kSome.rotation * axes(g);
    CHECK((axes(moved) - expected).cwiseAbs().maxCoeff() < 1e-6 * expected.cwiseAbs().maxCoeff());
  }
  CHECK(moved.opacity_logits == g.opacity_logits);
}

TEST_CASE("without a rotation only what has to change does, and nothing at all by the identity") {
  const Gaussians g = plain_gaussians(9, 3);
  CHECK(same_numbers(transformed(g, {}), g));
  const Gaussians moved = transformed(g, {2, Matrix3<double>::Identity(), {1, 2, 3}});
  CHECK(moved.sh == g.sh);
  CHECK(moved.quats == g.quats);
  CHECK(moved.origin_world == Vector3<double>(1, 2, 3));
  for (std::size_t i = 0; i < g.means.size(); ++i) CHECK(moved.means[i] == 2 * g.means[i]);
}

TEST_CASE("similarities compose and have inverses") {
  const Similarity other = {0.3, so3_exp(Vector3<double>(-2, 0.1, 0.7)), {1, 2, 3}};
  const Vector3<double> point(0.7, -3, 11);
  CHECK((transform_point(compose(kSome, other), point) - transform_point(kSome, transform_point(other, point))).norm() <
        1e-13);
  CHECK((transform_point(inverse(kSome), transform_point(kSome, point)) - point).norm() < 1e-13);
  const Gaussians g = plain_gaussians(20, 3);
  const Gaussians both = transformed(g, compose(kSome, other)), one_by_one = transformed(transformed(g, other), kSome);
  CHECK((both.origin_world - one_by_one.origin_world).norm() < 1e-12);
  CHECK(largest_difference(both.means, one_by_one.means) < 1e-6);
  CHECK(largest_difference(both.log_scales, one_by_one.log_scales) < 1e-6);
  CHECK(largest_difference(both.sh, one_by_one.sh) < 1e-6);
  CHECK(largest_angle(both, one_by_one) < 1e-6);
  const Gaussians back = transformed(transformed(g, kSome), inverse(kSome));
  CHECK(back.origin_world.norm() < 1e-13);
  CHECK(largest_difference(back.means, g.means) < 1e-6);
  CHECK(largest_difference(back.log_scales, g.log_scales) < 1e-6);
  CHECK(largest_difference(back.sh, g.sh) < 1e-6);
  CHECK(largest_angle(back, g) < 1e-6);
}

TEST_CASE("what a camera that goes along sees does not change") {
  const SplatScene scene = random_splats(60, 3, {24, 18});
  const Gaussians g = scene.gaussians();
  const auto image = [&](const Gaussians& of, const Rigid<double>& camera_from_world) {
    reference::Scene<double> s;
    s.n = of.count();
    s.sh_coefficients = of.sh_coefficients();
    for (Index i = 0; i < 3 * of.count(); ++i)
      s.means.push_back(static_cast<double>(of.means[static_cast<std::size_t>(i)]) + of.origin_world[i % 3]);
    s.quats.assign(of.quats.begin(), of.quats.end());
    s.log_scales.assign(of.log_scales.begin(), of.log_scales.end());
    s.opacity_logits.assign(of.opacity_logits.begin(), of.opacity_logits.end());
    s.sh.assign(of.sh.begin(), of.sh.end());
    reference::Pinhole<double> p;
    p.width = scene.camera.width, p.height = scene.camera.height;
    p.fx = scene.camera.fx, p.fy = scene.camera.fy, p.cx = scene.camera.cx, p.cy = scene.camera.cy;
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 3; ++c)
        p.camera_from_world[static_cast<std::size_t>(4 * r + c)] = camera_from_world.rotation(r, c);
      p.camera_from_world[static_cast<std::size_t>(4 * r + 3)] = camera_from_world.translation[r];
    }
    RenderSettings settings;
    settings.alpha_min = 0;  // no edges, at which a rounding could show
    settings.transmittance_stop = 0;
    return reference::render(s, p, {0.1, 0.2, 0.3}, settings).color;
  };
  const Similarity s = {1, kSome.rotation, {0.5, -2, 1}};
  const Rigid<double>& camera = scene.camera.camera_from_world;
  const Rigid<double> moved_camera = compose(camera, inverse(Rigid<double>{s.rotation, s.translation}));
  const std::vector<double> before = image(g, camera), after = image(transformed(g, s), moved_camera);
  // With a scale, the camera's distances scale along; the blur is in pixels and stays.
  const Similarity larger = {3, s.rotation, s.translation};
  Rigid<double> far_camera = {camera.rotation * s.rotation.transpose(), Vector3<double>::Zero()};
  far_camera.translation = 3 * camera.translation - far_camera.rotation * s.translation;
  const std::vector<double> scaled = image(transformed(g, larger), far_camera);
  double difference = 0, scaled_difference = 0, contrast = 0;
  for (std::size_t i = 0; i < before.size(); ++i) {
    difference = test::larger(difference, std::fabs(after[i] - before[i]));
    scaled_difference = test::larger(scaled_difference, std::fabs(scaled[i] - before[i]));
    contrast = std::max(contrast, std::fabs(before[i] - before[i % 3]));
  }
  CHECK(contrast > 0.1);
  CHECK(difference < 1e-6);
  CHECK(scaled_difference < 1e-6);
}

TEST_CASE("a matrix that is no similarity is refused") {
  const auto fault = [](const Matrix4<double>& m) {
    try {
      similarity_from_matrix(m, "--matrix");
    } catch (const UserError& error) {
      return std::string(error.what());
    }
    return std::string("no fault");
  };
  Matrix4<double> m = Matrix4<double>::Identity();
  m.topLeftCorner<3, 3>() = kSome.scale * kSome.rotation;
  m.topRightCorner<3, 1>() = kSome.translation;
  const Similarity read = similarity_from_matrix(m, "--matrix");
  CHECK(std::fabs(read.scale - kSome.scale) < 1e-14);
  CHECK((read.rotation - kSome.rotation).cwiseAbs().maxCoeff() < 1e-14);
  CHECK(read.translation == kSome.translation);

  Matrix4<double> rounded = m;  // six digits, as people paste them
  for (int i = 0; i < 9; ++i) rounded(i / 3, i % 3) = std::round(m(i / 3, i % 3) * 1e6) / 1e6;
  const Similarity nearest = similarity_from_matrix(rounded, "--matrix");
  CHECK((nearest.rotation.transpose() * nearest.rotation - Matrix3<double>::Identity()).cwiseAbs().maxCoeff() < 1e-15);
  CHECK((nearest.rotation - kSome.rotation).cwiseAbs().maxCoeff() < 1e-6);

  Matrix4<double> bad = m;
  bad.col(0) *= -1;
  CHECK(fault(bad) ==
        "--matrix: the matrix mirrors (its determinant is negative), which Gaussians cannot follow: "
        "allowed are rotations with one scale");
  bad = m;
  bad.col(0) *= 1.01;
  CHECK(fault(bad) ==
        "--matrix: the matrix shears, or scales the axes differently; allowed are rotations with one scale");
  bad = m;
  bad(3, 0) = 0.1;
  CHECK(fault(bad) == "--matrix: the last row is not 0 0 0 1, so this is no similarity");
  bad = Matrix4<double>::Identity();
  bad.topLeftCorner<3, 3>().setZero();
  CHECK(fault(bad) == "--matrix: the matrix has no extent: its determinant is 0");
  bad = m;
  bad(0, 3) = NAN;
  CHECK(fault(bad) == "--matrix: a number is not finite");
  CHECK_THROWS_AS(transformed(Gaussians{}, {0, Matrix3<double>::Identity(), {0, 0, 0}}), InternalError);
  CHECK_THROWS_AS(transformed(Gaussians{}, {1, 2 * Matrix3<double>::Identity(), {0, 0, 0}}), InternalError);
  CHECK_THROWS_AS(transformed(Gaussians{}, {1, -Matrix3<double>::Identity(), {0, 0, 0}}), InternalError);
}

}  // namespace transform_test
