// L = mean over adjacent frames, some of which move, over the objects, and over six places on each, of |Δᵏ x|², m²:
// Δ x = x_{t+1} − x_t with `order` 1; 2 asks for steps that are alike, 3 for their changes to be. The places are the
// centres of the object's Gaussians that lie furthest along each of its axes, so that a turn counts as a move does.
// With `free` what exceeds that alone, of the squares.
#include <algorithm>
#include <cmath>

#include "autodiff/elementwise.h"
#include "autodiff/matrix.h"
#include "autodiff/reduce.h"
#include "optim/losses/list.h"

namespace hsi4d {

namespace {

struct ObjectSmoothSettings {
  int order = 2;
  double free = 0;  // m/s^order
};

void describe(ConfigFields& fields, ObjectSmoothSettings& settings) {
  fields.integer("order", settings.order, {.min = 1, .max = 3},
                 "Of the differences between frames: 1 steps, 2 changes of steps, 3 changes of these");
  fields.number("free", settings.free, {.min = 0, .max = 1e6},
                "What costs nothing: m/s with order 1, m/s^2 with 2, m/s^3 with 3");
}

/// The Gaussians that lie furthest along an object's axes, to both sides: six, of which some may be the same.
std::vector<Index> outermost(const Gaussians& object) {
  std::vector<Index> rows;
  for (Index axis = 0; axis < 3; ++axis) {
    Index least = 0, most = 0;
    for (Index n = 1; n < object.count(); ++n) {
      const auto at = [&object, axis](Index row) { return object.means[static_cast<std::size_t>(3 * row + axis)]; };
      if (at(n) < at(least)) least = n;
      if (at(n) > at(most)) most = n;
    }
    rows.insert(rows.end(), {least, most});
  }
  return rows;
}

/// The outermost Gaussians of all objects in frames [begin, end), frame by frame.
std::vector<ObjectPoint> outermost_points(const MotionStart& motion, Index begin, Index end) {
  std::vector<ObjectPoint> of_frame, points;
  for (Index o = 0; o < std::ssize(motion.objects); ++o) {
    for (const Index row : outermost(*motion.objects[static_cast<std::size_t>(o)])) of_frame.push_back({0, o, row});
  }
  for (Index t = begin; t < end; ++t) {
    for (ObjectPoint point : of_frame) {
      point.frame = t;
      points.push_back(point);
    }
  }
  return points;
}

/// Where they were when the stage began: in frames that stand, and in those that follow.
template <class S>
Var<S> standing_places(Tape<S>& tape, const MotionStart& motion, const std::vector<ObjectPoint>& points) {
  const Var<S> places = tape.constant("object_places", shape_of(std::ssize(points), 3));
  const Array<S> numbers = tape.write(places);
  for (Index i = 0; i < std::ssize(points); ++i) {
    const Vector3<S> place = motion.place(points[static_cast<std::size_t>(i)]).template cast<S>();
    std::copy_n(place.data(), 3, numbers.row(i));
  }
  return places;
}

template <class S>
Var<S> object_smooth(const LossInputs<S>& in, const ObjectSmoothSettings& settings) {
  if (in.is_of_other) return {};
  const MotionStart& motion = *in.motion;
  // Differences between frames that stand say nothing.
  const Index first = std::max<Index>(0, motion.still_frames - settings.order);
  const Index last = std::min(motion.frames_with_objects(), motion.frames() + settings.order);
  if (last - first <= settings.order) return {};
  const Var<S> moving = in.object_points(outermost_points(motion, motion.still_frames, motion.frames()));
  const auto standing = [&](Index begin, Index end) {
    return standing_places(moving.owner(), motion, outermost_points(motion, begin, end));
  };
  std::vector<Var<S>> places;
  if (first < motion.still_frames) places.push_back(standing(first, motion.still_frames));
  places.push_back(moving);
  if (motion.frames() < last) places.push_back(standing(motion.frames(), last));
  Var<S> steps = concat_rows<S>(places);
  const Index in_a_frame = moving.shape().rows / motion.moving_frames();
  for (int k = 0; k < settings.order; ++k) {
    const Index rows = steps.shape().rows - in_a_frame;
    steps = slice_rows(steps, in_a_frame, rows) - slice_rows(steps, 0, rows);
  }
  const double free = settings.free / std::pow(motion.frame_rate, settings.order);
  const Var<S> squares = sum_cols(square(steps));
  return free > 0 ? mean(leaky_relu(squares - free * free, 0)) : mean(squares);
}

}  // namespace

LossTerm object_smooth_loss() {
  return needing({LossInput::kObjectMotion},
                 make_loss_term<ObjectSmoothSettings>(
                     "object_smooth", "How far places on the objects go between adjacent frames",
                     [](const auto& in, const ObjectSmoothSettings& settings) { return object_smooth(in, settings); }));
}

}  // namespace hsi4d
