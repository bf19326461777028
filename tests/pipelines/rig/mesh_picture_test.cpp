#include "pipelines/rig/mesh_picture.h"

#include <cmath>

#include <catch2/catch.hpp>

#include "core/camera_places.h"
#include "core/parallel.h"
#include "tests/pipelines/rig/mesh_files.h"

namespace mesh_picture_test {

using namespace hsi4d;
using namespace hsi4d::test;

namespace {

constexpr MeshLight kPlain = {4, 0};

CastMesh cast_mesh(LoadedMesh loaded_mesh) { return CastMesh(textured_mesh(std::move(loaded_mesh), "mesh.obj")); }

/// A tilted square of 2 m: its lower edge at y = 0, its upper one at y = 1.2.
QuadMesh tilted() {
  QuadMesh quads;
  quads.add(Vector3<double>(-1, 0, -0.8), Vector3<double>(2, 0, 0), Vector3<double>(0, 1.2, 1.6));
  return quads;
}

/// From y = −3 towards +y.
Camera level_camera(int size = 64) {
  return camera_at(Vector3<double>(0.1, -3, 0.05), Vector3<double>(0.1, 0, 0.05), 1.2, size);
}

/// u, v and camera z where the ray through a pixel's place meets the tilted square's plane.
struct Met {
  double u, v, z;
};
Met meet_tilted(double x, double y, int size) {
  const double across = (x / size - 0.5) / 1.2, down = (y / size - 0.5) / 1.2;
  // (0.1 + across z, −3 + z, 0.05 − down z) on the plane through (·, 0, −0.8) and (·, 1.2, 0.8)
  const double v = (0.85 - 3 * down) / (1.6 + 1.2 * down), z = 3 + 1.2 * v;
  return {(0.1 + across * z + 1) / 2, v, z};
}

}  // namespace

TEST_CASE("a tilted textured square has the depths and colours of its formula") {
  const CastMesh mesh = cast_mesh(loaded(tilted(), quarters()));
  const MeshPicture picture = mesh_picture(mesh, level_camera(), kPlain);
  int inside = 0;
  for (int y = 0; y < 64; ++y) {
    for (int x = 0; x < 64; ++x) {
      const Met met = meet_tilted(x + 0.5, y + 0.5, 64);
      const bool is_in = met.u > 0 && met.u < 1 && met.v > 0 && met.v < 1;
      CAPTURE(x, y, met.u, met.v);
      CHECK(picture.depth(0, y, x) == (is_in ? Approx(met.z).epsilon(1e-6) : Approx(0)));
      const auto far_from = [](double a, double b) { return std::fabs(a - b) > 0.08; };
      if (!far_from(met.u, 0) || !far_from(met.u, 1) || !far_from(met.v, 0) || !far_from(met.v, 1)) continue;
      CHECK(picture.alpha(0, y, x) == (is_in ? 1 : 0));
      if (!is_in || !far_from(met.u, 0.5) || !far_from(met.v, 0.5)) continue;
      ++inside;
      const Image texels = quarters();
      const int row = met.v > 0.5 ? 0 : 15, col = met.u > 0.5 ? 15 : 0;
      for (int c = 0; c < 3; ++c) CHECK(picture.color(c, y, x) == Approx(texels(c, row, col)).margin(1e-6));
    }
  }
  CHECK(inside > 500);
}

TEST_CASE("edges of a mesh are as transparent as they cover pixels") {
  QuadMesh quads;
  quads.add(Vector3<double>(-1, 0, -1), Vector3<double>(1.125, 0, 0), Vector3<double>(0, 0, 2));
  const Camera camera = camera_at(Vector3<double>(0, -1, 0), Vector3<double>(0, 0, 0), 0.5, 4);  // a pixel is ½ m
  const MeshPicture picture = mesh_picture(cast_mesh(loaded(quads, {})), camera, kPlain);
  CHECK(picture.alpha(0, 1, 1) == 1);
  CHECK(picture.alpha(0, 1, 2) == 0.25F);  // 1/8 m of ½ m
  CHECK(picture.color(0, 1, 2) == 1);
  CHECK(picture.alpha(0, 1, 3) == 0);
  CHECK(picture.depth(0, 1, 2) == 0);
}

TEST_CASE("what looks away from the sky is darker, and colours stay without a shade") {
  CHECK(sky_shade(Vector3<double>(0, 0, 1), 0.3) > sky_shade(Vector3<double>(1, 0, 0), 0.3));
  CHECK(sky_shade(Vector3<double>(1, 0, 0), 0.3) > sky_shade(Vector3<double>(-1, 0, 0), 0.3));
  CHECK(sky_shade(Vector3<double>(0, 0, -1), 0.3) >= 0.7);
  CHECK(sky_shade(Vector3<double>(0, 0, -1), 0) == 1);
  QuadMesh cube;
  cube.add_box(Vector3<double>(-1, -1, -1), Vector3<double>(1, 1, 1));
  const CastMesh mesh = cast_mesh(loaded(cube, {}));
  const Camera camera = camera_at(Vector3<double>(-4, -5, 3), Vector3<double>(0, 0, 0), 1.2, 32);
  const MeshPicture shaded = mesh_picture(mesh, camera, {2, 0.5}), plain = mesh_picture(mesh, camera, {2, 0});
  CHECK(plain.color(0, 16, 16) == 1);
  CHECK(shaded.color(0, 16, 16) < 0.95F);
}

TEST_CASE("a mask is cut out at its cut-off, and a blend stops as many rays as its alpha says") {
  LoadedMesh leaf = loaded(tilted(), {});
  Image texture(4, 16, 16);
  for (int y = 0; y < 16; ++y) {
    for (int x = 0; x < 16; ++x) {
      texture(1, y, x) = 1;
      texture(3, y, x) = x < 8 ? 1 : 0.25F;
    }
  }
  leaf.materials[0].texture = 0;
  leaf.textures.push_back({"leaf", encode_image("leaf.png", texture), true});
  const auto picture_with = [&](MeshAlpha alpha) {
    leaf.materials[0].alpha = alpha;
    return mesh_picture(cast_mesh(leaf), level_camera(), kPlain);
  };
  constexpr int kMiddle = 36, kLeft = 20, kRight = 44;
  const MeshPicture mask = picture_with(MeshAlpha::kMask), blend = picture_with(MeshAlpha::kBlend);
  CHECK(mask.alpha(0, kMiddle, kLeft) == 1);
  CHECK(mask.alpha(0, kMiddle, kRight) == 0);
  CHECK(mask.depth(0, kMiddle, kRight) == 0);
  CHECK(blend.alpha(0, kMiddle, kLeft) == 1);
  CHECK(blend.alpha(0, kMiddle, kRight) == Approx(0.25).margin(0.01));
  CHECK(blend.color(1, kMiddle, kRight) == 1);
  const MeshPicture opaque = picture_with(MeshAlpha::kOpaque);
  CHECK(opaque.alpha(0, kMiddle, kRight) == 1);
  CHECK(opaque.color(1, kMiddle, kRight) == 1);
}

TEST_CASE("a coarse picture of a fine texture has its mean") {
  Image stripes(3, 256, 256);
  for (int y = 0; y < 256; ++y) {
    for (int x = 0; x < 256; ++x) stripes(0, y, x) = x % 2 == 0 ? 1 : 0;
  }
  const MeshPicture picture = mesh_picture(cast_mesh(loaded(tilted(), stripes)), level_camera(32), kPlain);
  for (int x = 12; x < 20; ++x) CHECK(picture.color(0, 18, x) == Approx(0.5).margin(0.03));
}

TEST_CASE("a picture has the same bits on any number of threads", "[parallel]") {
  QuadMesh cube;
  cube.add_box(Vector3<double>(-1, -1, -1), Vector3<double>(1, 1, 1));
  const Camera camera = camera_at(Vector3<double>(-4, -5, 3), Vector3<double>(0, 0, 0), 1.2, 48);
  const auto drawn = [&](int threads) {
    MeshPicture picture;
    with_threads(threads, [&] { picture = mesh_picture(cast_mesh(loaded(cube, quarters())), camera, {3, 0.3}); });
    return picture;
  };
  const MeshPicture one = drawn(1), two = drawn(2);
  CHECK(one.color == two.color);
  CHECK(one.alpha == two.alpha);
  CHECK(one.depth == two.depth);
}

}  // namespace mesh_picture_test
