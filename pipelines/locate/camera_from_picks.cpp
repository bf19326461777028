#include "pipelines/locate/camera_from_picks.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <limits>
#include <optional>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

#include "core/angles.h"
#include "core/check.h"
#include "core/random.h"
#include "core/text.h"

namespace hsi4d {

namespace {

using Triple = std::array<std::size_t, 3>;
using VectorX = Eigen::VectorXd;
using MatrixX = Eigen::MatrixXd;

constexpr std::size_t kMostTriples = 2000, kMostTriplesOfAFocal = 300;
constexpr double kShortestFocal = 0.35, kLongestFocal = 5, kFocalStep = 1.1;  // of the longer side
constexpr double kSlack = 2;  // tolerances that a camera of three picks may cost
constexpr std::size_t kMostSettled = 40,
                      kMostSettledOfAFocal = 4;  // cameras of triples that least squares goes on from
constexpr double kThinnest = 1e-3;               // width of points over their length, below which they are a line
constexpr double kOpenFocal = 0.3;               // standard deviation of the focal length's logarithm
constexpr double kLeastError = 0.5;              // pixels: nobody picks better
constexpr double kSingular = 1e-13;              // eigenvalue of the normal equations, whose diagonal is 1
constexpr int kMostRounds = 20, kMostSteps = 50;

double cosine(const Vector3<double>& a, const Vector3<double>& b) { return std::clamp(a.dot(b), -1.0, 1.0); }

/// Real roots of c[0] + c[1] x + … + c[4] x⁴, as eigenvalues of the companion matrix.
std::vector<double> real_roots(const std::array<double, 5>& c) {
  constexpr double kReal = 1e-3;  // double roots come as pairs that are not quite real; least squares settles them
  int degree = 4;
  const double largest =
      *std::max_element(c.begin(), c.end(), [](double a, double b) { return std::fabs(a) < std::fabs(b); });
  while (degree > 0 && !(std::fabs(c[static_cast<std::size_t>(degree)]) > 1e-12 * std::fabs(largest))) --degree;
  if (degree == 0) return {};
  MatrixX companion = MatrixX::Zero(degree, degree);
  for (int i = 0; i < degree; ++i) {
    companion(i, degree - 1) = -c[static_cast<std::size_t>(i)] / c[static_cast<std::size_t>(degree)];
    if (i > 0) companion(i, i - 1) = 1;
  }
  const Eigen::EigenSolver<MatrixX> solver(companion, false);
  std::vector<double> roots;
  for (const std::complex<double>& root : solver.eigenvalues()) {
    if (std::fabs(root.imag()) < kReal * (1 + std::fabs(root.real()))) roots.push_back(root.real());
  }
  return roots;
}

/// Axes of a triangle: along its first side, in its plane, across it. Null: no triangle.
std::optional<Matrix3<double>> axes_of(const std::array<Vector3<double>, 3>& corners) {
  const Vector3<double> side = corners[1] - corners[0], normal = cross(side, Vector3<double>(corners[2] - corners[0]));
  if (!(normal.norm() > kThinnest * kThinnest * side.squaredNorm())) return {};
  Matrix3<double> axes;
  axes.col(0) = side.normalized();
  axes.col(2) = normal.normalized();
  axes.col(1) = cross(Vector3<double>(axes.col(2)), Vector3<double>(axes.col(0)));
  return axes;
}

/// What the search knows of the picture.
struct Problem {
  std::span<const PickedPoint> picks;
  Camera camera;  ///< intrinsics
  bool moves_focal = false;
  double tolerance = 0;

  Index numbers() const { return moves_focal ? 7 : 6; }
  Index fewest() const { return moves_focal ? kFewestPicksForFocal : kFewestPicks; }
};

/// (u, v) − pick in a camera; nothing behind it.
std::optional<Vector2<double>> error_of(const Camera& camera, const PickedPoint& pick) {
  const Vector3<double> point = transform_point(camera.camera_from_world, pick.point_world);
  if (!(point[2] > 0)) return {};
  return Vector2<double>(project_point(camera, point) - pick.pixel);
}

double cost_of(const Problem& problem, const Camera& camera, double tolerance) {
  double cost = 0;
  for (const PickedPoint& pick : problem.picks) {
    const std::optional<Vector2<double>> error = error_of(camera, pick);
    cost += error ? std::min(error->squaredNorm(), tolerance * tolerance) : tolerance * tolerance;
  }
  return cost;
}

std::vector<std::size_t> agreeing_picks(const Problem& problem, const Camera& camera, double tolerance) {
  std::vector<std::size_t> agreeing;
  for (std::size_t i = 0; i < problem.picks.size(); ++i) {
    const std::optional<Vector2<double>> error = error_of(camera, problem.picks[i]);
    if (error && error->norm() <= tolerance) agreeing.push_back(i);
  }
  return agreeing;
}

// --- least squares ---------------------------------------------------------------------------------------------------

/// Normal equations of Σ |error|² by (ξ, logarithm of the focal length).
struct Normal {
  double cost = 0;
  MatrixX matrix;
  VectorX gradient;
};

Normal normal_at(const Problem& problem, const Camera& camera, const std::vector<std::size_t>& picks) {
  const Index n = problem.numbers();
  Normal normal{0, MatrixX::Zero(n, n), VectorX::Zero(n)};
  for (const std::size_t i : picks) {
    const std::optional<Vector2<double>> error = error_of(camera, problem.picks[i]);
    if (!error) return {std::numeric_limits<double>::infinity(), {}, {}};
    const Vector3<double> point = transform_point(camera.camera_from_world, problem.picks[i].point_world);
    const Vector2<double> pixel = project_point(camera, point);
    for (Index k = 0; k < 2; ++k) {
      Vector3<double> d_point = Vector3<double>::Zero();
      project_point_adjoint(camera, point, Vector2<double>(Vector2<double>::Unit(k)), d_point);
      Vector6<double> d_xi = Vector6<double>::Zero();
      se3_transform_point_adjoint_at_zero(point, d_point, d_xi);
      VectorX row(n);
      row.head<6>() = d_xi;
      if (problem.moves_focal) row[6] = pixel[k] - (k == 0 ? camera.cx : camera.cy);
      normal.matrix += row * row.transpose();
      normal.gradient += row * (*error)[k];
    }
    normal.cost += error->squaredNorm();
  }
  return normal;
}

Camera moved(const Camera& camera, const VectorX& step) {
  Camera result = camera;
  result.camera_from_world = se3_update(Vector6<double>(step.head<6>()), camera.camera_from_world);
  if (step.size() > 6) {
    result.fx *= std::exp(step[6]);
    result.fy *= std::exp(step[6]);
  }
  return result;
}

/// The camera of least squares over some picks [damped: Marquardt 1963].
Camera fitted(const Problem& problem, Camera camera, const std::vector<std::size_t>& picks) {
  constexpr double kMostDamping = 1e8, kSmallestStep = 1e-12;
  double damping = 1e-3;
  Normal here = normal_at(problem, camera, picks);
  for (int i = 0; i < kMostSteps && damping < kMostDamping && std::isfinite(here.cost); ++i) {
    MatrixX damped = here.matrix;
    damped.diagonal() += damping * here.matrix.diagonal();
    const VectorX step = -damped.ldlt().solve(here.gradient);
    if (!step.allFinite()) break;
    const Camera trial = moved(camera, step);
    Normal there = normal_at(problem, trial, picks);
    if (there.cost <= here.cost) {
      camera = trial;
      here = std::move(there);
      damping /= 10;
      if (step.norm() < kSmallestStep) break;
    } else {
      damping *= 10;
    }
  }
  return camera;
}

/// Least squares over the picks that agree, until these stay the same.
Camera settled(const Problem& problem, Camera camera, double tolerance) {
  std::vector<std::size_t> agreeing = agreeing_picks(problem, camera, tolerance);
  for (int round = 0; round < kMostRounds && std::ssize(agreeing) >= problem.fewest(); ++round) {
    camera = fitted(problem, camera, agreeing);
    std::vector<std::size_t> next = agreeing_picks(problem, camera, tolerance);
    if (next == agreeing) break;
    agreeing = std::move(next);
  }
  return camera;
}

// --- search ----------------------------------------------------------------------------------------------------------

/// All triples of `count` picks, or `most` drawn ones.
std::vector<Triple> triples_of(std::size_t count, std::size_t most) {
  std::vector<Triple> triples;
  if (count * (count - 1) * (count - 2) / 6 <= most) {
    for (std::size_t a = 0; a < count; ++a) {
      for (std::size_t b = a + 1; b < count; ++b) {
        for (std::size_t c = b + 1; c < count; ++c) triples.push_back({a, b, c});
      }
    }
    return triples;
  }
  RandomSequence random(0, random_stream("locate.picks"));
  while (triples.size() < most) {
    const Triple triple{random.below(count), random.below(count), random.below(count)};
    if (triple[0] != triple[1] && triple[0] != triple[2] && triple[1] != triple[2]) triples.push_back(triple);
  }
  return triples;
}

/// A camera and Σ min(e², tolerance²).
struct ScoredCamera {
  Camera camera;
  double cost = std::numeric_limits<double>::infinity();
};

void keep_better(ScoredCamera& best, const Problem& problem, const Camera& camera, double tolerance) {
  const double cost = cost_of(problem, camera, tolerance);
  if (cost < best.cost) best = {camera, cost};
}

/// The best cameras of the triples, as they give them, the best first.
std::vector<ScoredCamera> best_of_triples(const Problem& problem, const std::vector<Triple>& triples, double tolerance,
                                          std::size_t most) {
  std::vector<ScoredCamera> all;
  for (const Triple& triple : triples) {
    std::array<Vector3<double>, 3> rays, points;
    for (std::size_t i = 0; i < 3; ++i) {
      const PickedPoint& pick = problem.picks[triple[i]];
      rays[i] = unproject_pixel(problem.camera, pick.pixel, 1.0).normalized();
      points[i] = pick.point_world;
    }
    for (const Rigid<double>& pose : poses_of_three(rays, points)) {
      Camera camera = problem.camera;
      camera.camera_from_world = pose;
      all.push_back({camera, cost_of(problem, camera, tolerance)});
    }
  }
  std::stable_sort(all.begin(), all.end(), [](const auto& a, const auto& b) { return a.cost < b.cost; });
  all.resize(std::min(all.size(), most));
  return all;
}

/// Settles a camera within a wider tolerance, then within that of the problem, and keeps it where it is the best.
void settle_and_keep(const Problem& problem, const Camera& camera, ScoredCamera& best) {
  const Camera rough = settled(problem, camera, kSlack * problem.tolerance);
  keep_better(best, problem, settled(problem, rough, problem.tolerance), problem.tolerance);
}

ScoredCamera best_camera(const Problem& problem) {
  const std::vector<Triple> triples =
      triples_of(problem.picks.size(), problem.moves_focal ? kMostTriplesOfAFocal : kMostTriples);
  ScoredCamera best;
  if (!problem.moves_focal) {
    for (const ScoredCamera& found : best_of_triples(problem, triples, kSlack * problem.tolerance, kMostSettled))
      settle_and_keep(problem, found.camera, best);
    return best;
  }
  const double side = std::max(problem.camera.width, problem.camera.height),
               aspect = problem.camera.fy / problem.camera.fx;
  for (double share = kShortestFocal; share < kLongestFocal; share *= kFocalStep) {
    Problem trial = problem;
    trial.camera.fx = share * side;
    trial.camera.fy = share * side * aspect;
    for (const ScoredCamera& found : best_of_triples(trial, triples, kSlack * problem.tolerance, kMostSettledOfAFocal))
      settle_and_keep(problem, found.camera, best);
  }
  return best;
}

// --- what is wrong with picks ----------------------------------------------------------------------------------------

/// Width over length of points, 0 on a line.
double width_of(std::span<const PickedPoint> picks, const std::vector<std::size_t>& chosen) {
  Vector3<double> mean = Vector3<double>::Zero();
  for (const std::size_t i : chosen) mean += picks[i].point_world / static_cast<double>(chosen.size());
  Matrix3<double> scatter = Matrix3<double>::Zero();
  for (const std::size_t i : chosen) {
    const Vector3<double> offset = picks[i].point_world - mean;
    scatter += offset * offset.transpose();
  }
  const Vector3<double> spread = Eigen::SelfAdjointEigenSolver<Matrix3<double>>(scatter).eigenvalues();
  return spread[2] > 0 ? std::sqrt(std::max(spread[1], 0.0) / spread[2]) : 0;
}

void check_not_on_a_line(const Problem& problem, const std::vector<std::size_t>& chosen, const std::string& where) {
  if (width_of(problem.picks, chosen) < kThinnest)
    throw UserError(where + ": the points of the " + std::to_string(chosen.size()) +
                    " picks lie on one line, about which a camera may turn; pick points beside it");
}

std::string count_needed(bool has_focal) {
  return std::to_string(kFewestPicks) +
         (has_focal ? " or more"
                    : " or more with a focal length, " + std::to_string(kFewestPicksForFocal) + " or more without");
}

/// Standard deviations by the normal equations.
void set_deviations(const Problem& problem, const std::vector<std::size_t>& agreeing, PickedCamera& found) {
  const Normal normal = normal_at(problem, found.camera, agreeing);
  const Index spare = 2 * std::ssize(agreeing) - problem.numbers();
  const double sigma = std::max(kLeastError, std::sqrt(normal.cost / static_cast<double>(std::max<Index>(spare, 1))));
  const VectorX units =
      normal.matrix.diagonal().cwiseMax(std::numeric_limits<double>::min()).cwiseSqrt().cwiseInverse();
  const Eigen::SelfAdjointEigenSolver<MatrixX> solver(units.asDiagonal() * normal.matrix * units.asDiagonal());
  const VectorX weights = solver.eigenvalues().cwiseMax(kSingular).cwiseInverse();
  const VectorX variance =
      sigma * sigma * ((solver.eigenvectors().cwiseAbs2() * weights).array() * units.array().square()).matrix();
  found.position_m = std::sqrt(variance.head<3>().sum());
  found.rotation_deg = std::sqrt(variance.segment<3>(3).sum()) / kDegree;
  if (problem.moves_focal) found.focal_share = std::sqrt(variance[6]);
}

}  // namespace

std::vector<Rigid<double>> poses_of_three(const std::array<Vector3<double>, 3>& rays,
                                          const std::array<Vector3<double>, 3>& points) {
  const std::optional<Matrix3<double>> world = axes_of(points);
  if (!world) return {};
  const double aa = (points[1] - points[2]).squaredNorm(), bb = (points[0] - points[2]).squaredNorm(),
               cc = (points[0] - points[1]).squaredNorm();
  const double ca = cosine(rays[1], rays[2]), cb = cosine(rays[0], rays[2]), cg = cosine(rays[0], rays[1]);
  const double p = (aa - cc) / bb, q = (aa + cc) / bb, a = aa / bb, c = cc / bb;
  // Of v, the third distance over the first.
  const std::array<double, 5> quartic = {
      (1 + p) * (1 + p) - 4 * a * cg * cg, 4 * (-p * (1 + p) * cb + 2 * a * cg * cg * cb - (1 - q) * ca * cg),
      2 * (p * p - 1 + 2 * p * p * cb * cb + 2 * (1 - c) * ca * ca - 4 * q * ca * cb * cg + 2 * (1 - a) * cg * cg),
      4 * (p * (1 - p) * cb - (1 - q) * ca * cg + 2 * c * ca * ca * cb), (p - 1) * (p - 1) - 4 * c * ca * ca};
  constexpr double kLoose = 0.05;  // of a squared side: one of the two u is none of the triangle's
  std::vector<Rigid<double>> poses;
  for (const double v : real_roots(quartic)) {
    const double first = std::sqrt(bb / (1 + v * v - 2 * v * cb));
    // u, the second distance over the first: |p1 − p0| leaves two, also where the quotient for it is 0/0.
    const double half = std::sqrt(std::max(0.0, cg * cg - 1 + c * (1 + v * v - 2 * v * cb)));
    for (const double u : {cg + half, cg - half}) {
      if (!(v > 0 && u > 0 && std::isfinite(first))) continue;
      const std::array<Vector3<double>, 3> seen = {first * rays[0], u * first * rays[1], v * first * rays[2]};
      if (std::fabs((seen[1] - seen[2]).squaredNorm() - aa) > kLoose * aa) continue;
      const std::optional<Matrix3<double>> camera = axes_of(seen);
      if (!camera) continue;
      const Matrix3<double> rotation = *camera * world->transpose();
      poses.push_back({rotation, (seen[0] + seen[1] + seen[2] - rotation * (points[0] + points[1] + points[2])) / 3});
    }
  }
  return poses;
}

PickedCamera camera_from_picks(std::span<const PickedPoint> picks, const Camera& intrinsics, bool has_focal,
                               double tolerance, const std::string& where) {
  const Problem problem{picks, intrinsics, !has_focal, tolerance};
  if (std::ssize(picks) < problem.fewest())
    throw UserError(where + ": holds " + std::to_string(picks.size()) + " picks; allowed: " + count_needed(has_focal));
  std::vector<std::size_t> all(picks.size());
  for (std::size_t i = 0; i < all.size(); ++i) all[i] = i;
  check_not_on_a_line(problem, all, where);
  const ScoredCamera best = best_camera(problem);
  std::vector<std::size_t> agreeing;
  if (std::isfinite(best.cost)) agreeing = agreeing_picks(problem, best.camera, tolerance);
  if (std::ssize(agreeing) < problem.fewest())
    throw UserError(where + ": no camera shows " + std::to_string(problem.fewest()) + " of the " +
                    std::to_string(picks.size()) + " picks within " + rounded(tolerance, 3) +
                    " pixels of where they are; the best shows " + std::to_string(agreeing.size()) +
                    ". Are pixels and points of one picture and one scene" +
                    (has_focal ? ", and is the focal length right?" : "?"));
  check_not_on_a_line(problem, agreeing, where);
  PickedCamera found{best.camera, {}, tolerance, std::ssize(agreeing)};
  double sum = 0;
  for (const PickedPoint& pick : picks) {
    const std::optional<Vector2<double>> error = error_of(best.camera, pick);
    found.errors_px.push_back(error ? error->norm() : std::numeric_limits<double>::infinity());
    if (found.errors_px.back() <= tolerance) sum += found.errors_px.back() * found.errors_px.back();
  }
  found.rms_px = std::sqrt(sum / static_cast<double>(agreeing.size()));
  set_deviations(problem, agreeing, found);
  if (!has_focal && !(found.focal_share < kOpenFocal))
    throw UserError(where +
                    ": the picks leave the focal length open, as points of one plane seen from its front do; "
                    "give it, or pick points of other depths");
  return found;
}

}  // namespace hsi4d
