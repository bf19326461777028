// Views of real Gaussians: of a small scene among the tests' own assets, and of the data folder beside the source tree,
// where there is one.
#pragma once

#include <string>
#include <vector>

#include "tests/support/splat_scenes.h"

namespace hsi4d::test {

/// A view from outside towards the middle of a file's Gaussians.
struct RealView {
  std::string file;      ///< from the top of the source tree
  Vector3<double> from;  ///< direction of the eye as seen from the middle
  double distance;       ///< of the eye, in median distances of the Gaussians from the middle
  double zoom;           ///< focal length over width
  SceneSize size = {96, 64};
  double margin = 0.05;  ///< Gaussians with centres farther outside of the image, in sizes of it, are left out
};

/// The tests' own scene (tests/assets/README.md): always there.
RealView cropped_view();
/// Close views of parts of three large files, small enough for the brute-force renderer.
std::vector<RealView> close_views();
/// Views of all of a scene of 104,575 Gaussians.
std::vector<RealView> whole_views();

/// Reads the Gaussians of a view. False without the file.
bool real_scene(const RealView& view, SplatScene& scene);

}  // namespace hsi4d::test
