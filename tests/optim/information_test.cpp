// Standard deviations from information matrices, against inverses, and against estimates of many noisy measurements.
#include "optim/information.h"

#include <cmath>
#include <limits>

#include <Eigen/LU>
#include <catch2/catch.hpp>

#include "core/check.h"
#include "core/random.h"

namespace information_test {

using namespace hsi4d;
using Matrix = Eigen::MatrixXd;
using Vector = Eigen::VectorXd;

namespace {

Matrix random_matrix(Index rows, Index cols, std::uint64_t seed) {
  RandomSequence random(seed);
  Matrix matrix(rows, cols);
  for (Index r = 0; r < rows; ++r) {
    for (Index c = 0; c < cols; ++c) matrix(r, c) = random.normal();
  }
  return matrix;
}

}  // namespace

TEST_CASE("standard deviations are those of the inverse, whatever the units of the parameters") {
  const Matrix a = random_matrix(40, 7, 1), jacobian = random_matrix(5, 7, 2);
  const Vector expected = (jacobian * (a.transpose() * a).inverse() * jacobian.transpose()).diagonal().cwiseSqrt();
  Vector units(7);
  units << 1e-4, 1, 1e3, 0.1, 1e-2, 30, 1e5;
  for (const Vector& unit : {Vector(Vector::Ones(7)), units}) {
    const Matrix in_units = a * unit.asDiagonal();
    const Information information(in_units.transpose() * in_units);
    CHECK(information.unknown_directions() == 0);
    const Vector found = information.sigmas(jacobian * unit.asDiagonal());
    CHECK((found - expected).cwiseQuotient(expected).cwiseAbs().maxCoeff() < 1e-9);
  }
}

TEST_CASE("a linear problem's estimates scatter as its information says") {
  constexpr Index kTrials = 4000, kMeasured = 12, kUnknown = 3;
  constexpr double kNoise = 0.2;
  const Matrix a = random_matrix(kMeasured, kUnknown, 3), jacobian = random_matrix(4, kUnknown, 4);
  const Vector sigmas = Information(a.transpose() * a / (kNoise * kNoise)).sigmas(jacobian);
  const Matrix estimate = (a.transpose() * a).inverse() * a.transpose();
  RandomSequence random(5);
  Vector squares = Vector::Zero(4), within = Vector::Zero(4);
  for (Index trial = 0; trial < kTrials; ++trial) {
    Vector noise(kMeasured);
    for (Index m = 0; m < kMeasured; ++m) noise[m] = kNoise * random.normal();
    const Vector error = jacobian * (estimate * noise);
    squares += error.cwiseAbs2();
    for (Index r = 0; r < 4; ++r) within[r] += std::abs(error[r]) <= sigmas[r] ? 1 : 0;
  }
  for (Index r = 0; r < 4; ++r) {
    CHECK(std::sqrt(squares[r] / kTrials) == Approx(sigmas[r]).epsilon(0.05));
    CHECK(within[r] / kTrials == Approx(0.683).margin(0.03));
  }
}

TEST_CASE("what depends on a direction of which nothing is known is not known, all else is") {
  // Two numbers of which the sum alone is measured, one by itself, one not at all.
  Matrix information = Matrix::Zero(4, 4);
  information.topLeftCorner(2, 2).setConstant(25);
  information(2, 2) = 4;
  Matrix jacobian = Matrix::Zero(6, 4);
  jacobian.row(0) << 1, 1, 0, 0;
  jacobian.row(1) << 1, 0, 0, 0;
  jacobian.row(2) << 0, 0, 1, 0;
  jacobian.row(3) << 0, 0, 0, 1;
  jacobian.row(4) << 2, 2, 3, 0.2;
  const Information known(information);
  CHECK(known.unknown_directions() == 2);
  const Vector sigmas = known.sigmas(jacobian);
  CHECK(sigmas[0] == Approx(0.2));
  CHECK(sigmas[1] == std::numeric_limits<double>::infinity());
  CHECK(sigmas[2] == Approx(0.5));
  CHECK(sigmas[3] == std::numeric_limits<double>::infinity());
  CHECK(sigmas[4] == std::numeric_limits<double>::infinity());
  CHECK(sigmas[5] == 0);
}

TEST_CASE("nothing is known where there is no information, and damaged numbers are refused") {
  const Information nothing(Matrix::Zero(2, 2));
  CHECK(nothing.unknown_directions() == 2);
  CHECK(nothing.sigmas(Matrix::Identity(2, 2))[1] == std::numeric_limits<double>::infinity());
  CHECK(Information(Matrix(0, 0)).sigmas(Matrix(3, 0)).norm() == 0);
  CHECK_THROWS_AS(Information(Matrix::Constant(2, 2, std::nan(""))), InternalError);
}

}  // namespace information_test
