#include "pipelines/config/camera_selection_settings.h"

namespace hsi4d {

void describe(ConfigFields& f, CameraSelectionSettings& s) {
  const IntegerRange pixels = {.min = 16, .max = 16384};
  f.integer("width", s.width, pixels, "Image width, pixels; this and the next two count only without data.camera");
  f.integer("height", s.height, pixels, "Image height, pixels");
  f.number("field_of_view_deg", s.field_of_view_deg, {.min = 1, .max = 170}, "Horizontal field of view, degrees");
  f.numbers("radii_m", s.radii_m, {.min = 0.01, .max = 1000},
            "Distances of candidates from the point they look at, metres");
  f.number("frontal_deg", s.frontal_deg, {.min = 0, .max = 89},
           "Views nearer to the human's heading than this are left out, degrees");
  f.number("above_pelvis_m", s.above_pelvis_m, {.min = -10, .max = 10},
           "Height of that point above the pelvis, metres");
  f.number("tolerance_m", s.tolerance_m, {.above = 0, .max = 10},
           "A joint is visible if the depth of everything is within this of the human's, metres");
  f.boolean(
      "by_cover", s.by_cover,
      "Of views with as many visible joints, take one whose image is covered most, in steps of 5 %; else, as in the "
      "paper, the nearest to the horizon");
}

}  // namespace hsi4d
