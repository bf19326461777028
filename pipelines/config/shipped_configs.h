// Configs that are part of the program, so that it runs from anywhere.
#pragma once

#include <map>
#include <string>

namespace hsi4d {

/// Texts of configs/ by name: those of `hsi4d demo`, `hsi4d init`, poses of keypoints, and `hsi4d avatar fit
/// --run`, and what they extend.
std::map<std::string, std::string> shipped_config_texts();

}  // namespace hsi4d
