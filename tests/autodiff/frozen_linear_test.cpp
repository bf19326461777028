#include "autodiff/frozen_linear.h"

#include <random>

#include "tests/support/operator_check.h"

namespace frozen_linear_test {

using namespace hsi4d;
using namespace hsi4d::test;

namespace {

using Numbers = std::vector<double>;

Numbers random_numbers(std::size_t count, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  Numbers numbers(count);
  for (double& x : numbers) x = std::uniform_real_distribution<double>(-1, 1)(random);
  return numbers;
}

struct Maps {
  FrozenLinear<float> single;
  FrozenLinear<double> full;
  const FrozenLinear<float>& of(const Var<float>&) const { return single; }
  const FrozenLinear<double>& of(const Var<double>&) const { return full; }
};

}  // namespace

TEST_CASE("an affine map agrees with plain loops") {
  const Numbers weight = random_numbers(5 * 7, 1), bias = random_numbers(5, 2), x = random_numbers(11 * 7, 3);
  Tape<double> tape;
  const auto in = tape.parameter("x", shape_of(11, 7));
  tape.set(in, x);
  const auto out = frozen_linear(FrozenLinear<double>(weight, bias), in);
  tape.forward(out);
  for (std::size_t r = 0; r < 11; ++r) {
    for (std::size_t o = 0; o < 5; ++o) {
      double sum = bias[o];
      for (std::size_t i = 0; i < 7; ++i) sum += weight[7 * o + i] * x[7 * r + i];
      CHECK(tape.value(out)(static_cast<Index>(r), static_cast<Index>(o)) == Approx(sum).margin(1e-15));
    }
  }
}

TEST_CASE("affine maps pass the operator checks", "[parallel]") {
  for (const Index rows : {1, 4, 19}) {
    const Numbers weight = random_numbers(23 * 14, 4), bias = random_numbers(23, 5);
    const Maps maps{FrozenLinear<float>(weight, bias), FrozenLinear<double>(weight, bias)};
    check_operator("frozen_linear", {{"x", shape_of(rows, 14)}},
                   [&](const auto& in) { return frozen_linear(maps.of(in[0]), in[0]); });
  }
}

TEST_CASE("an affine map refuses what does not fit") {
  CHECK_THROWS_AS(FrozenLinear<double>(Numbers(7), Numbers(2)), InternalError);
  CHECK_THROWS_AS(FrozenLinear<double>(Numbers(7), Numbers()), InternalError);
  Tape<double> tape;
  const FrozenLinear<double> map(Numbers(8), Numbers(2));
  CHECK_THROWS_AS(frozen_linear(map, tape.parameter("x", shape_of(3, 5))), InternalError);
}

}  // namespace frozen_linear_test
