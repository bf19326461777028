// Config section `log`: what a run writes beside its results, for people and for other programs.
#pragma once

#include "core/config.h"

namespace hsi4d {

/// Config section `log`. No result depends on it, so that a run is resumed with another one too.
struct LogSettings {
  bool preview = true;       ///< preview.mp4
  bool tensorboard = false;  ///< see pipelines/record/run_events.h
  int images_every = 0;      ///< frames; 0: no images
};

/// Describes the section: every setting with its range.
void describe(ConfigFields& fields, LogSettings& settings);

}  // namespace hsi4d
