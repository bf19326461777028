// Config section `camera_selection`: how the camera of a clip's first frame is chosen.
#pragma once

#include <vector>

#include "core/config.h"

namespace hsi4d {

/// Config section `camera_selection`.
struct CameraSelectionSettings {
  int width = 1024, height = 1024;  ///< of the image, pixels
  double field_of_view_deg = 50;    ///< across the image
  std::vector<double> radii_m = {2.5, 3.25, 4};
  double frontal_deg = 20;  ///< views nearer to the human's heading than this are left out
  double above_pelvis_m = 0.1;
  double tolerance_m = 0.05;
  bool by_cover = false;  ///< of views with as many joints, those whose image is covered most come first
  // Not for configs:
  int azimuths = 24;  ///< around a whole circle, of which those that face the human are tried
  std::vector<double> elevations_deg = {0, 15, 30};
  int trial_px = 256;  ///< longer side of the images in which joints are counted
};

/// Describes the section: every setting with its range.
void describe(ConfigFields& fields, CameraSelectionSettings& settings);

}  // namespace hsi4d
