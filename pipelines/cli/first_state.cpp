#include "pipelines/cli/first_state.h"

#include "body/motion_edit.h"
#include "body/motion_io.h"
#include "core/file.h"

namespace hsi4d::cli {

void write_first_state(const FolderInMaking& out, const Avatar& avatar, const StandingPlace& place, double frame_rate,
                       const ConfigValue& objects) {
  Motion motion{frame_rate, {standing_pose(avatar, place)}};
  motion.pelvis_rest = pelvis_of(avatar.joints);
  write_motion(out.file("initial_motion.npz"), motion);
  ConfigValue initial = ConfigValue::make_object();
  initial.add("motion", ConfigValue::make_string("initial_motion.npz"));
  if (!objects.members.empty()) initial.add("objects", objects);
  write_text_file(out.file("initial.json"), to_json(initial));
}

}  // namespace hsi4d::cli
