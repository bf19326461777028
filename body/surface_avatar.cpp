// Gaussians on a surface: places spread over it, and what lies at each.
#include <algorithm>
#include <cmath>
#include <sstream>

#include "body/avatar.h"
#include "body/clothing.h"
#include "body/surface_sampling.h"
#include "core/quaternion.h"
#include "core/random.h"

namespace hsi4d {

namespace {

using Vector = Vector3<double>;

void require_range(const char* name, double value, double low, double high) {
  if (value >= low && value <= high) return;
  std::ostringstream text;
  text << "avatar: " << name << " is " << value << "; allowed: " << low << " to " << high;
  throw UserError(text.str());
}

/// Distance of neighbours over the distance to what is midway between them: 1.6 in an even triangular lattice.
constexpr double kReachShare = 1.6;

/// Normal scale over how far the surface bends away, where it does: fingertips are rounder than their Gaussians are
/// small.
constexpr double kBendShare = 1.25;

/// Gaussians per area over those of the trunk: parts with detail need more.
double density_of(std::int32_t joint) {
  if (joint >= 25) return 6;                                               // fingers
  if (joint == 20 || joint == 21) return 4;                                // wrists
  if (joint == 15 || (joint >= 22 && joint <= 24)) return 2.5;             // head
  if (joint == 12 || joint == 18 || joint == 19) return 1.5;               // neck, forearms
  if (joint == 7 || joint == 8 || joint == 10 || joint == 11) return 1.5;  // feet
  return 1;
}

/// Places per area at each vertex: 1 everywhere without detail.
std::vector<double> densities_of(const BodyModel& body, double detail) {
  std::vector<double> densities(static_cast<std::size_t>(body.vertex_count()), 0.0);
  const Index k = body.weights.per_vertex;
  for (std::size_t i = 0; i < body.weights.weights.size(); ++i) {
    const double density = 1 + detail * (density_of(body.weights.indices[i]) - 1);
    densities[i / static_cast<std::size_t>(k)] += body.weights.weights[i] * density;
  }
  return densities;
}

Vector normal_at(const BodyModel& body, const std::vector<Vector>& normals, const SurfacePlace& place) {
  Vector sum = Vector::Zero();
  for (std::size_t i = 0; i < 3; ++i) {
    const std::int32_t v = body.faces[3 * static_cast<std::size_t>(place.face) + i];
    sum += normals[static_cast<std::size_t>(v)] * place.shares[i];
  }
  return direction_of(sum).unit;
}

/// Quaternion of a rotation that takes z to the normal.
Vector4<double> facing(const Vector& normal) {
  int least = 0;
  for (int i = 1; i < 3; ++i) {
    if (std::abs(normal[i]) < std::abs(normal[least])) least = i;
  }
  const Vector across = direction_of(cross(Vector(Vector::Unit(least)), normal)).unit;
  Matrix3<double> frame;
  frame.col(0) = across;
  frame.col(1) = cross(normal, across);
  frame.col(2) = normal;
  return quaternion_from_matrix(frame);
}

void append(std::vector<float>& to, std::initializer_list<double> numbers) {
  for (const double x : numbers) to.push_back(static_cast<float>(x));
}

}  // namespace

Avatar surface_avatar(const BodyModel& body, const AvatarSettings& settings) {
  require_range("gaussians", static_cast<double>(settings.gaussians), 1, 5e6);
  require_range("cover", settings.cover, 0.01, 100);
  require_range("thickness", settings.thickness, 1e-3, 10);
  require_range("opacity", settings.opacity, 1e-3, 1 - 1e-6);
  require_range("detail", settings.detail, 0, 1);
  require_range("texture", settings.texture, 0, 1);
  HSI4D_CHECK(body.face_count() > 0, "the body has no surface");
  const detail::Clothing clothing(body, settings.texture);
  const std::vector<SurfaceSample> samples =
      sample_surface(body, densities_of(body, settings.detail), settings.gaussians, settings.seed);
  const std::vector<Vector> normals = vertex_normals(body);
  const Random noise(settings.seed, random_stream("avatar.color"));

  Avatar avatar;
  avatar.parents = body.parents;
  avatar.joints = body.joints;
  avatar.joint_names = body.joint_names;
  avatar.body = body.name;
  avatar.weights = {settings.gaussians, body.joint_count(), 4, {}, {}};
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const SurfaceSample& sample = samples[i];
    const Vector point = sample.place.point, normal = normal_at(body, normals, sample.place);
    const Vector4<double> q = facing(normal);
    // Where places lie unevenly, the ones beside a gap reach over it.
    const double tangent = settings.cover * std::max(sample.spacing, kReachShare * sample.reach);
    append(avatar.means, {point[0], point[1], point[2]});
    append(avatar.quats, {q[0], q[1], q[2], q[3]});
    append(avatar.log_scales, {std::log(tangent), std::log(tangent),
                               std::log(std::max(tangent * settings.thickness, kBendShare * sample.bend))});
    append(avatar.opacity_logits, {std::log(settings.opacity / (1 - settings.opacity))});
    append_weights(body, sample.place, avatar.weights);
    const int joint = avatar.weights.indices[avatar.weights.indices.size() - 4];
    const double speckle = 1 + 0.08 * settings.texture * (noise.uniform(static_cast<std::uint64_t>(i)) - 0.5);
    const Vector color = clothing.color(point, normal, joint) * speckle;
    append(avatar.colors, {color[0], color[1], color[2]});
  }
  avatar.weights = normalized_weights(std::move(avatar.weights), "avatar");
  return avatar;
}

}  // namespace hsi4d
