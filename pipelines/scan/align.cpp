#include "pipelines/scan/align.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>

#include "core/check.h"
#include "core/random.h"
#include "core/text.h"

namespace hsi4d {

namespace {

constexpr double kSteepest = 35 * std::numbers::pi / 180;  // between a guess of up and the ground's
constexpr Index kTrials = 3000, kMostLookedAt = 20000;
constexpr double kToleranceShare = 0.01;  // of the median distance from the middle

double median(std::vector<double> values) {
  const auto middle = values.begin() + std::ssize(values) / 2;
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// How thick the ground may be: by the size of the scene, whose units nobody knows.
double tolerance_of(std::span<const Vector3<double>> points) {
  Vector3<double> middle;
  for (Index axis = 0; axis < 3; ++axis) {
    std::vector<double> along;
    for (const Vector3<double>& point : points) along.push_back(point[axis]);
    middle[axis] = median(std::move(along));
  }
  std::vector<double> distances;
  for (const Vector3<double>& point : points) distances.push_back((point - middle).norm());
  return kToleranceShare * median(std::move(distances));
}

/// Every n-th of too many points.
std::vector<Vector3<double>> some_of(std::span<const Vector3<double>> points) {
  const Index stride = std::ssize(points) / kMostLookedAt + 1;
  std::vector<Vector3<double>> some;
  for (Index i = 0; i < std::ssize(points); i += stride) some.push_back(points[static_cast<std::size_t>(i)]);
  return some;
}

/// Shares of points on and under a plane.
void count_points(std::span<const Vector3<double>> points, GroundPlane& ground) {
  Index on = 0, under = 0;
  for (const Vector3<double>& point : points) {
    const double over = ground.up.dot(point) - ground.height;
    if (std::abs(over) <= ground.tolerance) ++on;
    if (over < -3 * ground.tolerance) ++under;
  }
  ground.share = static_cast<double>(on) / static_cast<double>(points.size());
  ground.below = static_cast<double>(under) / static_cast<double>(points.size());
}

double worth(const GroundPlane& ground) { return ground.below > kMostBelowGround ? -1 : ground.share - ground.below; }

/// The plane of least squares through the points within the tolerance.
GroundPlane refitted(std::span<const Vector3<double>> points, const GroundPlane& ground) {
  Vector3<double> mean = Vector3<double>::Zero();
  std::vector<Vector3<double>> on;
  for (const Vector3<double>& point : points) {
    if (std::abs(ground.up.dot(point) - ground.height) > ground.tolerance) continue;
    on.push_back(point);
    mean += point;
  }
  if (on.size() < 3) return ground;
  mean /= static_cast<double>(on.size());
  Matrix3<double> spread = Matrix3<double>::Zero();
  for (const Vector3<double>& point : on) spread += (point - mean) * (point - mean).transpose();
  const Eigen::SelfAdjointEigenSolver<Matrix3<double>> solver(spread);
  GroundPlane better = ground;
  better.up = solver.eigenvectors().col(0);
  if (better.up.dot(ground.up) < 0) better.up = -better.up;
  better.height = better.up.dot(mean);
  return better;
}

}  // namespace

Vector3<double> up_of(const std::vector<Camera>& cameras) {
  Vector3<double> sum = Vector3<double>::Zero();
  for (const Camera& camera : cameras) sum -= camera.camera_from_world.rotation.row(1).transpose();
  constexpr double kLeast = 0.2;  // of one camera's
  if (!(sum.norm() > kLeast * static_cast<double>(cameras.size())))
    throw UserError("the cameras' up vectors cancel: no way is up on average; --up says which");
  return sum.normalized();
}

GroundPlane find_ground(std::span<const Vector3<double>> points, const Vector3<double>& up) {
  constexpr Index kFewest = 50;
  if (std::ssize(points) < kFewest)
    throw UserError("no ground is found: " + std::to_string(points.size()) +
                    " points are too few; allowed: " + std::to_string(kFewest) + " or more");
  const std::vector<Vector3<double>> some = some_of(points);
  const double tolerance = tolerance_of(points), least_cosine = std::cos(kSteepest);
  const Random random(0, random_stream("scan.ground"));
  const auto pick = [&](Index trial, std::uint64_t k) {
    return some[random.below(3 * static_cast<std::uint64_t>(trial) + k, some.size())];
  };
  GroundPlane best;
  double best_worth = -1;
  for (Index trial = 0; trial < kTrials; ++trial) {
    const Vector3<double> a = pick(trial, 0), b = pick(trial, 1), c = pick(trial, 2);
    const Vector3<double> normal = (b - a).cross(c - a);
    if (!(std::abs(normal.dot(up)) > least_cosine * normal.norm()) || normal.norm() == 0) continue;
    GroundPlane ground;
    ground.up = normal.normalized() * (normal.dot(up) < 0 ? -1 : 1);
    ground.height = ground.up.dot(a);
    ground.tolerance = tolerance;
    count_points(some, ground);
    if (worth(ground) <= best_worth) continue;
    best_worth = worth(ground);
    best = ground;
  }
  constexpr int kRefits = 10;
  for (int i = 0; best_worth > 0 && i < kRefits; ++i) best = refitted(points, best);
  if (best_worth > 0) count_points(points, best);
  const bool is_level = best.up.dot(up) > least_cosine && best.below <= kMostBelowGround;
  if (best.share >= kLeastGroundShare && is_level) return best;
  throw UserError("no ground is found: of level planes with little under them the best holds " +
                  rounded(100 * best.share, 2) + " % of the points; a ground holds " +
                  rounded(100 * kLeastGroundShare, 2) + " % or more. Is --up right?");
}

std::vector<Vector3<double>> solid_points(const Gaussians& gaussians) {
  std::vector<Vector3<double>> points;
  for (Index i = 0; i < gaussians.count(); ++i) {
    if (gaussians.opacity_logits[static_cast<std::size_t>(i)] > 0)
      points.push_back(Vector3<float>(gaussians.means.data() + 3 * i).cast<double>() + gaussians.origin_world);
  }
  return points;
}

Similarity alignment(const GroundPlane& ground, double scale, const Vector3<double>& middle) {
  Similarity similarity;
  similarity.scale = scale;
  similarity.rotation =
      Eigen::Quaterniond::FromTwoVectors(ground.up, Vector3<double>::UnitZ()).normalized().toRotationMatrix();
  const Vector3<double> under = middle - height_over(ground, middle) * ground.up;
  similarity.translation = -scale * (similarity.rotation * under);
  return similarity;
}

double height_over(const GroundPlane& ground, const Vector3<double>& point) {
  return ground.up.dot(point) - ground.height;
}

void draw_ground_grid(const Camera& camera, std::span<const double> depth, Image& image) {
  constexpr double kReach = 5, kWidth = 0.015, kHidden = 0.25, kRoom = 0.03;  // metres; share of the colour; metres
  constexpr std::array<float, 3> kColor = {1, 0.85F, 0};
  const Matrix3<double> rotation = camera.camera_from_world.rotation.transpose();
  const Vector3<double> eye = camera_center_world(camera);
  for (int y = 0; y < image.height(); ++y) {
    for (int x = 0; x < image.width(); ++x) {
      const Vector3<double> way =
          rotation * unproject_pixel(camera, Vector2<double>(x + 0.5, y + 0.5), 1.0);  // of depth 1
      const double z = -eye[2] / way[2];
      const Vector3<double> place = eye + z * way;
      if (!(z > 0) || std::abs(place[0]) > kReach + kWidth || std::abs(place[1]) > kReach + kWidth) continue;
      const double width = std::max(kWidth, 0.7 * z / camera.fx);
      const auto is_near_line = [width](double u) { return std::abs(u - std::round(u)) < width; };
      if (!is_near_line(place[0]) && !is_near_line(place[1])) continue;
      const double before =
          depth[static_cast<std::size_t>(y) * static_cast<std::size_t>(image.width()) + static_cast<std::size_t>(x)];
      const bool is_hidden = before > 0 && before < z - kRoom - 0.02 * z;
      const auto share = static_cast<float>(is_hidden ? kHidden : 1);
      for (int c = 0; c < 3; ++c)
        image(c, y, x) = (1 - share) * image(c, y, x) + share * kColor[static_cast<std::size_t>(c)];
    }
  }
}

}  // namespace hsi4d
