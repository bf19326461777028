#include "pipelines/rig/textured_mesh.h"

#include <catch2/catch.hpp>

#include "core/camera_places.h"
#include "core/check.h"
#include "pipelines/rig/mesh_picture.h"
#include "stress/scratch_folder.h"
#include "tests/pipelines/rig/mesh_files.h"

namespace textured_mesh_test {

using namespace hsi4d;
using namespace hsi4d::test;

namespace fs = std::filesystem;

namespace {

constexpr MeshLight kPlain = {2, 0};

QuadMesh cube() {
  QuadMesh quads;
  quads.add_box(Vector3<double>(-1, -0.5, 0), Vector3<double>(1, 0.5, 0.7));
  return quads;
}

MeshPicture picture_of(const std::string& file) {
  const CastMesh mesh(read_textured_mesh(file));
  return mesh_picture(mesh, camera_at(Vector3<double>(2, -4, 3), Vector3<double>(0, 0, 0.3), 1.2, 48), kPlain);
}

double largest_difference(const Image& a, const Image& b) {
  double largest = 0;
  for (std::size_t i = 0; i < a.data().size(); ++i)
    largest = std::max<double>(largest, std::fabs(a.data()[i] - b.data()[i]));
  return largest;
}

std::string fault_of(const std::string& file) {
  try {
    read_textured_mesh(file);
  } catch (const std::runtime_error& error) {
    return error.what();
  }
  return "no fault";
}

}  // namespace

TEST_CASE("a textured cube is the same from GLB, OBJ and PLY") {
  const ScratchFolder scratch;
  const fs::path folder = scratch.path();
  write_image((folder / "texture.png").string(), quarters());
  const MeshPicture glb = picture_of(write_glb(folder, cube(), quarters()));
  CHECK(*std::max_element(glb.color.data().begin(), glb.color.data().end()) == Approx(1));
  for (const std::string& file : {write_obj(folder, cube()), write_ply(folder, cube())}) {
    CAPTURE(file);
    const MeshPicture other = picture_of(file);
    CHECK(largest_difference(glb.color, other.color) < 1e-5);
    CHECK(largest_difference(glb.alpha, other.alpha) == 0);
    CHECK(largest_difference(glb.depth, other.depth) < 1e-5);
  }
}

TEST_CASE("a GLB is turned to z up, and its linear colours get the curve that pictures have") {
  const ScratchFolder scratch;
  const fs::path folder = scratch.path();
  const TexturedMesh mesh = read_textured_mesh(write_glb(folder, cube(), quarters()));
  CHECK(mesh.low == Vector3<double>(-1, -0.5, 0));
  CHECK(mesh.high[2] == Approx(0.7));
  LoadedMesh plain = loaded(cube(), {});
  plain.materials[0].color = {0.5F, 1, 0, 1};
  CHECK(textured_mesh(plain, "a.glb").materials[0].color[0] == Approx(0.7354).margin(1e-3));
  CHECK(textured_mesh(plain, "a.obj").materials[0].color[0] == 0.5F);
}

TEST_CASE("an OBJ without its texture has its material's colour") {
  const ScratchFolder scratch;
  const TexturedMesh mesh = read_textured_mesh(write_obj(scratch.path(), cube()));
  CHECK(mesh.textures.empty());
  REQUIRE_FALSE(mesh.faces.empty());
  CHECK(mesh.materials[row_of(mesh.materials_of_faces[0])].texture == -1);
  CHECK(mesh.materials[row_of(mesh.materials_of_faces[0])].color[0] == 0.8F);
}

TEST_CASE("colours of vertices are read from PLY and OBJ") {
  const ScratchFolder scratch;
  const fs::path folder = scratch.path();
  const std::string ply = (folder / "c.ply").string(), obj = (folder / "c.obj").string();
  write_text_file(ply,
                  "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
                  "property uchar red\nproperty uchar green\nproperty uchar blue\nelement face 1\n"
                  "property list uchar int vertex_indices\nend_header\n"
                  "0 0 0 255 0 51\n1 0 0 255 0 51\n0 1 0 255 0 51\n3 0 1 2\n");
  write_text_file(obj, "v 0 0 0 1 0 0.2\nv 1 0 0 1 0 0.2\nv 0 1 0 1 0 0.2\nf 1 2 3\n");
  for (const std::string& file : {ply, obj}) {
    CAPTURE(file);
    const CastMesh mesh(read_textured_mesh(file));
    const Camera above = camera_at(Vector3<double>(0.3, 0.3, 3), Vector3<double>(0.3, 0.3, 0), 4, 8);
    const MeshPicture picture = mesh_picture(mesh, above, kPlain);
    CHECK(picture.color(0, 4, 4) == Approx(1));
    CHECK(picture.color(1, 4, 4) == Approx(0).margin(1e-6));
    CHECK(picture.color(2, 4, 4) == Approx(0.2).margin(1e-5));
  }
}

TEST_CASE("files that hold no mesh are refused in words") {
  const ScratchFolder scratch;
  const fs::path folder = scratch.path();
  const auto written = [&](const std::string& name, const std::string& text) {
    write_text_file((folder / name).string(), text);
    return (folder / name).string();
  };
  const std::string points =
      "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\n"
      "property float z\nend_header\n0 0 0\n";
  CHECK_THAT(fault_of(written("points.ply", points)), Catch::Contains("points, not a mesh"));
  CHECK_THROWS_WITH(is_mesh_file("chair.FBX"), Catch::Contains("export it as .glb"));
  CHECK_FALSE(is_mesh_file("runs/photos/transforms.json"));
  CHECK_THAT(fault_of(written("empty.obj", "v 0 0 0\n")), Catch::Contains("no faces"));
  CHECK_THAT(fault_of(written("flat.obj", "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n")), Catch::Contains("area"));
  CHECK_THAT(fault_of(written("nan.obj", "v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")), Catch::Contains("nan"));
  CHECK_THAT(fault_of(written("text.glb", "hello there")), Catch::Contains("text.glb"));
  CHECK_THAT(fault_of((folder / "none.glb").string()), Catch::Contains("none.glb"));
}

TEST_CASE("a GLB that is cut off or damaged anywhere is read or refused", "[fuzz]") {
  const ScratchFolder scratch;
  const fs::path folder = scratch.path();
  const std::string whole = glb_bytes(cube(), quarters());
  const std::string file = (folder / "damaged.glb").string();
  int refused = 0;
  for (std::size_t size = 0; size < whole.size(); size += 97) {
    write_text_file(file, whole.substr(0, size));
    refused += fault_of(file) != "no fault" ? 1 : 0;
  }
  CHECK(refused > 10);
  for (std::size_t at = 0; at < whole.size(); at += 31) {
    std::string damaged = whole;
    damaged[at] = static_cast<char>(damaged[at] ^ 0x55);
    write_text_file(file, damaged);
    fault_of(file);
  }
}

}  // namespace textured_mesh_test
