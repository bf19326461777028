#include "pipelines/config/log_settings.h"

namespace hsi4d {

void describe(ConfigFields& f, LogSettings& s) {
  f.boolean("preview", s.preview,
            "Write preview.mp4, the video beside its reconstruction; where ffmpeg is not installed it is left out");
  f.boolean("tensorboard", s.tensorboard, "Write losses and metrics as events for TensorBoard too, into tensorboard/");
  f.integer("images_every", s.images_every, {.min = 0, .max = 1000000},
            "The events have the images of each frame whose number is a multiple of this; 0: no images");
}

}  // namespace hsi4d
