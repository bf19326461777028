// L = mean over the frames that move of L_t, L_t = mean over the contacts of frame t of w |b − x|², m²: parts of the
// body are drawn to what somebody said that they touch in that frame. x is the place that is touched, and b the point
// of the part that was nearest to it when the stage began; of a contact with an object without a place, b and the
// object's Gaussian x are the nearest two. Where nothing is said of a frame L_t = 0. Points are vertices of the body,
// or the avatar's Gaussians where it is made on another.   [beyond the paper, whose stage 3 finds contacts by itself:
// contact.cpp]
#include <algorithm>
#include <limits>

#include "autodiff/difference.h"
#include "autodiff/elementwise.h"
#include "autodiff/matrix.h"
#include "autodiff/reduce.h"
#include "core/check.h"
#include "core/text.h"
#include "optim/losses/list.h"
#include "optim/object_centres.h"

namespace hsi4d {

namespace {

constexpr double kAnywhere = 1e9;  // metres

/// What touches, what is touched, and their distance when the stage begins. Those on objects come first.
struct Touching {
  std::vector<BodyPoint> body;
  std::vector<ObjectPoint> objects;
  std::vector<double> places;   // [.,3] of the scene, metres
  std::vector<double> weights;  // of each squared distance in the loss
  double distance = 0;          // metres, the sum
};

/// The point of the object that lies at a place in its frame.
ObjectPoint point_of_object(const MotionStart& motion, const AnnotatedContact& contact) {
  const std::vector<float>& means = motion.objects[static_cast<std::size_t>(*contact.object)]->means;
  return {contact.frame, *contact.object, 0, *contact.place - Vector3<float>(means.data()).cast<double>()};
}

/// Where the object's nearest Gaussian is; without a place.
struct NearestOfObject {
  const MotionStart& motion;
  Index frame, object;
  ObjectCentres centres{{motion.objects[static_cast<std::size_t>(object)]}};

  NearestGaussian operator()(const Vector3<double>& place) const {
    const auto& poses = motion.world_from_object[static_cast<std::size_t>(frame)];
    const auto found = centres.nearest(place, std::span(&poses[static_cast<std::size_t>(object)], 1), kAnywhere);
    HSI4D_CHECK(found.has_value(), "an object without Gaussians, or without a place");
    return *found;
  }
};

/// The first of the nearest points of the part.
/// @param distance  of a point, metres
template <class F>
BodyPoint nearest_of(const MotionStart& motion, BodySet of, const AnnotatedContact& contact, const F& distance,
                     double& least) {
  BodyPoint nearest;
  least = std::numeric_limits<double>::infinity();
  for (const Index row : touching_rows(contact, *motion.rest_points(of).weights)) {
    const BodyPoint point{contact.frame, row, of};
    const double d = distance(motion.place(point));
    if (d < least) {
      least = d;
      nearest = point;
    }
  }
  HSI4D_CHECK(std::isfinite(least), "a contact of a part that has no point");
  return nearest;
}

void add(const MotionStart& motion, BodySet of, const AnnotatedContact& contact, Touching& touching) {
  double least = 0;
  const auto to = [](const Vector3<double>& place) {
    return [place](const Vector3<double>& point) { return (point - place).norm(); };
  };
  if (!contact.object) {
    touching.body.push_back(nearest_of(motion, of, contact, to(*contact.place), least));
    touching.places.insert(touching.places.end(), contact.place->data(), contact.place->data() + 3);
  } else if (contact.place) {
    const ObjectPoint touched = point_of_object(motion, contact);
    touching.body.push_back(nearest_of(motion, of, contact, to(motion.place(touched)), least));
    touching.objects.push_back(touched);
  } else {
    const NearestOfObject nearest{motion, contact.frame, *contact.object};
    touching.body.push_back(nearest_of(
        motion, of, contact, [&nearest](const Vector3<double>& point) { return nearest(point).distance; }, least));
    touching.objects.push_back({contact.frame, *contact.object, nearest(motion.place(touching.body.back())).row});
  }
  touching.distance += least;
}

Touching touching_points(const MotionStart& motion) {
  const BodySet of = motion.mesh == nullptr ? BodySet::kGaussians : BodySet::kVertices;
  std::vector<double> counts(static_cast<std::size_t>(motion.frames()));
  for (const AnnotatedContact& contact : *motion.contacts) ++counts[static_cast<std::size_t>(contact.frame)];
  Touching touching;
  for (const bool of_objects : {true, false}) {
    for (const AnnotatedContact& contact : *motion.contacts) {
      if (contact.object.has_value() != of_objects) continue;
      add(motion, of, contact, touching);
      touching.weights.push_back(contact.weight / (counts[static_cast<std::size_t>(contact.frame)] *
                                                   static_cast<double>(motion.moving_frames())));
    }
  }
  return touching;
}

template <class S>
Var<S> constant_of(Tape<S>& tape, const char* name, const std::vector<double>& numbers, Index cols) {
  const Var<S> var = tape.constant(name, shape_of(std::ssize(numbers) / cols, cols));
  std::transform(numbers.begin(), numbers.end(), tape.write(var).data, [](double x) { return static_cast<S>(x); });
  return var;
}

/// The places that are touched, [.,3].
template <class S>
Var<S> touched_places(const LossInputs<S>& in, Tape<S>& tape, const Touching& touching) {
  std::vector<Var<S>> parts;
  if (!touching.objects.empty()) parts.push_back(in.object_points(touching.objects));
  if (!touching.places.empty()) parts.push_back(constant_of(tape, "touched_places", touching.places, 3));
  return parts.size() == 1 ? parts.front() : concat_rows<S>(parts);
}

}  // namespace

LossTerm annotated_contact_loss() {
  return needing(
      {LossInput::kContacts, LossInput::kBodyVertices},
      make_loss_term(
          "annotated_contact", "How far parts of the body are from what they are said to touch", [](const auto& in) {
            using Value = decltype(in.joints);
            if (!in.gives(LossInput::kContacts)) return Value{};
            auto& tape = in.joints.owner();
            const Touching touching = touching_points(*in.motion);
            const auto count = std::ssize(touching.body);
            if (count == 0) return sum(in.joints) * 0.0;  // depends on what the term does, and moves nothing
            if (in.notes != nullptr)
              in.notes->push_back(
                  {"annotated_contact", std::to_string(count) + (count == 1 ? " contact, " : " contacts, on average ") +
                                            rounded(1000 * touching.distance / static_cast<double>(count), 3) +
                                            " mm apart"});
            const Value body = in.body_points(touching.body), touched = touched_places(in, tape, touching);
            const Value weights = constant_of(tape, "contact_weights", touching.weights, 1);
            return l2(body, touched, weights) * static_cast<double>(body.shape().count());
          }));
}

}  // namespace hsi4d
