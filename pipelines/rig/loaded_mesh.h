// Meshes with materials as files have them.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "core/file.h"
#include "core/linear.h"

namespace hsi4d {

/// How a material is seen through: not at all; where alpha is below a cut-off; by its alpha.
enum class MeshAlpha { kOpaque, kMask, kBlend };

/// What a texture shows beyond its edges.
enum class TextureWrap { kRepeat, kClamp, kMirror };

struct MeshMaterial {
  std::array<float, 4> color = {1, 1, 1, 1};  ///< factor of the base colour, as the file has it
  int texture = -1;                           ///< of the base colour; -1: none
  int opacity_texture = -1;                   ///< of MTL's map_d; -1: none
  TextureWrap wrap_u = TextureWrap::kRepeat, wrap_v = TextureWrap::kRepeat;
  MeshAlpha alpha = MeshAlpha::kOpaque;
  float cutoff = 0.5F;  ///< of kMask
};

/// A picture that materials name: a file, or what the mesh's file holds.
struct MeshTexture {
  std::string file;  ///< as the mesh names it; of one that is inside, what messages call it
  Bytes bytes;       ///< of an image file inside the mesh's; empty: `file` is beside the mesh
  bool is_inside = false;
};

/// A mesh as its file has it, its parts placed by its nodes; z up. Arrays of vertices have as many rows as `places`.
struct LoadedMesh {
  std::vector<Vector3<double>> places;
  std::vector<std::array<float, 3>> normals;  ///< unit; 0 where the file has none
  std::vector<std::array<float, 2>> uvs;      ///< v up, from the image's bottom edge
  std::vector<std::array<float, 4>> colors;   ///< of vertices, 1 where the file has none
  std::vector<std::array<std::int32_t, 3>> faces;
  std::vector<std::int32_t> materials_of_faces;
  std::vector<MeshMaterial> materials;
  std::vector<MeshTexture> textures;
};

/// Appends a vertex. Returns its number.
std::int32_t add_vertex(LoadedMesh& mesh, const Vector3<double>& place);

/// Appends a face of vertices that are there.
void add_face(LoadedMesh& mesh, const std::array<std::int32_t, 3>& face, std::size_t material);

/// The number of a texture of that name, which is appended where it is not there. Its file is beside the mesh's.
int add_texture(LoadedMesh& mesh, const std::string& file);

/// A mesh from a file's bytes, its textures' files named, not read. @param name  what messages call it, and where its
/// materials and textures are: beside it.
/// Throw DataError naming file and place. The log tells what is left out.
LoadedMesh load_glb(std::span<const std::uint8_t> file, const std::string& name);
LoadedMesh load_obj(std::string_view text, const std::string& name);
LoadedMesh load_ply(std::span<const std::uint8_t> file, const std::string& name);

}  // namespace hsi4d
