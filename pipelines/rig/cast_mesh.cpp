#include "pipelines/rig/cast_mesh.h"

#include <algorithm>
#include <cmath>

#include <Eigen/LU>

#include "core/check.h"

namespace hsi4d {

namespace {

/// A row of a face's corners, mixed.
template <std::size_t N>
std::array<double, N> mixed(const TexturedMesh& mesh, const std::vector<std::array<float, N>>& rows, std::int32_t face,
                            double u, double v) {
  const std::array<std::int32_t, 3>& corners = mesh.faces[row_of(face)];
  std::array<double, N> result;
  for (std::size_t k = 0; k < N; ++k)
    result[k] =
        (1 - u - v) * rows[row_of(corners[0])][k] + u * rows[row_of(corners[1])][k] + v * rows[row_of(corners[2])][k];
  return result;
}

bool stops_ray(const void* context, std::int32_t face, float u, float v, float threshold) {
  const TexturedMesh& mesh = *static_cast<const TexturedMesh*>(context);
  const MeshMaterial& material = mesh.materials[row_of(mesh.materials_of_faces[row_of(face)])];
  const float alpha = alpha_at(mesh, face, u, v);
  return material.alpha == MeshAlpha::kMask ? alpha >= material.cutoff : alpha >= threshold;
}

RayScene* scene_of(const TexturedMesh& mesh) {
  std::string error;
  RayScene* const scene = ray_library().make_scene({mesh.places, mesh.faces, mesh.opaque, stops_ray, &mesh}, error);
  if (scene == nullptr) throw UserError("rays at a mesh of " + std::to_string(mesh.faces.size()) + " faces: " + error);
  return scene;
}

}  // namespace

CastMesh::CastMesh(TexturedMesh mesh) : mesh_(std::move(mesh)), scene_(scene_of(mesh_), ray_library().free_scene) {}

std::vector<std::int32_t> CastMesh::faces_met(std::span<const WorldRay> rays) const {
  std::vector<MeshRay> asked(rays.size());
  std::vector<std::int32_t> faces(rays.size());
  for (std::size_t i = 0; i < rays.size(); ++i) {
    for (Index k = 0; k < 3; ++k) {
      asked[i].origin[row_of(static_cast<std::int32_t>(k))] = static_cast<float>(rays[i].origin[k] - mesh_.origin[k]);
      asked[i].direction[row_of(static_cast<std::int32_t>(k))] = static_cast<float>(rays[i].direction[k]);
    }
    asked[i].threshold = rays[i].threshold;
  }
  ray_library().cast(*scene_, asked, faces);
  return faces;
}

std::vector<MeshHit> CastMesh::cast(std::span<const WorldRay> rays) const {
  const std::vector<std::int32_t> faces = faces_met(rays);
  std::vector<MeshHit> hits;
  for (std::size_t i = 0; i < rays.size(); ++i) hits.push_back(hit_on(mesh_, faces[i], rays[i]));
  return hits;
}

MeshHit hit_on(const TexturedMesh& mesh, std::int32_t face, const WorldRay& ray) {
  MeshHit hit{face};
  if (face < 0) return hit;
  // Möller and Trumbore 1997
  const Vector3<double> a = corner_of(mesh, face, 0), ab = corner_of(mesh, face, 1) - a;
  const Vector3<double> ac = corner_of(mesh, face, 2) - a, from = ray.origin - mesh.origin - a;
  const Vector3<double> normal = cross(ab, ac), p = cross(ray.direction, ac), q = cross(from, ab);
  const double determinant = dot(ab, p), scale = normal.norm() * ray.direction.norm();
  if (determinant == 0 || scale == 0) return {};
  hit.u = std::clamp(dot(from, p) / determinant, 0.0, 1.0);
  hit.v = std::clamp(dot(ray.direction, q) / determinant, 0.0, 1 - hit.u);
  const Vector3<double> reach = hit.u * ab + hit.v * ac - from;
  hit.distance = dot(reach, ray.direction) / dot(ray.direction, ray.direction);
  hit.cosine = dot(normal, ray.direction) / scale;
  return hit;
}

PictureRays::PictureRays(const Camera& camera) : center_(camera_center_world(camera)) {
  Matrix3<double> camera_from_pixel = Matrix3<double>::Identity();
  camera_from_pixel.row(0) << 1 / camera.fx, 0, -camera.cx / camera.fx;
  camera_from_pixel.row(1) << 0, 1 / camera.fy, -camera.cy / camera.fy;
  direction_ = camera.camera_from_world.rotation.inverse() * camera_from_pixel;
}

float alpha_at(const TexturedMesh& mesh, std::int32_t face, double u, double v) {
  const MeshMaterial& material = mesh.materials[row_of(mesh.materials_of_faces[row_of(face)])];
  double alpha = material.color[3] * mixed(mesh, mesh.colors, face, u, v)[3];
  const std::array<double, 2> uv = mixed(mesh, mesh.uvs, face, u, v);
  const auto looked_up = [&](int texture) {
    return look_up(mesh.textures[row_of(texture)], uv[0], uv[1], 1, material.wrap_u, material.wrap_v);
  };
  if (material.opacity_texture >= 0) {
    const bool has_alpha = mesh.textures[row_of(material.opacity_texture)].has_alpha;
    alpha *= looked_up(material.opacity_texture)[has_alpha ? 3 : 0];
  } else if (material.texture >= 0) {
    alpha *= looked_up(material.texture)[3];
  }
  return static_cast<float>(alpha);
}

}  // namespace hsi4d
