// What the rows of `hsi4d bench --json` have in common.
#pragma once

#include <set>
#include <string>

#include <catch2/catch.hpp>
#include <nlohmann/json.hpp>

namespace hsi4d::test {

/// Checks that a row tells what it is of, its times and what it was measured with, and that its rate follows from its
/// counts.
inline void check_bench_row(const nlohmann::json& row) {
  INFO(row.dump());
  CHECK_FALSE(row.at("name").get<std::string>().empty());
  CHECK(row.at("threads") >= 1);
  CHECK(row.at("min_ms") > 0);
  CHECK(row.at("median_ms") >= row.at("min_ms"));
  CHECK(row.at("repeats") >= 1);
  CHECK(std::set<std::string>{"baseline", "avx2", "avx512"}.count(row.at("isa")) == 1);
  const nlohmann::json& machine = row.at("machine");
  CHECK_FALSE(machine.at("cpu").get<std::string>().empty());
  CHECK(machine.at("cores") >= 1);
  CHECK_THAT(machine.at("compiler").get<std::string>(), Catch::Matchers::Matches("[A-Za-z]+ [0-9]+\\..*"));
  CHECK_THAT(machine.at("flags").get<std::string>(),
             Catch::Matchers::Contains("-O") && Catch::Matchers::Contains("-ffp-contract=off"));
  if (!row.contains("mfragments_per_s")) return;
  CHECK(row["mfragments_per_s"].get<double>() ==
        Approx(row.at("fragments").get<double>() / row.at("median_ms").get<double>() / 1e3));
}

}  // namespace hsi4d::test
