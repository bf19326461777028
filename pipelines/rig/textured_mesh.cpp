#include "pipelines/rig/textured_mesh.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <numeric>
#include <optional>

#include "core/check.h"
#include "core/file.h"
#include "core/image_io.h"
#include "core/log.h"
#include "core/parallel.h"
#include "core/text.h"
#include "optim/solid/mesh_file.h"

namespace hsi4d {

namespace fs = std::filesystem;

namespace {

std::string ending_of(const std::string& path) {
  std::string ending = fs::path(path).extension().string();
  for (char& c : ending) c = c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  return ending;
}

/// sRGB's curve: what a picture has for a linear colour.
float encoded(float x) {
  x = std::clamp(x, 0.0F, 1.0F);
  return x <= 0.0031308F ? 12.92F * x : 1.055F * std::pow(x, 1 / 2.4F) - 0.055F;
}

void encode(std::array<float, 4>& color) {
  for (std::size_t c = 0; c < 3; ++c) color[c] = encoded(color[c]);
}

template <std::size_t N>
bool is_finite(const std::array<float, N>& numbers) {
  return std::all_of(numbers.begin(), numbers.end(), [](float x) { return std::isfinite(x); });
}

void check_places(const LoadedMesh& mesh, const std::string& name) {
  for (std::size_t v = 0; v < mesh.places.size(); ++v) {
    for (Index i = 0; i < 3; ++i) {
      const double x = mesh.places[v][i];
      if (std::fabs(x) <= kFarthestVertex) continue;
      throw DataError(name + ": vertex " + std::to_string(v) + " has the coordinate " + number_text(x) +
                      "; allowed are numbers from -1e6 to 1e6");
    }
  }
  if (mesh.faces.empty()) throw DataError(name + ": the mesh has no faces");
}

/// What a format's numbers mean becomes what pictures have.
void take_conventions(bool is_glb, LoadedMesh& mesh) {
  for (std::array<float, 4>& color : mesh.colors) {
    if (!is_finite(color)) color = {1, 1, 1, 1};
    if (is_glb) encode(color);
  }
  for (std::array<float, 2>& uv : mesh.uvs) {
    if (!is_finite(uv)) uv = {0, 0};
  }
  for (std::array<float, 3>& normal : mesh.normals) {
    if (!is_finite(normal)) normal = {0, 0, 0};
  }
}

void take_places(const LoadedMesh& from, TexturedMesh& mesh) {
  const auto at = [&](std::size_t v) -> const Vector3<double>& { return from.places[v]; };
  mesh.low = mesh.high = at(static_cast<std::size_t>(from.faces.front()[0]));
  for (const std::array<std::int32_t, 3>& face : from.faces) {
    for (const std::int32_t corner : face) {
      mesh.low = mesh.low.cwiseMin(at(static_cast<std::size_t>(corner)));
      mesh.high = mesh.high.cwiseMax(at(static_cast<std::size_t>(corner)));
    }
  }
  mesh.origin = 0.5 * (mesh.low + mesh.high);
  for (std::size_t v = 0; v < from.places.size(); ++v) {
    const Vector3<float> place = (at(v) - mesh.origin).cast<float>();
    mesh.places.push_back({place[0], place[1], place[2]});
  }
}

/// A texture's image; nothing, which the log tells, where there is none.
std::optional<Texture> decoded(const MeshTexture& texture, const std::string& name, bool alpha_counts) {
  std::string file = texture.file;
  std::replace(file.begin(), file.end(), '\\', '/');
  const fs::path path = fs::path(file).is_absolute() ? fs::path(file) : fs::path(name).parent_path() / file;
  try {
    Image image =
        texture.is_inside ? decode_image(texture.bytes, name + ": " + texture.file) : read_image(path.string());
    if (!alpha_counts && image.channels() % 2 == 0) image = take_channels(image, 0, image.channels() - 1);
    return texture_from(image);
  } catch (const std::exception& error) {
    log_warning(name + ": a texture is left out, the colour of its material counts alone: " + error.what());
    return std::nullopt;
  }
}

/// Decodes all textures; materials name those that are left.
void take_textures(const LoadedMesh& from, const std::string& name, TexturedMesh& mesh) {
  std::vector<char> alpha_counts(from.textures.size(), 0);
  for (const MeshMaterial& material : from.materials) {
    for (const int texture : {material.texture, material.opacity_texture}) {
      if (texture >= 0 && material.alpha != MeshAlpha::kOpaque) alpha_counts[static_cast<std::size_t>(texture)] = 1;
    }
  }
  std::vector<int> numbers;
  for (std::size_t i = 0; i < from.textures.size(); ++i) {
    std::optional<Texture> texture = decoded(from.textures[i], name, alpha_counts[i] != 0);
    numbers.push_back(texture ? static_cast<int>(mesh.textures.size()) : -1);
    if (texture) mesh.textures.push_back(std::move(*texture));
  }
  mesh.materials = from.materials;
  for (MeshMaterial& material : mesh.materials) {
    for (int* texture : {&material.texture, &material.opacity_texture})
      *texture = *texture < 0 ? -1 : numbers[static_cast<std::size_t>(*texture)];
  }
}

/// Colours of materials as pictures have them.
void take_colors(const std::string& ending, std::vector<MeshMaterial>& materials) {
  const bool is_glb = ending == ".glb", is_ply = ending == ".ply";
  for (MeshMaterial& material : materials) {
    if (is_glb) encode(material.color);
    // Of MTL's Kd, exporters write 0 or 0.8 beside a texture that is meant as it is; PLY has none.
    if (is_ply || (!is_glb && material.texture >= 0)) material.color = {1, 1, 1, material.color[3]};
  }
}

/// Whether something can be seen through a material at all.
bool is_opaque(const MeshMaterial& material, const TexturedMesh& mesh) {
  if (material.alpha == MeshAlpha::kOpaque) return true;
  if (material.color[3] < 1 || material.opacity_texture >= 0) return false;
  return material.texture < 0 || !mesh.textures[static_cast<std::size_t>(material.texture)].has_alpha;
}

double triangle_area(const Vector3<double>& a, const Vector3<double>& b, const Vector3<double>& c) {
  return 0.5 * cross(Vector3<double>(b - a), Vector3<double>(c - a)).norm();
}

void check_areas(const TexturedMesh& mesh, const std::string& name) {
  for (std::int32_t f = 0; f < std::ssize(mesh.faces); ++f) {
    if (triangle_area(corner_of(mesh, f, 0), corner_of(mesh, f, 1), corner_of(mesh, f, 2)) > 0) return;
  }
  throw DataError(name + ": none of the mesh's " + std::to_string(mesh.faces.size()) + " triangles has an area");
}

float density_of(const TexturedMesh& mesh, std::int32_t face) {
  std::array<Vector3<double>, 3> places, uvs;
  for (std::size_t k = 0; k < 3; ++k) {
    const std::array<float, 2>& uv = mesh.uvs[row_of(mesh.faces[row_of(face)][k])];
    places[k] = corner_of(mesh, face, k);
    uvs[k] = Vector3<double>(uv[0], uv[1], 0);
  }
  const double area = triangle_area(places[0], places[1], places[2]);
  return area > 0 ? static_cast<float>(std::sqrt(triangle_area(uvs[0], uvs[1], uvs[2]) / area)) : 0.0F;
}

/// Faces in the order that rays want.
void take_faces(const LoadedMesh& from, TexturedMesh& mesh) {
  std::vector<char> opaque;
  for (const MeshMaterial& material : mesh.materials) opaque.push_back(is_opaque(material, mesh) ? 1 : 0);
  for (const bool wanted : {true, false}) {
    for (std::size_t f = 0; f < from.faces.size(); ++f) {
      const std::int32_t material = from.materials_of_faces[f];
      if ((opaque[static_cast<std::size_t>(material)] != 0) != wanted) continue;
      mesh.faces.push_back(from.faces[f]);
      mesh.materials_of_faces.push_back(material);
    }
    if (wanted) mesh.opaque = std::ssize(mesh.faces);
  }
  mesh.densities.resize(mesh.faces.size());
  parallel_for(std::ssize(mesh.faces), 4096, [&](Index begin, Index end) {
    for (auto f = static_cast<std::int32_t>(begin); f < end; ++f) mesh.densities[row_of(f)] = density_of(mesh, f);
  });
}

}  // namespace

TexturedMesh textured_mesh(LoadedMesh loaded, const std::string& name) {
  check_places(loaded, name);
  take_conventions(ending_of(name) == ".glb", loaded);
  TexturedMesh mesh;
  take_places(loaded, mesh);
  mesh.normals = std::move(loaded.normals);
  mesh.uvs = std::move(loaded.uvs);
  mesh.colors = std::move(loaded.colors);
  take_textures(loaded, name, mesh);
  take_colors(ending_of(name), mesh.materials);
  take_faces(loaded, mesh);
  check_areas(mesh, name);
  return mesh;
}

bool is_mesh_file(const std::string& path) {
  constexpr std::string_view kOthers[] = {".gltf", ".fbx", ".dae",  ".stl", ".off",
                                          ".3ds",  ".usd", ".usdz", ".abc", ".blend"};
  const std::string ending = ending_of(path);
  if (std::find(std::begin(kOthers), std::end(kOthers), ending) != std::end(kOthers))
    throw UserError(path + ": meshes are read from .glb, .obj and .ply; export it as .glb");
  return ending == ".glb" || ending == ".obj" || ending == ".ply";
}

TexturedMesh read_textured_mesh(const std::string& path) {
  const Bytes file = read_file(path);
  const std::string ending = ending_of(path);
  if (ending == ".glb") return textured_mesh(load_glb(file, path), path);
  if (ending == ".ply") return textured_mesh(load_ply(file, path), path);
  return textured_mesh(load_obj({reinterpret_cast<const char*>(file.data()), file.size()}, path), path);
}

}  // namespace hsi4d
