// A long synthetic motion as a chain of clips: each begins with the frame in which the one before ends, and has a
// camera of its own.
#pragma once

#include <vector>

#include "body/avatar.h"
#include "pipelines/input/scene_setup.h"
#include "pipelines/synthetic/motion.h"

namespace hsi4d {

/// What is filmed.
struct SyntheticSetting {
  const Gaussians& scene;
  const SyntheticObject& object;
  const Avatar& avatar;
};

/// What stands at the beginning of the clip, as a run would read it; the motion is the true one.
SceneSetup setup_in(const SyntheticSetting& filmed, const SyntheticClip& clip);

/// Cuts a clip of `clips` · (`frames` − 1) + 1 frames. The first one keeps its cameras. Those of each other begin 20 or
/// 30 degrees beside, where most of the human is to be seen in its first frame (count_visible), and drift from there as
/// the first one's do.
/// @param settings  of the whole
std::vector<SyntheticClip> cut_into_clips(const SyntheticClip& whole, const ClipSettings& settings, Index clips,
                                          const SyntheticSetting& filmed);

/// "clip1" for clip 0.
std::string clip_name(Index clip);

}  // namespace hsi4d
