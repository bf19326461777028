#include "pipelines/cli/sweep_text.h"

#include <algorithm>
#include <sstream>

#include <catch2/catch.hpp>

#include "core/text.h"
#include "pipelines/sweep/tables.h"
#include "tests/support/made_sweep.h"
#include "tests/support/program.h"
#include "tests/support/terminal_program.h"

namespace sweep_text_test {

using namespace hsi4d;
using namespace hsi4d::test;
using Catch::Matchers::Contains;

namespace {

std::size_t widest_line(const std::string& text) {
  std::istringstream lines(text);
  std::size_t widest = 0;
  for (std::string line; std::getline(lines, line);) widest = std::max(widest, count_characters(line));
  return widest;
}

/// What `hsi4d report made` shows on a terminal of that width.
std::string reported(int columns) {
  int status = -1;
  const std::string text = on_terminal({"report", "made"}, columns, status);
  INFO(text);
  CHECK(status == 0);
  return text;
}

}  // namespace

TEST_CASE("a terminal is shown the tables of a sweep within its width, files and other programs the whole") {
  MadeSweep sweep;
  sweep.finish_all();
  for (const int columns : {50, 80}) {
    const std::string text = reported(columns);
    CHECK(widest_line(text) <= static_cast<std::size_t>(columns));
    CHECK_THAT(text,
               Contains("made: 12 runs: 12 done\n") && Contains("\nMeans\n") && Contains("\nDifferences to plain\n") &&
                   Contains("whole tables, of each clip too: made/results.md") && !Contains("|") && !Contains("**"));
    // Every column of the whole table is there, and the better mean is marked.
    for (const Cell& column : mean_table(sweep.read()).head) CHECK_THAT(text, Contains(column.text));
    CHECK_THAT(text, Contains("35.0 ± 10.0*") || Contains("35.00 ± 10.00*"));
  }
  const std::string piped = run_hsi4d({"report", "made"}).out;
  CHECK(piped == sweep_markdown(sweep.read()) + "\nreport: made/report.html\n");
  CHECK_THAT(piped, Contains("| plain |"));
}

TEST_CASE("the table of runs leaves out folders' names where they find no place on a terminal") {
  MadeSweep sweep([](SweepPlan& plan) {
    for (SweepRun& run : plan.runs) run.clip = "a_clip_with_a_rather_long_name_" + run.clip;
  });
  int status = -1;
  const std::string narrow = on_terminal({"sweep", "made", "--dry-run"}, 50, status);
  INFO(narrow);
  CHECK(status == 0);
  std::string table = narrow.substr(0, narrow.find("\nwithout the names of folders"));
  CHECK(table != narrow);
  CHECK(widest_line(table) == 50);
  CHECK_THAT(table, !Contains(sweep.id(1)) && Contains("…") && Contains("seed 1"));
  const std::string whole = run_hsi4d({"sweep", "made", "--dry-run"}).out;
  CHECK_THAT(whole, Contains(sweep.id(1)) && !Contains("…"));
  CHECK(on_terminal({"sweep", "made", "--dry-run"}, 200, status) == whole);
}

}  // namespace sweep_text_test
