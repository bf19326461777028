#include "optim/losses/list.h"

namespace hsi4d {

const std::vector<LossTerm>& loss_terms() {
#define HSI4D_LOSS(name) name##_loss(),
  static const std::vector<LossTerm> terms = {HSI4D_LOSSES};
#undef HSI4D_LOSS
  return terms;
}

}  // namespace hsi4d
