#include "pipelines/rig/mesh_picture.h"

#include <algorithm>
#include <cmath>

#include "core/parallel.h"

namespace hsi4d {

namespace {

using Rgb = std::array<float, 3>;

/// Weights of a face's corners at a hit.
std::array<double, 3> weights_of(const MeshHit& hit) { return {1 - hit.u - hit.v, hit.u, hit.v}; }

/// The smooth normal at a hit, unit, turned to where the ray comes from.
Vector3<double> normal_at(const TexturedMesh& mesh, const MeshHit& hit, const Vector3<double>& direction) {
  const std::array<std::int32_t, 3>& corners = mesh.faces[row_of(hit.face)];
  const std::array<double, 3> weights = weights_of(hit);
  Vector3<double> normal = Vector3<double>::Zero();
  for (std::size_t k = 0; k < 3; ++k)
    normal += weights[k] * Vector3<float>(mesh.normals[row_of(corners[k])].data()).cast<double>();
  if (!(normal.norm() > 0.1)) {
    const Vector3<double> a = corner_of(mesh, hit.face, 0);
    normal = cross(Vector3<double>(corner_of(mesh, hit.face, 1) - a), Vector3<double>(corner_of(mesh, hit.face, 2) - a));
  }
  normal.normalize();
  return dot(normal, direction) > 0 ? Vector3<double>(-normal) : normal;
}

/// Colour of what a ray meets.
/// @param width  of what it stands for, metres across the ray at distance 1
Rgb color_at(const TexturedMesh& mesh, const MeshHit& hit, const Vector3<double>& direction, double width,
               double shade) {
  const std::array<std::int32_t, 3>& corners = mesh.faces[row_of(hit.face)];
  const MeshMaterial& material = mesh.materials[row_of(mesh.materials_of_faces[row_of(hit.face)])];
  const std::array<double, 3> weights = weights_of(hit);
  std::array<double, 3> color{};
  double u = 0, v = 0;
  for (std::size_t k = 0; k < 3; ++k) {
    for (std::size_t c = 0; c < 3; ++c) color[c] += weights[k] * mesh.colors[row_of(corners[k])][c];
    u += weights[k] * mesh.uvs[row_of(corners[k])][0];
    v += weights[k] * mesh.uvs[row_of(corners[k])][1];
  }
  std::array<float, 4> texel = {1, 1, 1, 1};
  if (material.texture >= 0) {
    constexpr double kMostOblique = 0.1;  // cosine: beyond, sharp along is worth more than smooth across
    const Texture& texture = mesh.textures[row_of(material.texture)];
    const double size = std::sqrt(static_cast<double>(texture.levels[0].width) * texture.levels[0].height);
    const double across = hit.distance * width / std::sqrt(std::max(kMostOblique, std::fabs(hit.cosine)));
    texel = look_up(texture, u, v, across * mesh.densities[row_of(hit.face)] * size, material.wrap_u, material.wrap_v);
  }
  const double light = shade > 0 ? sky_shade(normal_at(mesh, hit, direction), shade) : 1;
  Rgb result;
  for (std::size_t c = 0; c < 3; ++c)
    result[c] = static_cast<float>(std::clamp(color[c] * material.color[c] * texel[c] * light, 0.0, 1.0));
  return result;
}

/// Alphas that the rays of a pixel stop at: as many as there are, evenly, in an order that neighbours do not share.
float threshold_of(int ray, int rays) {
  const int step = rays % 7 == 0 ? 5 : 7;
  return (static_cast<float>(ray * step % rays) + 0.5F) / static_cast<float>(rays);
}

/// Rays of a row: `side` × `side` a pixel, a pixel's together.
std::vector<WorldRay> rays_of_row(const Camera& camera, int y, int side) {
  std::vector<WorldRay> rays;
  rays.reserve(static_cast<std::size_t>(camera.width * side * side));
  for (int x = 0; x < camera.width; ++x) {
    for (int k = 0; k < side * side; ++k) {
      rays.push_back(ray_through(camera, x + (k % side + 0.5) / side, y + (k / side + 0.5) / side));
      rays.back().threshold = threshold_of(k, side * side);
    }
  }
  return rays;
}

void draw_row(const CastMesh& mesh, const Camera& camera, const MeshLight& light, int y, MeshPicture& picture) {
  std::vector<MeshHit> hits;
  mesh.cast(rays_of_row(camera, y, 1), hits);
  for (int x = 0; x < camera.width; ++x) {
    const MeshHit& hit = hits[row_of(x)];
    picture.depth(0, y, x) = hit.face < 0 ? 0.0F : static_cast<float>(hit.distance);
  }
  const int side = light.supersample, count = side * side;
  const std::vector<WorldRay> rays = rays_of_row(camera, y, side);
  mesh.cast(rays, hits);
  const double width = 1 / (camera.fx * side);
  for (int x = 0; x < camera.width; ++x) {
    Rgb sum{};
    int met = 0;
    for (int i = x * count; i < (x + 1) * count; ++i) {
      if (hits[row_of(i)].face < 0) continue;
      ++met;
      const Rgb color = color_at(mesh.mesh(), hits[row_of(i)], rays[row_of(i)].direction, width, light.shade);
      for (std::size_t c = 0; c < 3; ++c) sum[c] += color[c];
    }
    if (met == 0) continue;
    for (int c = 0; c < 3; ++c) picture.color(c, y, x) = sum[row_of(c)] / static_cast<float>(met);
    picture.alpha(0, y, x) = static_cast<float>(met) / static_cast<float>(count);
  }
}

}  // namespace

double sky_shade(const Vector3<double>& normal, double shade) {
  const Vector3<double> sky = Vector3<double>(0.3, -0.45, 0.85).normalized();  // aside, so that walls differ
  return 1 - 0.5 * shade * (1 - dot(normal, sky));
}

MeshPicture mesh_picture(const CastMesh& mesh, const Camera& camera, const MeshLight& light) {
  MeshPicture picture{Image(3, camera.height, camera.width), Image(1, camera.height, camera.width),
                      Image(1, camera.height, camera.width)};
  parallel_for(camera.height, 8, [&](Index begin, Index end) {
    for (auto y = static_cast<int>(begin); y < end; ++y) draw_row(mesh, camera, light, y, picture);
  });
  return picture;
}

}  // namespace hsi4d
