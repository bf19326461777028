#include "pipelines/photos/alignment.h"

#include <charconv>
#include <cmath>
#include <memory>

#include "core/check.h"
#include "core/config_parse.h"

namespace hsi4d {

namespace {

using Kind = ConfigValue::Kind;

double number_of(const ConfigValue& value, const std::string& name, const std::string& pointer) {
  double number = 0;
  const char* const end = value.text.data() + value.text.size();
  if (value.kind == Kind::kNumber && std::from_chars(value.text.data(), end, number).ec == std::errc() &&
      std::isfinite(number))
    return number;
  throw UserError(name + ": " + pointer + ": " + shown(value) + " is no finite number");
}

const ConfigValue& four_of(const ConfigValue* value, const std::string& name, const std::string& pointer) {
  if (value != nullptr && value->kind == Kind::kArray && value->items.size() == 4) return *value;
  throw UserError(name + ": " + pointer + ": " + (value == nullptr ? "is missing" : shown(*value)) +
                  "; allowed: a matrix as hsi4d align writes it, 4 rows of 4 numbers");
}

}  // namespace

Camera moved_camera(const Camera& camera, const Similarity& similarity) {
  const Rigid<double>& old = camera.camera_from_world;
  Camera moved = camera;
  moved.camera_from_world.rotation = old.rotation * similarity.rotation.transpose();
  moved.camera_from_world.translation =
      similarity.scale * old.translation - moved.camera_from_world.rotation * similarity.translation;
  return moved;
}

Similarity decode_alignment(const std::string& text, const std::string& name) {
  ConfigProblems problems;
  ConfigValue tree;
  parse_config_text(text, std::make_shared<ConfigSource>(ConfigSource{name, {}}), problems, tree);
  problems.throw_if_any();
  const ConfigValue& rows = four_of(find_member(tree, "matrix"), name, "/matrix");
  Matrix4<double> matrix;
  for (int i = 0; i < 4; ++i) {
    const std::string pointer = "/matrix/" + std::to_string(i);
    const ConfigValue& row = four_of(&rows.items[static_cast<std::size_t>(i)], name, pointer);
    for (int j = 0; j < 4; ++j)
      matrix(i, j) = number_of(row.items[static_cast<std::size_t>(j)], name, pointer + "/" + std::to_string(j));
  }
  return similarity_from_matrix(matrix, name + ": /matrix");
}

}  // namespace hsi4d
