// Rows D4 to D7 and D9: bad steps, distances, neighbours, joint ranges, wraps.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>

#include "autodiff/elementwise.h"
#include "autodiff/reduce.h"
#include "autodiff/rotations.h"
#include "body/pose_prior.h"
#include "body/surface_index.h"
#include "core/angles.h"
#include "core/random.h"
#include "core/rotation.h"
#include "optim/stage.h"
#include "stress/plain_adam.h"
#include "stress/pulled_turn.h"
#include "stress/rotation_measures.h"
#include "stress/rows.h"
#include "stress/tape_numbers.h"

namespace hsi4d::stress {

/// D4: towards five numbers, with one gradient that is not a number in iteration 7 and infinite ones in 20 and 21.
std::vector<StressFigure> bad_steps(Remedy remedy) {
  constexpr std::array kGoals = {0.5, -0.3, 0.8, 0.1, -0.9};
  constexpr int kIterations = 600;
  constexpr double kRate = 0.05;
  Tape<double> tape;
  const Var<double> x = tape.parameter("x", shape_of(1, 5)), fault = tape.constant("fault", shape_of(1, 5));
  const Var<double> goal = tape.constant("goal", shape_of(1, 5));
  tape.set(goal, kGoals);
  const Var<double> loss = sum(square(x - goal) * fault);
  ParameterGroupSettings settings;
  settings.lr = kRate;
  Adam<double> adam(tape, {{{"all", {x}}, settings}}, {});
  std::vector<PlainAdam<double>> plain(5, {.lr = kRate});
  const auto numbers = [&] {
    std::array<double, 5> now;
    std::copy_n(tape.value(x).data, 5, now.begin());
    return now;
  };
  double changed = 0, untold = 0;
  std::array<double, 5> back = numbers();  // where a bad evaluation leads: before the last step, if there is one
  for (int i = 0; i < kIterations; ++i) {
    std::array<double, 5> factors = {1, 1, 1, 1, 1};
    const bool is_bad = i == 7 || i == 20 || i == 21;
    if (is_bad)
      factors[2] = i == 7 ? std::numeric_limits<double>::quiet_NaN() : std::numeric_limits<double>::infinity();
    tape.set(fault, factors);
    tape.forward(loss);
    tape.backward(loss);
    const std::array<double, 5> before = numbers();
    if (remedy == Remedy::kOn) {
      const StepReport report = adam.step(i, kIterations, tape.value(loss).scalar());
      if (is_bad && !(report.rolled_back && report.bad && report.bad->group.empty())) ++untold;
    } else {
      std::array<double, 5> next;
      for (std::size_t k = 0; k < 5; ++k) {
        plain[k].step(tape.gradient(x).data[k]);
        next[k] = plain[k].x;
      }
      tape.set(x, next);
      untold += is_bad ? 1 : 0;
    }
    const std::array<double, 5> after = numbers();
    if (is_bad) changed += std::memcmp(back.data(), after.data(), sizeof back) != 0 ? 1 : 0;
    if (!is_bad) back = before;
  }
  double left = 0;
  for (std::size_t k = 0; k < 5; ++k) left = larger(left, std::abs(numbers()[k] - kGoals[k]));
  return {{"bad steps that are not taken back to the bit", changed, 0},
          {"bad steps that are not told", untold, 0},
          {"distance to the goal after 600 steps", left, 1e-3}};
}

/// D5: the norm's gradient for differences from 0 to 1; below 1e-15 its square is nothing in float, and so may the
/// gradient be.
std::vector<StressFigure> distances_at_zero(Remedy remedy) {
  std::vector<float> rows;
  for (int digit = 0; digit <= 21; ++digit) {
    const float d = digit == 21 ? 0.0f : static_cast<float>(std::pow(10.0, -digit));
    rows.insert(rows.end(), {d, -d / 2, d / 4});
  }
  const auto count = static_cast<Index>(rows.size() / 3);
  std::vector<float> gradient(rows.size());
  if (remedy == Remedy::kOn) {
    Tape<float> tape;
    const Var<float> x = leaf(tape, "x", shape_of(count, 3), rows);
    const Var<float> loss = sum(norm_cols(x));
    tape.forward(loss);
    tape.backward(loss);
    std::copy_n(tape.gradient(x).data, rows.size(), gradient.begin());
  } else {
    for (std::size_t i = 0; i < rows.size(); ++i) {  // d √s = ds / (2 √s)
      const float* d = &rows[i / 3 * 3];
      gradient[i] = 2 * rows[i] * (0.5f / std::sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]));
    }
  }
  double size = 0, at_zero = 0, error = 0;
  const Vector3<double> direction = Vector3<double>(1, -0.5, 0.25).normalized();
  for (Index r = 0; r < count; ++r) {
    const Vector3<double> d = widen(Vector3<float>(&gradient[static_cast<std::size_t>(3 * r)]));
    size = larger(size, d.norm());
    if (r == count - 1) at_zero = largest(d);
    if (r <= 15) error = larger(error, largest(Vector3<double>(d - direction)));
  }
  return {{"gradient of the distance of equal points", at_zero, 0},
          {"largest gradient of a distance", size, 1 + 1e-6},
          {"error of the gradient from 1e-15 m on", error, 1e-6}};
}

namespace {

/// Points as a surface: each a face of one point.
BodyModel points_as_faces(const std::vector<Vector3<float>>& points) {
  BodyModel body;
  for (const Vector3<float>& p : points) {
    const auto v = static_cast<std::int32_t>(body.vertices.size() / 3);
    body.vertices.insert(body.vertices.end(), p.begin(), p.end());
    body.faces.insert(body.faces.end(), {v, v, v});
  }
  return body;
}

/// The point nearest to `a`, in float by |a|² + |b|² − 2 a·b.
std::size_t nearest_by_squares(const std::vector<Vector3<float>>& points, const Vector3<float>& a) {
  std::size_t best = 0;
  float least = std::numeric_limits<float>::infinity();
  for (std::size_t i = 0; i < points.size(); ++i) {
    const float square = a.squaredNorm() + points[i].squaredNorm() - 2 * a.dot(points[i]);
    if (square < least) least = square, best = i;
  }
  return best;
}

}  // namespace

/// D6: which of 300 points is nearest, a kilometre from the origin, and which of two that tie.
std::vector<StressFigure> near_neighbours(Remedy remedy) {
  const Vector3<double> far(1100, -700, 700);  // steps of floats are the same all around
  RandomSequence random(4, random_stream("stress.D6"));
  const auto place = [&] {
    const double x = random.uniform(-1, 1), y = random.uniform(-1, 1);
    return narrow(Vector3<double>(far + Vector3<double>(x, y, random.uniform(-1, 1))));
  };
  std::vector<Vector3<float>> points(300);
  for (Vector3<float>& p : points) p = place();
  const BodyModel body = points_as_faces(points);
  const SurfaceIndex index(body);
  double beyond = 0, other = 0, later = 0;
  for (int repeat = 0; repeat < 300; ++repeat) {
    const Vector3<float> at = place();
    const auto distance = [&](std::size_t i) { return (widen(points[i]) - widen(at)).norm(); };
    std::size_t truth = 0;
    for (std::size_t i = 1; i < points.size(); ++i) truth = distance(i) < distance(truth) ? i : truth;
    const std::size_t found = remedy == Remedy::kOn ? static_cast<std::size_t>(index.nearest(widen(at)).face)
                                                    : nearest_by_squares(points, at);
    beyond = larger(beyond, distance(found) - distance(truth));
    other += found != truth ? 1 : 0;
  }
  for (int repeat = 0; repeat < 50; ++repeat) {  // beside `at` by steps that floats have there
    const Vector3<float> at = place(), step(static_cast<float>(repeat + 1) / 256, 0, 0);
    const std::vector<Vector3<float>> pair = {at + step, at - step};
    const BodyModel two = points_as_faces(pair);
    later += remedy == Remedy::kOn ? SurfaceIndex(two).nearest(widen(at)).face
                                   : static_cast<double>(nearest_by_squares(pair, at));
  }
  return {{"nearest of 300 that are another, of 300", other, 0},
          {"distance beyond the nearest, m", beyond, 1e-9},
          {"ties that do not go to the first, of 50", later, 0}};
}

/// D7: joints turned by up to 60 rad, as a wild step turns them.
std::vector<StressFigure> joint_ranges(Remedy remedy) {
  double energy = 0, gradient = 0;
  for (const double angle : {0.5, 1.5, 3.0, kPi, 4.5, 2 * kPi, 9.0, 30.0, 60.0}) {
    std::vector<float> pose(63);
    for (std::size_t j = 0; j < 21; ++j) pose[3 * j + j % 3] = static_cast<float>(j % 2 == 0 ? angle : -angle);
    if (remedy == Remedy::kOff) {  // Σ exp(x)² and its derivative
      float sum = 0;
      for (const float x : pose) {
        sum += std::exp(x) * std::exp(x);
        gradient = larger(gradient, static_cast<double>(2 * std::exp(x) * std::exp(x)));
      }
      energy = larger(energy, static_cast<double>(sum));
      continue;
    }
    Tape<float> tape;
    const Var<float> x = leaf(tape, "pose", shape_of(21, 3), pose);
    const Var<float> loss = joint_limit_energy(rotations_from_axis_angle(x));
    tape.forward(loss);
    tape.backward(loss);
    energy = larger(energy, static_cast<double>(tape.value(loss).scalar()));
    for (int i = 0; i < 63; ++i) gradient = larger(gradient, std::abs(static_cast<double>(tape.gradient(x).data[i])));
  }
  // A joint is at most half a turn about each of three axes beyond a range that holds 0.
  return {{"energy of a pose, rad^2", energy, 63 * kPi * kPi}, {"largest gradient", gradient, 1e3}};
}

/// D9: a stage that turns a joint on and on, up to a full turn; and what wrapping does to rotations.
std::vector<StressFigure> turns_beyond_half(Remedy remedy) {
  double angle = 0, jacobian = 0, change = 0;
  // 66 steps of 0.05 go from 3 to 6.3, just beyond 2π.
  pull_turn({.start = 3, .rate = 0.05, .iterations = 66, .wraps = remedy == Remedy::kOn}, [&](Index, const double* w) {
    const Vector3<double> now(w);
    angle = larger(angle, now.norm());
    jacobian = larger(jacobian, largest(so3_left_jacobian_inverse(now)));
  });
  RandomSequence random(22, random_stream("stress.D9"));
  for (const double turned : {3.2, 4.0, 2 * kPi - 1e-3, 2 * kPi + 1e-3, 9.0}) {
    const double x = random.normal(), y = random.normal();
    const Vector3<float> before = narrow(Vector3<double>(Vector3<double>(x, y, random.normal()).normalized() * turned));
    Vector3<float> after = before;
    if (remedy == Remedy::kOn) wrap_axis_angle(after);
    change = larger(change, largest(Matrix3<double>(so3_exp(widen(after)) - so3_exp(widen(before)))));
    angle = larger(angle, widen(after).norm());
  }
  return {{"largest angle, rad", angle, kPi * (1 + 1e-6)},
          {"entry of the inverse Jacobian", jacobian, 2},
          {"change of R by wrapping", change, 1e-6}};
}

}  // namespace hsi4d::stress
