// `hsi4d list TOPIC`: what configs can name.
#pragma once

#include <string>
#include <vector>

#include "optim/loss_description.h"

namespace hsi4d::cli {

/// Returns a table, a line an entry. Throws UserError, with the nearest topic, for one that is not known.
std::string list_command(const std::string& topic, const std::vector<LossDescription>& losses);

}  // namespace hsi4d::cli
