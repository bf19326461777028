// A short motion of a human of a few Gaussians beside two objects, for terms that look at one.
#pragma once

#include <array>

#include "body/body_model.h"
#include "core/random.h"
#include "optim/motion_start.h"
#include "tests/optim/solid/surface_of_test.h"

namespace hsi4d::test {

/// Frames, of which the first stand; Gaussians of the human and of each object; vertices of its body.
inline constexpr Index kFrames = 5, kStill = 2, kBodyRows = 60, kObjectRows = 30, kVertexRows = 110;

/// A human of a few Gaussians, each on one joint (every joint has one at least), on a body of which each vertex follows
/// two, and two objects: the first is at its right hand.
struct MotionOfTest {
  Avatar avatar;
  BodyModel body;
  std::array<Gaussians, 2> objects;
  Gaussians scene;  // a floor
  MotionStart start;

  MotionOfTest() {
    RandomSequence random(5);
    SparseWeights& weights = avatar.weights;
    weights.vertices = kBodyRows;
    weights.joints = kSmplxJoints;
    weights.per_vertex = 1;
    for (Index v = 0; v < kBodyRows; ++v) {
      weights.indices.push_back(static_cast<std::int32_t>(v % kSmplxJoints));
      weights.weights.push_back(1);
      for (int i = 0; i < 3; ++i) avatar.means.push_back(static_cast<float>(random.uniform(-0.04, 0.04)));
    }
    body.weights = {.vertices = kVertexRows, .joints = kSmplxJoints, .per_vertex = 2, .indices = {}, .weights = {}};
    RandomSequence of_vertices(6);
    for (Index v = 0; v < kVertexRows; ++v) {
      for (const Index joint : {v % kSmplxJoints, (v + 1) % kSmplxJoints})
        body.weights.indices.push_back(static_cast<std::int32_t>(joint));
      for (const double weight : {0.75, 0.25}) body.weights.weights.push_back(weight);
      for (int i = 0; i < 3; ++i) body.vertices.push_back(static_cast<float>(of_vertices.uniform(-0.04, 0.04)));
    }
    for (std::size_t o = 0; o < objects.size(); ++o) {
      objects[o].opacity_logits.resize(kObjectRows);
      for (Index i = 0; i < 3 * kObjectRows; ++i)
        objects[o].means.push_back(static_cast<float>(random.uniform(-0.03, 0.03)));
      start.objects.push_back(&objects[o]);
    }
    add_sheet(scene, {-1, -1, -0.2}, {2, 0, 0}, {0, 2, 0}, 0.1);
    start.scene = &scene;
    start.first_camera_center = {0, 0, 1.5};
    start.avatar = &avatar;
    start.mesh = &body;
    start.still_frames = kStill;
    for (Index t = 0; t < kFrames; ++t) {
      start.body.push_back(shifted(0.01 * static_cast<double>(t)));
      start.world_from_object.push_back({{Matrix3<double>::Identity(), {0.01 * static_cast<double>(t), 0, 0}},
                                         {Matrix3<double>::Identity(), {3, 0, 0}}});
    }
    start.first_body = shifted(0);
    start.contacts = {{.frame = 2, .joints = {smplx_joint("right_wrist")}, .object = 0},
                      {.frame = 2,
                       .joints = {smplx_joint("left_foot"), smplx_joint("left_ankle")},
                       .place = Vector3<double>(0.01, 0.02, -0.2),
                       .weight = 0.5},
                      {.frame = 4,
                       .joints = {smplx_joint("head")},
                       .object = 1,
                       .place = Vector3<double>(-0.02, 0.01, 0.03),
                       .weight = 2}};
  }
  /// All joints at the same place.
  static PosedJoints shifted(double x) {
    PosedJoints posed;
    for (Index j = 0; j < kSmplxJoints; ++j) {
      posed.transforms.insert(posed.transforms.end(), {1, 0, 0, x, 0, 1, 0, 0, 0, 0, 1, 0});
      posed.joints.insert(posed.joints.end(), {x, 0, 0});
    }
    return posed;
  }
};

inline const MotionOfTest& motion_of_test() {
  static const MotionOfTest motion;
  return motion;
}

}  // namespace hsi4d::test
