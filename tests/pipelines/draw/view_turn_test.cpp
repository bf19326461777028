#include "pipelines/draw/view_turn.h"

#include <Eigen/Geometry>
#include <catch2/catch.hpp>

#include "core/angles.h"
#include "core/rotation.h"
#include "tests/support/tiny_run.h"

namespace view_turn_test {

using namespace hsi4d;
using namespace hsi4d::test;

TEST_CASE("turns are those of objects, joints and the camera, against each other") {
  const Clip clip = read_clip(dataset_inputs(TinyDataset::folder()));
  const Matrix3<double>& camera = clip.first.camera_from_world.rotation;
  const Vector3<double> center = -(camera.transpose() * clip.first.camera_from_world.translation);
  CHECK(view_turn_deg(clip, clip.first, clip.first) == 0);
  SceneState turned = clip.first;
  const Vector3<double> view = center - turned.objects[0].translation;
  const Vector3<double> across = view.unitOrthogonal(), axis = view.normalized();
  const auto turn_object = [&](const Vector3<double>& about) {
    turned.objects[0].rotation = so3_log(Matrix3<double>(so3_exp(about) * so3_exp(clip.first.objects[0].rotation)));
    return view_turn_deg(clip, clip.first, turned);
  };
  CHECK(turn_object(20 * kDegree * across) == Approx(20));
  CHECK(turn_object(170 * kDegree * across) == Approx(170));
  CHECK(turn_object(20 * kDegree * axis) < 1e-5);  // about the line of sight
  turned = clip.first;
  turned.camera_from_world.rotation = so3_exp(Vector3<double>(0, 0.3, 0)) * camera;
  turned.camera_from_world.translation = -(turned.camera_from_world.rotation * center);
  CHECK(view_turn_deg(clip, clip.first, turned) < 1e-5);  // it looks elsewhere, from the same place
  turned.camera_from_world.translation += Vector3<double>(0.5, 0, 0);
  CHECK(view_turn_deg(clip, clip.first, turned) > 1);
  turned = clip.first;
  for (int i = 0; i < 3; ++i) turned.body.axis_angle[static_cast<std::size_t>(3 * 18 + i)] += 0.5;  // an elbow
  CHECK(view_turn_deg(clip, clip.first, turned) > 5);
}

}  // namespace view_turn_test
