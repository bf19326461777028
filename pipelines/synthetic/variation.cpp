#include "pipelines/synthetic/variation.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "body/pose_layout.h"
#include "core/angles.h"
#include "core/random.h"
#include "core/rotation.h"
#include "pipelines/synthetic/kit.h"

namespace hsi4d {
namespace {

using Vector = Vector3<double>;

/// What is drawn for each part; a number in [-1, 1] times the variation.
enum Draw : std::uint64_t {
  kSpeed,
  kBegin,
  kTurn,
  kDistance,
  kUp,
  kDrift,
  kDirection,
  kAside,
  kHeading,
  kShirt,
  kTrousers,
  kShade,
  kSun,
  kBright
};

class Draws {
 public:
  explicit Draws(const SyntheticSettings& settings)
      : random_(static_cast<std::uint64_t>(settings.seed), random_stream("synthetic.variation")),
        variation_(settings.variation) {}

  double operator()(Draw what) const { return variation_ * random_.uniform(what, -1.0, 1.0); }

 private:
  Random random_;
  double variation_;
};

enum class Garment { kNone, kShirt, kTrousers };

int joint_of(const Avatar& avatar, std::size_t gaussian) {
  const auto width = static_cast<std::size_t>(avatar.weights.per_vertex);
  const auto first = avatar.weights.weights.begin() + static_cast<std::ptrdiff_t>(width * gaussian);
  const auto most = std::max_element(first, first + static_cast<std::ptrdiff_t>(width)) - first;
  return avatar.weights.indices[width * gaussian + static_cast<std::size_t>(most)];
}

Garment garment_of(const std::string& joint) {
  for (const char* name :
       {"spine1", "spine2", "spine3", "left_collar", "right_collar", "left_shoulder", "right_shoulder"})
    if (joint == name) return Garment::kShirt;
  for (const char* name : {"pelvis", "left_hip", "right_hip", "left_knee", "right_knee"})
    if (joint == name) return Garment::kTrousers;
  return Garment::kNone;
}

/// Red over green and over blue, as of skin under any light.
bool is_skin(const Vector& color) {
  return std::abs(color[0] / color[1] - 1.33) < 0.14 && std::abs(color[0] / color[2] - 1.67) < 0.3;
}

}  // namespace

ClipVariation clip_variation(const SyntheticSettings& settings) {
  ClipVariation result;
  if (settings.variation == 0) return result;
  const Draws draw(settings);
  result.speed = 1 + 0.15 * draw(kSpeed);
  result.begin = 0.4 * std::abs(draw(kBegin));
  result.turn = 13 * kDegree * draw(kTurn);
  result.distance = 1 + 0.09 * draw(kDistance);
  result.up = 0.14 * draw(kUp);
  result.drift = (1 + 0.4 * draw(kDrift)) * (draw(kDirection) < 0 ? -1 : 1);
  result.aside = draw(kAside);
  result.heading_deg = 9 * draw(kHeading);
  return result;
}

Avatar in_other_clothes(const Avatar& avatar, const SyntheticSettings& settings) {
  if (settings.variation == 0) return avatar;
  const Draws draw(settings);
  const Vector grey = Vector(1, 1, 1).normalized();
  const Matrix3<double> shirt = so3_exp(Vector(grey * (std::numbers::pi * draw(kShirt))));
  const double shade = 1 + 0.35 * draw(kShade), tint = 0.3 * draw(kTrousers);
  const Vector trousers = shade * Vector(1 + tint, 1 + 0.1 * std::abs(tint), 1 - tint);
  Avatar result = avatar;
  for (std::size_t i = 0; i < static_cast<std::size_t>(avatar.count()); ++i) {
    const Garment garment = garment_of(avatar.joint_names[static_cast<std::size_t>(joint_of(avatar, i))]);
    const Vector color(double(avatar.colors[3 * i]), double(avatar.colors[3 * i + 1]),
                       double(avatar.colors[3 * i + 2]));
    if (garment == Garment::kNone || is_skin(color)) continue;
    const Vector other = garment == Garment::kShirt ? Vector(shirt * color) : Vector(trousers.cwiseProduct(color));
    for (std::size_t c = 0; c < 3; ++c)
      result.colors[3 * i + c] = static_cast<float>(std::clamp(other[static_cast<Eigen::Index>(c)], 0.0, 1.0));
  }
  return result;
}

Light from_another_side(Light light, const SyntheticSettings& settings) {
  if (settings.variation == 0) return light;
  const Draws draw(settings);
  const Vector sun = so3_exp(Vector(0, 0, 55 * kDegree * draw(kSun))) * detail::kToLight;
  const double bright = 1 + 0.08 * draw(kBright);
  return [light = std::move(light), sun, bright](const Vector& point, const Vector& normal) {
    const double faced = 0.66 + 0.4 * std::max(0.0, dot(normal, sun));
    return light(point, normal) * bright * faced / detail::faced_light(normal);
  };
}

}  // namespace hsi4d
