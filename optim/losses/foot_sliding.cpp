// L = mean over adjacent frames of Σ_j |J_{t+1} − J_t|² over the ankles and balls of the feet that stood when the stage
// began, m²: nearer to the ground than `height` above where they were in the first frame, and slower than `speed`.
#include <algorithm>

#include "autodiff/difference.h"
#include "autodiff/elementwise.h"
#include "autodiff/matrix.h"
#include "optim/losses/list.h"
#include "optim/standing_feet.h"

namespace hsi4d {

namespace {

struct FootSlidingSettings {
  StandingRule rule;
};

void describe(ConfigFields& fields, FootSlidingSettings& settings) {
  fields.number("height", settings.rule.height, {.min = 0, .max = 10},
                "A foot stands if at most this much higher than in frame 0, metres");
  fields.number("speed", settings.rule.speed, {.above = 0, .max = 100},
                "and slower than this at the stage's start, metres per second");
}

Vector3<double> joint_of(const PosedJoints& body, Index joint) {
  return Vector3<double>(body.joints.data() + 3 * joint);
}

bool stands(const MotionStart& motion, Index frame, Index joint, const StandingRule& rule) {
  return foot_stands(joint_of(motion.body_in(frame), joint), joint_of(motion.body_in(frame + 1), joint),
                     joint_of(motion.first_body, joint)[2], motion.frame_rate, rule);
}

/// The first frame that is followed by one that moves.
Index first_pair(const MotionStart& motion) { return std::max<Index>(0, motion.still_frames - 1); }

/// 1 for each coordinate of a joint that stands between such a frame and the next.
std::vector<double> standing_weights(const MotionStart& motion, Index coordinates, const StandingRule& rule) {
  std::vector<double> weights;
  for (Index t = first_pair(motion); t + 1 < motion.frames(); ++t) {
    for (Index i = 0; i < coordinates; ++i)
      weights.push_back(is_foot_joint(i / 3) && stands(motion, t, i / 3, rule) ? 1 : 0);
  }
  return weights;
}

}  // namespace

LossTerm foot_sliding_loss() {
  return needing({LossInput::kMotion},
                 make_loss_term<FootSlidingSettings>(
                     "foot_sliding", "How far feet that stand go between adjacent frames",
                     [](const auto& in, const FootSlidingSettings& settings) {
                       if (in.motion->frames() < 2) return decltype(in.joints){};
                       const Index coordinates = in.joints.shape().cols, first = first_pair(*in.motion),
                                   pairs = in.motion->frames() - 1 - first;
                       const std::vector<double> stand = standing_weights(*in.motion, coordinates, settings.rule);
                       auto& tape = in.joints.owner();
                       const auto weights = tape.constant("standing", shape_of(pairs, coordinates));
                       const auto numbers = tape.write(weights);
                       std::copy(stand.begin(), stand.end(), numbers.data);
                       return l2(slice_rows(in.joints, first + 1, pairs), slice_rows(in.joints, first, pairs),
                                 weights) *
                              static_cast<double>(coordinates);
                     }));
}

}  // namespace hsi4d
