// L = (1/B) Σ c ρ(|b/|b| − u|²): b a bone of the body in the camera's axes, u the direction in which a detector saw it,
// c how sure the detector is; ρ(r²) = s² r² / (s² + r²) [Geman and McClure 1987]. Directions need no person of the same
// size, and say what the image alone does not: whether a limb, or the person, leans to the camera or away.
#include "autodiff/elementwise.h"
#include "autodiff/map.h"
#include "autodiff/matrix.h"
#include "optim/losses/list.h"
#include "optim/losses/robust.h"

namespace hsi4d {

namespace {

constexpr float kShortest = 1e-12F;  // m², so that a bone without length has a slope

/// An angle of 10 degrees, a chord of 0.17, is worth 0.0027.
constexpr double kWeight = 0.1;

struct BoneSettings {
  double scale = 1;
  double min_confidence = 0.5;
};

void describe(ConfigFields& fields, BoneSettings& settings) {
  fields.number("scale", settings.scale, {.above = 0, .max = 2},
                "Difference of two directions of length 1 far beyond which a bone no longer pulls; 1 is 60 degrees");
  fields.number("min_confidence", settings.min_confidence, {.min = 0, .max = 1},
                "Confidence below which a bone does not count");
}

}  // namespace

LossTerm bone_directions_loss() {
  LossTerm term = needing(
      {LossInput::kBones},
      make_loss_term<BoneSettings>(
          "bone_directions", "Difference of directions of the body's bones from those that a detector saw in space",
          [](const auto& in, const BoneSettings& settings) {
            const auto b = in.bones, u = in.bones_target;
            const auto column = [](auto x, Index c) { return slice_cols(x, c, 1); };
            const float limit = static_cast<float>(settings.scale * settings.scale),
                        least = static_cast<float>(settings.min_confidence);
            const auto total = sum_over(
                {column(b, 0), column(b, 1), column(b, 2), column(u, 0), column(u, 1), column(u, 2), column(u, 3)},
                [limit, least](auto x, auto y, auto z, auto to_x, auto to_y, auto to_z, auto confidence) {
                  const auto length = sqrt(square(x) + square(y) + square(z) + kShortest);
                  const auto squared = 2.0F - 2.0F * (x * to_x + y * to_y + z * to_z) / length;
                  return select(value_of(confidence) >= least, confidence * geman_mcclure(squared, limit),
                                confidence * 0.0F);
                });
            return total * (1 / static_cast<double>(b.shape().rows));
          }));
  term.description.weight = kWeight;
  return term;
}

}  // namespace hsi4d
