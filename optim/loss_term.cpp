#include "optim/loss_term.h"

#include "optim/losses/list.h"

namespace hsi4d {

const std::vector<LossTerm>& loss_terms() {
#define HSI4D_LOSS(name) name##_loss(),
  static const std::vector<LossTerm> terms = {HSI4D_LOSSES};
#undef HSI4D_LOSS
  return terms;
}

std::vector<LossDescription> descriptions_of(const std::vector<LossTerm>& terms) {
  std::vector<LossDescription> all;
  for (const LossTerm& term : terms) all.push_back(term.description);
  return all;
}

}  // namespace hsi4d
