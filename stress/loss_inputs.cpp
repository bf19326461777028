#include "stress/loss_inputs.h"

#include <array>
#include <cmath>
#include <memory>

#include "autodiff/matrix.h"
#include "body/body_model.h"
#include "body/pose_layout.h"
#include "core/random.h"
#include "core/rotation.h"
#include "stress/tape_numbers.h"

namespace hsi4d::stress {

namespace {

/// What the motion's start points to.
struct StillLife {
  Avatar avatar;
  std::array<Gaussians, kLossObjects> objects;
  Gaussians floor;
  MotionStart start;

  StillLife() {
    add_body();
    add_floor();
    RandomSequence random(85);
    for (Gaussians& object : objects) {
      object.opacity_logits.resize(kLossObjectRows);
      for (Index i = 0; i < 3 * kLossObjectRows; ++i)
        object.means.push_back(static_cast<float>(random.uniform(-0.03, 0.03)));
      start.objects.push_back(&object);
    }
    start.avatar = &avatar;
    start.scene = &floor;
    start.first_camera_center = {0, 0, 1.5};
    start.still_frames = kLossStill;
    for (Index t = 0; t < kLossFrames; ++t) {
      const double x = 0.01 * static_cast<double>(t);
      start.body.push_back(shifted(x));
      start.world_from_object.push_back(
          {{Matrix3<double>::Identity(), {x, 0, 0}}, {Matrix3<double>::Identity(), {3, 0, 0}}});
    }
    start.first_body = shifted(0);
    start.contacts = {
        {.frame = kLossStill, .joints = {smplx_joint("right_wrist")}, .object = 0},
        {.frame = kLossStill, .joints = {smplx_joint("left_foot")}, .place = Vector3<double>(0.1, 0, -0.2)}};
  }

 private:
  /// Every joint has a Gaussian at least.
  void add_body() {
    RandomSequence random(84);
    SparseWeights& weights = avatar.weights;
    weights.vertices = kLossBodyRows;
    weights.joints = kSmplxJoints;
    weights.per_vertex = 1;
    for (Index v = 0; v < kLossBodyRows; ++v) {
      weights.indices.push_back(static_cast<std::int32_t>(v % kSmplxJoints));
      weights.weights.push_back(1);
      for (int i = 0; i < 3; ++i) avatar.means.push_back(static_cast<float>(random.uniform(-0.04, 0.04)));
    }
  }
  /// Opaque discs that lie in a plane.
  void add_floor() {
    for (int i = 0; i < 400; ++i) {
      for (const double x : {0.1 * (i % 20) - 0.95, 0.1 * (i / 20) - 0.95, -0.2})
        floor.means.push_back(static_cast<float>(x));
      floor.quats.insert(floor.quats.end(), {1, 0, 0, 0});
      for (const double scale : {0.066, 0.066, 0.0033}) floor.log_scales.push_back(static_cast<float>(std::log(scale)));
      floor.opacity_logits.push_back(5);
      floor.sh.insert(floor.sh.end(), {0, 0, 0});
    }
  }
  static PosedJoints shifted(double x) {
    PosedJoints posed;
    for (Index j = 0; j < kSmplxJoints; ++j) {
      posed.transforms.insert(posed.transforms.end(), {1, 0, 0, x, 0, 1, 0, 0, 0, 0, 1, 0});
      posed.joints.insert(posed.joints.end(), {x, 0, 0});
    }
    return posed;
  }
};

/// Makes leaves, and keeps a list of them.
template <class S>
struct LeafMaker {
  Tape<S>& tape;
  std::vector<Var<S>>& leaves;
  RandomSequence random{86};

  Var<S> operator()(const char* name, const Shape& shape, double low, double high) {
    std::vector<double> numbers;
    for (Index i = 0; i < shape.count(); ++i) numbers.push_back(random.uniform(low, high));
    return operator()(name, shape, numbers);
  }
  Var<S> operator()(const char* name, const Shape& shape, const std::vector<double>& numbers) {
    return leaves.emplace_back(leaf(tape, name, shape, numbers));
  }
};

/// Depths of pixels, metres, and a map that is not far from them.
std::vector<double> some_depths(double scale, double shift, double noise) {
  std::vector<double> depths;
  for (Index i = 0; i < kLossHeight * kLossWidth; ++i) {
    const auto at = static_cast<double>(i);
    depths.push_back(scale * (2 + std::sin(0.7 * at)) + shift + noise * std::sin(0.9 * at * at));
  }
  return depths;
}

std::vector<double> some_pose() {
  std::vector<double> rows;
  for (int j = 0; j < 21; ++j) {
    const double size = 0.4 + 0.1 * j;
    const Matrix3<double> r = so3_exp(Vector3<double>(size * std::sin(1.0 + j), size * std::cos(2.0 * j), -0.3 * size));
    for (int i = 0; i < 9; ++i) rows.push_back(r(i / 3, i % 3));
  }
  return rows;
}

}  // namespace

template <class S>
LossLeaves<S> loss_leaves(Tape<S>& tape) {
  LossLeaves<S> made;
  LeafMaker<S> leaf{tape, made.leaves};
  LossInputs<S>& in = made.inputs;
  const auto image = [](Index planes) { return image_shape<S>(planes, kLossHeight, kLossWidth); };
  in.rendered = leaf("rendered", image(3), 0, 1);
  in.target = leaf("target", image(3), 0, 1);
  in.weight = leaf("weight", image(1), 0, 1);
  in.object_opacity = leaf("object_opacity", image(kLossObjects), 0, 1);
  in.object_center_target = leaf("object_center_target", shape_of(kLossObjects, 3), {4.5, 6, 1, 12.25, 3.5, 1});
  in.object_masks = leaf("object_masks", image(kLossObjects), 0, 1);
  in.object_seen = leaf("object_seen", {kLossObjects, 1, 1, 1}, {1, 1});
  in.object_depth = leaf("object_depth", shape_of(kLossObjects, 1), 1, 3);
  in.object_depth_target = leaf("object_depth_target", shape_of(kLossObjects, 1), 1, 3);
  in.human_opacity = leaf("human_opacity", image(1), 0, 1);
  in.human_mask = leaf("human_mask", image(1), 0, 1);
  in.human_seen = leaf("human_seen", kScalarShape, {1});
  in.gaussian_opacities = leaf("gaussian_opacities", shape_of(9, 1), 0, 1);
  in.gaussian_log_scales = leaf("gaussian_log_scales", shape_of(9, 3), -4, 0);
  in.color_change = leaf("color_change", shape_of(9, 3), -0.5, 0.5);
  in.shape_change = leaf("shape_change", shape_of(9, 7), -1, 1);
  in.depth_moments = leaf("depth_moments", image(2), 0.2, 0.3);
  in.transmittance = leaf("transmittance", image(1), 0, 0.5);
  in.depth_target = leaf("depth_target", image(1), 1, 2);
  in.keypoints = leaf("keypoints", shape_of(3, 2), 0, 60);
  in.keypoints_target = leaf("keypoints_target", shape_of(3, 3), {3, 5, 1, 40, 9, 0.5, 22, 31, 0.8});
  in.bones = leaf("bones", shape_of(3, 3), {0.1, -0.3, 0.05, 0, 0.4, 0.2, -0.3, 0, 0.1});
  in.bones_target = leaf("bones_target", shape_of(3, 4), {0, -1, 0, 1, 0, 0.6, 0.8, 0.7, 1, 0, 0, 0.9});
  in.tracks = leaf("tracks", shape_of(3, 2), 0, 20);
  in.tracks_target = leaf("tracks_target", shape_of(3, 3), {3, 5, 1, 14, 9, 0.6, 12, 3, 0.8});
  in.depth = leaf("depth", image(1), some_depths(1, 0, 0));
  in.depth_map = leaf("depth_map", image(1), some_depths(1.3, -2.7, 0.5));
  in.depth_map_weight = leaf("depth_map_weight", image(1), 0.2, 1);
  in.unknowns = leaf("unknowns", shape_of(1, 3), -0.2, 0.2);
  in.body_rotations = leaf("body_rotations", shape_of(21, 9), some_pose());
  in.joints = leaf("joints", shape_of(kLossFrames, 66), -1, 1);
  in.joints_start = leaf("joints_start", shape_of(kLossFrames, 66), -1, 1);
  in.joints_after = leaf("joints_after", shape_of(2, 66), -1, 1);
  static const StillLife still_life;
  in.motion = std::shared_ptr<const MotionStart>(&still_life.start, [](const MotionStart*) {});
  constexpr Index kMoving = kLossFrames - kLossStill;
  const Var<S> body = leaf("body_places", shape_of(kMoving * kLossBodyRows, 3), -0.3, 0.3);
  const Var<S> objects = leaf("object_places", shape_of(kMoving * kLossObjects * kLossObjectRows, 3), -0.3, 0.3);
  in.body_points = [body](const std::vector<BodyPoint>& points) {
    std::vector<std::uint32_t> rows;
    for (const BodyPoint& p : points)
      rows.push_back(static_cast<std::uint32_t>((p.frame - kLossStill) * kLossBodyRows + p.row));
    return gather_rows(body, rows);
  };
  in.object_points = [objects](const std::vector<ObjectPoint>& points) {
    std::vector<std::uint32_t> rows;
    for (const ObjectPoint& p : points)
      rows.push_back(
          static_cast<std::uint32_t>(((p.frame - kLossStill) * kLossObjects + p.object) * kLossObjectRows + p.row));
    return gather_rows(objects, rows);
  };
  return made;
}

template LossLeaves<float> loss_leaves(Tape<float>&);
template LossLeaves<double> loss_leaves(Tape<double>&);

}  // namespace hsi4d::stress
