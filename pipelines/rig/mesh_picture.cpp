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
    normal =
        cross(Vector3<double>(corner_of(mesh, hit.face, 1) - a), Vector3<double>(corner_of(mesh, hit.face, 2) - a));
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

/// Rays of a pixel that meet one face, in one quarter of it: they are shaded as one, through their middle.
struct RayGroup {
  std::int32_t face = -1;
  int count = 0;
  double x = 0, y = 0;  ///< sums
};

/// The groups of a quarter of a pixel; rays that meet nothing are left out.
/// @param faces  of the pixel's rays, [side][side]
void find_groups(std::span<const std::int32_t> faces, int side, int quarter, std::vector<RayGroup>& groups) {
  groups.clear();
  const int half = (side + 1) / 2, left = quarter % 2 * half, top = quarter / 2 * half;
  for (int row = top; row < std::min(top + half, side); ++row) {
    for (int col = left; col < std::min(left + half, side); ++col) {
      const std::int32_t face = faces[row_of(row * side + col)];
      if (face < 0) continue;
      auto group = std::find_if(groups.begin(), groups.end(), [&](const RayGroup& g) { return g.face == face; });
      if (group == groups.end()) group = groups.insert(groups.end(), RayGroup{face});
      ++group->count;
      group->x += (col + 0.5) / side;
      group->y += (row + 0.5) / side;
    }
  }
}

/// Draws the rows of one picture.
class Drawing {
 public:
  Drawing(const CastMesh& mesh, const Camera& camera, const MeshLight& light, MeshPicture& picture)
      : mesh_(mesh),
        side_(light.supersample),
        shade_(light.shade),
        width_((light.supersample > 1 ? 0.5 : 1.0) / camera.fx),
        rays_(camera),
        picture_(picture) {}

  void draw_row(int y) const {
    draw_depths(y);
    const std::vector<std::int32_t> faces = mesh_.faces_met(rays_of_row(y, side_));
    for (int x = 0; x < picture_.color.width(); ++x)
      draw_pixel(std::span(faces).subspan(row_of(x * side_ * side_), row_of(side_ * side_)), x, y);
  }

 private:
  /// Rays of a row: `side` × `side` a pixel, a pixel's together.
  std::vector<WorldRay> rays_of_row(int y, int side) const {
    std::vector<WorldRay> rays;
    const int count = side * side, width = picture_.color.width();
    rays.reserve(row_of(width * count));
    for (int x = 0; x < width; ++x) {
      for (int k = 0; k < count; ++k)
        rays.push_back(rays_.through(x + (k % side + 0.5) / side, y + (k / side + 0.5) / side, threshold_of(k, count)));
    }
    return rays;
  }

  void draw_depths(int y) const {
    const std::vector<MeshHit> hits = mesh_.cast(rays_of_row(y, 1));
    for (std::size_t x = 0; x < hits.size(); ++x)
      picture_.depth.row(0, y)[x] = hits[x].face < 0 ? 0.0F : static_cast<float>(hits[x].distance);
  }

  void draw_pixel(std::span<const std::int32_t> faces, int x, int y) const {
    thread_local std::vector<RayGroup> groups;
    Rgb sum{};
    int met = 0;
    for (int quarter = 0; quarter < (side_ > 1 ? 4 : 1); ++quarter) {
      find_groups(faces, side_, quarter, groups);
      for (const RayGroup& group : groups) {
        const WorldRay ray = rays_.through(x + group.x / group.count, y + group.y / group.count);
        const MeshHit hit = hit_on(mesh_.mesh(), group.face, ray);
        if (hit.face < 0) continue;
        const Rgb color = color_at(mesh_.mesh(), hit, ray.direction, width_, shade_);
        for (std::size_t c = 0; c < 3; ++c) sum[c] += static_cast<float>(group.count) * color[c];
        met += group.count;
      }
    }
    if (met == 0) return;
    for (int c = 0; c < 3; ++c) picture_.color(c, y, x) = sum[row_of(c)] / static_cast<float>(met);
    picture_.alpha(0, y, x) = static_cast<float>(met) / static_cast<float>(faces.size());
  }

  const CastMesh& mesh_;
  int side_;
  double shade_, width_;
  PictureRays rays_;
  MeshPicture& picture_;
};

}  // namespace

double sky_shade(const Vector3<double>& normal, double shade) {
  const Vector3<double> sky = Vector3<double>(0.3, -0.45, 0.85).normalized();  // aside, so that walls differ
  return 1 - 0.5 * shade * (1 - dot(normal, sky));
}

MeshPicture mesh_picture(const CastMesh& mesh, const Camera& camera, const MeshLight& light) {
  MeshPicture picture{Image(3, camera.height, camera.width), Image(1, camera.height, camera.width),
                      Image(1, camera.height, camera.width)};
  const Drawing drawing(mesh, camera, light, picture);
  parallel_for(camera.height, 8, [&](Index begin, Index end) {
    for (auto y = static_cast<int>(begin); y < end; ++y) drawing.draw_row(y);
  });
  return picture;
}

}  // namespace hsi4d
