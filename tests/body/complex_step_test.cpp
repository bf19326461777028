// Operators of body against complex steps of formulas that are written down here a second time.
#include <array>

#include "body/blend_shapes.h"
#include "body/canonical_directions.h"
#include "body/kinematics.h"
#include "body/natural_pose.h"
#include "body/skinning.h"
#include "core/rotation.h"
#include "tests/support/complex_formulas.h"
#include "tests/support/complex_step_check.h"
#include "tests/support/random_numbers.h"

namespace complex_step_test {

using namespace hsi4d;
using namespace hsi4d::test;

namespace {

using V = Var<double>;
using Vars = std::vector<V>;

constexpr std::size_t kPoints = 9, kJoints = 4, kWeights = 3;

/// Three joints a point, in both forms.
struct Weights {
  SparseWeights sparse{kPoints, kJoints, kWeights, {}, {}};
  DenseWeights dense{kPoints, kJoints, std::vector<double>(kPoints* kJoints, 0.0)};

  Weights() {
    for (std::size_t v = 0; v < kPoints; ++v) {
      for (std::size_t k = 0; k < kWeights; ++k) {
        const std::size_t joint = (v + k) % kJoints;
        const double weight = std::array{0.5, 0.3, 0.2}[k];
        sparse.indices.push_back(static_cast<std::int32_t>(joint));
        sparse.weights.push_back(weight);
        dense.weights[v * kJoints + joint] = weight;
      }
    }
  }
};

/// Σ_j w_vj A_j, [V,12].
Complexes blended(const Weights& weights, const Complexes& transforms) {
  Complexes y(12 * kPoints, 0);
  for (std::size_t v = 0; v < kPoints; ++v) {
    for (std::size_t j = 0; j < kJoints; ++j) {
      for (std::size_t i = 0; i < 12; ++i)
        y[12 * v + i] += weights.dense.weights[v * kJoints + j] * transforms[12 * j + i];
    }
  }
  return y;
}

/// A_n (x_n, 1) of rows.
Complexes moved_points(const Complexes& transforms, const Complexes& points) {
  Complexes y;
  for (std::size_t n = 0; n < points.size() / 3; ++n) {
    for (std::size_t r = 0; r < 3; ++r) {
      const Complex* const row = &transforms[12 * n + 4 * r];
      y.push_back(row[0] * points[3 * n] + row[1] * points[3 * n + 1] + row[2] * points[3 * n + 2] + row[3]);
    }
  }
  return y;
}

Matrix3<Complex> matrix_at(const Complexes& x, std::size_t row) {
  Matrix3<Complex> m;
  for (int i = 0; i < 9; ++i) m(i / 3, i % 3) = x[9 * row + static_cast<std::size_t>(i)];
  return m;
}
Vector3<Complex> vector_at(const Complexes& x, std::size_t row) { return {x[3 * row], x[3 * row + 1], x[3 * row + 2]}; }

/// R − I by rows.
Complexes offsets_of(const Matrix3<Complex>& r) {
  Complexes y;
  for (int i = 0; i < 9; ++i) y.push_back(r(i / 3, i % 3) - (i % 4 == 0 ? 1.0 : 0.0));
  return y;
}

/// Transforms and joints of a skeleton.
std::array<Complexes, 2> plain_chain(const ComplexInputs& in, const std::vector<int>& parents) {
  const std::size_t joints = parents.size();
  std::vector<Matrix3<Complex>> turn(joints);
  std::vector<Vector3<Complex>> place(joints);
  std::array<Complexes, 2> out;
  for (std::size_t j = 0; j < joints; ++j) {
    const Vector3<Complex> rest = vector_at(in[2], j);
    const auto parent = static_cast<std::size_t>(parents[j]);
    turn[j] = matrix_at(in[0], j);
    place[j] = rest;
    if (j > 0) {
      turn[j] = turn[parent] * turn[j];
      place[j] = place[parent] + turn[parent] * Vector3<Complex>(rest - vector_at(in[2], parent));
    }
    const Vector3<Complex> transl = vector_at(in[1], 0), shift = place[j] - turn[j] * rest + transl;
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 3; ++c) out[0].push_back(turn[j](r, c));
      out[0].push_back(shift[r]);
      out[1].push_back(place[j][r] + transl[r]);
    }
  }
  return out;
}

/// joint_limit_excess of rotations [21,9].
void check_excess(const std::vector<double>& matrices) {
  check_complex_step(
      {{"rotations", shape_of(21, 9), 0, 0, matrices}}, [](const Vars& in) { return joint_limit_excess(in[0]); },
      [](const ComplexInputs& in) {
        Complexes y;
        for (std::size_t n = 0; n < 21; ++n) y.push_back(plain_excess(matrix_at(in[0], n), natural_joints()[n]));
        return y;
      },
      {.tolerance = 1e-11});
}

}  // namespace

TEST_CASE("skinning has the gradients of complex steps") {
  const Weights weights;
  const SkinWeights<double> sparse(weights.sparse), dense(weights.dense);
  const OperatorInput transforms{"transforms", shape_of(kJoints, 12)}, points{"points", shape_of(kPoints, 3)};
  for (const SkinWeights<double>& w : {sparse, dense}) {
    check_complex_step(
        {transforms, points, {"transl", shape_of(1, 3)}},
        [&](const Vars& in) { return skin_points(w, in[0], in[1], in[2]); },
        [&](const ComplexInputs& in) {
          Complexes y = moved_points(blended(weights, in[0]), in[1]);
          for (std::size_t i = 0; i < y.size(); ++i) y[i] += in[2][i % 3];
          return y;
        });
    check_complex_step(
        {transforms}, [&](const Vars& in) { return blend_transforms(w, in[0]); },
        [&](const ComplexInputs& in) { return blended(weights, in[0]); });
  }
  const std::vector<OperatorInput> framed = {transforms, points, {"frames", shape_of(kPoints, 9)}};
  check_complex_step(
      framed, [&](const Vars& in) { return skin_frames(sparse, in[0], in[1], in[2]).frames; },
      [&](const ComplexInputs& in) {
        const Complexes b = blended(weights, in[0]);
        Complexes y;
        for (std::size_t v = 0; v < kPoints; ++v) {
          Matrix3<Complex> linear;
          for (int i = 0; i < 9; ++i) linear(i / 3, i % 3) = b[12 * v + static_cast<std::size_t>(4 * (i / 3) + i % 3)];
          const Matrix3<Complex> m = linear * matrix_at(in[2], v);
          for (int i = 0; i < 9; ++i) y.push_back(m(i / 3, i % 3));
        }
        return y;
      });
  check_complex_step(
      {{"transforms", shape_of(5, 12)}, {"points", shape_of(5, 3)}},
      [](const Vars& in) { return transform_points(in[0], in[1]); },
      [](const ComplexInputs& in) { return moved_points(in[0], in[1]); });
}

TEST_CASE("the kinematic chain has the gradients of complex steps") {
  const std::vector<int> parents = {-1, 0, 1, 1, 3, 0};
  const std::vector<OperatorInput> inputs = {
      {"rotations", shape_of(6, 9)}, {"transl", shape_of(1, 3)}, {"rest_joints", shape_of(6, 3)}};
  for (const std::size_t output : {0, 1}) {
    check_complex_step(
        inputs,
        [&](const Vars& in) {
          const PosedSkeleton<double> posed = kinematic_chain(in[0], in[1], parents, in[2]);
          return output == 0 ? posed.transforms : posed.joints;
        },
        [&](const ComplexInputs& in) { return plain_chain(in, parents)[output]; });
  }
}

TEST_CASE("blend shapes and pose correctives have the gradients of complex steps") {
  constexpr std::size_t kVertices = 40;
  RandomNumbers random(3);
  const std::vector<double> rest = random.numbers(3 * kVertices, 1), shape = random.numbers(3 * kVertices * 4, 0.3),
                            poses = random.numbers(3 * kVertices * 18, 0.3);
  const Directions<double> directions(DirectionSource{shape, kVertices, 4, {0}, 4});
  const auto with_directions = [](Complexes y, const std::vector<double>& p, const Complexes& c) {
    for (std::size_t i = 0; i < y.size(); ++i) {
      for (std::size_t k = 0; k < c.size(); ++k) y[i] += p[i * c.size() + k] * c[k];
    }
    return y;
  };
  check_complex_step(
      {{"betas", shape_of(1, 4)}},
      [&](const Vars& in) {
        const std::array<BlendTerm<double>, 1> terms = {{{directions, in[0]}}};
        return blend_shapes(rest, std::span<const BlendTerm<double>>(terms));
      },
      [&](const ComplexInputs& in) { return with_directions(Complexes(rest.begin(), rest.end()), shape, in[0]); });
  const PoseDirections<double> correctives(poses, kVertices, 1, 2);
  check_complex_step(
      {{"offsets", shape_of(2, 9)}, {"points", shape_of(kVertices, 3)}},
      [&](const Vars& in) { return pose_correctives(correctives, in[0], in[1]); },
      [&](const ComplexInputs& in) { return with_directions(in[1], poses, in[0]); });
}

TEST_CASE("functions of poses have the gradients of complex steps") {
  check_complex_step(
      {{"axis_angle", shape_of(5, 3), -2, 2}}, [](const Vars& in) { return rotation_offsets_from_axis_angle(in[0]); },
      [](const ComplexInputs& in) {
        Complexes y;
        for (std::size_t n = 0; n < 5; ++n) {
          const Complexes row = offsets_of(so3_exp(vector_at(in[0], n)));
          y.insert(y.end(), row.begin(), row.end());
        }
        return y;
      });
  check_complex_step(
      {{"rotations", shape_of(5, 9)}}, [](const Vars& in) { return rotation_offsets(in[0]); },
      [](const ComplexInputs& in) {
        Complexes y;
        for (std::size_t n = 0; n < 5; ++n) {
          const Complexes row = offsets_of(matrix_at(in[0], n));
          y.insert(y.end(), row.begin(), row.end());
        }
        return y;
      });
  std::vector<double> matrices;
  RandomNumbers random(4);
  const std::vector<double> axis_angle = random.numbers(63, 1.5);
  for (std::size_t j = 0; j < 21; ++j) {
    const Matrix3<double> r = so3_exp(Vector3<double>(axis_angle[3 * j], axis_angle[3 * j + 1], axis_angle[3 * j + 2]));
    for (int i = 0; i < 9; ++i) matrices.push_back(r(i / 3, i % 3));
  }
  check_excess(matrices);
  // Its last operator is turn_rows, by which the pose at ease is put before.
  check_complex_step(
      {{"latents", shape_of(1, 63)}}, [](const Vars& in) { return natural_decode(in[0]); },
      [](const ComplexInputs& in) {
        constexpr double kRadians = 3.14159265358979323846 / 180;
        Complexes y;
        for (std::size_t j = 0; j < 21; ++j) {
          const NaturalJoint& joint = natural_joints()[j];
          Vector3<Complex> w = vector_at(in[0], j);
          for (int i = 0; i < 3; ++i) w[i] *= joint.spread[i] * kRadians;
          const Matrix3<double> ease = so3_exp(Vector3<double>(Vector3<double>(joint.ease) * kRadians));
          const Matrix3<Complex> r = ease.cast<Complex>() * so3_exp(w);
          for (int i = 0; i < 9; ++i) y.push_back(r(i / 3, i % 3));
        }
        return y;
      });
  check_complex_step(
      {{"transforms", shape_of(6, 12)}, {"points", shape_of(6, 3), 2, 3}, {"center", shape_of(1, 3)}},
      [](const Vars& in) { return canonical_directions(in[0], in[1], in[2]); },
      [](const ComplexInputs& in) {
        Complexes y;
        for (std::size_t n = 0; n < 6; ++n) {
          Matrix3<Complex> linear;
          for (int i = 0; i < 9; ++i)
            linear(i / 3, i % 3) = in[0][12 * n + static_cast<std::size_t>(4 * (i / 3) + i % 3)];
          const Vector3<Complex> w = linear.transpose() * Vector3<Complex>(vector_at(in[1], n) - vector_at(in[2], 0));
          const Complex length = std::sqrt(dot(w, w));
          for (int i = 0; i < 3; ++i) y.push_back(w[i] / length);
        }
        return y;
      });
}

TEST_CASE("excess beyond ranges has the gradients of complex steps on both sides of where its series ends") {
  // The slope of the swing is a series where tan(swing/2) ≤ 0.1, up to 11.42°. Knees may be bent 8° the wrong way and
  // elbows 10°, so that these joints alone are beyond their ranges there.
  constexpr double kRadians = 3.14159265358979323846 / 180;
  std::vector<double> swings;
  for (const double degrees : {8.5, 9.0, 9.7, 10.3, 11.0, 11.4, 11.45, 12.0, 14.0})
    swings.push_back(degrees * kRadians);
  for (const double beside : {-1e-3, -1e-9, 1e-9, 1e-3}) swings.push_back(2 * std::atan(0.1) * (1 + beside));
  for (const double swing : swings) {
    INFO("swings of " << swing / kRadians << " degrees");
    std::vector<double> matrices;
    for (const NaturalJoint& joint : natural_joints()) {
      const std::string name = joint.name;
      Vector3<double> across(0.3, 0.2, 0.1), along = Vector3<double>::Zero();
      if (name.ends_with("knee")) across = {-1, 0, 0.05};
      if (name.ends_with("elbow")) across = {0, name.starts_with("left") ? 1.0 : -1.0, 0.05};
      across[joint.twist_axis] = 0;
      along[joint.twist_axis] = 0.1;
      const Matrix3<double> r = so3_exp(Vector3<double>(swing * across.normalized())) * so3_exp(along);
      for (int i = 0; i < 9; ++i) matrices.push_back(r(i / 3, i % 3));
    }
    check_excess(matrices);
  }
}

}  // namespace complex_step_test
