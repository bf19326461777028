#include "pipelines/synthetic/noise.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>

#include "body/body_model.h"
#include "core/angles.h"
#include "core/random.h"
#include "core/rotation.h"
#include "pipelines/synthetic/surface.h"

namespace hsi4d {
namespace {

using Vector = Vector3<double>;

constexpr double kBiasPeriod = 8;            // seconds
constexpr double kJagSize = 8;               // pixels
constexpr Index kPlaces = kSmplxJoints + 1;  // joints, and where the root is

/// Three independent standard normals.
Vector normal_vector(const Random& random, std::uint64_t index) {
  const auto [x, y] = random.normal_pair(2 * index);
  return {x, y, random.normal(2 * index + 1)};
}

/// The errors of an estimator, standard normal vectors.
class EstimatorErrors {
 public:
  EstimatorErrors(const SyntheticSettings& settings, std::size_t frames, double frame_rate)
      : seed_(static_cast<std::uint64_t>(settings.seed)), frames_(frames), frame_rate_(frame_rate) {}

  Vector of_frame(std::size_t t, Index place) const {
    return at("synthetic.initial_motion", t * static_cast<std::uint64_t>(kPlaces) + static_cast<std::uint64_t>(place));
  }
  /// Turns from one vector to another and on, once in kBiasPeriod seconds.
  Vector bias(std::size_t t, Index place) const {
    const double angle = 2 * std::numbers::pi * double(t) / frame_rate_ / kBiasPeriod;
    const auto i = 2 * static_cast<std::uint64_t>(place);
    return std::cos(angle) * at("synthetic.initial_bias", i) + std::sin(angle) * at("synthetic.initial_bias", i + 1);
  }
  /// Grows to a standard normal vector in the last frame.
  Vector drift(std::size_t t, Index place) const {
    const double part = frames_ > 1 ? double(t) / double(frames_ - 1) : 0;
    return part * at("synthetic.initial_drift", static_cast<std::uint64_t>(place));
  }

 private:
  Vector at(std::string_view stream, std::uint64_t index) const {
    return normal_vector(Random(seed_, random_stream(stream)), index);
  }

  std::uint64_t seed_;
  std::size_t frames_;
  double frame_rate_;
};

/// A standard normal vector as a rotation vector of a root mean square angle.
Vector turn_of(const Vector& normal, double degrees) { return normal * (degrees * kDegree / std::sqrt(3.0)); }

/// The largest or smallest value of a mask within a radius of a pixel.
float extreme_within(const Image& mask, int row, int column, int radius, bool largest) {
  float value = mask(0, row, column);
  for (int y = std::max(0, row - radius); y <= std::min(mask.height() - 1, row + radius); ++y) {
    const int dy = y - row, reach = static_cast<int>(std::sqrt(double(radius * radius - dy * dy)));
    for (int x = std::max(0, column - reach); x <= std::min(mask.width() - 1, column + reach); ++x)
      value = largest ? std::max(value, mask(0, y, x)) : std::min(value, mask(0, y, x));
  }
  return value;
}

}  // namespace

Motion disturbed_motion(const Motion& truth, const SyntheticSettings& settings) {
  const EstimatorErrors errors(settings, truth.poses.size(), truth.frame_rate);
  Motion motion = truth;
  for (std::size_t t = 1; t < motion.poses.size(); ++t) {
    BodyPose& pose = motion.poses[t];
    const auto turn = [&](Index joint, const Vector& noise) {
      if (noise.norm() > 0)
        pose.set_rotation(joint, so3_log(Matrix3<double>(so3_exp(pose.rotation_of(joint)) * so3_exp(noise))));
    };
    const auto joint_error = [&](Index joint, double share) {
      Vector sum = Vector::Zero();
      if (settings.pose_noise_deg > 0) sum += turn_of(errors.of_frame(t, joint), share * settings.pose_noise_deg);
      if (settings.pose_bias_deg > 0) sum += turn_of(errors.bias(t, joint), share * settings.pose_bias_deg);
      if (settings.pose_drift_deg > 0) sum += turn_of(errors.drift(t, joint), share * settings.pose_drift_deg);
      return sum;
    };
    turn(0, turn_of(errors.of_frame(t, 0), settings.root_noise_deg));
    for (Index joint = 1; joint <= 21; ++joint) turn(joint, joint_error(joint, 1));
    for (Index joint = 25; joint < kSmplxJoints; ++joint) turn(joint, joint_error(joint, settings.hand_noise_share));
    pose.transl += errors.of_frame(t, kSmplxJoints) * settings.root_noise_m;
    pose.transl += errors.drift(t, kSmplxJoints) * settings.root_drift_m;
  }
  return motion;
}

std::vector<Rigid<double>> disturbed_object(const std::vector<Rigid<double>>& truth,
                                            const SyntheticSettings& settings) {
  const Random random(static_cast<std::uint64_t>(settings.seed), random_stream("synthetic.initial_objects"));
  std::vector<Rigid<double>> poses = truth;
  for (std::size_t t = 1; t < poses.size(); ++t) {
    poses[t].rotation = so3_exp(turn_of(normal_vector(random, 2 * t), settings.object_noise_deg)) * truth[t].rotation;
    poses[t].translation += normal_vector(random, 2 * t + 1) * settings.object_noise_m;
  }
  return poses;
}

Image disturbed_mask(const Image& mask, const SyntheticMaskNoise& noise, std::uint64_t seed, std::string_view name,
                     Index frame) {
  const std::string stream = "synthetic.mask." + std::string(name);
  const Random random(seed, random_stream(stream));
  if (frame > 0 && random.uniform(static_cast<std::uint64_t>(frame)) < noise.dropped_share)
    return Image(1, mask.height(), mask.width());
  if (noise.grow_px == 0 && noise.jagged_px == 0) return mask;
  const SmoothNoise jag(seed, stream);
  Image result = mask;
  for (int y = 0; y < mask.height(); ++y)
    for (int x = 0; x < mask.width(); ++x) {
      const Vector at(x / kJagSize, y / kJagSize, 17.3 * double(frame));
      const double out = noise.grow_px + (noise.jagged_px > 0 ? noise.jagged_px * jag.at(at) : 0);
      const int radius = static_cast<int>(std::lround(std::abs(out)));
      if (radius > 0) result(0, y, x) = extreme_within(mask, y, x, radius, out > 0);
    }
  return result;
}

}  // namespace hsi4d
