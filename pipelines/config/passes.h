// Passes through the frames after the first one, as copies of its stages.
#pragma once

#include <string>
#include <vector>

#include "core/config.h"

namespace hsi4d {

struct RunConfig;

/// How often the stages go through the frames; see with_passes.
struct PassSettings {
  int count = 1;
  double iterations_share = 0.67;  ///< of a further pass, of those of the first
  double lr_share = 0.5;           ///< likewise
  double smooth_share = 1;         ///< of the weight of `smooth` over the sequence: what was far off has been found
};

void describe(ConfigFields& fields, PassSettings& settings);

/// The config with its further passes written out, and one pass to go: after the last stage come copies of all stages
/// that draw everything in a frame and of those over the sequence, NAME_2 of NAME in the second pass and so on. Of
/// stages over frames iterations and rates are the shares of those of the first pass, but for the rates of color nets
/// and features, which go on learning; of stages over the sequence the weight of `smooth` is. Without a stage over the
/// sequence nothing lies between passes, and there is one. Throws InternalError where stages are in the way.
RunConfig with_passes(const RunConfig& config);

/// Names of copies that stages have already.
std::vector<std::string> stages_in_the_way(const RunConfig& config);

/// Whether further passes are asked for and there are none.
bool are_passes_idle(const RunConfig& config);

}  // namespace hsi4d
