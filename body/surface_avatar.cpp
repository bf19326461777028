// Gaussians on a surface: places spread over it, and what lies at each.
#include <algorithm>
#include <array>
#include <cmath>

#include "body/avatar.h"
#include "body/clothing.h"
#include "body/procedural_shape.h"
#include "body/surface_sampling.h"
#include "core/quaternion.h"
#include "core/random.h"
#include "core/text.h"

namespace hsi4d {

namespace {

using Vector = Vector3<double>;

void require_range(const char* name, double value, double low, double high) {
  if (value >= low && value <= high) return;
  throw UserError("avatar: " + std::string(name) + " is " + number_text(value) + "; allowed: " + number_text(low) +
                  " to " + number_text(high));
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
std::vector<double> densities_of(const BodyModel& body, const detail::Clothing& clothing, double detail) {
  std::vector<double> densities(static_cast<std::size_t>(body.vertex_count()), 0.0);
  const Index k = body.weights.per_vertex;
  for (std::size_t i = 0; i < body.weights.weights.size(); ++i) {
    const double density = 1 + detail * (density_of(body.weights.indices[i]) - 1);
    densities[i / static_cast<std::size_t>(k)] += body.weights.weights[i] * density;
  }
  for (std::size_t v = 0; v < densities.size(); ++v) {
    const float* const at = body.vertices.data() + 3 * v;
    densities[v] *= 1 + detail * (clothing.detail(Vector(at[0], at[1], at[2])) - 1);
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

/// A rotation that takes z to the normal.
Matrix3<double> facing(const Vector& normal) {
  int least = 0;
  for (int i = 1; i < 3; ++i) {
    if (std::abs(normal[i]) < std::abs(normal[least])) least = i;
  }
  const Vector across = direction_of(cross(Vector(Vector::Unit(least)), normal)).unit;
  Matrix3<double> frame;
  frame.col(0) = across;
  frame.col(1) = cross(normal, across);
  frame.col(2) = normal;
  return frame;
}

/// The colours about a place, in the mean: weights of a normal distribution along the surface at points of a hexagonal
/// lattice. A Gaussian has one colour for all that it covers; with that of its middle alone, edges had teeth.
constexpr double kBlurShare = 0.5;      // standard deviation over the distance of neighbours,
constexpr double kLargestBlur = 0.005;  // metres; more would take the patterns from an avatar of few Gaussians
constexpr double kLatticeShare = 0.9;   // distance of the lattice's points over it

/// What of a place's colour is that of clothes on its second joint: seams are as smooth as skinning weights.
double second_share(double first, double second) { return 1 - detail::smoothstep(-0.2, 0.2, first - second); }

Vector color_around(const detail::Clothing& clothing, const SurfacePlace& place, const Matrix3<double>& frame,
                    double spacing, const std::array<int, 2>& joints, double second) {
  const double step = kLatticeShare * std::min(kBlurShare * spacing, kLargestBlur);
  Vector sum = Vector::Zero();
  double weights = 0;
  for (int a = -2; a <= 2; ++a) {
    for (int b = -2; b <= 2; ++b) {
      if (std::abs(a + b) > 2) continue;
      const double u = a + 0.5 * b, v = 0.8660254037844386 * b;
      const double weight = std::exp(-0.5 * kLatticeShare * kLatticeShare * (u * u + v * v));
      const Vector point = place.point + step * u * frame.col(0) + step * v * frame.col(1);
      Vector color = clothing.color(point, joints[0]);
      if (second > 0) color = color * (1 - second) + clothing.color(point, joints[1]) * second;
      sum += weight * color;
      weights += weight;
    }
  }
  return sum / weights;
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
      sample_surface(body, densities_of(body, clothing, settings.detail), settings.gaussians, settings.seed);
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
    const Matrix3<double> frame = facing(normal);
    const Vector4<double> q = quaternion_from_matrix(frame);
    // Where places lie unevenly, the ones beside a gap reach over it.
    const double tangent = settings.cover * std::max(sample.spacing, kReachShare * sample.reach);
    append(avatar.means, {point[0], point[1], point[2]});
    append(avatar.quats, {q[0], q[1], q[2], q[3]});
    append(avatar.log_scales, {std::log(tangent), std::log(tangent),
                               std::log(std::max(tangent * settings.thickness, kBendShare * sample.bend))});
    append(avatar.opacity_logits, {std::log(settings.opacity / (1 - settings.opacity))});
    append_weights(body, sample.place, avatar.weights);
    const std::size_t at = avatar.weights.indices.size() - 4;
    const std::array<int, 2> joints = {avatar.weights.indices[at], avatar.weights.indices[at + 1]};
    const double second = second_share(avatar.weights.weights[at], avatar.weights.weights[at + 1]);
    const double speckle = 1 + 0.08 * settings.texture * (noise.uniform(static_cast<std::uint64_t>(i)) - 0.5);
    const double light = 0.90 + 0.10 * normal[1];  // from above, as clothes in photographs have it
    const Vector color = color_around(clothing, sample.place, frame, sample.spacing, joints, second) * light * speckle;
    append(avatar.colors, {color[0], color[1], color[2]});
  }
  avatar.weights = normalized_weights(std::move(avatar.weights), "avatar");
  return avatar;
}

}  // namespace hsi4d
