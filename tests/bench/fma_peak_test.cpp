#include "bench/fma_peak.h"

#include <catch2/catch.hpp>

#include "core/parallel.h"
#include "core/simd.h"

namespace fma_peak_test {

using namespace hsi4d;

TEST_CASE("the peak of multiply-adds is what no processor exceeds, and none where there are none") {
  FmaBurst<float> narrow;
  FmaBurst<double> wide;
  const Index floats = narrow.run(), doubles = wide.run();
  CHECK(floats == 2 * doubles);
  double peak = 0;
  with_threads(1, [&] { peak = fma_peak_per_second(); });
  CHECK((peak > 0) == (floats > 0));
#if defined(__x86_64__)
  CHECK((floats > 0) == (best_isa() != Isa::kBaseline));
#endif
  if (peak == 0) return;
  CHECK(peak > 1e8);
  CHECK(peak < 1e12);  // 2 units of 16 lanes at 6 GHz are 192 G
}

}  // namespace fma_peak_test
