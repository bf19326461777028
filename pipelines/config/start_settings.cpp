#include "pipelines/config/start_settings.h"

namespace hsi4d {

void describe(ConfigFields& f, StartSettings& s) {
  f.choice(
      "pose", s.pose, kStartsFrom,
      "Joints but the root begin as the frame before ended, as estimated, extrapolated, or as fits the image best");
  f.choice("root", s.root, kStartsFrom, "Place and heading of the body, likewise");
  f.choice("objects", s.objects, kStartsFrom, "Objects, likewise; estimates are object_tracks of data.initial");
  f.choice("camera", s.camera, kStartsFrom, "The camera: as the frame before ended, or extrapolated");
  f.rule({"camera"}, [&s]() -> std::string {
    if (s.camera == StartFrom::kBest) return "the best start is chosen by images, which need the camera";
    return s.camera == StartFrom::kEstimate ? "there are no estimates of the camera" : "";
  });
}

}  // namespace hsi4d
