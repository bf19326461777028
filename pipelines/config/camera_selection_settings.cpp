#include "pipelines/config/camera_selection_settings.h"

namespace hsi4d {

void describe(ConfigFields& f, CameraSelectionSettings& s) {
  const IntegerRange pixels = {.min = 16, .max = 16384};
  f.integer("width", s.width, pixels, "Image width, pixels; this and the next two count only without data.camera");
  f.integer("height", s.height, pixels, "Image height, pixels");
  f.number("field_of_view_deg", s.field_of_view_deg, {.min = 1, .max = 170}, "Horizontal field of view, degrees");
  f.numbers("radii_m", s.radii_m, {.min = 0.01, .max = 1000},
            "Distances of candidates from the point they look at, metres");
  f.integer("azimuths", s.azimuths, {.min = 3, .max = 3600}, "Directions around; those that the human faces are tried");
  f.numbers("elevations_deg", s.elevations_deg, {.min = -89, .max = 89}, "Angles above the horizon, degrees");
  f.number("frontal_deg", s.frontal_deg, {.min = 0, .max = 89},
           "Views nearer to the human's heading than this are left out, degrees");
  f.number("above_pelvis_m", s.above_pelvis_m, {.min = -10, .max = 10},
           "Height of that point above the pelvis, metres");
  f.number("tolerance_m", s.tolerance_m, {.above = 0, .max = 10},
           "A joint is visible if the depth of everything is within this of the human's, metres");
  f.boolean("at_objects", s.at_objects,
            "Look between the human and the objects that it faces; false: at the human alone");
  f.integer("trial_px", s.trial_px, {.min = 16, .max = 4096},
            "Longer side of the images in which joints are counted, pixels");
}

}  // namespace hsi4d
