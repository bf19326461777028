// Triangle meshes from files: Wavefront OBJ, PLY, binary glTF (GLB).
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "core/linear.h"
#include "core/types.h"

namespace hsi4d {

/// A surface of triangles.
struct TriangleMesh {
  std::vector<Vector3<double>> vertices;           ///< metres
  std::vector<std::array<std::int32_t, 3>> faces;  ///< vertices, counter-clockwise seen from the free side
};

/// Coordinates beyond this are refused, metres.
inline constexpr double kFarthestVertex = 1e6;

/// A mesh as signed distances need it: vertices at the same place become one, triangles without an area and vertices
/// that no triangle uses are left out.
///
/// @param name  what messages call the mesh
/// Throws DataError naming the first vertex that is not finite or beyond kFarthestVertex, the first corner that is no
/// vertex; when there is no triangle, or none that has an area.
TriangleMesh cleaned(const TriangleMesh& mesh, const std::string& name);

/// Reads a mesh (.obj, .ply, .glb) and cleans it. Coordinates are those of the file, but that those of a .glb, which
/// are y up by its standard, are turned to z up: (x, y, z) becomes (x, −z, y). Polygons become fans of triangles;
/// colours, normals and textures are passed over. Of a .glb all meshes of the scene, placed by its nodes.
///
/// @param path  UTF-8
/// Throws UserError: missing, another ending. DataError naming file and place: damaged, or as cleaned.
TriangleMesh read_mesh(const std::string& path);

/// The same from a file's bytes. @param name  what messages call it; its ending says what it is
TriangleMesh parse_mesh(std::span<const std::uint8_t> file, const std::string& name);

/// Writes a mesh: .ply, binary, little-endian, vertices as doubles; .obj; .glb, vertices as floats, y up, so that
/// read_mesh turns it back. Errors as write_file (core/file.h); UserError for another ending.
void write_mesh(const std::string& path, const TriangleMesh& mesh);

/// The ending of a mesh's file in lower case: .obj, .ply or .glb. Throws UserError naming the file for another.
std::string mesh_ending(const std::string& path);

namespace detail {

/// The triangles of a .glb file, before cleaning.
TriangleMesh parse_glb_mesh(std::span<const std::uint8_t> file, const std::string& name);

/// Appends a polygon as a fan of triangles.
void add_polygon(std::span<const std::int32_t> corners, TriangleMesh& mesh);

}  // namespace detail

}  // namespace hsi4d
