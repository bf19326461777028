// The state of frame 0 in which somebody stands, as files of a dataset.
#pragma once

#include "body/avatar.h"
#include "core/config_value.h"
#include "core/folder_in_making.h"
#include "pipelines/draw/standing.h"

namespace hsi4d::cli {

/// Writes initial_motion.npz, of one frame, and initial.json. Throws UserError.
/// @param avatar      in the SMPL-X layout
/// @param frame_rate  of the motion, frames a second
/// @param objects     by name, {"rotation", "translation"}; empty: none
void write_first_state(const FolderInMaking& out, const Avatar& avatar, const StandingPlace& place, double frame_rate,
                       const ConfigValue& objects = ConfigValue::make_object());

}  // namespace hsi4d::cli
