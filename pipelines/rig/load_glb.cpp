// Meshes in binary glTF: base colours, colours of vertices, alpha modes.
// [glTF 2.0, Khronos Group: chapters 3.7, 3.8, 3.9; KHR_texture_transform, KHR_materials_pbrSpecularGlossiness]
#include <cmath>
#include <map>

#include <Eigen/LU>

#include "core/check.h"
#include "core/log.h"
#include "optim/solid/glb_file.h"
#include "pipelines/rig/loaded_mesh.h"

namespace hsi4d {

namespace {

/// How a material's texture is put on a primitive.
struct UvRule {
  std::size_t set = 0;  ///< TEXCOORD_n
  double move_u = 0, move_v = 0, scale_u = 1, scale_v = 1, turn = 0;
};

const ConfigValue* member_of_path(const ConfigValue& object, std::initializer_list<const char*> keys) {
  const ConfigValue* at = &object;
  for (const char* key : keys) {
    at = at->kind == ConfigValue::Kind::kObject ? find_member(*at, key) : nullptr;
    if (at == nullptr) return nullptr;
  }
  return at;
}

TextureWrap wrap_of(std::size_t mode) {
  constexpr std::size_t kClampToEdge = 33071, kMirroredRepeat = 33648;
  if (mode == kClampToEdge) return TextureWrap::kClamp;
  return mode == kMirroredRepeat ? TextureWrap::kMirror : TextureWrap::kRepeat;
}

class GlbLoader {
 public:
  GlbLoader(std::span<const std::uint8_t> file, const std::string& name) : glb_(file, name), name_(name) {}

  LoadedMesh load() {
    if (const ConfigValue* const materials = find_member(glb_.json(), "materials")) {
      for (const ConfigValue& material : materials->items) add_material(material);
    }
    mesh_.materials.emplace_back();  // of primitives that name none
    rules_.emplace_back();
    glb_.each_primitive([&](const GlbPrimitive& primitive) { add_primitive(primitive); });
    return std::move(mesh_);
  }

 private:
  void add_material(const ConfigValue& json) {
    MeshMaterial& material = mesh_.materials.emplace_back();
    rules_.emplace_back();
    const ConfigValue* const usual = member_of_path(json, {"pbrMetallicRoughness"});
    const ConfigValue* const other = member_of_path(json, {"extensions", "KHR_materials_pbrSpecularGlossiness"});
    if (usual != nullptr) take_color(*usual, "baseColorFactor", "baseColorTexture", material);
    if (usual == nullptr && other != nullptr) take_color(*other, "diffuseFactor", "diffuseTexture", material);
    if (const ConfigValue* const mode = find_member(json, "alphaMode")) {
      if (mode->text == "MASK") material.alpha = MeshAlpha::kMask;
      if (mode->text == "BLEND") material.alpha = MeshAlpha::kBlend;
    }
    material.cutoff = static_cast<float>(glb_.numbers(json, "alphaCutoff", 0.5));
  }

  void take_color(const ConfigValue& json, const char* factor, const char* texture, MeshMaterial& material) {
    const std::vector<double> color = glb_.numbers(json, factor, {1, 1, 1, 1});
    for (std::size_t c = 0; c < 4; ++c) material.color[c] = static_cast<float>(color[c]);
    const ConfigValue* const named = member_of_path(json, {texture});
    if (named == nullptr) return;
    UvRule& rule = rules_.back();
    rule.set = glb_.whole(*named, "texCoord", 0);
    if (const ConfigValue* const moved = member_of_path(*named, {"extensions", "KHR_texture_transform"})) {
      const std::vector<double> move = glb_.numbers(*moved, "offset", {0, 0}),
                                scale = glb_.numbers(*moved, "scale", {1, 1});
      rule = {glb_.whole(*moved, "texCoord", rule.set), move[0], move[1], scale[0], scale[1],
              glb_.numbers(*moved, "rotation", 0.0)};
    }
    take_texture(glb_.entry("textures", glb_.whole(*named, "index")), material);
  }

  void take_texture(const ConfigValue& json, MeshMaterial& material) {
    if (find_member(json, "source") == nullptr) {
      log_warning(name_ + ": a texture is neither PNG nor JPEG and is left out");
      return;
    }
    material.texture = image_number(glb_.whole(json, "source"));
    if (find_member(json, "sampler") == nullptr) return;
    const ConfigValue& sampler = glb_.entry("samplers", glb_.whole(json, "sampler"));
    constexpr std::size_t kRepeat = 10497;
    material.wrap_u = wrap_of(glb_.whole(sampler, "wrapS", kRepeat));
    material.wrap_v = wrap_of(glb_.whole(sampler, "wrapT", kRepeat));
  }

  /// The texture of an image, which is taken once.
  int image_number(std::size_t image) {
    const auto [at, is_new] = images_.emplace(image, static_cast<int>(mesh_.textures.size()));
    if (!is_new) return at->second;
    const ConfigValue& json = glb_.entry("images", image);
    if (find_member(json, "bufferView") != nullptr) {
      const std::span<const std::uint8_t> bytes = glb_.view_bytes(glb_.whole(json, "bufferView"));
      mesh_.textures.push_back({"image " + std::to_string(image), Bytes(bytes.begin(), bytes.end()), true});
    } else {
      const ConfigValue* const uri = find_member(json, "uri");
      mesh_.textures.push_back({uri == nullptr ? "" : uri->text, {}, false});
    }
    return at->second;
  }

  void add_primitive(const GlbPrimitive& primitive) {
    const std::size_t last = mesh_.materials.size() - 1;
    const std::size_t material = glb_.whole(primitive.json, "material", last);
    if (material > last) glb_.fail("there is no material " + std::to_string(material));
    const auto first = mesh_.places.size();
    for (const Vector3<double>& place : primitive.vertices) add_vertex(mesh_, place);
    take_normals(primitive, first);
    take_uvs(primitive, rules_[material], first);
    take_colors(primitive, first);
    for (std::array<std::int32_t, 3> face : primitive.faces) {
      for (std::int32_t& corner : face) corner += static_cast<std::int32_t>(first);
      add_face(mesh_, face, material);
    }
  }

  /// The numbers of an attribute, `columns` a vertex; none where there is none.
  std::vector<float> attribute(const GlbPrimitive& primitive, const std::string& key, std::size_t columns) const {
    if (find_member(primitive.attributes, key) == nullptr) return {};
    const std::string type = "VEC" + std::to_string(columns);
    std::vector<float> rows = glb_.rows(glb_.whole(primitive.attributes, key.c_str()), type.c_str(), columns);
    if (rows.size() != columns * primitive.vertices.size())
      glb_.fail(key + " has " + std::to_string(rows.size() / columns) + " rows for " +
                std::to_string(primitive.vertices.size()) + " vertices");
    return rows;
  }

  void take_normals(const GlbPrimitive& primitive, std::size_t first) {
    const std::vector<float> rows = attribute(primitive, "NORMAL", 3);
    if (rows.empty() || std::fabs(primitive.axes.determinant()) == 0) return;
    const Matrix3<double> turn = primitive.axes.inverse().transpose();
    for (std::size_t v = 0; v < primitive.vertices.size(); ++v) {
      const Vector3<double> normal = (turn * Vector3<float>(&rows[3 * v]).cast<double>()).normalized();
      mesh_.normals[first + v] = {static_cast<float>(normal[0]), static_cast<float>(normal[1]),
                                  static_cast<float>(normal[2])};
    }
  }

  void take_uvs(const GlbPrimitive& primitive, const UvRule& rule, std::size_t first) {
    const std::vector<float> rows = attribute(primitive, "TEXCOORD_" + std::to_string(rule.set), 2);
    const double c = std::cos(rule.turn), s = std::sin(rule.turn);
    for (std::size_t v = 0; v < rows.size() / 2; ++v) {
      const double u = rule.scale_u * rows[2 * v], down = rule.scale_v * rows[2 * v + 1];
      mesh_.uvs[first + v] = {static_cast<float>(c * u + s * down + rule.move_u),
                              static_cast<float>(1 - (c * down - s * u + rule.move_v))};
    }
  }

  void take_colors(const GlbPrimitive& primitive, std::size_t first) {
    if (find_member(primitive.attributes, "COLOR_0") == nullptr) return;
    const ConfigValue& accessor = glb_.entry("accessors", glb_.whole(primitive.attributes, "COLOR_0"));
    const ConfigValue* const type = find_member(accessor, "type");
    const std::size_t columns = type != nullptr && type->text == "VEC4" ? 4 : 3;
    const std::vector<float> rows = attribute(primitive, "COLOR_0", columns);
    for (std::size_t i = 0; i < rows.size(); ++i) mesh_.colors[first + i / columns][i % columns] = rows[i];
  }

  GlbFile glb_;
  const std::string& name_;
  std::vector<UvRule> rules_;  ///< of materials
  std::map<std::size_t, int> images_;
  LoadedMesh mesh_;
};

}  // namespace

LoadedMesh load_glb(std::span<const std::uint8_t> file, const std::string& name) {
  return GlbLoader(file, name).load();
}

}  // namespace hsi4d
