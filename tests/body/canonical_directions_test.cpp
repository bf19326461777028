#include "body/canonical_directions.h"

#include <cmath>

#include "core/random.h"
#include "core/rotation.h"
#include "tests/support/operator_check.h"

namespace canonical_directions_test {

using namespace hsi4d;
using namespace hsi4d::test;

namespace {

/// Transform, point and camera's centre of one row.
template <class S>
Vector3<double> direction_of_one(const std::vector<S>& transform, const std::vector<S>& point,
                                 const std::vector<S>& center, std::vector<S>* d_transform = nullptr) {
  Tape<S> tape;
  const Var<S> t = tape.parameter("transforms", shape_of(1, 12)), p = tape.parameter("points", shape_of(1, 3)),
               c = tape.parameter("center", shape_of(1, 3));
  tape.set(t, transform);
  tape.set(p, point);
  tape.set(c, center);
  const Var<S> v = canonical_directions(t, p, c);
  tape.forward(v);
  if (d_transform != nullptr) {
    tape.backward(v, std::vector<S>{S(1), S(1), S(1)});
    d_transform->assign(tape.gradient(t).data, tape.gradient(t).data + 12);
  }
  const ConstArray<S> value = tape.value(v);
  return {static_cast<double>(value.data[0]), static_cast<double>(value.data[1]), static_cast<double>(value.data[2])};
}

}  // namespace

TEST_CASE("canonical directions pass the operator checks", "[parallel]") {
  for (const Index rows : {7, 1500}) {
    OperatorCheck options;
    options.entries = rows > 100 ? 6 : 64;
    check_operator(
        "canonical_directions",
        {{"transforms", shape_of(rows, 12)}, {"points", shape_of(rows, 3), 2, 3}, {"center", shape_of(1, 3)}},
        [](const auto& in) { return canonical_directions(in[0], in[1], in[2]); }, options);
  }
}

TEST_CASE("a direction turns back with the body: moving body and camera together changes nothing") {
  RandomSequence random(2);
  for (int i = 0; i < 50; ++i) {
    const Vector3<double> rest(random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(-1, 1));
    const Vector3<double> eye(random.uniform(2, 4), random.uniform(-1, 1), random.uniform(-1, 1));
    const Matrix3<double> turn = so3_exp(Vector3<double>(random.normal(), random.normal(), random.normal()));
    const Vector3<double> move(random.normal(), random.normal(), random.normal());
    std::vector<double> transform(12);
    for (Index r = 0; r < 3; ++r) {
      for (Index c = 0; c < 3; ++c) transform[static_cast<std::size_t>(4 * r + c)] = turn(r, c);
      transform[static_cast<std::size_t>(4 * r + 3)] = move[r];
    }
    const Vector3<double> point = turn * rest + move, center = turn * eye + move;
    const Vector3<double> v =
        direction_of_one<double>(transform, {point[0], point[1], point[2]}, {center[0], center[1], center[2]});
    CHECK((v - (rest - eye).normalized()).norm() < 1e-14);
  }
}

TEST_CASE("canonical directions are finite where there is none") {
  const std::vector<float> identity = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};
  const std::vector<float> singular(12, 0.0F);
  std::vector<float> d_transform;
  CHECK(direction_of_one<float>(identity, {1, 2, 3}, {1, 2, 3}, &d_transform) == Vector3<double>(0, 0, 1));
  for (const float d : d_transform) CHECK(d == 0);
  CHECK(direction_of_one<float>(singular, {1, 2, 3}, {0, 0, 0}, &d_transform) == Vector3<double>(0, 0, 1));
  for (const float d : d_transform) CHECK(d == 0);
  const Vector3<double> far = direction_of_one<float>(identity, {1e30F, 0, 0}, {0, 0, 0});
  CHECK(far == Vector3<double>(1, 0, 0));
}

TEST_CASE("a point whose transform is no number keeps the camera's gradient as it is without it") {
  const auto d_center = [](double bad) {
    Tape<double> tape;
    const Var<double> t = tape.parameter("transforms", shape_of(2, 12)), p = tape.parameter("points", shape_of(2, 3)),
                      c = tape.parameter("center", shape_of(1, 3));
    tape.set(t, {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, bad, 0, 0, 0, 0, bad, 0, 0, 0, 0, bad, 0});
    tape.set(p, {1, 2, 3, 3, 2, 1});
    const Var<double> v = canonical_directions(t, p, c);
    tape.forward(v);
    tape.backward(v, std::vector<double>{1, 2, 0, 2, 0, 1});
    const ConstArray<double> d = tape.gradient(c);
    return std::vector<double>(d.data, d.data + 3);
  };
  const std::vector<double> without = d_center(0);  // a singular one has no direction either
  CHECK(d_center(std::nan("")) == without);
  CHECK(d_center(HUGE_VAL) == without);
}

}  // namespace canonical_directions_test
