// Meshes with colours: textures, colours of vertices and of materials.
#pragma once

#include <string>
#include <vector>

#include "core/linear.h"
#include "pipelines/rig/loaded_mesh.h"
#include "pipelines/rig/texture.h"

namespace hsi4d {

/// A mesh whose colours are all as picture files have them (sRGB's curve). Places are relative to `origin`, z up.
struct TexturedMesh {
  Vector3<double> origin = Vector3<double>::Zero();  ///< of places, in the world; the middle of the bounds
  Vector3<double> low, high;                         ///< bounds in the world, metres
  std::vector<std::array<float, 3>> places;
  std::vector<std::array<float, 3>> normals;       ///< unit, or 0: that of the face
  std::vector<std::array<float, 2>> uvs;           ///< v up
  std::vector<std::array<float, 4>> colors;        ///< of vertices
  std::vector<std::array<std::int32_t, 3>> faces;  ///< those that nothing is seen through come first
  std::vector<std::int32_t> materials_of_faces;
  std::vector<float> densities;  ///< of faces: √(area in uv / area in m²)
  std::vector<MeshMaterial> materials;
  std::vector<Texture> textures;
  Index opaque = 0;  ///< faces that nothing is seen through
};

/// A row of the mesh's arrays.
inline std::size_t row_of(std::int32_t number) { return static_cast<std::size_t>(number); }

/// Corner `k` of a face, relative to the mesh's origin.
inline Vector3<double> corner_of(const TexturedMesh& mesh, std::int32_t face, std::size_t k) {
  return Vector3<float>(mesh.places[row_of(mesh.faces[row_of(face)][k])].data()).cast<double>();
}

/// Whether a path names a mesh, by its ending: .glb, .obj, .ply.
/// Throws UserError for endings of other kinds of meshes, naming these.
bool is_mesh_file(const std::string& path);

/// Reads a mesh. A .glb, which is y up by its standard, is turned as read_mesh does it: (x, y, z) becomes (x, −z, y).
///
///   .glb   base colour (factor, which is linear, texture), colours of vertices (linear), alpha mode
///   .obj   map_Kd, or else Kd; d and map_d; colours after a vertex's place
///   .ply   colours of vertices; "comment TextureFile"
///
/// Textures are PNG or JPEG, inside the file or beside it, or what core/image_io.h reads. One that is missing or cannot
/// be read is told in the log, and its material's colour counts alone.
///
/// @param path  UTF-8
/// Throws UserError where it cannot be read; DataError naming file and place: damaged, or as textured_mesh.
TexturedMesh read_textured_mesh(const std::string& path);

/// A mesh as read_textured_mesh makes it of what a file has.
/// @param name  what messages call it; its ending says what numbers mean
/// Throws DataError: a place that is not finite or beyond kFarthestVertex, no faces, none with an area.
TexturedMesh textured_mesh(LoadedMesh loaded, const std::string& name);

}  // namespace hsi4d
