// Made-up Gaussians on which the renderer is measured: the same bits every time.
#pragma once

#include <string>
#include <vector>

#include "splat/view.h"

namespace hsi4d {

/// Gaussians in the world and a camera that sees them.
struct Workload {
  std::string name;
  SplatView view;
  Index count = 0;
  std::vector<float> means = {};       ///< [N,3] metres
  std::vector<float> quats = {};       ///< [N,4] wxyz
  std::vector<float> log_scales = {};  ///< [N,3] log metres
  std::vector<float> opacities = {};   ///< [N]
  std::vector<float> colors = {};      ///< [N,3]
  Index moving_begin = 0;              ///< rows [moving_begin, count) are those that move; none: count
};

/// How large a workload is. Gaussians are as much larger as fewer of them have to cover what many do.
struct WorkloadSize {
  int side_px = 1024;
  Index figure = 50000, scene = 500000;  ///< Gaussians
};

/// 50,000 flat Gaussians on the surface of a figure of capsules that covers 11.5 % of 1024×1024 pixels.
Workload avatar_workload(const WorkloadSize& size = {});
/// 500,000 Gaussians that fill a view of 1024×1024 pixels, from 2 to 12 m.
Workload scene_workload(const WorkloadSize& size = {});
/// The first inside the second; the figure moves.
Workload avatar_in_scene_workload(const WorkloadSize& size = {});
/// 100,000 Gaussians of one pixel of standard deviation, blur included, at 512×512.
Workload small_workload();

}  // namespace hsi4d
