// L = mean over the frames that move of L_t, L_t = mean over C_t of |h − μ|², m²: hands that were near an object when
// the stage began are drawn to it. C_t has the points h of the hands that then were nearer than `distance` to a
// Gaussian of an object, μ the nearest; where it is empty L_t = 0. Points are vertices of the body, or the avatar's
// Gaussians. [method, stage 3: Eqs. S2, S3]
#include <algorithm>
#include <array>

#include "autodiff/difference.h"
#include "autodiff/elementwise.h"
#include "autodiff/reduce.h"
#include "core/text.h"
#include "optim/losses/list.h"
#include "optim/object_centres.h"

namespace hsi4d {

namespace {

constexpr std::array<ConfigChoice<BodySet>, 2> kHandPoints = {
    {{BodySet::kVertices, "vertices"}, {BodySet::kGaussians, "gaussians"}}};

struct ContactSettings {
  BodySet points = BodySet::kVertices;
  double distance = kContactDistance;  // metres
};

void describe(ConfigFields& fields, ContactSettings& settings) {
  fields.choice(
      "points", settings.points, kHandPoints,
      "What of the hands is drawn: vertices of `body`, where the avatar was made on it, or the avatar's Gaussians");
  fields.number("distance", settings.distance, {.above = 0, .max = 10},
                "Hands nearer to an object than this at the stage's start are drawn to it, metres");
}

struct ContactPairs {
  std::vector<BodyPoint> hands;
  std::vector<ObjectPoint> objects;
  std::vector<double> weights;  // of each pair's squared distance in the loss
  Index frames = 0;             // that have some
};

/// For each point of a hand in a frame the nearest Gaussian among all objects, if it is near enough.
void add_pairs(const MotionStart& motion, const std::vector<BodyPoint>& hands, const ObjectCentres& centres,
               double distance, ContactPairs& pairs) {
  const std::size_t before = pairs.hands.size();
  for (const BodyPoint& hand : hands) {
    const auto nearest =
        centres.nearest(motion.place(hand), motion.world_from_object[static_cast<std::size_t>(hand.frame)], distance);
    if (!nearest) continue;
    pairs.hands.push_back(hand);
    pairs.objects.push_back({hand.frame, nearest->object, nearest->row});
  }
  const auto count = static_cast<double>(pairs.hands.size() - before);
  if (count > 0) ++pairs.frames;
  pairs.weights.resize(pairs.hands.size(), 1 / (count * static_cast<double>(motion.moving_frames())));
}

ContactPairs contact_pairs(const MotionStart& motion, BodySet of, double distance) {
  const ObjectCentres centres(motion.objects);
  const std::vector<Index> rows = rows_of_joints(*motion.rest_points(of).weights, is_hand_joint);
  ContactPairs pairs;
  for (Index t = motion.still_frames; t < motion.frames(); ++t) {
    std::vector<BodyPoint> hands;
    for (const Index row : rows) hands.push_back({t, row, of});
    add_pairs(motion, hands, centres, distance, pairs);
  }
  return pairs;
}

LossNote note_of(const ContactPairs& pairs, const MotionStart& motion, double distance) {
  const std::string within = number_text(distance) + " m of an object's Gaussian in ",
                    frames = std::to_string(motion.moving_frames()) + " frames";
  return {"contact",
          (pairs.frames == 0 ? "no hand is within " + within + "any of " + frames
                             : "hands are within " + within + std::to_string(pairs.frames) + " of " + frames),
          pairs.frames == 0};
}

}  // namespace

LossTerm contact_loss() {
  return needing<ContactSettings>(
      [](const ContactSettings& settings) {
        std::vector<LossInput> needs = {LossInput::kObjectMotion};
        if (settings.points == BodySet::kVertices) needs.push_back(LossInput::kBodyVertices);
        return needs;
      },
      make_loss_term<ContactSettings>(
          "contact", "How far hands are from the object that they were near to",
          [](const auto& in, const ContactSettings& settings) {
            using Value = decltype(in.joints);
            if (!in.gives(LossInput::kObjectMotion)) return Value{};
            auto& tape = in.joints.owner();
            // Of an avatar that was made on another body the Gaussians stand for the vertices; a run warns of it.
            const BodySet of = in.motion->mesh == nullptr ? BodySet::kGaussians : settings.points;
            const ContactPairs pairs = contact_pairs(*in.motion, of, settings.distance);
            if (in.notes != nullptr) in.notes->push_back(note_of(pairs, *in.motion, settings.distance));
            if (pairs.hands.empty()) return sum(in.joints) * 0.0;  // depends on what the term does, and moves nothing
            const Value hands = in.body_points(pairs.hands), objects = in.object_points(pairs.objects);
            const Value weights =
                tape.constant("contact_weights", shape_of(static_cast<Index>(pairs.weights.size()), 1));
            const auto numbers = tape.write(weights);
            std::copy(pairs.weights.begin(), pairs.weights.end(), numbers.data);
            return l2(hands, objects, weights) * static_cast<double>(hands.shape().count());
          }));
}

}  // namespace hsi4d
