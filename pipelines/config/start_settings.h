// Config section `start`: where the stages of a frame begin.
#pragma once

#include <array>

#include "core/config.h"

namespace hsi4d {

/// What a part of the state begins a frame with: where the frame before ended; the estimate of this frame; or where it
/// would be, had it gone on as between the two frames before; or the one of these that the image says is best
/// (pipelines/run/start_choice.h).
enum class StartFrom { kPrevious, kEstimate, kVelocity, kBest };

inline constexpr std::array<ConfigChoice<StartFrom>, 4> kStartsFrom = {{{StartFrom::kPrevious, "previous"},
                                                                        {StartFrom::kEstimate, "estimate"},
                                                                        {StartFrom::kVelocity, "velocity"},
                                                                        {StartFrom::kBest, "best"}}};

/// Config section `start`. The defaults are the method's.   [method.md, stage 2]
struct StartSettings {
  StartFrom pose = StartFrom::kEstimate;  ///< joints but the root; without estimates as in the frame before
  StartFrom root = StartFrom::kPrevious;  ///< place and heading of the body
  StartFrom objects = StartFrom::kPrevious;
  StartFrom camera = StartFrom::kPrevious;  ///< there are no estimates of it
};

/// Describes the section: every setting with its range.
void describe(ConfigFields& fields, StartSettings& settings);

}  // namespace hsi4d
