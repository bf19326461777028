// L = mean over the N Gaussians of |Δc|² + λ |Δs|²: Δc the change of a Gaussian's colour since the fit of an avatar
// began, Δs that of its place, scales and opacity, each about 1 where it is a large one. A picture pulls a Gaussian by
// as much of it as it shows, this term all alike: what is hardly seen stays, what no picture shows does not move at
// all.
#include "autodiff/elementwise.h"
#include "autodiff/reduce.h"
#include "optim/losses/list.h"

namespace hsi4d {

namespace {

struct LookSettings {
  double shape = 1;  // λ
};

void describe(ConfigFields& fields, LookSettings& settings) {
  fields.number("shape", settings.shape, {.min = 0},
                "Factor of the changes of place (cm), log-scales and opacity logit beside those of colours");
}

}  // namespace

LossTerm look_loss() {
  LossTerm term =
      needing({LossInput::kLook},
              make_loss_term<LookSettings>("look", "How far a learnt avatar is from the look that it began with",
                                           [](const auto& in, const LookSettings& settings) {
                                             const double share = 1 / static_cast<double>(in.color_change.shape().rows);
                                             return sum(square(in.color_change)) * share +
                                                    sum(square(in.shape_change)) * (settings.shape * share);
                                           }));
  term.description.weight = 0.01;
  return term;
}

}  // namespace hsi4d
