#include "splat/render/camera_center.h"

#include "core/rigid.h"
#include "tests/support/operator_check.h"

namespace camera_center_test {

using namespace hsi4d;
using namespace hsi4d::test;

namespace {

SplatView some_view() {
  SplatView view;
  view.camera = {64, 48, 60, 61, 31, 25, look_at({3, -2, 1.5}, {0, 0.3, 1})};
  view.origin_world = {10, -20, 30};
  return view;
}

}  // namespace

TEST_CASE("the centre of a moved camera passes the operator checks") {
  check_operator("camera_center", {{"xi", shape_of(1, 6)}},
                 [view = some_view()](const auto& in) { return camera_center(in[0], view); });
}

TEST_CASE("the centre of a moved camera is where its transform takes the camera's origin from") {
  const SplatView view = some_view();
  const Vector6<double> xi = (Vector6<double>() << 0.3, -0.2, 0.5, 0.4, 1.1, -0.7).finished();
  Tape<double> tape;
  const Var<double> update = tape.constant("xi", shape_of(1, 6));
  tape.set(update, std::span<const double>(xi.data(), 6));
  const Var<double> center = camera_center(update, view);
  tape.forward(center);
  const Rigid<double> moved = se3_update(xi, view.camera.camera_from_world);
  const Vector3<double> found = Vector3<double>(tape.value(center).data) + view.origin_world;
  CHECK(transform_point(moved, found).norm() < 1e-13);
}

}  // namespace camera_center_test
