// Rows G about steps by a Gauss-Newton matrix (lm): matrices without full rank, losses that bend down, bad evaluations.
#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include <Eigen/LU>

#include "autodiff/elementwise.h"
#include "autodiff/map.h"
#include "autodiff/matrix.h"
#include "autodiff/reduce.h"
#include "optim/levenberg_marquardt.h"
#include "optim/losses/robust.h"
#include "stress/measures.h"
#include "stress/rows.h"
#include "stress/tape_numbers.h"

namespace hsi4d::stress {

namespace {

constexpr Index kMatrixSteps = 60;

/// The numbers that lm ends at, and how many evaluations were bad.
struct MatrixEnd {
  std::vector<double> x;
  Index bad = 0;
};

/// @param rate  of the numbers x
MatrixEnd end_of_lm(Tape<double>& tape, Var<double> x, Var<double> loss, double rate) {
  ParameterGroupSettings group;
  group.lr = rate;
  OptimizerSettings settings;
  settings.kind = OptimizerKind::kLm;
  LevenbergMarquardt<double> method(tape, loss, {{{"x", {x}}, group}}, settings);
  for (Index i = 0; i < kMatrixSteps && !method.is_done(); ++i) {
    tape.forward(loss);
    tape.backward(loss);
    method.step(i, kMatrixSteps, tape.value(loss).scalar());
  }
  const ConstArray<double> found = tape.value(x);
  return {{found.data, found.data + found.shape.count()}, method.rollbacks()};
}

}  // namespace

// --- G14: a matrix without full rank ---------------------------------------------------------------------------------

/// G14: (x0 + x1 − 1)², x2 in nothing. Without: the step that solves H d = −g.
std::vector<StressFigure> matrix_without_rank(Remedy remedy) {
  std::array<double, 3> x = {0.5, 0, 0.25};
  if (remedy == Remedy::kOn) {
    Tape<double> tape;
    const Var<double> numbers = leaf(tape, "x", shape_of(1, 3), {x[0], x[1], x[2]});
    const Var<double> ones = tape.constant("ones", shape_of(3, 1));
    tape.set(ones, {1.0, 1.0, 0.0});
    const MatrixEnd end = end_of_lm(tape, numbers, sum(square(matmul(numbers, ones) - 1.0)), 0.1);
    std::copy(end.x.begin(), end.x.end(), x.begin());
  } else {
    Eigen::Matrix3d h = Eigen::Matrix3d::Zero();
    h.topLeftCorner<2, 2>().setConstant(2);
    const Eigen::Vector3d step = h.partialPivLu().solve(-2 * (x[0] + x[1] - 1) * Eigen::Vector3d(1, 1, 0));
    for (Index i = 0; i < 3; ++i) x[static_cast<std::size_t>(i)] += step[i];
  }
  return {{"what is seen, off its goal", std::abs(x[0] + x[1] - 1), 1e-3},
          {"what is seen together, parted", std::abs(x[0] - x[1] - 0.5), 0.1},
          {"way of what nothing sees", std::abs(x[2] - 0.25), 0}};
}

// --- G15: a loss that bends down -------------------------------------------------------------------------------------

/// G15: r²/(1 + r²) is least at 0, and far from there bends down. Without: Newton's steps by its second derivative.
std::vector<StressFigure> loss_that_bends_down(Remedy remedy) {
  double worst = 0;
  for (const double start : {0.7, 1.5, -3.0}) {
    double x = start;
    if (remedy == Remedy::kOn) {
      Tape<double> tape;
      const Var<double> number = leaf(tape, "x", shape_of(1, 1), {x});
      const Var<double> loss = sum_over({number}, [](auto r) { return geman_mcclure(square(r), 1.0F); });
      x = end_of_lm(tape, number, loss, 0.1).x.front();
    } else {
      for (Index i = 0; i < kMatrixSteps; ++i) {
        const double s = 1 + x * x, slope = 2 * x / (s * s), bend = (2 - 6 * x * x) / (s * s * s);
        x -= slope / bend;
      }
    }
    worst = larger(worst, std::abs(x));
  }
  return {{"off the least value, of 3 starts", worst, 1e-2}};
}

// --- G16: bad evaluations --------------------------------------------------------------------------------------------

/// G16: 2x − log x is least at 0.5 and not a number below 0, where a long step goes. Without: the step is kept.
std::vector<StressFigure> bad_matrix_steps(Remedy remedy) {
  double x = 0.9, bad = 0;
  if (remedy == Remedy::kOn) {
    Tape<double> tape;
    const Var<double> number = leaf(tape, "x", shape_of(1, 1), {x});
    const MatrixEnd end = end_of_lm(tape, number, sum(number * 2.0 - log(number)), 0.4);
    x = end.x.front();
    bad = static_cast<double>(end.bad);
  } else {
    for (Index i = 0; i < kMatrixSteps; ++i) {
      if (!std::isfinite(std::log(x))) ++bad;
      x -= kLongestMatrixStep * 0.4 * (2 - 1 / x) / std::abs(2 - 1 / x);  // as far as a step goes
    }
  }
  return {{"off the least value", std::abs(x - 0.5), 0.02},
          {"bad evaluations", bad, 10},
          {"of which there is one", bad > 0 ? 0.0 : 1.0, 0}};
}

}  // namespace hsi4d::stress
