// Any bytes as a mesh in GLB, OBJ or PLY, or as an OBJ's materials, with textures, of which a picture is
// taken. The first byte says which.
#include "pipelines/rig/camera_rig.h"
#include "pipelines/rig/mesh_picture.h"
#include "tests/fuzz/scratch.h"
#include "tests/pipelines/rig/mesh_files.h"

namespace hsi4d::fuzz::textured_mesh_fuzz {

namespace {

constexpr std::size_t kKinds = 4;
constexpr const char* kNames[kKinds] = {"mesh.glb", "mesh.obj", "mesh.ply", "mesh.mtl"};

Scratch& scratch() {
  static Scratch made = [] {
    test::QuadMesh cube;
    cube.add_box(Vector3<double>(0, 0, 0), Vector3<double>(1, 2, 3));
    Image texture(3, 2, 2);
    texture(0, 0, 0) = 1;
    const ScratchFolder folder;
    const std::string files[] = {test::write_glb(folder.path(), cube, texture, R"("alphaMode": "MASK", )"),
                                 test::write_obj(folder.path(), cube), test::write_ply(folder.path(), cube),
                                 folder / "mesh.mtl"};
    std::vector<ScratchFile> all;
    for (std::size_t i = 0; i < kKinds; ++i) all.push_back({kNames[i], read_file(files[i])});
    return Scratch(all);
  }();
  return made;
}

}  // namespace

std::vector<Bytes> corpus() { return scratch().corpus(); }

bool accepts(std::span<const uint8_t> input) {
  const std::size_t choice = input.empty() ? 0 : input[0] % kKinds;
  scratch().try_file(input);
  return is_read([&] {
    TexturedMesh mesh = read_textured_mesh(scratch() / (choice == 3 ? "mesh.obj" : kNames[choice]));
    HSI4D_CHECK(!mesh.faces.empty(), "a mesh without faces was taken");
    for (const auto& face : mesh.faces) {
      for (const std::int32_t corner : face)
        HSI4D_CHECK(corner >= 0 && row_of(corner) < mesh.places.size(), "a corner is no vertex");
    }
    RigSettings few;
    few.count = 1;
    few.size = 8;
    const Camera camera = rig_around(mesh, few).cameras.front();
    const MeshPicture picture = mesh_picture(CastMesh(std::move(mesh)), camera, {2, 0.3});
    for (const float x : picture.color.data()) HSI4D_CHECK(x >= 0 && x <= 1, "a colour is none");
  });
}

const Target target("textured_mesh", corpus, accepts);

}  // namespace hsi4d::fuzz::textured_mesh_fuzz
