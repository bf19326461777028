// L = mean over the frames that move of L_t, L_t = mean over C_t of |h − μ|², m²: hands that were near an object when
// the stage began are drawn to it. C_t has the Gaussians h of the hands that then were nearer than `distance` to one of
// an object, μ the nearest; where it is empty L_t = 0.   [method, stage 3: Eqs. S2, S3]
#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <nanoflann.hpp>

#include "autodiff/difference.h"
#include "autodiff/elementwise.h"
#include "autodiff/reduce.h"
#include "optim/losses/list.h"

namespace hsi4d {

namespace {

struct ContactSettings {
  double distance = 0.05;  // metres
};

void describe(ConfigFields& fields, ContactSettings& settings) {
  fields.number("distance", settings.distance, {.above = 0, .max = 10},
                "Hands nearer to an object than this when the stage begins are drawn to it, metres");
}

/// The centres of an object's Gaussians, as nanoflann reads them.
struct Centres {
  const Gaussians& gaussians;
  std::size_t kdtree_get_point_count() const { return static_cast<std::size_t>(gaussians.count()); }
  double kdtree_get_pt(std::size_t row, std::size_t axis) const {
    return static_cast<double>(gaussians.means[3 * row + axis]);
  }
  template <class Box>
  bool kdtree_get_bbox(Box&) const {
    return false;
  }
};

using Tree = nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<double, Centres>, Centres, 3>;

struct ContactPairs {
  std::vector<BodyPoint> hands;
  std::vector<ObjectPoint> objects;
  std::vector<double> weights;  // of each pair's squared distance in the loss
};

/// The first of the centres that are at this squared distance, which is the least: trees have an order of their own.
Index first_at(const Tree& tree, const Vector3<double>& place, double squared) {
  std::vector<std::pair<std::uint32_t, double>> found;
  tree.radiusSearch(place.data(), std::nextafter(squared, HUGE_VAL), found, {});
  std::uint32_t first = std::numeric_limits<std::uint32_t>::max();
  for (const auto& item : found) first = std::min(first, item.first);
  return static_cast<Index>(first);
}

/// For each hand point the nearest Gaussian among all objects (of equals the first), if it is near enough.  [row D6]
class Neighbours {
 public:
  Neighbours(const MotionStart& motion, double distance) : motion_(motion), distance_(distance) {
    for (const Gaussians* object : motion.objects) centres_.push_back({*object});
    for (const Centres& centres : centres_) trees_.push_back(std::make_unique<Tree>(3, centres));
  }

  void add_pairs(Index frame, const std::vector<Index>& hands, ContactPairs& pairs) const {
    const std::size_t before = pairs.hands.size();
    for (const Index row : hands) {
      const BodyPoint hand{frame, row};
      ObjectPoint nearest{frame, -1, 0};
      double least = distance_ * distance_;
      for (std::size_t o = 0; o < trees_.size(); ++o) {
        const Rigid<double>& pose = motion_.world_from_object[static_cast<std::size_t>(frame)][o];
        const Vector3<double> local = pose.rotation.transpose() * (motion_.place(hand) - pose.translation);
        std::uint32_t found = 0;
        double squared = 0;
        if (trees_[o]->knnSearch(local.data(), 1, &found, &squared) == 0 || !(squared < least)) continue;
        least = squared;
        nearest = {frame, static_cast<Index>(o), first_at(*trees_[o], local, squared)};
      }
      if (nearest.object < 0) continue;
      pairs.hands.push_back(hand);
      pairs.objects.push_back(nearest);
    }
    const auto count = static_cast<double>(pairs.hands.size() - before);
    pairs.weights.resize(pairs.hands.size(), 1 / (count * static_cast<double>(motion_.moving_frames())));
  }

 private:
  const MotionStart& motion_;
  double distance_;
  std::vector<Centres> centres_;
  std::vector<std::unique_ptr<Tree>> trees_;
};

ContactPairs contact_pairs(const MotionStart& motion, double distance) {
  const Neighbours neighbours(motion, distance);
  const std::vector<Index> hands = rows_of_joints(*motion.avatar, is_hand_joint);
  ContactPairs pairs;
  for (Index t = motion.still_frames; t < motion.frames(); ++t) neighbours.add_pairs(t, hands, pairs);
  return pairs;
}

}  // namespace

LossTerm contact_loss() {
  LossTerm term = make_loss_term<ContactSettings>(
      "contact", "How far hands are from the object that they were near to",
      [](const auto& in, const ContactSettings& settings) {
        using Value = decltype(in.joints);
        if (!in.given(in.joints) || !in.motion || in.motion->objects.empty()) return Value{};
        auto& tape = in.joints.owner();
        const ContactPairs pairs = contact_pairs(*in.motion, settings.distance);
        if (pairs.hands.empty()) return sum(in.joints) * 0.0;  // depends on what the term does, and moves nothing
        const Value hands = in.body_points(pairs.hands), objects = in.object_points(pairs.objects);
        const Value weights = tape.constant("contact_weights", shape_of(static_cast<Index>(pairs.weights.size()), 1));
        const auto numbers = tape.write(weights);
        std::copy(pairs.weights.begin(), pairs.weights.end(), numbers.data);
        return l2(hands, objects, weights) * static_cast<double>(hands.shape().count());
      });
  term.description.needs = LossNeeds::kBody;
  return term;
}

}  // namespace hsi4d
