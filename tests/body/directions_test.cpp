#include "body/directions.h"

#include <cmath>

#include "body/directions_kernel.h"
#include "core/parallel.h"
#include "tests/support/operator_check.h"
#include "tests/support/random_numbers.h"

namespace directions_test {

using namespace hsi4d;
using namespace hsi4d::test;

namespace {

using Numbers = std::vector<double>;

/// P, the columns that a table takes of it, and what both directions must give.
struct Problem {
  Numbers values;
  DirectionSource source;
  Numbers coefficients, points, d_result;

  Problem(Index vertices, Index groups, Index group_columns, double size = 0.01) {
    const Index stride = groups * group_columns + 3;  // some that are not taken
    values = random_numbers(3 * vertices * stride, size, 1);
    source = {values, vertices, stride, {}, group_columns};
    for (Index g = 0; g < groups; ++g) source.group_begin.push_back(g * group_columns + (g % 2 == 0 ? 0 : 2));
    coefficients = random_numbers(groups * group_columns, 1, 2);
    points = random_numbers(3 * vertices, 1, 3);
    d_result = random_numbers(3 * vertices, 1, 4);
  }
  double number(Index row, Index column) const {
    const Index begin = source.group_begin[static_cast<std::size_t>(column / source.group_columns)];
    return values[static_cast<std::size_t>(row * source.row_stride + begin + column % source.group_columns)];
  }
  Index columns() const { return static_cast<Index>(coefficients.size()); }
  Numbers result() const {
    Numbers y = points;
    for (Index row = 0; row < static_cast<Index>(y.size()); ++row) {
      for (Index c = 0; c < columns(); ++c)
        y[static_cast<std::size_t>(row)] += number(row, c) * coefficients[static_cast<std::size_t>(c)];
    }
    return y;
  }
  Numbers d_coefficients() const {
    Numbers d(coefficients.size());
    for (Index row = 0; row < static_cast<Index>(points.size()); ++row) {
      for (Index c = 0; c < columns(); ++c)
        d[static_cast<std::size_t>(c)] += number(row, c) * d_result[static_cast<std::size_t>(row)];
    }
    return d;
  }
};

template <class S>
std::vector<S> rounded(const Numbers& numbers) {
  return {numbers.begin(), numbers.end()};
}

template <class S>
double largest_difference(const std::vector<S>& a, const Numbers& b) {
  REQUIRE(a.size() == b.size());
  double largest = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    const double difference = std::abs(static_cast<double>(a[i]) - b[i]);
    largest = difference <= largest ? largest : difference;
  }
  return largest;
}

template <class S>
std::vector<S> added(const Directions<S>& table, const Problem& p) {
  std::vector<S> y = rounded<S>(p.points);
  add_directions(table, rounded<S>(p.coefficients).data(), y.data(), y.data());
  return y;
}

template <class S>
Numbers gathered(const Directions<S>& table, const Problem& p) {
  std::vector<S> scratch(static_cast<std::size_t>(gather_scratch(table)));
  Numbers sums(p.coefficients.size());
  gather_directions(table, rounded<S>(p.d_result).data(), scratch.data(), sums.data());
  return sums;
}

}  // namespace

TEMPLATE_TEST_CASE("directions are their definition for any number of points and columns", "", float, double) {
  using S = TestType;
  const double tolerance = sizeof(S) == 8 ? 1e-13 : 2e-5;
  for (const Index vertices : {1, 2, 31, 32, 33, 64, 500, 513, 2048, 2049, 4200}) {
    for (const auto& [groups, columns] : {std::pair{1, 1}, {1, 10}, {3, 9}}) {
      INFO("V = " << vertices << ", " << groups << " × " << columns);
      const Problem p(vertices, groups, columns);
      const Directions<S> table(p.source);
      CHECK(table.columns() == groups * columns);
      CHECK(largest_difference(added(table, p), p.result()) <= (sizeof(S) == 8 ? 1e-15 : 1.5e-7));
      CHECK(largest_difference(gathered(table, p), p.d_coefficients()) <= tolerance);
    }
  }
}

TEST_CASE("directions have the same bits for any number of threads", "[parallel]") {
  const Problem p(7000, 5, 9);
  const Directions<float> exact(p.source), packed(p.source, {1e-3, 8.5});
  for (const Directions<float>& table : {exact, packed}) {
    std::vector<float> first;
    Numbers first_sums;
    for (const int threads : {1, 2, 3, 8}) {
      with_threads(threads, [&] {
        const std::vector<float> y = added(table, p);
        const Numbers sums = gathered(table, p);
        if (threads == 1) {
          first = y;
          first_sums = sums;
        }
        CHECK(y == first);
        CHECK(sums == first_sums);
      });
    }
  }
}

TEST_CASE("packed directions keep the bound, in each direction of the worst coefficients") {
  const Problem p(333, 6, 9, 0.004);
  const Directions<float> table(p.source, {1e-4, 9});
  const Directions<float> exact(p.source);
  CHECK(table.bytes() * 2 == exact.bytes());  // everything is packed: 6 · 9 · 0.004/32767/2 = 3.3e-6
  CHECK(table.largest_error() > 3e-6);
  CHECK(table.largest_error() < 3.4e-6);
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    Problem worst = p;
    for (std::size_t c = 0; c < worst.coefficients.size(); ++c) {
      worst.coefficients[c] = (random_numbers(60, 1, seed)[c] > 0 ? 1 : -1);
    }
    CHECK(largest_difference(added(table, worst), worst.result()) <= table.largest_error() + 3e-7);
  }
  // The adjoint is that of the packed numbers.
  Problem unit = p;
  unit.points.assign(unit.points.size(), 0.0);
  const Numbers sums = gathered(table, p);
  for (std::size_t c = 0; c < unit.coefficients.size(); ++c) {
    unit.coefficients.assign(unit.coefficients.size(), 0.0);
    unit.coefficients[c] = 1;
    const std::vector<float> column = added(table, unit);
    double along = 0;
    for (std::size_t row = 0; row < column.size(); ++row) along += static_cast<double>(column[row]) * p.d_result[row];
    CHECK(sums[c] == Approx(along).margin(2e-7));
  }
}

TEST_CASE("tiles are packed, smallest numbers first, as far as the bound goes") {
  Problem p(32, 3, 2, 1);
  const double sizes[] = {0.01, 1, 0.1};
  for (std::size_t row = 0; row < 96; ++row) {
    for (std::size_t c = 0; c < 9; ++c) p.values[row * 9 + c] = 0;
    for (std::size_t g = 0; g < 3; ++g)
      p.values[row * 9 + static_cast<std::size_t>(p.source.group_begin[g])] = sizes[g];
  }
  p.source.values = p.values;
  const auto bytes_at = [&](double bound) { return Directions<float>(p.source, {bound, 2}).bytes(); };
  const Index tile = 2 * 96 * 4;
  CHECK(bytes_at(0) == 3 * tile);
  CHECK(bytes_at(0.009 / 32767) == 3 * tile);
  CHECK(bytes_at(0.0101 / 32767) == 2 * tile + tile / 2);
  CHECK(bytes_at(0.1101 / 32767) == tile + 2 * (tile / 2));
  CHECK(bytes_at(1.1101 / 32767) == 3 * (tile / 2));
  CHECK(Directions<double>(p.source, {1, 2}).bytes() == 3 * 2 * tile);
}

TEST_CASE("tiles of zeros are left out") {
  Problem p(64, 4, 9);
  for (std::size_t row = 0; row < 96; ++row) {
    for (Index c = 0; c < 39; ++c) p.values[row * 39 + static_cast<std::size_t>(c)] = 0;
  }
  p.source.values = p.values;
  const Directions<double> table(p.source);
  CHECK(table.bytes() == 4 * 9 * 96 * 8);  // one block of two
  CHECK(largest_difference(added(table, p), p.result()) <= 1e-15);
  CHECK(largest_difference(gathered(table, p), p.d_coefficients()) <= 1e-13);
}

TEMPLATE_TEST_CASE("the kernels of every instruction set agree", "", float, double) {
  using S = TestType;
  const Problem p(100, 5, 9);
  const double tolerance = sizeof(S) == 8 ? 1e-14 : 3e-6;
  for (const double bound : {0.0, 1.0}) {
    const Directions<S> table(p.source, {bound, 9});
    for (const Isa isa : {Isa::kBaseline, Isa::kAvx2, Isa::kAvx512}) {
      if (isa > best_isa()) continue;
      INFO(isa_name(isa));
      const auto k = hsi4d::detail::direction_kernels<S>(isa);
      std::vector<S> y(p.points.size()), partial(45 * hsi4d::detail::kDirectionLanes);
      k.add(table.tiles(), rounded<S>(p.coefficients).data(), rounded<S>(p.points).data(), y.data(), 0, 4);
      CHECK(largest_difference(y, p.result()) <= tolerance);
      k.gather(table.tiles(), rounded<S>(p.d_result).data(), partial.data(), 0, 4);
      Numbers sums(45);
      for (std::size_t i = 0; i < partial.size(); ++i)
        sums[i / hsi4d::detail::kDirectionLanes] += static_cast<double>(partial[i]);
      CHECK(largest_difference(sums, p.d_coefficients()) <= 5 * tolerance);
    }
  }
}

TEST_CASE("sources whose sizes do not fit are refused") {
  const Numbers values(90);
  CHECK_THROWS_AS(Directions<double>(DirectionSource{values, 3, 11, {0}, 9}), InternalError);
  CHECK_THROWS_AS(Directions<double>(DirectionSource{values, 3, 10, {2}, 9}), InternalError);
  CHECK_THROWS_AS(Directions<double>(DirectionSource{values, 3, 10, {-1}, 9}), InternalError);
}

}  // namespace directions_test
