#include "pipelines/footage/person_camera.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "body/body_model.h"
#include "body/kinematics.h"
#include "core/angles.h"
#include "core/check.h"
#include "core/text.h"
#include "pipelines/draw/standing.h"

namespace hsi4d {

namespace {

/// Joints in pairs; their middle hardly moves when a person turns. The first one is on the ground.
constexpr std::array<const char*, 5> kPairs = {"ankle", "knee", "hip", "shoulder", "eye_smplhf"};
constexpr double kUsualHeight = 1.5, kHeightSpread = 0.4;  // metres, and of its logarithm: somebody holds the camera
constexpr double kPitchSpread = 30 * kDegree;
constexpr double kPriorWeight = 0.03;
constexpr double kKernel = 0.08;  // of a person's height in the image
constexpr std::size_t kFirstAboveKnees = 2;
constexpr int kDrops = 7;
constexpr double kDropStep = 0.1;    // metres
constexpr double kDropWeight = 0.1;  // a metre
constexpr double kFarthest = 60;     // metres, of a person
constexpr Index kMostCompared = 100;
constexpr double kNowhere = 1e6;  // the error of a point that is not before the camera

using Middles = std::array<std::optional<Vector2<double>>, kPairs.size()>;

/// The point that stands for a joint alone; −1: none.
int point_of(const Keypoints& keypoints, int joint) {
  for (std::size_t k = 0; k < keypoints.joints.size(); ++k) {
    if (keypoints.joints[k].size() == 1 && keypoints.joints[k].front().first == joint) return static_cast<int>(k);
  }
  return -1;
}

std::vector<Middles> middles_of(const Keypoints& keypoints, const Camera& camera) {
  std::vector<Middles> all(keypoints.frames.size());
  for (std::size_t p = 0; p < kPairs.size(); ++p) {
    const std::string name = kPairs[p];
    const int left = point_of(keypoints, smplx_joint("left_" + name)),
              right = point_of(keypoints, smplx_joint("right_" + name));
    for (std::size_t t = 0; left >= 0 && right >= 0 && t < all.size(); ++t) {
      const Keypoint &a = keypoints.frames[t][static_cast<std::size_t>(left)],
                     &b = keypoints.frames[t][static_cast<std::size_t>(right)];
      if (std::min(a.confidence, b.confidence) < kFoundConfidence) continue;
      all[t][p] = Vector2<double>((a.x + b.x) / 2 * camera.width, (a.y + b.y) / 2 * camera.height);
    }
  }
  return all;
}

bool tells_something(const Middles& middles) {
  return middles[0] && std::count_if(middles.begin() + 1, middles.end(), [](const auto& m) { return !!m; }) >= 2;
}

/// Heights of the pairs above the ground, of an upright person.
std::array<double, kPairs.size()> pair_heights(const Avatar& avatar) {
  const std::vector<double> joints = pose_joints(avatar.parents, avatar.joints, standing_pose(avatar, {}));
  std::array<double, kPairs.size()> heights{};
  for (std::size_t p = 0; p < kPairs.size(); ++p) {
    const std::string name = kPairs[p];
    for (const char* side : {"left_", "right_"})
      heights[p] += joints[3 * static_cast<std::size_t>(smplx_joint(side + name)) + 2] / 2;
  }
  return heights;
}

Rigid<double> pose_of(double height, double pitch) {
  const Vector3<double> eye(0, 0, height);
  return look_at(eye, eye + Vector3<double>(0, std::cos(pitch), -std::sin(pitch)));
}

/// What the points of somebody who stands or sits on the ground say of a camera.
class PersonOnGround {
 public:
  PersonOnGround(const Keypoints& keypoints, const Avatar& avatar, const Camera& intrinsics)
      : camera_(intrinsics), heights_(pair_heights(avatar)), middles_(middles_of(keypoints, intrinsics)) {
    std::vector<std::size_t> telling;
    for (std::size_t t = 0; t < middles_.size(); ++t) {
      if (tells_something(middles_[t])) telling.push_back(t);
    }
    const Index count = std::min(std::ssize(telling), kMostCompared);
    for (Index i = 0; i < count; ++i)
      used_.push_back(telling[static_cast<std::size_t>(i * std::ssize(telling) / count)]);
  }

  bool is_seen() const { return !used_.empty(); }

  /// Mean robust cost of the points, 0 to 1, how low the person is, and how surprising the camera is.
  double cost(double height, double pitch) {
    camera_.camera_from_world = pose_of(height, pitch);
    double sum = 0;
    for (const std::size_t t : used_) sum += best_fit(t).cost;
    const double h = std::log(height / kUsualHeight) / kHeightSpread, p = pitch / kPitchSpread;
    return sum / static_cast<double>(used_.size()) + kPriorWeight * (h * h + p * p);
  }

  /// Share of the points that are about where they are expected.
  double agreeing() const {
    double sum = 0;
    for (const std::size_t t : used_) sum += best_fit(t).agreeing;
    return sum / static_cast<double>(used_.size());
  }

  /// Where the ankles' middle meets the height that it has over the ground.
  std::optional<Vector2<double>> place(std::size_t frame) const {
    if (!middles_[frame][0]) return {};
    const Vector2<double> pixel = *middles_[frame][0];
    const Vector3<double> ray = camera_.camera_from_world.rotation.transpose() * unproject_pixel(camera_, pixel, 1.0);
    const Vector3<double> center = camera_center_world(camera_);
    const double distance = (heights_[0] - center[2]) / ray[2];
    if (!(distance > 0 && distance < kFarthest)) return {};
    const Vector3<double> point = center + distance * ray;
    return Vector2<double>(point[0], point[1]);
  }

  void set_pose(const Rigid<double>& camera_from_world) { camera_.camera_from_world = camera_from_world; }

  /// What the camera that was set comes to.
  PersonCamera result() const {
    const Vector3<double> forward = camera_.camera_from_world.rotation.row(2).transpose();
    PersonCamera result{camera_,
                        camera_center_world(camera_)[2],
                        std::asin(std::clamp(-forward[2], -1.0, 1.0)) / kDegree,
                        agreeing(),
                        {}};
    for (std::size_t t = 0; t < middles_.size(); ++t) result.places.push_back(place(t));
    return result;
  }

 private:
  struct Fit {
    double cost = 1, agreeing = 0;
  };

  /// Of the person's heights above the feet, standing to sitting on the ground, the one that fits best.
  Fit best_fit(std::size_t frame) const {
    const std::optional<Vector2<double>> at = place(frame);
    double extent = 0;  // of the person, pixels
    for (const auto& middle : middles_[frame])
      extent = std::max(extent, middle && at ? (*middle - *middles_[frame][0]).norm() : 0);
    Fit best;
    for (int step = 0; extent > 0 && step <= kDrops; ++step) {
      const Fit fit = fit_of(middles_[frame], extent, *at, step * kDropStep);
      if (fit.cost < best.cost) best = fit;
    }
    return best;
  }

  /// Mean over the points of a robust function of their distances from where they are expected, which are shares of the
  /// person's height in the image.
  /// @param drop  by which all above the knees is lower than of somebody upright
  Fit fit_of(const Middles& middles, double extent, const Vector2<double>& at, double drop) const {
    double sum = 0, agreeing = 0, count = 0;
    for (std::size_t p = 1; p < kPairs.size(); ++p) {
      if (!middles[p]) continue;
      const Vector3<double> point(at[0], at[1], heights_[p] - (p >= kFirstAboveKnees ? drop : 0));
      const Vector3<double> seen = transform_point(camera_.camera_from_world, point);
      const double error = seen[2] > 0 ? (project_point(camera_, seen) - *middles[p]).norm() / extent : kNowhere;
      sum += error * error / (error * error + kKernel * kKernel);
      agreeing += error < kKernel ? 1 : 0;
      ++count;
    }
    return {sum / count + kDropWeight * drop, agreeing / count};
  }

  Camera camera_;
  std::array<double, kPairs.size()> heights_;
  std::vector<Middles> middles_;
  std::vector<std::size_t> used_;
};

struct HeightAndPitch {
  double height, pitch;
};

/// The least cost of a grid.
HeightAndPitch best_of_grid(PersonOnGround& person, std::optional<double> known) {
  constexpr double kLowest = 0.2, kHeightStep = 0.1;                // metres
  constexpr int kHeights = 59, kLeastPitch = -40, kMostPitch = 80;  // degrees
  HeightAndPitch best{};
  double least = std::numeric_limits<double>::infinity();
  for (int i = 0; i < (known ? 1 : kHeights); ++i) {
    const double height = known.value_or(kLowest + i * kHeightStep);
    for (int degrees = kLeastPitch; degrees <= kMostPitch; ++degrees) {
      const double cost = person.cost(height, degrees * kDegree);
      if (cost < least) {
        least = cost;
        best = {height, degrees * kDegree};
      }
    }
  }
  return best;
}

/// Goes down in steps that halve when none of them helps.
HeightAndPitch refined(PersonOnGround& person, HeightAndPitch at, bool is_height_known) {
  double least = person.cost(at.height, at.pitch);
  for (double step = 0.1; step > 1e-5;) {
    const HeightAndPitch before = at;
    const double metres = is_height_known ? 0 : step, angle = 0.2 * step;
    for (const HeightAndPitch& next :
         {HeightAndPitch{before.height + metres, before.pitch}, HeightAndPitch{before.height - metres, before.pitch},
          HeightAndPitch{before.height, before.pitch + angle}, HeightAndPitch{before.height, before.pitch - angle},
          HeightAndPitch{before.height + metres, before.pitch + angle},
          HeightAndPitch{before.height - metres, before.pitch - angle}}) {
      if (next.height <= 0) continue;
      const double cost = person.cost(next.height, next.pitch);
      if (cost >= least) continue;
      least = cost;
      at = next;
    }
    if (at.height == before.height && at.pitch == before.pitch) step /= 2;
  }
  return at;
}

PersonOnGround person_on_ground(const Keypoints& keypoints, const Avatar& avatar, const Camera& camera,
                                const std::string& file) {
  PersonOnGround person(keypoints, avatar, camera);
  if (person.is_seen()) return person;
  throw DataError(file +
                  ": no frame shows both ankles and two other pairs of knees, hips, shoulders and eyes with a "
                  "confidence of at least " +
                  number_text(kFoundConfidence) + "; without them nothing tells where the ground is");
}

}  // namespace

double far_distance(const PersonCamera& found) {
  const Vector2<double> center = camera_center_world(found.camera).head<2>();
  std::vector<double> distances;
  for (const std::optional<Vector2<double>>& at : found.places) {
    if (at) distances.push_back((*at - center).norm());
  }
  if (distances.empty()) return 0;
  std::sort(distances.begin(), distances.end());
  return distances[(distances.size() - 1) * 9 / 10];
}

double usual_focal_length(int width, int height) { return std::hypot(width, height); }

PersonCamera camera_of_person(const Keypoints& keypoints, const Avatar& avatar, const Camera& intrinsics,
                              std::optional<double> height, const std::string& file) {
  PersonOnGround person = person_on_ground(keypoints, avatar, intrinsics, file);
  const HeightAndPitch found = refined(person, best_of_grid(person, height), height.has_value());
  person.set_pose(pose_of(found.height, found.pitch));
  return person.result();
}

PersonCamera placed_person(const Keypoints& keypoints, const Avatar& avatar, const Camera& camera,
                           const std::string& file) {
  return person_on_ground(keypoints, avatar, camera, file).result();
}

}  // namespace hsi4d
