// Image files, and the points that detectors found in images.
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include "body/body_model.h"
#include "core/file.h"
#include "core/image_io.h"
#include "pipelines/input/found_keypoints.h"
#include "python/arrays.h"
#include "python/parts.h"

namespace hsi4d::python {

namespace {

namespace fs = std::filesystem;

void write_array(const fs::path& path, py::handle pixels, int png_bits, int jpeg_quality, bool exr_half) {
  const Image image = image_of(pixels, "image");
  ImageFormat format;
  format.png_bits = png_bits;
  format.jpeg_quality = jpeg_quality;
  format.exr_half = exr_half;
  const Released released;
  write_image(path.string(), image, format);
}

/// [P,3] of a person; None for nobody.
py::object person_array(const FoundPerson& person) {
  if (person.empty()) return py::none();
  std::vector<double> numbers;
  for (const std::array<double, 3>& point : person) numbers.insert(numbers.end(), point.begin(), point.end());
  return array_of(std::move(numbers), {std::ssize(person), 3});
}

py::list joint_weights(const std::vector<KeypointJoints>& points) {
  py::list all;
  for (const KeypointJoints& joints : points) {
    py::dict weights;
    for (const auto& [joint, weight] : joints)
      weights[py::str(smplx_joint_names()[static_cast<std::size_t>(joint)])] = weight;
    all.append(weights);
  }
  return all;
}

py::dict keypoints_of(const fs::path& path) {
  FoundKeypoints found;
  {
    const Released released;
    found = read_found_keypoints(path);
  }
  py::list frames, landmarks;
  for (const std::vector<FoundPerson>& persons : found.frames) {
    py::list in_frame;
    for (const FoundPerson& person : persons) in_frame.append(person_array(person));
    frames.append(in_frame);
  }
  for (const FoundPerson& person : found.landmarks) landmarks.append(person_array(person));
  py::dict keypoints;
  keypoints["frames"] = frames;
  keypoints["landmarks"] = landmarks;
  keypoints["joints"] = joint_weights(found.joints);
  keypoints["size"] = found.size[0] > 0 ? py::object(py::make_tuple(found.size[0], found.size[1])) : py::none();
  return keypoints;
}

/// What JSON has of people by frame: lists of points, empty for nobody.
py::list point_lists(const py::object& frames, const std::string& name) {
  py::list lists;
  py::ssize_t frame = 0;
  for (const py::handle person : frames) {
    const std::string place = name + "[" + std::to_string(frame++) + "]";
    if (person.is_none()) {
      lists.append(py::list());
      continue;
    }
    numbers_of<double>(person, {-1, 3}, place, "[P,3]");
    lists.append(py::module_::import("numpy").attr("asarray")(person).attr("tolist")());
  }
  return lists;
}

void write_keypoints(const fs::path& path, const py::object& frames, const py::object& joints, const py::object& size,
                     const py::object& landmarks) {
  py::dict file;
  file["format"] = "hsi4d keypoints";
  file["version"] = 1;
  file["joints"] = joints;
  if (!size.is_none()) file["size"] = py::list(size);
  file["frames"] = point_lists(frames, "frames");
  if (!landmarks.is_none()) file["landmarks"] = point_lists(landmarks, "landmarks");
  const std::string text = json_text(file);
  const Released released;
  parse_keypoints(text, path.string());
  write_text_file(path.string(), text + "\n");
}

}  // namespace

void add_images(py::module_& module) {
  module.def(
      "read_image",
      [](const fs::path& path) {
        Image image;
        {
          const Released released;
          image = read_image(path.string());
        }
        return array_of(image);
      },
      py::arg("path"),
      "[H,W,C] float32 of an image file: PNG, JPEG, OpenEXR, or what else OpenImageIO reads. 8-bit numbers are v/255,\n"
      "16-bit ones v/65535, floats as they are; colours are never converted.");
  module.def(
      "write_image", &write_array, py::arg("path"), py::arg("image"), py::arg("png_bits") = 8,
      py::arg("jpeg_quality") = 95, py::arg("exr_half") = false,
      "Writes an array [H,W] or [H,W,C]; the path's ending says how: .png, .jpg, .exr. PNG and JPEG hold 0 to 1.");
  module.def(
      "read_keypoints", &keypoints_of, py::arg("path"),
      "Points of people that a detector found: a file of hsi4d's own or of COCO's results, or a folder of OpenPose.\n"
      "A dict: frames, by frame a list of persons [P,3] of (x px, y px, confidence); landmarks, by frame [P,3]\n"
      "metres or None, empty where there are none; joints, by point a dict of joints and weights; size, pixels of\n"
      "the pictures, or None.");
  module.def(
      "write_keypoints", &write_keypoints, py::arg("path"), py::arg("frames"), py::arg("joints"),
      py::arg("size") = py::none(), py::arg("landmarks") = py::none(),
      "Writes points of one person: frames, [P,3] of (x px, y px, confidence) or None for nobody; joints, \"coco17\",\n"
      "\"body25\", \"blazepose33\", \"smplx55\" or a list (docs/formats.md); size, (width, height) of the pictures;\n"
      "landmarks, by frame [P,3] metres in the camera's axes, or None.");
}

}  // namespace hsi4d::python
