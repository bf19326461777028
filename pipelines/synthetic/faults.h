// What generated videos get wrong: another person than the one that is tracked, hands that vanish, colours that change,
// content invented for what was hidden.
#pragma once

#include <cstdint>

#include "body/avatar.h"
#include "core/image.h"
#include "pipelines/config/synthetic_settings.h"
#include "pipelines/synthetic/render.h"

namespace hsi4d {

/// The human of the video: with difference 0 `tracked` itself; else other Gaussians on the same body, of another seed
/// and another number, colours off by some hundredths on the whole and here and there.
Avatar filmed_avatar(const BodyModel& body, const Avatar& tracked, const SyntheticSettings& settings);

/// Hands (wrists and fingers) let through `share` of what is behind them.
Avatar with_faded_hands(const Avatar& avatar, double share);

/// Colours warmer, darker and less saturated; `share` 1: very much.
Avatar with_changed_colors(const Avatar& avatar, double share);

/// How much of the hands is gone at a time of the clip (0 first frame, 1 last): nothing at both ends, all of it in the
/// middle.
double hands_gone(double part);

/// What was hidden shows something else when it is seen again: an invention that stays where it is in the image.
class RevealedContent {
 public:
  RevealedContent(double strength, std::uint64_t seed) : strength_(strength), seed_(seed) {}

  /// Changes a frame where human or object were in earlier frames and are not any more, and remembers where they are.
  void apply(SyntheticFrame& frame);

 private:
  double strength_;
  std::uint64_t seed_;
  Image covered_;  ///< [1,H,W] most of what was covered so far
  Image content_;  ///< [3,H,W] what is shown there
};

}  // namespace hsi4d
