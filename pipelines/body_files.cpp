#include "pipelines/body_files.h"

#include "body/motion_edit.h"
#include "core/log.h"

namespace hsi4d {

void warn_of_repairs(const SmplxModel& model) {
  if (model.rescaled_weights == 0) return;
  log_warning(model.source +
              ": vertices whose skinning weights are divided by their sum: " + std::to_string(model.rescaled_weights));
}

Motion read_motion_aloud(const std::string& path) {
  Motion motion = read_motion(path);
  if (motion.lost_shape)
    log_warning(path + ": is of " + motion.converted_from + ", whose betas are no shape of SMPL-X: they are left out");
  return motion;
}

Motion read_motion_for(const std::string& path, const Avatar& avatar) {
  return for_body(read_motion_aloud(path), avatar);
}

}  // namespace hsi4d
