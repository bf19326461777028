#include "pipelines/input/straight_keypoints.h"

namespace hsi4d {

void straighten(const Lens& lens, const Camera& camera, Keypoints& keypoints) {
  for (std::vector<Keypoint>& frame : keypoints.frames) {
    for (Keypoint& point : frame) {
      const Vector2<double> place = straight_of(
          lens, {(point.x * camera.width - camera.cx) / camera.fx, (point.y * camera.height - camera.cy) / camera.fy});
      point.x = (place[0] * camera.fx + camera.cx) / camera.width;
      point.y = (place[1] * camera.fy + camera.cy) / camera.height;
    }
  }
}

}  // namespace hsi4d
