#include "pipelines/sweep/report.h"

#include <catch2/catch.hpp>

#include "pipelines/sweep/plots.h"
#include "pipelines/sweep/tables.h"
#include "tests/support/made_sweep.h"
#include "tests/support/markup.h"

namespace report_test {

using namespace hsi4d;
using namespace hsi4d::test;
using Catch::Matchers::Contains;

namespace {

const MetricFacts& mpjpe() { return *find_metric_facts("mpjpe_mm"); }

/// The page of a sweep, which must be well formed and show no number that is none.
std::string checked_page(const MadeSweep& sweep) {
  const std::string page = sweep_page(sweep.read());
  INFO(page);
  CHECK(tag_fault(page) == "");
  for (const char* number : {"nan", "inf", "not finite"}) {
    const std::string body = page.substr(page.find("<main>"));
    CHECK(count_of(body, std::string(">") + number) == 0);
    CHECK(count_of(body, std::string("=\"") + number) == 0);
  }
  return page;
}

/// A sweep of one ablation over the numbers of an axis, of one clip and seed.
void make_axis(SweepPlan& plan, const std::vector<std::string>& numbers) {
  plan.compare.clear();
  plan.runs.resize(numbers.size());
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    plan.runs[i].ablation.clear();
    plan.runs[i].clip = "a";
    plan.runs[i].seed = "0";
    plan.runs[i].values = {{"render.blur", numbers[i]}};
  }
}

}  // namespace

TEST_CASE("the page of a sweep has its tables, plots and runs") {
  MadeSweep sweep;
  sweep.finish_all();
  const std::string page = checked_page(sweep);
  CHECK_THAT(page, Contains("<span class=\"badge done\">done</span>") && Contains("<dd>12 runs: 12 done</dd>") &&
                       Contains("<dt>compared with</dt><dd>plain</dd>"));
  for (const char* heading : {"Means", "Differences to plain", "Runs by metric", "a", "b", "Runs"})
    CHECK(page.find(std::string("<h2>") + heading + "</h2>") != std::string::npos);
  CHECK(page.find("<h2>By ") == std::string::npos);  // there is no axis of numbers
  CHECK(count_of(page, "/report.html\">") == 12);
  // A dot a run and metric (error and time), and a dot a pair and metric.
  CHECK(count_of(page, "<circle ") == 2 * 12 + 2 * 6);
  CHECK_THAT(page, Contains("<td class=\"worse\">+3.0 [+"));
}

TEST_CASE("the page of a sweep with failed runs tells why, and counts the others alone") {
  MadeSweep sweep;
  for (const std::size_t i : {0, 1, 2, 6}) sweep.finish(i, 10.0 + static_cast<double>(i));
  SweepClaim(sweep.paths(), sweep.id(7), {}).note("failed", "a <b> & \"c\"", 1);
  const std::string page = checked_page(sweep);
  CHECK_THAT(page, Contains("<span class=\"badge failed\">with failures</span>") &&
                       Contains("<dd>12 runs: 4 done, 1 failed, 7 new</dd>"));
  CHECK_THAT(page, Contains("<p class=\"message\">a &lt;b&gt; &amp; &quot;c&quot;</p>"));
  CHECK(count_of(page, "/report.html\">") == 4);
  // Of clip b nothing is done, so no seed has a mean over both clips, and there is one pair.
  CHECK(page.find("<h2>Runs by metric</h2>") == std::string::npos);
  CHECK(count_of(page, "<circle ") == 2 * 1);
}

TEST_CASE("the page of a sweep of which nothing is done has its runs alone") {
  MadeSweep sweep;
  for (std::size_t i = 0; i < 12; ++i) SweepClaim(sweep.paths(), sweep.id(i), {}).note("failed", "no scene", 1);
  const std::string page = checked_page(sweep);
  CHECK(count_of(page, "<h2>") == 1);
  CHECK(count_of(page, "<svg") == 0);
  CHECK(count_of(page, "<p class=\"message\">no scene</p>") == 12);
  CHECK(count_of(page, "/report.html\">") == 0);
}

TEST_CASE("the page of one run has its numbers without a spread or a comparison") {
  MadeSweep sweep([](SweepPlan& plan) { plan.runs.resize(1); });
  sweep.finish(0, 12.5);
  const std::string page = checked_page(sweep);
  CHECK_THAT(page, Contains("<dd>1 run: 1 done</dd>") &&
                       Contains("<tr><th scope=\"row\">all runs</th><td>1</td><td>12.5</td>"));
  CHECK(page.find("<h2>Differences") == std::string::npos);
  CHECK(count_of(page, "<circle ") == 2);
  CHECK(count_of(page, "stroke-width:5;") == 0);  // no bar
}

TEST_CASE("a metric that a run has not is left out of means and plots, one that is no number spoils its run alone") {
  MadeSweep sweep;
  sweep.finish_all();
  sweep.finish_with(6, "null");
  sweep.finish_with(7, "NaN");
  const SweepResults results = sweep.read();
  CHECK(progress_text(results) == "12 runs: 11 done, 1 started");
  CHECK(group_statistics(results, results.groups[1], mpjpe()).sample.count == 1);  // seed 2 alone has both clips
  CHECK(group_statistics(results, results.groups[1], seconds_facts()).sample.count == 2);
  CHECK(paired_difference(results, results.groups[1], mpjpe())->differences == std::vector<double>{6, 3, 3, 3});
  CHECK(count_of(mean_plot(results, mpjpe()), "<circle ") == 10);
  CHECK(count_of(difference_plot(results, mpjpe()), "<circle ") == 4);
  CHECK_THAT(checked_page(sweep), Contains("<dd>12 runs: 11 done, 1 started</dd>"));
}

TEST_CASE("an axis of numbers has a plot where two of its runs are done") {
  MadeSweep sweep([](SweepPlan& plan) { make_axis(plan, {"0.3", "0.1", "0.2"}); });
  CHECK(number_axes(sweep.plan()) == std::vector<std::string>{"render.blur"});
  sweep.finish(0, 10);
  CHECK(axis_plot(sweep.read(), "render.blur", mpjpe()).empty());
  CHECK(checked_page(sweep).find("<h2>By render.blur</h2>") == std::string::npos);
  sweep.finish(1, 20);
  const std::string plot = axis_plot(sweep.read(), "render.blur", mpjpe());
  CHECK(tag_fault(plot) == "");
  CHECK_THAT(plot, Contains("render.blur"));
  CHECK_THAT(checked_page(sweep), Contains("<h2>By render.blur</h2>"));
  CHECK(plot.find("class=\"entry\"") == std::string::npos);  // one line needs no name
  MadeSweep crossed([](SweepPlan& plan) {
    make_axis(plan, {"0.1", "0.2", "0.1", "0.2"});
    for (std::size_t i = 0; i < 4; ++i) plan.runs[i].values.emplace_back("render.near", i < 2 ? "0.01" : "0.02");
  });
  for (const std::size_t i : {0, 1, 2, 3}) crossed.finish(i, 10 + static_cast<double>(i));
  const std::string lines = axis_plot(crossed.read(), "render.blur", mpjpe());
  CHECK(count_of(lines, "<polyline ") == 2);
  CHECK_THAT(lines, Contains(">near 0.01</text>") && Contains(">near 0.02</text>"));
  MadeSweep words([](SweepPlan& plan) { make_axis(plan, {"\"a\"", "\"b\""}); });
  CHECK(number_axes(words.plan()).empty());
}

TEST_CASE("plots of ranges hold values that are equal, zero, far apart or huge") {
  for (const std::vector<double>& points : std::vector<std::vector<double>>{
           {0, 0}, {5, 5}, {-3, -3}, {1e-300, 2e-300}, {1e300, -1e300}, {1e-9, 1e9}, {7}}) {
    for (const bool has_zero : {false, true}) {
      const std::string svg =
          range_plot_svg("t", "mm", {{"a long label <of> several words & more", points, points[0], {}}}, has_zero, 1);
      INFO(svg);
      CHECK(tag_fault(svg) == "");
      CHECK(count_of(svg, "<circle ") == points.size());
      CHECK(svg.find("nan") == std::string::npos);
      CHECK(svg.find("inf") == std::string::npos);
      CHECK(count_of(svg, "class=\"grid\"") >= 1);
      CHECK(count_of(svg, "class=\"grid\"") <= 6);
      CHECK(count_of(svg, "class=\"axis\"") == (has_zero ? 1 : 0));
      CHECK_THAT(svg, Contains("a long label &lt;of&gt; several words &amp; more"));
    }
  }
  CHECK(range_plot_svg("t", "mm", {}, false, 1) == "<p class=\"nothing\">There is nothing to plot.</p>");
}

}  // namespace report_test
