// L = mean over the frames that move of L_t, L_t = mean over the contacts of frame t of w min |b − x|², m²: parts of
// the body are drawn to what somebody said that they touch in that frame. b are the points of the part, x the place
// that is touched or, of a contact with an object without a place, the object's Gaussians; which two are nearest is
// found anew in every evaluation, so that what touches somewhere has no pull. Where nothing is said of a frame L_t = 0.
// Points are vertices of the body, or the avatar's Gaussians where it is made on another.   [beyond the paper, whose
// stage 3 finds contacts by itself: contact.cpp]
#include <algorithm>
#include <limits>
#include <numeric>

#include "autodiff/difference.h"
#include "autodiff/elementwise.h"
#include "autodiff/matrix.h"
#include "autodiff/nearest.h"
#include "autodiff/reduce.h"
#include "autodiff/tape_rows.h"
#include "core/check.h"
#include "core/text.h"
#include "optim/losses/list.h"

namespace hsi4d {

namespace {

constexpr Index kMostBodyPoints = 512, kMostGaussians = 4096;  // of a contact: all pairs are tried

/// What touches and what is touched. Targets are the points of objects, then the places.
struct Touching {
  std::vector<BodyPoint> body;
  std::vector<ObjectPoint> objects;
  std::vector<double> places;  // [.,3] of the scene, metres
  std::vector<NearestSet> sets;
  std::vector<double> weights;  // of each squared distance in the loss
};

/// At most so many of them, evenly.
std::vector<Index> thinned(const std::vector<Index>& rows, Index most) {
  const Index count = std::ssize(rows);
  if (count <= most) return rows;
  std::vector<Index> kept;
  for (Index i = 0; i < most; ++i) kept.push_back(rows[static_cast<std::size_t>(i * count / most)]);
  return kept;
}

void add_touched_points(const MotionStart& motion, const AnnotatedContact& contact, Touching& touching) {
  const std::vector<float>& means = motion.objects[static_cast<std::size_t>(*contact.object)]->means;
  if (contact.place) {
    touching.objects.push_back(
        {contact.frame, *contact.object, 0, *contact.place - Vector3<float>(means.data()).cast<double>()});
    return;
  }
  std::vector<Index> rows(means.size() / 3);
  std::iota(rows.begin(), rows.end(), Index{0});
  for (const Index row : thinned(rows, kMostGaussians))
    touching.objects.push_back({contact.frame, *contact.object, row});
}

Touching touching_points(const MotionStart& motion) {
  const BodySet of = motion.mesh == nullptr ? BodySet::kGaussians : BodySet::kVertices;
  std::vector<double> counts(static_cast<std::size_t>(motion.frames()));
  for (const AnnotatedContact& contact : *motion.contacts) ++counts[static_cast<std::size_t>(contact.frame)];
  Touching touching;
  for (const bool of_objects : {true, false}) {
    for (const AnnotatedContact& contact : *motion.contacts) {
      if (contact.object.has_value() != of_objects) continue;
      NearestSet set{std::ssize(touching.body), 0, std::ssize(touching.objects) + std::ssize(touching.places) / 3, 1};
      for (const Index row : thinned(touching_rows(contact, *motion.rest_points(of).weights), kMostBodyPoints))
        touching.body.push_back({contact.frame, row, of});
      set.points = std::ssize(touching.body) - set.first_point;
      if (of_objects) {
        add_touched_points(motion, contact, touching);
        set.targets = std::ssize(touching.objects) - set.first_target;
      } else {
        touching.places.insert(touching.places.end(), contact.place->data(), contact.place->data() + 3);
      }
      touching.sets.push_back(set);
      touching.weights.push_back(contact.weight / (counts[static_cast<std::size_t>(contact.frame)] *
                                                   static_cast<double>(motion.moving_frames())));
    }
  }
  return touching;
}

/// How far the pairs are apart when the stage begins, on average, metres.
double mean_distance(const MotionStart& motion, const Touching& touching) {
  std::vector<Vector3<double>> targets;
  for (const ObjectPoint& point : touching.objects) targets.push_back(motion.place(point));
  for (std::size_t i = 0; i < touching.places.size(); i += 3) targets.emplace_back(&touching.places[i]);
  double sum = 0;
  for (const NearestSet& set : touching.sets) {
    double least = std::numeric_limits<double>::infinity();
    for (Index i = set.first_point; i < set.first_point + set.points; ++i) {
      const Vector3<double> point = motion.place(touching.body[static_cast<std::size_t>(i)]);
      for (Index j = set.first_target; j < set.first_target + set.targets; ++j)
        least = std::min(least, (point - targets[static_cast<std::size_t>(j)]).norm());
    }
    sum += least;
  }
  return sum / static_cast<double>(touching.sets.size());
}

/// The places that are touched, [.,3].
template <class S>
Var<S> touched_places(const LossInputs<S>& in, Tape<S>& tape, const Touching& touching) {
  std::vector<Var<S>> parts;
  if (!touching.objects.empty()) parts.push_back(in.object_points(touching.objects));
  if (!touching.places.empty()) parts.push_back(constant_rows(tape, "touched_places", touching.places, 3));
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
            const auto count = std::ssize(touching.sets);
            if (count == 0) return sum(in.joints) * 0.0;  // depends on what the term does, and moves nothing
            if (in.notes != nullptr)
              in.notes->push_back(
                  {"annotated_contact", std::to_string(count) + (count == 1 ? " contact, " : " contacts, on average ") +
                                            rounded(1000 * mean_distance(*in.motion, touching), 3) + " mm apart"});
            const Value apart =
                nearest_pairs(in.body_points(touching.body), touched_places(in, tape, touching), touching.sets);
            const Value weights = constant_rows(tape, "contact_weights", touching.weights, 1);
            const Value nothing = constant_rows(tape, "no_distance", {0}, 1);
            return l2(apart, nothing, weights) * static_cast<double>(apart.shape().count());
          }));
}

}  // namespace hsi4d
