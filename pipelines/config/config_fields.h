// The described fields of a config that is only read.
#pragma once

#include <vector>

#include "core/config.h"
#include "optim/loss_description.h"

namespace hsi4d {

/// What `use` makes of the fields of a config and of the losses that it may name. Fields are bound to settings that
/// they could change, so they get a copy.
///
/// @param use  called with const ConfigFields&, which do not outlive it
template <class Settings, class Use>
auto with_fields(Settings settings, const std::vector<LossDescription>& losses, const Use& use) {
  ConfigFields fields;
  describe(fields, settings, losses);
  return use(static_cast<const ConfigFields&>(fields));
}

}  // namespace hsi4d
