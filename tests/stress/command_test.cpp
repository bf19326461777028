#include "stress/command.h"

#include <limits>
#include <sstream>

#include <catch2/catch.hpp>
#include <nlohmann/json.hpp>

#include "core/check.h"
#include "core/file.h"
#include "stress/scratch_folder.h"

namespace command_test {

using namespace hsi4d;
using namespace hsi4d::cli;

TEST_CASE("stress tells rows, and those not known are refused with what is allowed") {
  const StressOutcome outcome = stress_command({.rows = {"E2"}, .threads = 1, .json = {}});
  CHECK(outcome.status == 0);
  CHECK(outcome.text.find("1 rows tried, 1 held, 0 failed; 0 exempt\n") != std::string::npos);
  CHECK(outcome.text.find("class      tried  held  failed  exempt  seconds\n"
                          "E  losses      1     1       0       0 ") != std::string::npos);
  CHECK(outcome.text.find("projection") == std::string::npos);  // classes without rows that were asked for
  CHECK_THROWS_WITH(stress_command({.rows = {"Z1"}, .threads = {}, .json = {}}),
                    "there is no row \"Z1\"; allowed: A1 to L3, or a letter for its group");
}

TEST_CASE(
    "stress fails where a row does, where nothing proves its remedy, and where it throws, but not by exempt rows") {
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  using Figures = std::vector<StressFigure>;
  const StressCase held{"X1", "held", "nothing", [](Remedy r) {
                          return Figures{{"a", r == Remedy::kOn ? 1.0 : 3, 2}};
                        }};
  const StressCase failing{"X2", "fails", "nothing", [](Remedy) { return Figures{{"a", 3, 2}}; }};
  const StressCase unproven{"X3", "unproven", "nothing", [](Remedy) { return Figures{{"a", 1, 2}}; }};
  const StressCase throwing{"X4", "throws", "nothing", [](Remedy) -> Figures { throw DataError("no"); }};
  const StressCase no_number{"X5", "no number", "nothing", [](Remedy r) {
                               return Figures{{"a", r == Remedy::kOn ? kNone : 3, 2}};
                             }};
  const StressCase exempt{"X6", "exempt", "nothing", nullptr, "", "cannot be"};
  const ScratchFolder folder;
  const auto outcome_of = [&](const std::vector<StressCase>& cases) {
    return run_cases(cases, {.rows = {}, .threads = 1, .json = folder / "rows.jsonl"});
  };
  CHECK(outcome_of({held, exempt}).status == 0);
  for (const StressCase& bad : {failing, unproven, throwing, no_number}) {
    INFO(bad.failure);
    const StressOutcome outcome = outcome_of({held, bad, exempt});
    CHECK(outcome.status == 1);
    CHECK(outcome.text.find(bad.id + std::string(bad.id == unproven.id ? "   NO PROOF" : "   FAILED ")) !=
          std::string::npos);
    CHECK(outcome.text.find("2 rows tried, 1 held, 1 failed (" + std::string(bad.id) + "); 1 exempt\n") !=
          std::string::npos);
    CHECK(read_text_file(folder / "rows.jsonl").find(bad.id) != std::string::npos);
  }
}

TEST_CASE("stress --functions tells a line for each function, range and instruction set, and writes them as JSON") {
  const ScratchFolder folder;
  StressOptions options{.rows = {}, .threads = {}, .json = folder / "functions.jsonl"};
  options.functions = true;
  options.points = 1000;
  const StressOutcome outcome = stress_command(options);
  CHECK(outcome.status == 0);
  std::istringstream lines(read_text_file(options.json));
  std::string line;
  int rows = 0;
  for (; std::getline(lines, line); ++rows) {
    const nlohmann::json row = nlohmann::json::parse(line);
    CHECK(row["holds"] == true);
    CHECK(row["largest"].get<double>() <= row["bound"].get<double>());
    CHECK(outcome.text.find(row["function"].get<std::string>()) != std::string::npos);
  }
  CHECK(rows > 30);
  const std::string count = std::to_string(rows);
  CHECK(outcome.text.find(count + " rows tried, " + count + " within their bounds\n") != std::string::npos);
  options.rows = {"A1"};
  CHECK_THROWS_WITH(stress_command(options), "--functions is a table of its own: --row says nothing to it");
}

}  // namespace command_test
