#include "pipelines/photos/inria_cameras.h"

#include <array>

#include <Eigen/LU>

#include "core/check.h"
#include "core/config.h"
#include "core/config_parse.h"

namespace hsi4d {

namespace {

struct InriaCamera {
  int id = 0;
  std::string img_name;
  Camera camera;
  std::array<double, 3> position{};
  std::array<double, 9> rotation{};  // world from camera, by rows
};

void describe(ConfigFields& f, InriaCamera& s) {
  constexpr NumberRange kFocal = {.above = 0};
  f.integer("id", s.id, {}, "Number of the picture");
  f.string("img_name", s.img_name, "Name of the picture").required();
  f.integer("width", s.camera.width, {.min = 1, .max = 65536}, "Columns, pixels").required();
  f.integer("height", s.camera.height, {.min = 1, .max = 65536}, "Rows, pixels").required();
  f.numbers("position", s.position, {}, "The camera's centre").required();
  f.numbers("rotation", s.rotation, {}, "World from camera").required();
  f.number("fx", s.camera.fx, kFocal, "Focal length along x, pixels").required();
  f.number("fy", s.camera.fy, kFocal, "Focal length along y, pixels").required();
}

/// Three rows of three numbers, as nine.
void flatten_rotation(ConfigValue& entry) {
  for (ConfigMember& member : entry.members) {
    if (member.key != "rotation" || member.value.kind != ConfigValue::Kind::kArray) continue;
    std::vector<ConfigValue> numbers;
    bool is_square = member.value.items.size() == 3;
    for (const ConfigValue& row : member.value.items) {
      is_square = is_square && row.items.size() == 3;
      numbers.insert(numbers.end(), row.items.begin(), row.items.end());
    }
    if (is_square) member.value.items = std::move(numbers);
  }
}

PosedImage image_of(const InriaCamera& read, const std::string& where) {
  PosedImage image;
  image.name = read.img_name;
  image.camera = read.camera;
  image.camera.cx = 0.5 * read.camera.width;
  image.camera.cy = 0.5 * read.camera.height;
  Matrix3<double> rotation;
  for (int i = 0; i < 9; ++i) rotation(i / 3, i % 3) = read.rotation[static_cast<std::size_t>(i)];
  const Vector3<double> center(read.position.data());
  image.camera.camera_from_world = {rotation, Vector3<double>::Zero()};
  check_camera(image.camera, where);  // as the file has it, before it is inverted
  const Matrix3<double> inverse = rotation.inverse();
  image.camera.camera_from_world = {inverse, -(inverse * center)};
  check_camera(image.camera, where);
  return image;
}

}  // namespace

bool is_inria_cameras(const std::string& text) {
  const std::size_t first = text.find_first_not_of(" \t\r\n");
  return first != std::string::npos && text[first] == '[';
}

std::vector<PosedImage> decode_inria_cameras(const std::string& text, const std::string& name) {
  auto source = std::make_shared<ConfigSource>();
  source->name = name;
  ConfigProblems problems;
  ConfigValue tree;
  if (!parse_config_text(text, source, problems, tree)) problems.throw_if_any();
  if (tree.kind != ConfigValue::Kind::kArray) problems.add(tree.origin, "", "is no list of cameras: [{...}, ...]");
  std::vector<PosedImage> images;
  for (std::size_t i = 0; i < tree.items.size(); ++i) {
    const std::string pointer = "/" + std::to_string(i);
    ConfigValue& entry = tree.items[i];
    flatten_rotation(entry);
    InriaCamera read;
    ConfigFields fields;
    describe(fields, read);
    const std::size_t before = problems.size();
    read_config(entry, fields, problems, pointer);
    if (problems.size() > before) continue;
    try {
      images.push_back(image_of(read, pointer + "/rotation"));
    } catch (const UserError& error) {
      problems.add(entry.origin, "", error.what());
    }
  }
  problems.throw_if_any();
  return images;
}

}  // namespace hsi4d
