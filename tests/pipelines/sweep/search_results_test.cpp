#include "pipelines/sweep/search_results.h"

#include <cmath>

#include <catch2/catch.hpp>

#include "core/random.h"
#include "core/text.h"
#include "pipelines/sweep/plots.h"
#include "pipelines/sweep/report.h"
#include "pipelines/sweep/tables.h"
#include "tests/support/made_sweep.h"
#include "tests/support/markup.h"

namespace search_results_test {

using namespace hsi4d;
using namespace hsi4d::test;
using Catch::Matchers::Contains;

namespace {

const MetricFacts& mpjpe() { return *find_metric_facts("mpjpe_mm"); }

std::vector<std::string> texts_of(const std::vector<double>& numbers) {
  std::vector<std::string> texts;
  for (const double number : numbers) texts.push_back(number_text(number));
  return texts;
}

constexpr std::size_t kPoints = 12;

/// Twelve points of a rate and a word, of two seeds and in as many rungs.
void make_search(SweepPlan& plan, std::size_t rungs) {
  plan.compare.clear();
  plan.runs.clear();
  plan.searches = {{"", "mpjpe_mm", {{"stages.a.lr", true}, {"color_net.use", false}}, {}, 2}};
  if (rungs > 1) plan.searches[0].rung_keys = {"last_frame"};
  for (std::size_t i = 0; i < rungs * kPoints * 2; ++i) {
    const std::size_t point = i / 2 % kPoints;
    SweepRun run;
    run.id = std::string(i < 10 ? 15 : 14, '0') + std::to_string(i);
    run.seed = std::to_string(i % 2);
    run.rung = i / (2 * kPoints);
    if (rungs > 1) run.values.emplace_back("last_frame", std::to_string(3 + 4 * run.rung));
    run.values.emplace_back("stages.a.lr", number_text(0.001 * std::pow(2, point)));
    run.values.emplace_back("color_net.use", point % 2 == 0 ? "\"on\"" : "\"off\"");
    run.config = "{}";
    plan.runs.push_back(run);
  }
}

/// Nearest to point 7, the nearer the better; seed 1 is 2 worse.
double error_of(std::size_t run) {
  return 10 + std::fabs(static_cast<double>(run / 2 % kPoints) - 7) + 2 * static_cast<double>(run % 2);
}

}  // namespace

TEST_CASE("what matters is told by how much of the ranks it explains") {
  std::vector<double> even, scores;
  for (int i = 0; i < 40; ++i) {
    even.push_back(i);
    scores.push_back((i - 20) * (i - 20));  // neither more nor less is better: no correlation would tell
  }
  const auto parabola = importance_of(texts_of(even), scores);
  REQUIRE(parabola);
  CHECK(parabola->share > 0.8);
  CHECK(parabola->share < 1);
  CHECK(std::fabs(parabola->correlation) < 0.1);
  const auto line = importance_of(texts_of(even), even);
  CHECK(line->correlation == Approx(1));
  CHECK(line->share > 0.9);
  CHECK(line->chance > 0.05);
  CHECK(line->chance < 0.35);
  std::vector<double> huge = even;
  for (double& score : huge) score = std::exp(score * score / 4);  // ranks are the same
  CHECK(importance_of(texts_of(even), huge)->share == line->share);
}

TEST_CASE("by hand: two words over ten scores") {
  // Ranks 0 to 9; "a" has 0, 1, 2, 3, 5 (mean 2.2, squares 14.8), "b" 4, 6, 7, 8, 9 (6.8, 14.8); all 82.5.
  const std::vector<std::string> words = {"a", "a", "a", "a", "b", "a", "b", "b", "b", "b"};
  const std::vector<double> scores = {1, 2, 3, 4, 5, 6, 7, 8, 9, 10};
  const auto importance = importance_of(words, scores);
  REQUIRE(importance);
  CHECK(importance->share == Approx(1 - 9.0 / 8 * 29.6 / 82.5));
  CHECK(importance->correlation == 0);
}

TEST_CASE("what does not matter passes the mark of chance as seldom as it says") {
  RandomSequence random(11);
  int above = 0;
  double mean = 0;
  constexpr int kTrials = 400;
  for (int trial = 0; trial < kTrials; ++trial) {
    std::vector<double> numbers, scores;
    for (int i = 0; i < 24; ++i) {
      numbers.push_back(random.uniform());
      scores.push_back(random.uniform());
    }
    const auto importance = importance_of(texts_of(numbers), scores);
    REQUIRE(importance);
    above += importance->share > importance->chance ? 1 : 0;
    mean += importance->share / kTrials;
  }
  CHECK(above > 0.02 * kTrials);
  CHECK(above < 0.09 * kTrials);
  CHECK(std::fabs(mean) < 0.03);  // as much below 0 as above
}

TEST_CASE("nothing is told of few points, equal values or equal scores") {
  const std::vector<double> ten = {1, 2, 3, 4, 5, 6, 7, 8, 9, 10};
  CHECK(importance_of(texts_of(ten), ten));
  CHECK_FALSE(importance_of({"1", "2", "3"}, {1, 2, 3}));
  CHECK_FALSE(importance_of(std::vector<std::string>(10, "1"), ten));
  CHECK_FALSE(importance_of(texts_of(ten), std::vector<double>(10, 3)));
  CHECK_FALSE(
      importance_of({"\"a\"", "\"b\"", "\"c\"", "\"d\"", "\"e\"", "\"f\"", "\"g\"", "\"h\"", "\"i\"", "\"j\""}, ten));
}

TEST_CASE("points are sorted by the median over their runs, and by the rung that they have come to") {
  MadeSweep sweep([](SweepPlan& plan) { make_search(plan, 2); });
  CHECK(search_results(sweep.read()).empty());
  for (std::size_t i = 0; i < 2 * kPoints; ++i) sweep.finish(i, error_of(i));
  const SweepResults first = sweep.read();
  REQUIRE(search_results(first).size() == 1);
  CHECK(search_results(first)[0].points.size() == kPoints);
  CHECK(search_results(first)[0].points[0].scores == std::vector<std::optional<double>>{11, std::nullopt});
  CHECK(search_results(first)[0].points[0].values == std::vector<std::string>{"0.128", "\"off\""});
  for (const std::size_t point : {5, 6}) {  // not the best of the first rung, but the only ones of the second
    for (const std::size_t seed : {0, 1}) sweep.finish(2 * (kPoints + point) + seed, 8.0 - static_cast<double>(point));
  }
  const SweepResults second = sweep.read();
  const SearchResults found = search_results(second)[0];
  CHECK(found.rungs == 2);
  CHECK(found.points[0].values[0] == "0.064");
  CHECK(found.points[0].scores == std::vector<std::optional<double>>{12, 2});
  CHECK(found.points[1].values[0] == "0.032");
  CHECK(found.points[2].values[0] == "0.128");
  const Table table = best_points_table(found);
  CHECK(table.rows.size() == 10);
  CHECK(table.head[1].text == "a.lr");
  CHECK(table.head[3].text == "MPJPE, mm ↓, rung 2");
  CHECK(table.rows[0][3].text == "2.0");
  CHECK(table.rows[2][3].text == "");
  CHECK(table.rows[2][4].text == "11.0");
}

TEST_CASE("the page of a search has its points, its settings and what matters") {
  for (const std::size_t rungs : {1, 2}) {
    MadeSweep sweep([rungs](SweepPlan& plan) { make_search(plan, rungs); });
    for (std::size_t i = 0; i < 2 * kPoints; ++i) sweep.finish(i, error_of(i));
    if (rungs > 1) {
      for (std::size_t i = 2 * kPoints + 10; i < 2 * kPoints + 20; ++i) sweep.finish(i, error_of(i) - 3);
    }
    const SweepResults results = sweep.read();
    const SearchResults found = search_results(results)[0];
    const std::string parallel = parallel_plot(found);
    INFO(parallel);
    CHECK(tag_fault(parallel) == "");
    CHECK(parallel.find("nan") == std::string::npos);
    CHECK(count_of(parallel, "<polyline ") == kPoints);
    CHECK(count_of(parallel, "<line class=\"axis\"") == 2 + rungs);
    CHECK(count_of(parallel, "stroke-width:3.2") == 1);
    for (const char* text : {">a.lr<", ">color_net.use<", ">0.001<", ">0.0453<", ">2.05<", ">on<"})
      CHECK_THAT(parallel, Contains(text));
    const std::string bars = importance_plot(results, found, mpjpe());
    CHECK(tag_fault(bars) == "");
    CHECK(count_of(bars, "stroke:var(--result)") == 1);  // the rate alone
    CHECK(bars.find("a.lr: ") < bars.find("color_net.use: "));
    CHECK(count_of(setting_plot(found, 0), "<circle ") == kPoints);
    CHECK(setting_plot(found, 1).empty());
    const std::string page = sweep_page(results);
    CHECK(tag_fault(page) == "");
    for (const char* heading :
         {"Best of the search", "Points of the search", "MPJPE by setting", "What matters", "Means", "Runs"})
      CHECK_THAT(page, Contains(std::string("<h2>") + heading + "</h2>"));
    CHECK(page.find("<h2>By ") == std::string::npos);
    CHECK(page.find("<h2>Runs by metric") == std::string::npos);
    CHECK_THAT(sweep_markdown(results), Contains("## Best of the search\n"));
  }
}

TEST_CASE("plots of a search hold points that are equal, few, or without a number") {
  MadeSweep sweep([](SweepPlan& plan) { make_search(plan, 1); });
  for (std::size_t i = 0; i < 4; ++i) sweep.finish(i, 5);
  const SweepResults results = sweep.read();
  const SearchResults found = search_results(results)[0];
  CHECK(found.points.size() == 2);
  const std::string plot = parallel_plot(found);
  CHECK(tag_fault(plot) == "");
  CHECK(plot.find("nan") == std::string::npos);
  CHECK(importance_plot(results, found, mpjpe()).empty());
  CHECK(sweep_page(results).find("<h2>What matters") == std::string::npos);
}

}  // namespace search_results_test
