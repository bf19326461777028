#include "stress/stress.h"

#include <array>
#include <limits>
#include <set>
#include <stdexcept>

#include <catch2/catch.hpp>

#include "core/parallel.h"

namespace stress_test {

using namespace hsi4d;

namespace {

void check_group(char letter) {
  std::vector<StressCase> cases;
  for (const StressCase& row : stress_cases())
    if (row.id[0] == letter && row.run != nullptr) cases.push_back(row);
  run_stress(cases, [](const StressResult& result) {
    INFO("row " << result.row->id << ": " << result.row->failure);
    INFO("thrown: \"" << result.error << "\", without the remedy \"" << result.error_without << "\"");
    CHECK_FALSE(result.with.empty());
    for (const StressFigure& figure : result.with) {
      INFO(figure.what << ": " << figure.measured << " of at most " << figure.allowed);
      CHECK(figure.holds());
    }
    CHECK(result.error.empty());
    INFO("without: " << result.row->remedy);
    CHECK(result.would_fail());
  });
}

/// A case whose figure is 1 of 2, or of 0.5 without its remedy.
StressCase sound_case() {
  return {"Z1", "", "", [](Remedy remedy) {
            return std::vector<StressFigure>{{"", 1, remedy == Remedy::kOn ? 2.0 : 0.5}};
          }};
}

}  // namespace

TEST_CASE("every row of the catalogue has one case, in its order") {
  std::vector<std::string> rows;
  for (const auto& [letter, count] :
       {std::pair{'A', 13}, {'B', 21}, {'C', 13}, {'D', 9}, {'E', 5}, {'F', 16}, {'G', 16}}) {
    for (int i = 1; i <= count; ++i) rows.push_back(letter + std::to_string(i));
  }
  REQUIRE(rows.size() == 93);
  std::set<std::string> seen;
  std::vector<std::string> found;
  for (const StressCase& row : stress_cases()) {
    CHECK(seen.insert(row.id).second);
    CHECK((row.run == nullptr) != std::string(row.exempt).empty());
    if (row.id[0] <= 'G') found.emplace_back(row.id);
  }
  CHECK(found == rows);
}

TEST_CASE("a case passes where it holds and would not without its remedy") {
  const auto result_of = [](auto* run) {
    const StressCase row{"Z1", "", "", run};
    return run_stress(std::span(&row, 1)).front();
  };
  const StressCase sound = sound_case();
  CHECK(run_stress(std::span(&sound, 1)).front().passed());
  using Figures = std::vector<StressFigure>;
  const StressResult no_proof = result_of(+[](Remedy) { return Figures{{"", 1, 2}}; });
  CHECK(no_proof.holds());
  CHECK_FALSE(no_proof.passed());
  const StressResult not_a_number = result_of(+[](Remedy) {
    return Figures{{"", std::numeric_limits<double>::quiet_NaN(), 2}};
  });
  CHECK_FALSE(not_a_number.holds());
  CHECK(not_a_number.would_fail());
  const StressResult thrown = result_of(+[](Remedy) -> Figures { throw std::runtime_error("broken"); });
  CHECK_FALSE(thrown.holds());
  CHECK(thrown.error == "broken");
  CHECK_FALSE(thrown.would_fail());
  const StressResult thrown_without = result_of(+[](Remedy remedy) {
    if (remedy == Remedy::kOff) throw std::runtime_error("broken");
    return Figures{{"", 1, 2}};
  });
  CHECK(thrown_without.holds());
  CHECK_FALSE(thrown_without.passed());  // nothing was measured without the remedy
  CHECK_FALSE(result_of(+[](Remedy) { return Figures{}; }).holds());
}

TEST_CASE("rows that compare numbers of threads run beside a limit, all others within it") {
  const StressCase limited{"Z1", "", "", [](Remedy) {
                             double threads = 0;
                             with_threads(3, [&] { threads = thread_count(); });
                             return std::vector<StressFigure>{{"", threads, 3}};
                           }};
  StressCase own = limited;
  own.own_threads = true;
  const std::array cases = {limited, own};
  const std::vector<StressResult> results = run_stress(cases, {}, 1);
  CHECK(results[0].with[0].measured == 1);
  CHECK(results[1].with[0].measured == 3);
  std::vector<std::string> ids;
  for (const StressCase& row : stress_cases()) {
    if (row.own_threads) ids.emplace_back(row.id);
  }
  CHECK(ids == std::vector<std::string>{"F6", "R9", "L3"});
}

TEST_CASE("rows A hold, and would not without their remedies") { check_group('A'); }
TEST_CASE("rows B hold, and would not without their remedies") { check_group('B'); }
TEST_CASE("rows C hold, and would not without their remedies") { check_group('C'); }
TEST_CASE("rows D hold, and would not without their remedies") { check_group('D'); }
TEST_CASE("rows E hold, and would not without their remedies") { check_group('E'); }
TEST_CASE("rows F hold, and would not without their remedies", "[release]") { check_group('F'); }
TEST_CASE("rows G hold, and would not without their remedies", "[release]") { check_group('G'); }
TEST_CASE("what is not a number is caught in every slot", "[release]") { check_group('P'); }
TEST_CASE("relations of renders hold", "[release]") { check_group('R'); }
TEST_CASE("10,000 steps end well", "[full]") { check_group('L'); }

}  // namespace stress_test
