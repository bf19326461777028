// Cameras and their files.
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include "core/camera.h"
#include "core/camera_file.h"
#include "core/formatted.h"
#include "python/arrays.h"
#include "python/parts.h"

namespace hsi4d::python {

namespace {

namespace fs = std::filesystem;

Camera camera_of(int width, int height, double fx, double fy, double cx, double cy, py::handle camera_from_world) {
  const Camera camera{width, height, fx, fy, cx, cy, rigid_of(camera_from_world, "camera_from_world")};
  check_camera(camera);
  return camera;
}

std::string camera_text(const Camera& camera) {
  return formatted("<hsi4d.Camera %d x %d pixels, fx %.6g, fy %.6g, cx %.6g, cy %.6g>", camera.width, camera.height,
                   camera.fx, camera.fy, camera.cx, camera.cy);
}

}  // namespace

void add_cameras(py::module_& module) {
  py::class_<Camera>(module, "Camera",
                     "A pinhole camera: width, height, fx, fy, cx, cy in pixels, camera_from_world [4,4] in metres.")
      .def(py::init(&camera_of), py::arg("width"), py::arg("height"), py::arg("fx"), py::arg("fy"), py::arg("cx"),
           py::arg("cy"), py::arg("camera_from_world"))
      .def_readonly("width", &Camera::width, "Pixels.")
      .def_readonly("height", &Camera::height, "Pixels.")
      .def_readonly("fx", &Camera::fx, "Pixels.")
      .def_readonly("fy", &Camera::fy, "Pixels.")
      .def_readonly("cx", &Camera::cx, "Pixels from the image's left edge.")
      .def_readonly("cy", &Camera::cy, "Pixels from the image's top edge.")
      .def_property_readonly(
          "camera_from_world", [](const Camera& camera) { return array_of(camera.camera_from_world); },
          "[4,4] takes points of the world, metres, to the camera's axes. A copy.")
      .def_property_readonly(
          "center_world", [](const Camera& camera) { return array_of(camera_center_world(camera)); }, "[3] metres.")
      .def(
          "resized", [](const Camera& camera, int width, int height) { return resized(camera, width, height); },
          py::arg("width"), py::arg("height"), "The camera of the image at another size, pixels.")
      .def(
          "moved",
          [](const Camera& camera, py::handle camera_from_world) {
            Camera moved = camera;
            moved.camera_from_world = rigid_of(camera_from_world, "camera_from_world");
            check_camera(moved);
            return moved;
          },
          py::arg("camera_from_world"), "The camera elsewhere; camera_from_world is [4,4].")
      .def("__repr__", &camera_text);
  module.def(
      "look_at",
      [](py::handle eye, py::handle target, py::handle up) {
        return array_of(look_at(vector_of(eye, "eye"), vector_of(target, "target"), vector_of(up, "up")));
      },
      py::arg("eye"), py::arg("target"), py::arg("up") = py::make_tuple(0, 0, 1),
      "camera_from_world [4,4] of a camera at eye [3] that looks at target [3], metres, with up [3] to the image's "
      "top.");
  module.def(
      "read_camera", [](const fs::path& path, int frame) { return read_camera(path.string(), frame); }, py::arg("path"),
      py::arg("frame") = 0, WhileReleased(),
      "Camera `frame` of a file: hsi4d's own, of one or several, or nerfstudio's transforms.json.");
  module.def(
      "read_cameras", [](const fs::path& path) { return read_cameras(path.string()); }, py::arg("path"),
      WhileReleased(), "All cameras of a file, as read_camera.");
  module.def(
      "write_camera", [](const fs::path& path, const Camera& camera) { write_camera(path.string(), camera); },
      py::arg("path"), py::arg("camera"), WhileReleased(), "Writes one camera; reading gives the same bits.");
  module.def(
      "write_cameras",
      [](const fs::path& path, const std::vector<Camera>& cameras) { write_cameras(path.string(), cameras); },
      py::arg("path"), py::arg("cameras"), WhileReleased(), "Writes a list of cameras.");
}

}  // namespace hsi4d::python
