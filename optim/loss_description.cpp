#include "optim/loss_description.h"

namespace hsi4d {

const std::vector<LossDescription>& loss_descriptions() {
  static const std::vector<LossDescription> descriptions;
  return descriptions;
}

}  // namespace hsi4d
