// The Python module hsi4d. What each part offers is in its file; the stubs, hsi4d.pyi, list all of it.
#include <pybind11/pybind11.h>

#include "core/version.h"
#include "python/parts.h"

PYBIND11_MODULE(hsi4d, module) {
  using namespace hsi4d::python;
  module.doc() =
      "4D human-scene interaction from video by differentiable Gaussian splatting.\n\n"
      "Lengths are metres, angles radians, the world has z up, cameras look along z with y down "
      "(docs/conventions.md).\n"
      "Arrays are NumPy's; shapes name N Gaussians, V vertices, J joints, T frames, H x W pixels, C channels.";
  module.attr("__version__") = std::string(hsi4d::version());
  add_errors(module);
  add_log(module);
  add_cameras(module);
  add_images(module);
  add_gaussians(module);
  add_bodies(module);
  add_render(module);
  add_losses(module);
  add_config(module);
  add_runs(module);
  add_stages(module);
}
