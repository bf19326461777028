#include "optim/solid/mesh_file.h"

#include <cmath>
#include <cstring>
#include <limits>

#include <catch2/catch.hpp>

#include "core/check.h"
#include "core/file.h"
#include "stress/scratch_folder.h"
#include "tests/optim/solid/meshes.h"

namespace mesh_file_test {

using namespace hsi4d;
using namespace hsi4d::test;

namespace {

TriangleMesh parsed(const std::string& text, const std::string& name) {
  return parse_mesh({reinterpret_cast<const std::uint8_t*>(text.data()), text.size()}, name);
}

std::string fault_of(const std::string& text, const std::string& name) {
  try {
    parsed(text, name);
  } catch (const DataError& error) {
    return error.what();
  }
  return "no fault";
}

const std::string kTriangle = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";

/// A .glb file of one triangle.
std::string glb(const std::string& json, const std::string& numbers) {
  const auto word = [](std::uint32_t x) { return std::string(reinterpret_cast<const char*>(&x), 4); };
  std::string text = json;
  while (text.size() % 4 != 0) text += ' ';
  const std::string chunks = word(static_cast<std::uint32_t>(text.size())) + "JSON" + text +
                             word(static_cast<std::uint32_t>(numbers.size())) + std::string("BIN\0", 4) + numbers;
  return "glTF" + word(2) + word(static_cast<std::uint32_t>(12 + chunks.size())) + chunks;
}

std::string bytes_of(const std::vector<float>& numbers) {
  return {reinterpret_cast<const char*>(numbers.data()), 4 * numbers.size()};
}

std::string triangle_json(const std::string& node, const std::string& count = "3") {
  return R"({"scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0)" + node +
         R"(}], "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
         "accessors": [{"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": )" +
         count + R"(}], "bufferViews": [{"buffer": 0, "byteLength": 36}]})";
}

const std::vector<float> kCorners = {0, 0, 0, 1, 0, 0, 0, 2, 0};

}  // namespace

TEST_CASE("an OBJ file gives triangles, polygons as fans, corners counted from either end") {
  const TriangleMesh mesh = parsed(
      "# a quad and a triangle\no thing\n" + kTriangle + "v 1 1 0\r\nvn 0 0 1\nf 1/1/1 2//1 4 3\nf -4 -3 -2  # again\n",
      "a.OBJ");
  REQUIRE(mesh.faces.size() == 3);
  CHECK(mesh.vertices.size() == 4);
  const auto corner = [&](std::size_t f, std::size_t c) {
    return mesh.vertices[static_cast<std::size_t>(mesh.faces[f][c])];
  };
  CHECK(corner(0, 2) == Vector3<double>(1, 1, 0));
  CHECK(corner(1, 1) == Vector3<double>(1, 1, 0));
  CHECK(corner(1, 2) == Vector3<double>(0, 1, 0));
  CHECK(corner(2, 1) == Vector3<double>(1, 0, 0));
}

TEST_CASE("faults of an OBJ file are told with their line") {
  CHECK(fault_of("v 0 0\n", "a.obj") == "a.obj:1: a vertex has three numbers, not \"\"");
  CHECK(fault_of("v 0 0 x\n", "a.obj") == "a.obj:1: a vertex has three numbers, not \"x\"");
  CHECK(fault_of(kTriangle + "f 1 2 4\n", "a.obj") == "a.obj:4: a corner is a vertex from 1 to 3, not \"4\"");
  CHECK(fault_of(kTriangle + "f 1 2\n", "a.obj") == "a.obj:4: a face has three corners at least, not 2");
  CHECK(fault_of(kTriangle + "v nan 0 0\nf 1 2 3\n", "a.obj") ==
        "a.obj: vertex 3 has the coordinate nan; allowed are numbers from -1e6 to 1e6");
  CHECK(fault_of(kTriangle + "v 0 1e7 0\nf 1 2 3\n", "a.obj") ==
        "a.obj: vertex 3 has the coordinate 10000000; allowed are numbers from -1e6 to 1e6");
  CHECK(fault_of(kTriangle, "a.obj") == "a.obj: the mesh has no faces");
  CHECK(fault_of("", "a.obj") == "a.obj: the mesh has no faces");
  CHECK(fault_of(kTriangle + "f 1 2 2\n", "a.obj") == "a.obj: none of the mesh's 1 triangles has an area");
  CHECK_THROWS_WITH(parsed(kTriangle, "a.stl"), "a.stl: a mesh ends in .obj, .ply or .glb");
}

TEST_CASE("vertices at the same place become one, triangles without an area are left out") {
  const TriangleMesh mesh = parsed(kTriangle + "v 1 0 0\nv -0 1 0\nv 1 1 0\nf 1 2 3\nf 4 6 5\nf 2 4 1\n", "a.obj");
  CHECK(mesh.vertices.size() == 4);
  REQUIRE(mesh.faces.size() == 2);
  CHECK(mesh.faces[0][1] == mesh.faces[1][0]);
  CHECK(mesh.faces[0][2] == mesh.faces[1][2]);
}

TEST_CASE("a mesh that was written is read as it was") {
  const ScratchFolder folder;
  const std::string path = std::string(folder.path()) + "/" + "box.ply";
  const TriangleMesh box = box_mesh({-0.1, 0.25, 1.0 / 3}, {1, 2, 3});
  write_mesh(path, box);
  const TriangleMesh mesh = read_mesh(path);
  REQUIRE(mesh.faces.size() == box.faces.size());
  for (std::size_t f = 0; f < box.faces.size(); ++f) {
    for (std::size_t c = 0; c < 3; ++c)
      CHECK(mesh.vertices[static_cast<std::size_t>(mesh.faces[f][c])] ==
            box.vertices[static_cast<std::size_t>(box.faces[f][c])]);
  }
}

TEST_CASE("an ascii PLY mesh is read, and one without faces is refused") {
  const std::string vertices =
      "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n";
  const std::string rows = "0 0 0\n1 0 0\n1 1 0\n0 1 0\n";
  const std::string face = "element face 1\nproperty uchar flag\nproperty list uchar int vertex_index\n";
  CHECK(parsed(vertices + face + "end_header\n" + rows + "7 4 0 1 2 3\n", "a.ply").faces.size() == 2);
  CHECK(fault_of(vertices + face + "end_header\n" + rows + "7 3 0 1 4\n", "a.ply") ==
        "a.ply: face 0 has the corner 4; the file has 4 vertices");
  CHECK(fault_of(vertices + "end_header\n" + rows, "a.ply") ==
        "a.ply: there is no element \"face\": these are points, not a mesh");
  CHECK(fault_of(vertices + "element face 1\nproperty int a\nend_header\n" + rows + "3\n", "a.ply") ==
        "a.ply: element \"face\" has no list \"vertex_indices\"");
}

TEST_CASE("a GLB mesh is placed by its nodes and turned to z up") {
  const std::string node = R"(, "translation": [0, 0, 5], "scale": [2, 1, 1])";
  const TriangleMesh mesh = parsed(glb(triangle_json(node), bytes_of(kCorners)), "a.glb");
  REQUIRE(mesh.faces.size() == 1);
  const auto corner = [&](std::size_t c) { return mesh.vertices[static_cast<std::size_t>(mesh.faces[0][c])]; };
  CHECK(corner(0) == Vector3<double>(0, -5, 0));
  CHECK(corner(1) == Vector3<double>(2, -5, 0));
  CHECK(corner(2) == Vector3<double>(0, -5, 2));
  const std::string mirrored = R"(, "scale": [-1, 1, 1])";
  const TriangleMesh other = parsed(glb(triangle_json(mirrored), bytes_of(kCorners)), "a.glb");
  CHECK(other.vertices[static_cast<std::size_t>(other.faces[0][1])] == Vector3<double>(0, 0, 2));
}

TEST_CASE("a damaged GLB file is refused") {
  CHECK(fault_of("glT", "a.glb") == "a.glb: the file ends after 3 bytes");
  CHECK(fault_of("abcdefghijkl", "a.glb") == "a.glb: this is no .glb file: it does not begin with \"glTF\"");
  CHECK(fault_of(glb(triangle_json("", "4"), bytes_of(kCorners)), "a.glb") ==
        "a.glb: accessor 0 goes beyond the file's 36 bytes of numbers");
  CHECK(fault_of(glb("[]", ""), "a.glb") == "a.glb: its JSON cannot be read");
  CHECK(fault_of(glb(R"({"scenes": [{"nodes": [0]}], "nodes": [{"children": [0]}]})", ""), "a.glb") ==
        "a.glb: nodes lie more than 64 deep in each other");
  const std::string whole = glb(triangle_json(""), bytes_of(kCorners));
  for (std::size_t size = 0; size < whole.size(); ++size) {
    INFO(size);
    CHECK_THROWS_AS(parsed(whole.substr(0, size), "a.glb"), DataError);
  }
}

}  // namespace mesh_file_test
