#include "pipelines/locate/colmap_camera.h"

#include <charconv>
#include <cmath>
#include <memory>
#include <vector>

#include "core/check.h"
#include "core/config_parse.h"
#include "core/text.h"
#include "pipelines/photos/colmap.h"
#include "pipelines/scan/align.h"

namespace hsi4d {

namespace {

namespace fs = std::filesystem;
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

Camera colmap_camera(const fs::path& folder, const std::string& picture, const Similarity& alignment) {
  const fs::path model = colmap_folder(folder);
  if (model.empty())
    throw UserError(folder.string() +
                    ": holds no model of COLMAP: cameras and images, .bin or .txt, in it, in sparse/0 "
                    "or in sparse");
  const std::vector<PosedImage> images = read_colmap(model).images;
  const PosedImage* found = nullptr;
  std::vector<std::string> names;
  for (const PosedImage& image : images) {
    names.push_back(image.name);
    if (image.name != picture && fs::path(image.name).filename() != picture) continue;
    if (found != nullptr && found->name != picture && image.name != picture)
      throw UserError(model.string() + ": both " + with_escapes(found->name) + " and " + with_escapes(image.name) +
                      " are called " + picture + "; --name says which");
    if (found == nullptr || image.name == picture) found = &image;
  }
  if (found == nullptr)
    throw UserError(model.string() + ": has not registered " + with_escapes(picture) + ", but " + few_names(names) +
                    "; --name says what the model calls it");
  if (!found->lens.is_straight())
    throw UserError(model.string() + ": the lens of " + with_escapes(found->name) +
                    " bends; frames are taken for a pinhole's. Register it with --ImageReader.camera_model PINHOLE, or "
                    "straighten the video first");
  return moved_camera(found->camera, alignment);
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
