#include "pipelines/rig/loaded_mesh.h"

#include <catch2/catch.hpp>

#include "core/check.h"
#include "core/log.h"
#include "stress/scratch_folder.h"
#include "tests/pipelines/rig/mesh_files.h"

namespace loaded_mesh_test {

using namespace hsi4d;
using namespace hsi4d::test;

namespace fs = std::filesystem;

namespace {

const std::string kTriangle = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";

LoadedMesh glb_with(const std::string& from, const std::string& to) {
  QuadMesh square;
  square.add(Vector3<double>(0, 0, 0), Vector3<double>(1, 0, 0), Vector3<double>(0, 0, 1));
  std::string file = glb_bytes(square, quarters());
  const std::size_t at = file.find(from);
  REQUIRE(at != std::string::npos);
  const std::size_t json_end = 20 + *reinterpret_cast<const std::uint32_t*>(file.data() + 12);
  std::string json = file.substr(20, json_end - 20);
  json.replace(at - 20, from.size(), to);
  while (json.size() % 4 != 0) json += ' ';
  const auto word = [](std::size_t x) {
    const auto number = static_cast<std::uint32_t>(x);
    return std::string(reinterpret_cast<const char*>(&number), 4);
  };
  const std::string rest = file.substr(json_end);
  file =
      file.substr(0, 8) + word(20 + json.size() + rest.size()) + word(json.size()) + file.substr(16, 4) + json + rest;
  return load_glb({reinterpret_cast<const std::uint8_t*>(file.data()), file.size()}, "test.glb");
}

}  // namespace

TEST_CASE("an OBJ's corners count from the end below 0, and vertices are shared where all of their numbers are") {
  const LoadedMesh mesh =
      load_obj(kTriangle + "vt 0 0\nvt 1 0\nvn 0 0 2\nf 1/1/1 2/2/1 3/1/1\nf -3/-2/-1 2/2/1 3\n", "a");
  REQUIRE(mesh.faces.size() == 2);
  CHECK(mesh.faces[0][0] == mesh.faces[1][0]);
  CHECK(mesh.faces[0][1] == mesh.faces[1][1]);
  CHECK(mesh.faces[0][2] != mesh.faces[1][2]);
  CHECK(mesh.normals[0] == std::array<float, 3>{0, 0, 1});
  CHECK(mesh.uvs[1] == std::array<float, 2>{1, 0});
  CHECK_THROWS_WITH(load_obj(kTriangle + "f 1 2 4\n", "a.obj"), Catch::Contains("a.obj:4") && Catch::Contains("\"4\""));
}

TEST_CASE("an MTL's textures may have options and folders, and its opacity makes a blend") {
  const ScratchFolder scratch;
  write_text_file(scratch / "m/wood.mtl",
                  "newmtl oak\nKd 0.1 0.2 0.3\nmap_Kd -s 2 2 1 -clamp on my oak.png\nnewmtl glass\nKd 0.5\nTr 0.75\n"
                  "newmtl leaf\nmap_d ..\\leaf.png\n");
  const std::string name = scratch / "a.obj";
  const LoadedMesh mesh = load_obj(
      kTriangle + "mtllib m/wood.mtl\nusemtl oak\nf 1 2 3\nusemtl glass\nf 1 2 3\nusemtl leaf\nf 1 2 3\n", name);
  REQUIRE(mesh.materials.size() == 4);
  CHECK(mesh.materials_of_faces == std::vector<std::int32_t>{1, 2, 3});
  CHECK(mesh.textures[0].file == "m/my oak.png");
  CHECK(mesh.textures[1].file == "m/../leaf.png");
  CHECK(mesh.materials[1].color == std::array<float, 4>{0.1F, 0.2F, 0.3F, 1});
  CHECK(mesh.materials[2].color == std::array<float, 4>{0.5F, 0.5F, 0.5F, 0.25F});
  CHECK(mesh.materials[2].alpha == MeshAlpha::kBlend);
  CHECK(mesh.materials[3].opacity_texture == 1);
}

TEST_CASE("an MTL that is not there is told, and faces stay white") {
  std::string told;
  const LogSink sink = log_to([&](LogLevel, std::string_view text) { told += text; }, LogLevel::kWarning);
  const LoadedMesh mesh = load_obj(kTriangle + "mtllib none.mtl\nusemtl oak\nf 1 2 3\n", "a.obj");
  CHECK(mesh.materials[0].color == std::array<float, 4>{1, 1, 1, 1});
  CHECK_THAT(told, Catch::Contains("none.mtl, which is not there") && Catch::Contains("oak"));
}

TEST_CASE("a PLY's faces may have texture places and textures of their own") {
  const std::string text =
      "ply\nformat ascii 1.0\ncomment TextureFile a.png\ncomment TextureFile b.png\nelement vertex 3\n"
      "property float x\nproperty float y\nproperty float z\nelement face 2\nproperty list uchar int vertex_indices\n"
      "property list uchar float texcoord\nproperty int texnumber\nend_header\n"
      "0 0 0\n1 0 0\n0 1 0\n3 0 1 2 6 0 0 1 0 0 1 0\n3 0 1 2 6 0.5 0 1 0 0 1 1\n";
  const LoadedMesh mesh = load_ply({reinterpret_cast<const std::uint8_t*>(text.data()), text.size()}, "a.ply");
  REQUIRE(mesh.faces.size() == 2);
  CHECK(mesh.materials_of_faces == std::vector<std::int32_t>{0, 1});
  CHECK(mesh.textures[static_cast<std::size_t>(mesh.materials[1].texture)].file == "b.png");
  CHECK(mesh.uvs[static_cast<std::size_t>(mesh.faces[1][0])] == std::array<float, 2>{0.5F, 0});
  CHECK(mesh.places[static_cast<std::size_t>(mesh.faces[1][1])] == Vector3<double>(1, 0, 0));
}

TEST_CASE("a GLB's texture may be moved, held at its edges, or missing") {
  const LoadedMesh moved =
      glb_with(R"({"index": 0})", R"({"index": 0, "extensions": {"KHR_texture_transform": {"offset": [0.5, 0.25], )"
                                  R"("scale": [2, 1]}}})");
  CHECK(moved.uvs[0] == std::array<float, 2>{0.5F, 1 - 1.25F});  // of the lower left corner, (0, 1) with v down
  CHECK(moved.uvs[1] == std::array<float, 2>{2.5F, 1 - 1.25F});
  const LoadedMesh held = glb_with(R"("textures": [{"source": 0}])",
                                   R"("textures": [{"source": 0, "sampler": 0}], "samplers": [{"wrapS": 33071}])");
  CHECK(held.materials[0].wrap_u == TextureWrap::kClamp);
  CHECK(held.materials[0].wrap_v == TextureWrap::kRepeat);
  const LoadedMesh none = glb_with(R"("textures": [{"source": 0}])", R"("textures": [{}])");
  CHECK(none.materials[0].texture == -1);
  CHECK_THROWS_AS(glb_with(R"({"source": 0})", R"({"source": 7})"), DataError);
  CHECK_THROWS_AS(glb_with(R"("material": 0)", R"("material": 9)"), DataError);
}

TEST_CASE("a GLB's alpha mode and colour are those of its material") {
  const LoadedMesh mesh = glb_with(R"("materials": [{)", R"("materials": [{"alphaMode": "MASK", "alphaCutoff": 0.3, )");
  CHECK(mesh.materials[0].alpha == MeshAlpha::kMask);
  CHECK(mesh.materials[0].cutoff == 0.3F);
  const LoadedMesh red =
      glb_with(R"("pbrMetallicRoughness": {)", R"("pbrMetallicRoughness": {"baseColorFactor": [1, 0, 0, 0.5], )");
  CHECK(red.materials[0].color == std::array<float, 4>{1, 0, 0, 0.5F});
}

}  // namespace loaded_mesh_test
