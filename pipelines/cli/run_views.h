// The frames of a finished run as views of its human: pictures in known poses, to learn an avatar from.
#pragma once

#include <filesystem>
#include <vector>

#include "core/config_value.h"
#include "optim/loss_description.h"
#include "pipelines/input/view_set.h"

namespace hsi4d::cli {

/// Of longer clips so many frames are taken, evenly chosen.
inline constexpr Index kMostRunViews = 60;

struct RunViews {
  ViewSet set;           ///< poses and cameras as the run found them; frames and masks of its video
  ConfigValue settings;  ///< of `hsi4d avatar fit`: the run's avatar, and how it is rendered
};

/// Reads config.resolved.json, motion.npz and cameras.json of a run, and opens its video and the human's masks.
///
/// Throws UserError for a folder without these, of a chain, or of another number of poses than the video has frames; as
/// load_run_config, read_motion, read_cameras and open_video.
RunViews run_views(const std::filesystem::path& run, const std::vector<LossDescription>& losses);

}  // namespace hsi4d::cli
