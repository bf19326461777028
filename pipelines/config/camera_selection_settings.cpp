#include "pipelines/config/camera_selection_settings.h"

namespace hsi4d {

void describe(ConfigFields& f, CameraSelectionSettings& s) {
  const IntegerRange pixels = {.min = 16, .max = 16384};
  f.integer("width", s.width, pixels,
            "Width of the image, pixels; with height and field of view where data.camera is not given");
  f.integer("height", s.height, pixels, "Height of the image, pixels");
  f.number("field_of_view_deg", s.field_of_view_deg, {.min = 1, .max = 170}, "Angle across the image");
  f.numbers("radii_m", s.radii_m, {.min = 0.01, .max = 1000}, "Distances from what candidates look at, metres");
  f.number("frontal_deg", s.frontal_deg, {.min = 0, .max = 89},
           "Views nearer to the human's heading than this are left out");
  f.number("above_pelvis_m", s.above_pelvis_m, {.min = -10, .max = 10},
           "Height of what they look at, over the pelvis, metres");
  f.number("tolerance_m", s.tolerance_m, {.above = 0, .max = 10},
           "A joint's pixel shows the human where the depth of everything is within this of the human's, metres");
}

}  // namespace hsi4d
