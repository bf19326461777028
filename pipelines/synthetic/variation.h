// What the seed changes of a clip beside textures and noise (synthetic.variation), so that several seeds are several
// videos: timing, camera, where it begins, clothes and light.
#pragma once

#include "body/avatar.h"
#include "pipelines/config/synthetic_settings.h"
#include "pipelines/synthetic/surface.h"

namespace hsi4d {

/// Of one clip. As it is by default it changes nothing.
struct ClipVariation {
  double speed = 1;        ///< of the motion
  double begin = 0;        ///< of the motion, seconds
  double turn = 0;         ///< of the camera about what it looks at, radians
  double distance = 1;     ///< of the camera, share of the designed one
  double up = 0;           ///< of the camera, metres
  double drift = 1;        ///< of the camera, share of the designed one; negative: the other way
  double aside = 0;        ///< of the person, -1 to 1: share of what the place leaves
  double heading_deg = 0;  ///< of the person where no place says it
};

/// A function of synthetic.seed; as by default for variation 0.
ClipVariation clip_variation(const SyntheticSettings& settings);

/// The avatar in clothes of other colours; itself for variation 0.
Avatar in_other_clothes(const Avatar& avatar, const SyntheticSettings& settings);

/// The light of a scene from another direction, a little brighter or darker; itself for variation 0.
Light from_another_side(Light light, const SyntheticSettings& settings);

}  // namespace hsi4d
