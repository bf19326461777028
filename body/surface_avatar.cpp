// Gaussians on a surface: places spread over it, and what lies at each.
#include <algorithm>
#include <array>
#include <cmath>

#include "body/avatar.h"
#include "body/clothing.h"
#include "body/procedural_shape.h"
#include "body/surface_sampling.h"
#include "core/parallel.h"
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

// A Gaussian's colour is the mean of those about its place, by a normal distribution along the surface: it has one for
// all that it covers, and with that of its middle alone edges had teeth.
constexpr double kBlurShare = 0.5;      // standard deviation over the distance of neighbours,
constexpr double kLargestBlur = 0.005;  // metres; more would take the patterns from an avatar of few Gaussians
constexpr double kLatticeShare = 0.9;   // distance of the points that are looked at over it

/// A point of a hexagonal lattice, in standard deviations, and its weight; the weights sum to 1.
struct LatticePoint {
  double u, v, weight;
};

std::vector<LatticePoint> lattice() {
  std::vector<LatticePoint> points;
  double sum = 0;
  for (int a = -2; a <= 2; ++a) {
    for (int b = -2; b <= 2; ++b) {
      if (std::abs(a + b) > 2) continue;
      const double u = kLatticeShare * (a + 0.5 * b), v = kLatticeShare * 0.8660254037844386 * b;
      points.push_back({u, v, std::exp(-0.5 * (u * u + v * v))});
      sum += points.back().weight;
    }
  }
  for (LatticePoint& point : points) point.weight /= sum;
  return points;
}

/// A place with its frame, whose z is the normal, and the two joints that move it most.
struct Dressed {
  const SurfaceSample& sample;
  Matrix3<double> frame;
  std::array<int, 2> joints;
  double second;  ///< share of the clothes on the second joint: seams are as smooth as skinning weights
};

Vector color_of(const detail::Clothing& clothing, const std::vector<LatticePoint>& points, const Dressed& place) {
  const double blur = std::min(kBlurShare * place.sample.spacing, kLargestBlur);
  Vector sum = Vector::Zero();
  for (const LatticePoint& at : points) {
    const Vector point = place.sample.place.point + blur * at.u * place.frame.col(0) + blur * at.v * place.frame.col(1);
    Vector color = clothing.color(point, place.joints[0]);
    if (place.second > 0) {
      color = color * (1 - place.second) + clothing.color(point, place.joints[1]) * place.second;
    }
    sum += at.weight * color;
  }
  return sum * (0.90 + 0.10 * place.frame(1, 2));  // light from above, as clothes in photographs have it
}

/// [N,3]
/// @param frames   of the samples
/// @param weights  of the Gaussians, the largest of each first
std::vector<float> colors_of(const detail::Clothing& clothing, const std::vector<SurfaceSample>& samples,
                             const std::vector<Matrix3<double>>& frames, const SparseWeights& weights,
                             const AvatarSettings& settings) {
  constexpr Index kGrain = 256;
  const std::vector<LatticePoint> points = lattice();
  const Random noise(settings.seed, random_stream("avatar.color"));
  std::vector<float> colors(3 * samples.size());
  parallel_for(std::ssize(samples), kGrain, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i) {
      const auto n = static_cast<std::size_t>(i), at = n * static_cast<std::size_t>(weights.per_vertex);
      const double second = 1 - detail::smoothstep(-0.2, 0.2, weights.weights[at] - weights.weights[at + 1]);
      const Dressed place{samples[n], frames[n], {weights.indices[at], weights.indices[at + 1]}, second};
      const double speckle = 1 + 0.08 * settings.texture * (noise.uniform(static_cast<std::uint64_t>(i)) - 0.5);
      const Vector color = color_of(clothing, points, place) * speckle;
      for (int c = 0; c < 3; ++c) colors[3 * n + static_cast<std::size_t>(c)] = static_cast<float>(color[c]);
    }
  });
  return colors;
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
  std::vector<Matrix3<double>> frames;

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
    frames.push_back(frame);
  }
  avatar.colors = colors_of(clothing, samples, frames, avatar.weights, settings);
  avatar.weights = normalized_weights(std::move(avatar.weights), "avatar");
  return avatar;
}

}  // namespace hsi4d
