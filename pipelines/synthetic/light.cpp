#include "pipelines/synthetic/light.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "core/parallel.h"
#include "core/quaternion.h"
#include "pipelines/synthetic/kit.h"
#include "splat/render/sh.h"

namespace hsi4d {
namespace {

using Vector = Vector3<double>;

constexpr Index kGrain = 512;

/// A row of balls from one joint to another.
struct Limb {
  const char *from, *to;
  int balls;
  double radius;  ///< metres
};

constexpr std::array<Limb, 16> kLimbs = {{{"pelvis", "spine2", 2, 0.13},
                                          {"spine2", "neck", 3, 0.13},
                                          {"neck", "head", 1, 0.07},
                                          {"left_hip", "left_knee", 4, 0.07},
                                          {"right_hip", "right_knee", 4, 0.07},
                                          {"left_knee", "left_ankle", 4, 0.05},
                                          {"right_knee", "right_ankle", 4, 0.05},
                                          {"left_ankle", "left_foot", 3, 0.045},
                                          {"right_ankle", "right_foot", 3, 0.045},
                                          {"left_shoulder", "left_elbow", 3, 0.045},
                                          {"right_shoulder", "right_elbow", 3, 0.045},
                                          {"left_elbow", "left_wrist", 3, 0.037},
                                          {"right_elbow", "right_wrist", 3, 0.037},
                                          {"left_wrist", "left_middle1", 2, 0.04},
                                          {"right_wrist", "right_middle1", 2, 0.04},
                                          {"head", "head", 1, 0.1}}};

Vector row_of(const std::vector<float>& values, std::size_t i) {
  return Vector(double(values[3 * i]), double(values[3 * i + 1]), double(values[3 * i + 2]));
}

/// An axis of a Gaussian.
Vector axis_of(const std::vector<float>& quats, std::size_t i, int axis) {
  const auto part = [&](std::size_t k) { return static_cast<double>(quats[4 * i + k]); };
  const Vector4<double> q(part(0), part(1), part(2), part(3));
  return quaternion_to_matrix(q).col(axis);
}

Vector thinnest_axis(const Gaussians& g, std::size_t i) {
  const float* s = g.log_scales.data() + 3 * i;
  return axis_of(g.quats, i, static_cast<int>(std::min_element(s, s + 3) - s));
}

/// Multiplies the colours of one Gaussian.
void scale_color(Gaussians& g, std::size_t i, double factor) {
  const auto numbers = static_cast<std::size_t>(3 * g.sh_coefficients());
  for (std::size_t k = 0; k < numbers; ++k) {
    float& x = g.sh[numbers * i + k];
    const double shift = k < 3 ? (factor - 1) * 0.5 / kShC0 : 0;  // colour is ½ + Σ Y sh
    x = static_cast<float>(factor * double(x) + shift);
  }
}

/// Factor of a colour by the direction of its surface.
double lit(const Vector& normal, double strength) {
  return 1 + strength * (0.5 * std::max(0.0, dot(normal, detail::kToLight)) + 0.12 * normal.z() - 0.32);
}

}  // namespace

std::vector<Occluder> body_occluders(const BodyModel& body, const BodyPose& pose) {
  const std::vector<double> joints = pose_joints(body, pose);
  const auto at = [&](const char* name) { return Vector(joints.data() + 3 * smplx_joint(name)); };
  const Vector up = (at("head") - at("neck")).normalized();
  std::vector<Occluder> balls;
  for (const Limb& limb : kLimbs) {
    const Vector from = at(limb.from), to = at(limb.to);
    for (int i = 0; i < limb.balls; ++i) balls.push_back({from + (to - from) * ((i + 0.5) / limb.balls), limb.radius});
  }
  balls.back().center += 0.09 * up;  // the skull is above its joint
  for (const char* side : {"left_", "right_"}) {
    const Vector ankle = at((std::string(side) + "ankle").c_str()), ball = at((std::string(side) + "foot").c_str());
    balls.push_back({ball + 0.35 * (ball - ankle), 0.035});  // the toes
  }
  return balls;
}

std::vector<Occluder> object_occluders(const Gaussians& object, Index most) {
  const auto count = static_cast<std::size_t>(object.count());
  if (count == 0) return {};
  // Centres: each the Gaussian farthest from those before; radius: so far that the balls meet.
  std::vector<double> distance(count, 1e30);
  std::vector<Occluder> balls;
  std::size_t next = 0;
  double reach = 0;
  while (static_cast<Index>(balls.size()) < most) {
    balls.push_back({row_of(object.means, next), 0});
    for (std::size_t i = 0; i < count; ++i)
      distance[i] = std::min(distance[i], (row_of(object.means, i) - balls.back().center).norm());
    next = static_cast<std::size_t>(std::max_element(distance.begin(), distance.end()) - distance.begin());
    reach = distance[next];
    if (reach < 0.01) break;
  }
  for (Occluder& ball : balls) ball.radius = std::clamp(0.7 * reach, 0.012, 0.12);
  return balls;
}

std::vector<Occluder> moved(const std::vector<Occluder>& occluders, const Rigid<double>& world_from_object) {
  std::vector<Occluder> result = occluders;
  for (Occluder& ball : result) ball.center = transform_point(world_from_object, ball.center);
  return result;
}

double light_left(const std::vector<Occluder>& occluders, const Vector3<double>& point, const Vector3<double>& normal,
                  double strength) {
  double sky = 1, sun = 1;
  const bool faces_light = dot(normal, detail::kToLight) > 0.05;
  for (const Occluder& ball : occluders) {
    const Vector to = ball.center - point;
    const double squared = to.squaredNorm(), radius2 = ball.radius * ball.radius;
    if (squared > 400 * radius2 && squared > 9) continue;
    const double distance = std::sqrt(squared);
    sky *= 1 - 0.75 * std::min(1.0, std::max(0.0, dot(normal, to)) / std::max(distance, 1e-6) * radius2 /
                                        std::max(squared, radius2));
    const double along = dot(to, detail::kToLight);
    if (!faces_light || along <= 0) continue;
    const double beside = std::sqrt(std::max(0.0, squared - along * along));
    const double soft = 0.03 + 0.22 * along;
    const double covered = 1 - std::clamp((beside - ball.radius + soft / 2) / soft, 0.0, 1.0);
    sun *= 1 - covered * covered * (3 - 2 * covered) * std::min(1.0, 2.2 * ball.radius / (0.05 + 0.5 * soft)) * 0.6;
  }
  return 1 - strength * (1 - sky * (0.55 + 0.45 * sun));
}

Gaussians shadowed_scene(const Gaussians& scene, const std::vector<Occluder>& occluders, const Vector3<double>& eye,
                         double strength) {
  Gaussians result = scene;
  if (strength <= 0 || occluders.empty()) return result;
  parallel_for(scene.count(), kGrain, [&](Index begin, Index end) {
    for (auto i = static_cast<std::size_t>(begin); i < static_cast<std::size_t>(end); ++i) {
      const Vector point = row_of(scene.means, i) + scene.origin_world;
      Vector normal = thinnest_axis(scene, i);
      if (dot(normal, Vector(eye - point)) < 0) normal = -normal;
      const double left = light_left(occluders, point, normal, strength);
      if (left < 1) scale_color(result, i, left);
    }
  });
  return result;
}

Avatar shaded_avatar(const Avatar& avatar, const BodyPose& pose, double strength) {
  Avatar result = avatar;
  if (strength <= 0) return result;
  const PosedJoints posed = pose_skeleton(avatar, pose);
  const auto width = static_cast<std::size_t>(avatar.weights.per_vertex);
  for (std::size_t i = 0; i < static_cast<std::size_t>(avatar.count()); ++i) {
    const Vector normal = axis_of(avatar.quats, i, 2);
    Vector turned = Vector::Zero();
    for (std::size_t k = 0; k < width; ++k) {
      const double* t = posed.transforms.data() + 12 * avatar.weights.indices[width * i + k];
      const Vector part(t[0] * normal[0] + t[1] * normal[1] + t[2] * normal[2],
                        t[4] * normal[0] + t[5] * normal[1] + t[6] * normal[2],
                        t[8] * normal[0] + t[9] * normal[1] + t[10] * normal[2]);
      turned += avatar.weights.weights[width * i + k] * part;
    }
    const double factor = lit(turned.normalized(), strength);
    for (std::size_t c = 0; c < 3; ++c)
      result.colors[3 * i + c] = static_cast<float>(std::clamp(factor * double(avatar.colors[3 * i + c]), 0.0, 1.0));
  }
  return result;
}

Gaussians shaded_object(const SyntheticObject& object, const Rigid<double>& world_from_object, double strength) {
  Gaussians result = object.gaussians;
  if (strength <= 0) return result;
  for (std::size_t i = 0; i < static_cast<std::size_t>(result.count()); ++i) {
    const Vector from_middle = row_of(result.means, i);
    const Vector normal =
        object.has_normals ? axis_of(result.quats, i, 2) : Vector(from_middle / std::max(from_middle.norm(), 1e-9));
    scale_color(result, i, lit(world_from_object.rotation * normal, strength) / lit(normal, strength));
  }
  return result;
}

}  // namespace hsi4d
