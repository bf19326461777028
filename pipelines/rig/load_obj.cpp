// Meshes in Wavefront OBJ with their materials (MTL): Kd, map_Kd, d, Tr, map_d; colours behind a vertex's place.
#include <algorithm>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <map>
#include <optional>
#include <unordered_map>

#include "core/check.h"
#include "core/file.h"
#include "core/log.h"
#include "core/text.h"
#include "pipelines/rig/loaded_mesh.h"

namespace hsi4d {

namespace fs = std::filesystem;

namespace {

/// Goes through a text, line by line and word by word.
class TextWords {
 public:
  TextWords(std::string_view text, const std::string& name) : text_(text), name_(name) {}

  bool next_line() {
    if (text_.empty()) return false;
    const std::size_t end = std::min(text_.find('\n'), text_.size());
    ++line_;
    left_ = text_.substr(0, end);
    text_.remove_prefix(std::min(end + 1, text_.size()));
    return true;
  }

  /// The next word of the line; empty: none is left, or a comment.
  std::string_view word() {
    skip_spaces();
    std::size_t end = 0;
    while (end < left_.size() && !is_space(left_[end])) ++end;
    const std::string_view found = left_.substr(0, end);
    left_.remove_prefix(end);
    if (!found.starts_with('#')) return found;
    left_ = {};
    return {};
  }

  /// What is left of the line, without spaces around it.
  std::string rest() {
    skip_spaces();
    while (!left_.empty() && is_space(left_.back())) left_.remove_suffix(1);
    return std::string(left_);
  }

  /// The next word as a number; nothing: there is no word.
  std::optional<double> number() {
    const std::string_view text = word();
    if (text.empty()) return {};
    const std::string_view digits = text.starts_with('+') ? text.substr(1) : text;
    double x = 0;
    const auto read = std::from_chars(digits.data(), digits.data() + digits.size(), x);
    if (read.ec != std::errc() || read.ptr != digits.data() + digits.size() || !std::isfinite(x))
      fail("a number is wanted, not \"" + with_escapes(text) + "\"");
    return x;
  }

  [[noreturn]] void fail(const std::string& problem) const {
    throw DataError(name_ + ":" + std::to_string(line_) + ": " + problem);
  }

 private:
  static bool is_space(char c) { return c == ' ' || c == '\t' || c == '\r' || c == '\v' || c == '\f'; }
  void skip_spaces() {
    while (!left_.empty() && is_space(left_.front())) left_.remove_prefix(1);
  }

  std::string_view text_, left_;
  const std::string& name_;
  int line_ = 0;
};

/// Takes the options before a texture's file; how many words each has.
std::string file_behind_options(TextWords& words) {
  static const std::map<std::string, int> kWords = {
      {"-blendu", 1}, {"-blendv", 1}, {"-boost", 1}, {"-cc", 1}, {"-clamp", 1}, {"-imfchan", 1}, {"-texres", 1},
      {"-bm", 1},     {"-type", 1},   {"-mm", 2},    {"-o", 3},  {"-s", 3},     {"-t", 3}};
  std::string rest = words.rest();
  while (rest.starts_with('-')) {
    const auto option = kWords.find(rest.substr(0, rest.find(' ')));
    if (option == kWords.end()) break;
    for (int i = 0; i <= option->second; ++i) {
      const std::size_t end = rest.find(' ');
      rest.erase(0, end == std::string::npos ? rest.size() : rest.find_first_not_of(' ', end));
    }
  }
  return rest;
}

class ObjLoader {
 public:
  ObjLoader(std::string_view text, const std::string& name) : words_(text, name), name_(name) {
    mesh_.materials.emplace_back();  // of faces that name none
  }

  LoadedMesh load() {
    while (words_.next_line()) {
      const std::string_view keyword = words_.word();
      if (keyword == "v") take_place();
      if (keyword == "vt") take_uv();
      if (keyword == "vn") take_normal();
      if (keyword == "f") take_face();
      if (keyword == "mtllib") read_materials(words_.rest());
      if (keyword == "usemtl") use(words_.rest());
    }
    return std::move(mesh_);
  }

 private:
  using Corner = std::array<std::int32_t, 3>;  ///< of place, uv and normal; -1: none

  void take_place() {
    std::vector<double> numbers;
    while (const std::optional<double> x = words_.number()) numbers.push_back(*x);
    if (numbers.size() < 3) words_.fail("a vertex has three numbers");
    places_.emplace_back(numbers[0], numbers[1], numbers[2]);
    std::array<float, 3> color = {1, 1, 1};
    for (std::size_t c = 0; c < 3 && numbers.size() >= 6; ++c)
      color[c] = static_cast<float>(numbers[numbers.size() - 3 + c]);
    colors_.push_back(color);
  }

  void take_uv() {
    const double u = words_.number().value_or(0), v = words_.number().value_or(0);
    uvs_.push_back({static_cast<float>(u), static_cast<float>(v)});
  }

  void take_normal() {
    Vector3<double> normal;
    for (int i = 0; i < 3; ++i) normal[i] = words_.number().value_or(0);
    normal.normalize();
    normals_.push_back({static_cast<float>(normal[0]), static_cast<float>(normal[1]), static_cast<float>(normal[2])});
  }

  /// "7", "7/1", "7//3", "7/1/3", from 1, or from the last one backwards below 0.
  Corner corner_of(std::string_view text) const {
    Corner corner = {-1, -1, -1};
    const std::array<std::size_t, 3> counts = {places_.size(), uvs_.size(), normals_.size()};
    std::string_view left = text;
    for (std::size_t k = 0; k < 3; ++k) {
      const std::string_view digits = left.substr(0, left.find('/'));
      left.remove_prefix(std::min(digits.size() + 1, left.size()));
      if (digits.empty() && k > 0) continue;
      std::int64_t number = 0;
      const auto read = std::from_chars(digits.data(), digits.data() + digits.size(), number);
      const auto count = static_cast<std::int64_t>(counts[k]);
      if (read.ec != std::errc() || read.ptr != digits.data() + digits.size() || number == 0 || number > count ||
          number < -count)
        words_.fail("a corner's numbers are from 1 to " + std::to_string(counts[0]) + " of vertices, " +
                    std::to_string(counts[1]) + " of texture places, " + std::to_string(counts[2]) +
                    " of normals; not \"" + with_escapes(text) + "\"");
      corner[k] = static_cast<std::int32_t>(number > 0 ? number - 1 : count + number);
    }
    return corner;
  }

  void take_face() {
    std::vector<std::int32_t> polygon;
    for (std::string_view text = words_.word(); !text.empty(); text = words_.word())
      polygon.push_back(vertex_of(corner_of(text)));
    if (polygon.size() < 3) words_.fail("a face has three corners at least, not " + std::to_string(polygon.size()));
    for (std::size_t i = 2; i < polygon.size(); ++i)
      add_face(mesh_, {polygon[0], polygon[i - 1], polygon[i]}, material_);
  }

  /// The vertex of these numbers, which is made once.
  std::int32_t vertex_of(const Corner& corner) {
    const auto [at, is_new] = vertices_.emplace(corner, static_cast<std::int32_t>(mesh_.places.size()));
    if (!is_new) return at->second;
    const auto place = static_cast<std::size_t>(corner[0]);
    add_vertex(mesh_, places_[place]);
    for (std::size_t c = 0; c < 3; ++c) mesh_.colors.back()[c] = colors_[place][c];
    if (corner[1] >= 0) mesh_.uvs.back() = uvs_[static_cast<std::size_t>(corner[1])];
    if (corner[2] >= 0) mesh_.normals.back() = normals_[static_cast<std::size_t>(corner[2])];
    return at->second;
  }

  void use(const std::string& material) {
    const auto found = materials_.find(material);
    if (found != materials_.end()) {
      material_ = found->second;
      return;
    }
    log_warning(name_ + ": there is no material " + material + "; its faces are white");
    materials_.emplace(material, 0);
    material_ = 0;
  }

  void read_materials(const std::string& file) {
    const fs::path path = fs::path(name_).parent_path() / file;
    std::error_code fault;  // a name that is too long, for one
    if (!fs::is_regular_file(path, fault)) {
      log_warning(name_ + ": names materials in " + file + ", which is not there");
      return;
    }
    const std::string text = read_text_file(path.string()), name = path.string();
    TextWords words(text, name);
    MeshMaterial* material = nullptr;
    while (words.next_line()) {
      const std::string_view keyword = words.word();
      if (keyword == "newmtl") {
        materials_[words.rest()] = mesh_.materials.size();
        material = &mesh_.materials.emplace_back();
      } else if (material != nullptr) {
        take_line(keyword, words, fs::path(file).parent_path(), *material);
      }
    }
  }

  void take_line(std::string_view keyword, TextWords& words, const fs::path& folder, MeshMaterial& material) {
    if (keyword == "Kd") {
      for (std::size_t c = 0; c < 3; ++c)
        material.color[c] = static_cast<float>(words.number().value_or(c == 0 ? 1 : material.color[c - 1]));
    }
    if (keyword == "d" || keyword == "Tr") {
      const auto number = static_cast<float>(words.number().value_or(1));
      material.color[3] = keyword == "d" ? number : 1 - number;
      if (material.color[3] < 1) material.alpha = MeshAlpha::kBlend;
    }
    if (keyword != "map_Kd" && keyword != "map_d") return;
    std::string file = file_behind_options(words);
    std::replace(file.begin(), file.end(), '\\', '/');
    const int texture = add_texture(mesh_, (folder / file).generic_string());
    if (keyword == "map_Kd") material.texture = texture;
    if (keyword == "map_d") {
      material.opacity_texture = texture;
      material.alpha = MeshAlpha::kBlend;
    }
  }

  struct CornerHash {
    std::size_t operator()(const Corner& corner) const {
      std::uint64_t hash = 0;
      for (const std::int32_t x : corner) hash = (hash ^ static_cast<std::uint32_t>(x)) * 0x9E3779B97F4A7C15u;
      return hash ^ hash >> 31;
    }
  };

  TextWords words_;
  const std::string& name_;
  std::vector<Vector3<double>> places_;
  std::vector<std::array<float, 3>> colors_, normals_;
  std::vector<std::array<float, 2>> uvs_;
  std::unordered_map<Corner, std::int32_t, CornerHash> vertices_;
  std::map<std::string, std::size_t> materials_;
  std::size_t material_ = 0;
  LoadedMesh mesh_;
};

}  // namespace

LoadedMesh load_obj(std::string_view text, const std::string& name) { return ObjLoader(text, name).load(); }

}  // namespace hsi4d
