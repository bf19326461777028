#include "optim/row_adam.h"

#include <cmath>
#include <limits>

#include <catch2/catch.hpp>

#include "autodiff/elementwise.h"
#include "autodiff/reduce.h"
#include "core/parallel.h"
#include "optim/adam.h"

namespace row_adam_test {

using namespace hsi4d;

namespace {

/// A leaf whose gradient is what is written beside it: the loss is Σ leaf · slope.
template <class S>
struct Slopes {
  Slopes(Index rows, Index cols) {
    leaf = tape.parameter("leaf", shape_of(rows, cols));
    slope = tape.constant("slope", shape_of(rows, cols));
    loss = sum(leaf * slope);
    tape.set(leaf, std::vector<S>(static_cast<std::size_t>(rows * cols), S(1)));
  }
  void differentiate(const std::vector<S>& slopes) {
    tape.set(slope, slopes);
    tape.forward(loss);
    tape.backward(loss);
  }
  std::vector<S> values() {
    const ConstArray<S> array = tape.value(leaf);
    std::vector<S> result;
    for (Index r = 0; r < array.total_rows(); ++r)
      result.insert(result.end(), array.row(r), array.row(r) + array.shape.cols);
    return result;
  }
  Tape<S> tape;
  Var<S> leaf, slope, loss;
};

const std::vector<double>& first() {
  static const std::vector<double> table = bias_corrections(0.9, 100);
  return table;
}
const std::vector<double>& second() {
  static const std::vector<double> table = bias_corrections(0.999, 100);
  return table;
}

}  // namespace

TEST_CASE("rows that are all seen move as Adam moves them") {
  constexpr Index kRows = 40, kCols = 3;
  Slopes<double> rows(kRows, kCols), all(kRows, kCols);
  RowMoments<double> moments;
  moments.resize(kRows, kCols);
  OptimizerSettings settings;
  settings.eps = 1e-15;
  OptimizerGroup<double> group;
  group.parameters = {"leaf", {all.leaf}};
  group.settings.lr = 0.1;
  Adam<double> adam(all.tape, {group}, settings);
  for (Index i = 0; i < 30; ++i) {
    std::vector<double> slopes;
    for (Index k = 0; k < kRows * kCols; ++k) slopes.push_back(std::sin(0.7 * static_cast<double>(i * 7 + k)) + 0.1);
    rows.differentiate(slopes);
    all.differentiate(slopes);
    CHECK(step_rows(rows.leaf, moments, {.rate = 0.1}, first(), second()).moved == kRows);
    adam.step(i, 30, 1);
  }
  const std::vector<double> a = rows.values(), b = all.values();
  for (std::size_t k = 0; k < a.size(); ++k) CHECK(a[k] == Approx(b[k]).epsilon(1e-12));
}

TEST_CASE("a row that is not seen stands still, and its first step is as long as the rate") {
  Slopes<float> slopes(3, 2);
  RowMoments<float> moments;
  moments.resize(3, 2);
  const std::vector<float> column_shares = {1, 0.25F};
  for (int i = 0; i < 50; ++i) {
    slopes.differentiate({1, -2, 0, 0, 3, 0});
    const RowAdamReport report = step_rows(slopes.leaf, moments, {.rate = 0.01}, first(), second());
    CHECK(report.moved == 2);
  }
  std::vector<float> values = slopes.values();
  CHECK(values[2] == 1);
  CHECK(values[3] == 1);
  CHECK(moments.steps == std::vector<std::int32_t>{50, 0, 50});
  CHECK(values[0] == Approx(1 - 0.5).epsilon(1e-4));
  slopes.differentiate({0, 0, 5, -7, 0, 0});
  step_rows(slopes.leaf, moments, {.rate = 0.01, .column_shares = column_shares}, first(), second());
  values = slopes.values();
  CHECK(values[2] == Approx(1 - 0.01).epsilon(1e-6));
  CHECK(values[3] == Approx(1 + 0.0025).epsilon(1e-6));
}

TEST_CASE("a row whose gradient is no number stays, and the others move") {
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN(), kInfinite = std::numeric_limits<float>::infinity();
  Slopes<float> slopes(4, 2);
  RowMoments<float> moments;
  moments.resize(4, 2);
  slopes.differentiate({1, kNan, kInfinite, 0, 1e19F, 0, 2, 2});
  const RowAdamReport report = step_rows(slopes.leaf, moments, {.rate = 0.5}, first(), second());
  CHECK(report.refused == 3);
  CHECK(report.moved == 1);
  CHECK(slopes.values() == std::vector<float>{1, 1, 1, 1, 1, 1, 0.5F, 0.5F});
  CHECK(moments.steps == std::vector<std::int32_t>{0, 0, 0, 1});
}

TEST_CASE("rows that are new or forgotten have nothing") {
  RowMoments<float> moments;
  moments.resize(2, 3);
  moments.mean.assign(6, 1);
  moments.square.assign(6, 2);
  moments.steps = {3, 4};
  moments.resize(3, 3);
  CHECK(moments.steps == std::vector<std::int32_t>{3, 4, 0});
  CHECK(moments.mean[6] == 0);
  moments.clear_row(0, 3);
  CHECK(moments.steps[0] == 0);
  CHECK(moments.mean[2] == 0);
  CHECK(moments.mean[3] == 1);
}

TEST_CASE("steps of rows have the same bits on any number of threads", "[parallel]") {
  constexpr Index kRows = 20000;
  std::vector<std::vector<float>> results;
  for (const int threads : {1, 2, 3, 8}) {
    Slopes<float> slopes(kRows, 3);
    RowMoments<float> moments;
    moments.resize(kRows, 3);
    with_threads(threads, [&] {
      for (int i = 0; i < 5; ++i) {
        std::vector<float> numbers;
        for (Index k = 0; k < 3 * kRows; ++k)
          numbers.push_back(k % 7 == 0 ? 0.0F : static_cast<float>(std::cos(0.3 * static_cast<double>(k + i))));
        slopes.differentiate(numbers);
        step_rows(slopes.leaf, moments, {.rate = 0.01}, first(), second());
      }
    });
    results.push_back(slopes.values());
  }
  for (const auto& result : results) CHECK(result == results.front());
}

}  // namespace row_adam_test
