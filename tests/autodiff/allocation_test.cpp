#include <memory>

#include <catch2/catch.hpp>

#include "autodiff/difference.h"
#include "autodiff/elementwise.h"
#include "autodiff/map.h"
#include "autodiff/matrix.h"
#include "autodiff/reduce.h"
#include "core/parallel.h"
#include "tests/support/allocation_counter.h"

namespace allocation_test {

using namespace hsi4d;
using namespace hsi4d::test;

TEST_CASE("the allocation counter sees allocations") {
  if (!allocations_are_counted()) {
    WARN("skipped: sanitizers bring their own malloc");
    return;
  }
  const std::int64_t before = allocation_count();
  const auto memory = std::make_unique<char[]>(100);
  struct alignas(64) Line {
    char bytes[64];
  };
  const auto aligned = std::make_unique<Line>();
  CHECK(allocation_count() - before == 2);
}

TEMPLATE_TEST_CASE("a steady iteration allocates nothing", "", float, double) {
  if (!allocations_are_counted()) {
    WARN("skipped: sanitizers bring their own malloc");
    return;
  }
  for (const int threads : {1, 2}) {
    with_threads(threads, [&] {
      Tape<TestType> tape;
      const Shape image{3, 64, 100, 112};
      const auto x = tape.parameter("x", image);
      const auto bias = tape.parameter("bias", shape_of(1, 100));
      const auto target = tape.constant("target", image);
      const auto mask = tape.constant("mask", {1, 64, 100, 112});
      const auto weights = tape.parameter("weights", shape_of(30, 20));
      const auto y = sigmoid(x + bias) * 0.5;
      const auto features = matmul(gather_rows(reshape(y, 640, 30), std::vector<std::uint32_t>(5000, 7)), weights);
      const auto loss = l1(y, target, mask) + charbonnier(y, target, 0.01) + mean(square(sum_rows(features))) +
                        sum_over({x, mask}, [](auto a, auto b) { return b * exp(-square(a)); });
      const auto iterate = [&](int i) {
        tape.write(x).data[i] += TestType(0.25);
        if (i % 3 == 0) tape.freeze(bias);
        if (i % 3 == 1) tape.unfreeze(bias);
        tape.forward(loss);
        tape.backward(loss);
      };
      CHECK(steady_allocations([&] {
              for (int i = 0; i < 30; ++i) iterate(i);
            }) == 0);
    });
  }
}

}  // namespace allocation_test
