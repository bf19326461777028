// What this project takes from Assimp and Embree, as a library of its own that is loaded when the first pictures of a
// mesh are made: meshes with materials, and where rays meet them.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "core/file.h"
#include "core/types.h"

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

/// A mesh as its file has it, its parts placed by its nodes. All of per-vertex arrays have as many rows as `places`, or
/// none.
struct LoadedMesh {
  std::vector<std::array<float, 3>> places;
  std::vector<std::array<float, 3>> normals;  ///< unit; 0 where the file has none
  std::vector<std::array<float, 2>> uvs;      ///< v up, from the image's bottom edge
  std::vector<std::array<float, 4>> colors;   ///< of vertices, 1 where the file has none
  std::vector<std::array<std::int32_t, 3>> faces;
  std::vector<std::int32_t> materials_of_faces;
  std::vector<MeshMaterial> materials;
  std::vector<MeshTexture> textures;
  std::vector<std::string> notes;  ///< what the reader complains of
};

/// A half-line from `from` on. `threshold` is for the filter.
struct MeshRay {
  std::array<float, 3> origin, direction;
  float threshold = 0.5F;
};

/// Whether a ray stops at a point of a face: (1 − u − v) a + u b + v c. Called by several threads at once.
using RayFilter = bool (*)(const void* context, std::int32_t face, float u, float v, float threshold);

/// Triangles that rays are cast at. `opaque` faces come first; the filter is asked of the others.
struct RayTarget {
  std::span<const std::array<float, 3>> places;
  std::span<const std::array<std::int32_t, 3>> faces;
  Index opaque = 0;
  RayFilter filter = nullptr;
  const void* context = nullptr;
};

struct RayScene;

/// The library's functions.
struct MeshLibrary {
  /// Reads .glb, .obj, .ply. Returns what was wrong, or "".
  std::string (*read)(const std::string& path, LoadedMesh& mesh);
  /// Prepares triangles for rays; null, and the reason in `error`, where that fails. The same for any number of
  /// threads.
  RayScene* (*make_scene)(const RayTarget& target, std::string& error);
  void (*free_scene)(RayScene* scene);
  /// The first face that each ray meets, -1: none. For several threads at once.
  void (*cast)(const RayScene& scene, std::span<const MeshRay> rays, std::span<std::int32_t> faces);
};

/// The library; the first call loads it. Throws InternalError telling where it was sought.
const MeshLibrary& mesh_library();

}  // namespace hsi4d
