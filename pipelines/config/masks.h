// Masks of a clip: their folders, and the loss terms that look at them.
#pragma once

#include <string>
#include <vector>

namespace hsi4d {

/// The folder of the human's masks, in data.masks beside those of the objects.
inline constexpr const char* kHumanMasks = "human";

/// Names of loss terms that are off for what a mask shows nothing of.
struct LossesOverMasks {
  std::vector<std::string> human, objects;
};

}  // namespace hsi4d
