// L = mean over the frames that move of L_t, L_t = mean over C_t of |h − μ|², m²: hands that were near an object when
// the stage began are drawn to it. C_t has the Gaussians h of the hands that then were nearer than `distance` to one of
// an object, μ the nearest; where it is empty L_t = 0.   [method, stage 3: Eqs. S2, S3]
#include <algorithm>

#include "autodiff/difference.h"
#include "autodiff/elementwise.h"
#include "autodiff/reduce.h"
#include "core/text.h"
#include "optim/losses/list.h"
#include "optim/object_centres.h"

namespace hsi4d {

namespace {

struct ContactSettings {
  double distance = kContactDistance;  // metres
};

void describe(ConfigFields& fields, ContactSettings& settings) {
  fields.number("distance", settings.distance, {.above = 0, .max = 10},
                "Hands nearer to an object than this at the stage's start are drawn to it, metres");
}

struct ContactPairs {
  std::vector<BodyPoint> hands;
  std::vector<ObjectPoint> objects;
  std::vector<double> weights;  // of each pair's squared distance in the loss
  Index frames = 0;             // that have some
};

/// For each hand point the nearest Gaussian among all objects, if it is near enough.
void add_pairs(const MotionStart& motion, Index frame, const std::vector<Index>& hands, const ObjectCentres& centres,
               double distance, ContactPairs& pairs) {
  const std::size_t before = pairs.hands.size();
  for (const Index row : hands) {
    const BodyPoint hand{frame, row};
    const auto nearest =
        centres.nearest(motion.place(hand), motion.world_from_object[static_cast<std::size_t>(frame)], distance);
    if (!nearest) continue;
    pairs.hands.push_back(hand);
    pairs.objects.push_back({frame, nearest->object, nearest->row});
  }
  const auto count = static_cast<double>(pairs.hands.size() - before);
  if (count > 0) ++pairs.frames;
  pairs.weights.resize(pairs.hands.size(), 1 / (count * static_cast<double>(motion.moving_frames())));
}

ContactPairs contact_pairs(const MotionStart& motion, double distance) {
  const ObjectCentres centres(motion.objects);
  const std::vector<Index> hands = rows_of_joints(*motion.avatar, is_hand_joint);
  ContactPairs pairs;
  for (Index t = motion.still_frames; t < motion.frames(); ++t) add_pairs(motion, t, hands, centres, distance, pairs);
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
  return needing({LossInput::kObjectMotion},
                 make_loss_term<ContactSettings>(
                     "contact", "How far hands are from the object that they were near to",
                     [](const auto& in, const ContactSettings& settings) {
                       using Value = decltype(in.joints);
                       auto& tape = in.joints.owner();
                       const ContactPairs pairs = contact_pairs(*in.motion, settings.distance);
                       if (in.notes != nullptr) in.notes->push_back(note_of(pairs, *in.motion, settings.distance));
                       if (pairs.hands.empty())
                         return sum(in.joints) * 0.0;  // depends on what the term does, and moves nothing
                       const Value hands = in.body_points(pairs.hands), objects = in.object_points(pairs.objects);
                       const Value weights =
                           tape.constant("contact_weights", shape_of(static_cast<Index>(pairs.weights.size()), 1));
                       const auto numbers = tape.write(weights);
                       std::copy(pairs.weights.begin(), pairs.weights.end(), numbers.data);
                       return l2(hands, objects, weights) * static_cast<double>(hands.shape().count());
                     }));
}

}  // namespace hsi4d
