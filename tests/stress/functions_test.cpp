#include "stress/functions.h"

#include <cmath>
#include <limits>
#include <map>
#include <set>

#include <catch2/catch.hpp>

#include "core/simd.h"
#include "stress/function_table.h"

namespace functions_test {

using namespace hsi4d;

TEST_CASE("every function is as near its exact value as its bound says, and the bound is not idle", "[isa]") {
  std::map<std::string, double> nearest;  // of any instruction set, to the bound
  std::set<std::string> sets;
  for (const FunctionErrors& row : function_errors(3000)) {
    INFO(row.function << ", " << row.precision << ", " << row.argument << " in [" << row.low << ", " << row.high
                      << "], " << row.isa << ": " << row.worst << " of " << row.bound << " at " << row.worst_at);
    CHECK(row.holds());
    CHECK(row.tried >= 1000);
    CHECK(row.mean <= row.worst);
    CHECK((row.worst_at >= row.low && row.worst_at <= row.high));
    double& share = nearest[row.function + row.precision + std::to_string(row.low)];
    share = std::max(share, row.worst / row.bound);
    sets.insert(row.isa);
  }
  for (const auto& [name, share] : nearest) {
    INFO(name << ": " << share << " of its bound");
    CHECK(share >= 0.1);
  }
  CHECK(sets.contains("all"));
  for (const Isa isa : stress::allowed_isas()) CHECK(sets.contains(isa_name(isa)));
}

TEST_CASE("errors are in units in the last place, of the value or of the largest") {
  stress::ErrorSum<float> sum;
  sum.add(1, 1 + 0x1p-23L, 1);        // one unit above 1
  sum.add(2, 1 - 0x1p-23L, 1);        // and one below
  sum.add(3, 4 + 0x1p-20L, 4);        // two of 4
  sum.add(4, 0x1p-30L, 0, 0x1p-23L);  // far less than one of 1
  const FunctionErrors row = sum.row({"f", "x", 0, 5, 2}, "all");
  CHECK(row.worst == 2);
  CHECK(row.worst_at == 3);
  CHECK(row.tried == 4);
  CHECK(row.mean == Approx((1 + 1 + 2 + 0x1p-7) / 4));
  CHECK(row.holds());
  sum.add(5, std::numeric_limits<long double>::quiet_NaN(), 1);
  CHECK_FALSE(sum.row({"f", "x", 0, 5, 2}, "all").holds());
  CHECK_FALSE(stress::ErrorSum<float>().row({"f", "x", 0, 5, 2}, "all").holds());
}

TEST_CASE("arguments lie within their range, near its ends and where a formula changes, down to very small ones") {
  const double switches[] = {0.5};
  const std::vector<float> x = stress::arguments<float>(-1, 2, 4000, switches);
  const auto count = [&x](auto wanted) { return std::count_if(x.begin(), x.end(), wanted); };
  CHECK(count([](float v) { return v < -1 || v > 2; }) == 0);
  CHECK(count([](float v) { return std::abs(v - 0.5f) <= 0x1p-14f; }) > 200);
  CHECK(count([](float v) { return v == 0; }) > 0);
  CHECK(count([](float v) { return v > 2 - 0x1p-14f; }) > 50);
  CHECK(count([](float v) { return v != 0 && std::abs(v) < 1e-6f; }) > 100);
}

}  // namespace functions_test
