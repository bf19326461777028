#include "pipelines/sweep/search.h"

#include <cmath>
#include <map>
#include <set>

#include <catch2/catch.hpp>

#include "core/check.h"
#include "core/text.h"
#include "pipelines/sweep/plan.h"
#include "tests/support/tiny_sweep.h"

namespace search_test {

using namespace hsi4d;
using namespace hsi4d::test;
using Json = nlohmann::ordered_json;
using Catch::Matchers::StartsWith;

namespace {

SweepRange range_of(double from, double to, bool is_log = false, bool is_integer = false) {
  return {"a", {}, {}, from, to, is_log, is_integer};
}

double number_at(const SweepRange& range, double share) { return std::stod(value_at(range, share).text); }

std::vector<std::vector<SweepSetting>> points_of(const SweepSearch& search, std::int64_t count) {
  return search_points(search, count).value().points;
}

/// The search of tests: a rate and two words.
Json search_json() {
  return {{"metric", "mpjpe_mm"},
          {"runs", 8},
          {"over",
           {{"stages.camera.optimize.camera.lr", {{"from", 1e-4}, {"to", 1e-1}, {"scale", "log"}}},
            {"color_net.use", {"on", "off"}}}}};
}

SweepPlan plan_of(const Json& search, Json more = Json::object()) {
  more["search"] = search;
  return plan_sweep(write_sweep(more), descriptions_of(loss_terms()));
}

std::string refused(const Json& search, const Json& more = Json::object()) {
  try {
    plan_of(search, more);
  } catch (const UserError& error) {
    return error.what();
  }
  return "";
}

/// The search of tests with something else in it.
Json changed(const std::string& pointer, const Json& value) {
  Json search = search_json();
  search[Json::json_pointer(pointer)] = value;
  return search;
}

std::vector<std::string> ids_in(const SweepPlan& plan) {
  std::vector<std::string> ids;
  for (const SweepRun& run : plan.runs) ids.push_back(run.id);
  return ids;
}

}  // namespace

TEST_CASE("values of a range are short, within it and spread by its scale") {
  CHECK(value_at(range_of(0, 1), 0.123456789).text == "0.123");
  CHECK(value_at(range_of(-500, 500), 0.123456789).text == "-377");
  CHECK(value_at(range_of(0, 5e6), 0.123456789).text == "617000");
  CHECK(value_at(range_of(1e-4, 1, true), 0.25).text == "0.001");
  CHECK(value_at(range_of(1e-4, 1, true), 0.3).text == "0.001585");
  CHECK(value_at(range_of(1000, 1001), 0.5004).text == "1000.5");
  CHECK(value_at(range_of(1000, 1001, true), 0.5004).text == "1000.5");
  for (const SweepRange& range : {range_of(0.123456, 0.987654), range_of(0.0123456, 9.87654, true), range_of(-3, -1),
                                  range_of(1e-15, 1e15, true)}) {
    double before = range.from;
    for (double share = 1e-9; share < 1; share += 0.001) {
      const double value = number_at(range, share);
      CHECK(value >= before);
      CHECK(value <= range.to);
      before = value;
      const double exact = range.is_log ? range.from * std::pow(range.to / range.from, share)
                                        : range.from + share * (range.to - range.from);
      CHECK(std::fabs(value - exact) <= (range.is_log ? exact : range.to - range.from) / 1000);
    }
    CHECK(number_at(range, 1e-12) == Approx(range.from).epsilon(1e-3));
    CHECK(number_at(range, 1 - 1e-12) == Approx(range.to).epsilon(1e-3));
  }
}

TEST_CASE("whole numbers and choices have equal parts of a range, on a logarithmic scale equal ratios") {
  std::map<double, int> linear, logarithmic;
  std::map<std::string, int> words;
  const SweepRange choice{
      "a", {}, {ConfigValue::make_string("x"), ConfigValue::make_null(), ConfigValue::make_integer(2)}};
  for (int i = 0; i < 3000; ++i) {
    const double share = (i + 0.5) / 3000;
    ++linear[number_at(range_of(-1, 1, false, true), share)];
    ++logarithmic[number_at(range_of(1, 7, true, true), share)];
    ++words[sweep_value_text(value_at(choice, share))];
  }
  CHECK(linear == std::map<double, int>{{-1, 1000}, {0, 1000}, {1, 1000}});
  CHECK(words == std::map<std::string, int>{{"\"x\"", 1000}, {"null", 1000}, {"2", 1000}});
  CHECK(logarithmic.size() == 7);
  CHECK(logarithmic[1] == 1000);                                 // 1 to 2 of 1 to 8
  CHECK(std::abs(logarithmic[2] + logarithmic[3] - 1000) <= 1);  // 2 to 4
}

TEST_CASE("a longer search begins with the points of a shorter one, and a seed has its own") {
  SweepSearch search;
  search.over = {range_of(0, 1), range_of(1, 100, true, true)};
  search.over[1].key = "b";
  for (const SweepSampling method : {SweepSampling::kSobol, SweepSampling::kRandom}) {
    search.method = method;
    search.seed = 0;
    const auto texts = [&search](std::int64_t count) {
      std::vector<std::string> all;
      for (const auto& point : points_of(search, count))
        all.push_back(sweep_value_text(point[0].value) + " " + sweep_value_text(point[1].value));
      return all;
    };
    const std::vector<std::string> few = texts(10), many = texts(64);
    CHECK(std::vector<std::string>(many.begin(), many.begin() + 10) == few);
    CHECK(std::set<std::string>(many.begin(), many.end()).size() == 64);
    search.seed = 1;
    CHECK(texts(10) != few);
  }
}

TEST_CASE("Sobol's points of a search are even in both of its settings, random ones are not") {
  SweepSearch search;
  search.over = {range_of(0, 1), range_of(0, 1)};
  search.over[1].key = "b";
  const auto boxes = [&search] {
    std::set<std::pair<int, int>> hit;  // of 8 by 8; what is rounded onto a border is in one of both beside it
    for (const auto& point : points_of(search, 64))
      hit.insert({static_cast<int>(8 * std::stod(point[0].value.text) - 1e-9),
                  static_cast<int>(8 * std::stod(point[1].value.text) - 1e-9)});
    return hit.size();
  };
  for (search.seed = 0; search.seed < 5; ++search.seed) CHECK(boxes() >= 56);
  search.method = SweepSampling::kRandom;
  for (search.seed = 0; search.seed < 5; ++search.seed) CHECK(boxes() < 50);
}

TEST_CASE("a small space is found whole, and no more than that") {
  SweepSearch search;
  search.over = {range_of(1, 3, false, true),
                 {"b", {}, {ConfigValue::make_boolean(true), ConfigValue::make_boolean(false)}}};
  CHECK(points_of_space(search.over) == 6);
  for (search.method = SweepSampling::kSobol;; search.method = SweepSampling::kRandom) {
    CHECK(points_of(search, 6).size() == 6);
    CHECK_FALSE(search_points(search, 7));
    if (search.method == SweepSampling::kRandom) break;
  }
  search.over.push_back(range_of(0, 1));
  CHECK_FALSE(points_of_space(search.over));
}

TEST_CASE("a budget of runs is that of all rungs together") {
  CHECK(rung_sizes(16, 1, 2) == std::vector<std::int64_t>{16});
  CHECK(rung_sizes(17, 4, 2) == std::vector<std::int64_t>{17, 8, 4, 2});
  CHECK(rung_sizes(5, 3, 3) == std::vector<std::int64_t>{5, 1, 1});
  SweepSearch search;
  search.runs = 60;
  CHECK(points_within(search, 4) == 15);
  CHECK(points_within(search, 61) == 0);
  search.rungs.points.resize(3);
  CHECK(points_within(search, 1) == 35);  // 35 + 17 + 8
  CHECK(points_within(search, 4) == 9);   // 9 + 4 + 2
  search.factor = 3;
  CHECK(points_within(search, 4) == 11);  // 11 + 3 + 1
}

TEST_CASE("a search is planned with the other axes, its points first") {
  const TemporaryFolder here;
  write_tiny_base();
  const SweepPlan plan = plan_of(search_json(), {{"seeds", 2}});
  REQUIRE(plan.runs.size() == 8);
  CHECK(plan.compare.empty());
  REQUIRE(plan.searches.size() == 1);
  CHECK(plan.searches[0].metric == "mpjpe_mm");
  CHECK(plan.searches[0].over[0].is_log);
  CHECK_FALSE(plan.searches[0].over[1].is_log);
  for (std::size_t i = 0; i < plan.runs.size(); ++i) {
    const SweepRun& run = plan.runs[i];
    CHECK(run.seed == std::to_string(i % 2));
    CHECK(run.values == plan.runs[i / 2 * 2].values);
    const double rate = std::stod(run.values[0].second);
    CHECK(rate >= 1e-4);
    CHECK(rate <= 1e-1);
    CHECK(Json::parse(run.config)["stages"]["camera"]["optimize"]["camera"]["lr"] == rate);
    CHECK("\"" + Json::parse(run.config)["color_net"]["use"].get<std::string>() + "\"" == run.values[1].second);
  }
  CHECK(ids_in(plan_of(search_json(), {{"seeds", 2}})) == ids_in(plan));
  std::vector<std::string> longer = ids_in(plan_of(changed("/runs", 13), {{"seeds", 2}}));
  REQUIRE(longer.size() == 12);
  longer.resize(8);
  CHECK(longer == ids_in(plan));
  CHECK(ids_in(plan_of(changed("/seed", 1), {{"seeds", 2}})) != ids_in(plan));
  CHECK(ids_in(plan_of(changed("/method", "random"), {{"seeds", 2}})) != ids_in(plan));
  const std::string text = sweep_plan_json(plan);
  CHECK(sweep_plan_json(parse_sweep_plan(text, "sweep.json")) == text);
}

TEST_CASE("a search by halving has a run of every point in every rung") {
  const TemporaryFolder here;
  write_tiny_base();
  const Json halving = {
      {"rungs", {{"stages.camera.iterations", {2, 4, 8}}, {"stages.interaction.iterations", {3, 6, 12}}}}};
  const SweepPlan plan = plan_of(changed("/halving", halving), {{"hours", 1.5}, {"memory_retries", 2}});
  REQUIRE(plan.runs.size() == 15);  // of 5 points, of which 5 + 2 + 1 are computed
  CHECK(plan.hours == 1.5);
  for (std::size_t i = 0; i < plan.runs.size(); ++i) {
    CHECK(plan.runs[i].rung == i / 5);
    CHECK(plan.runs[i].values[0] ==
          std::pair<std::string, std::string>("stages.camera.iterations", std::to_string(2 << i / 5)));
    CHECK(plan.runs[i].values[2] == plan.runs[i % 5].values[2]);
  }
  const std::string text = sweep_plan_json(plan);
  const SweepPlan again = parse_sweep_plan(text, "sweep.json");
  CHECK(sweep_plan_json(again) == text);
  CHECK(again.memory_retries == 2);
  CHECK(again.runs[14].rung == 2);
  CHECK(again.searches[0].rung_keys ==
        std::vector<std::string>{"stages.camera.iterations", "stages.interaction.iterations"});
}

TEST_CASE("blocks have searches of their own, and names for them") {
  const TemporaryFolder here;
  write_tiny_base();
  const Json blocks = {{{"name", "one"}},
                       {{"name", "none"}, {"search", Json::object()}},
                       {{"name", "two"}, {"search", changed("/runs", 2)}}};
  const SweepPlan plan = plan_of(search_json(), {{"blocks", blocks}});
  REQUIRE(plan.runs.size() == 8 + 1 + 2);
  REQUIRE(plan.searches.size() == 2);
  CHECK(search_of(plan, plan.runs[0]) == &plan.searches[0]);
  CHECK(search_of(plan, plan.runs[8]) == nullptr);
  CHECK(search_of(plan, plan.runs[9]) == &plan.searches[1]);
  CHECK(refused(search_json(), {{"blocks", {{{"seeds", 1}}, {{"name", "b"}}}}}) ==
        "sweep.json:5: /blocks/0: has a search beside other blocks; give it a \"name\"");
}

TEST_CASE("mistakes of a search are told with their place") {
  const TemporaryFolder here;
  write_tiny_base();
  CHECK(refused(Json::object()) == "sweep.json:4: /search: is empty; name something, or leave it out");
  CHECK(refused(7) == "sweep.json:4: /search: 7 is a number, not an object, {\"over\": {KEY: range}, ...}");
  CHECK(refused(changed("/ober", 1)) == "sweep.json:18: /search/ober: unknown key; did you mean \"over\"?");
  CHECK(refused(changed("/metric", "mpjpe")) ==
        "sweep.json:5: /search/metric: \"mpjpe\" is no metric; did you mean \"mpjpe_mm\"?");
  CHECK_THAT(
      refused(changed("/metric", "contact_share")),
      StartsWith("sweep.json:5: /search/metric: \"contact_share\" is neither better large nor small; allowed: "));
  CHECK(refused({{"metric", "mpjpe_mm"}, {"runs", 4}}) ==
        "sweep.json:4: /search: names nothing to search \"over\": {KEY: range}");
  CHECK(refused({{"runs", 4}, {"over", {{"render.blur", {1, 2, 3, 4, 5}}}}}) ==
        "sweep.json:4: /search: the key \"metric\" is missing; allowed: text");
  CHECK(refused({{"metric", "mpjpe_mm"}, {"over", {{"render.blur", {1, 2, 3, 4, 5}}}}}) ==
        "sweep.json:4: /search: the key \"runs\" is missing; allowed: 1 to 100000");
  CHECK(refused(changed("/method", "grid")) ==
        "sweep.json:18: /search/method: \"grid\" is not one of the choices; allowed: \"sobol\", \"random\"");
  CHECK(refused(changed("/seed", -1)) == "sweep.json:18: /search/seed: -1 is out of range; allowed: 0 or more");
  CHECK(refused(changed("/runs", 0)) == "sweep.json:6: /search/runs: 0 is out of range; allowed: 1 to 100000");
  CHECK(refused(changed("/over/seed", {0, 1})) ==
        "sweep.json:17: /search/over/seed: seeds are an axis of their own: write \"seeds\": [0, 1] beside the grid");
  CHECK(refused(changed("/over/color_net.use", {"on"})) ==
        "sweep.json:13: /search/over/color_net.use: a choice is of two values or more");
  CHECK(refused(changed("/over/color_net.use", {"on", "on"})) ==
        "sweep.json:15: /search/over/color_net.use: \"on\" is in the list twice");
  CHECK(refused(changed("/over/color_net.use", 5)) ==
        "sweep.json:13: /search/over/color_net.use: 5 is a number, not a list of choices, or a range, {\"from\": "
        "0.001, \"to\": 0.1}");
  CHECK(refused(changed("/over/render.blur", {{"from", 1}})) ==
        "sweep.json:17: /search/over/render.blur: the key \"to\" is missing; allowed: -1e+15 to 1e+15");
  CHECK(refused(changed("/over/render.blur", {{"from", 1}, {"to", 1}})) ==
        "sweep.json:19: /search/over/render.blur/to: 1 is not above \"from\", 1");
  CHECK(refused(changed("/over/render.blur", {{"from", 0}, {"to", 1}, {"scale", "log"}})) ==
        "sweep.json:18: /search/over/render.blur/from: 0 has no place on a logarithmic scale; allowed: 1e-15 or more");
  CHECK(refused(changed("/over/render.blur", {{"from", 0}, {"to", 1}, {"scale", "sqrt"}})) ==
        "sweep.json:20: /search/over/render.blur/scale: \"sqrt\" is not one of the choices; allowed: \"linear\", "
        "\"log\"");
  CHECK(refused(changed("/over/render.blur", {{"from", 0.5}, {"to", 1.5}, {"integer", true}})) ==
        "sweep.json:20: /search/over/render.blur/integer: \"from\" and \"to\" of whole numbers are whole numbers");
  CHECK(refused(changed("/over/render.blur", {{"from", 0}, {"to", 2}, {"scale", "log"}, {"integer", true}})) ==
        "sweep.json:18: /search/over/render.blur/from: 0 has no place on a logarithmic scale; allowed: 1 or more");
  CHECK(refused(changed("/over", Json::object())) ==
        "sweep.json:7: /search/over: is empty; name something, or leave it out");
  CHECK(refused(changed("/halving", Json::object())) ==
        "sweep.json:18: /search/halving: names no \"rungs\": {KEY: [values]}, the cheapest first");
  CHECK(refused(changed("/halving", {{"rungs", {{"stages.camera.iterations", {1}}}}})) ==
        "sweep.json:19: /search/halving/rungs: there is one rung; give each key two values or more");
  CHECK(refused(changed("/halving", {{"rungs", {{"stages.camera.iterations", {1, 2}}, {"last_frame", {1}}}}})) ==
        "sweep.json:19: /search/halving/rungs: lists that are zipped have one length, and these have 2 "
        "(stages.camera.iterations), 1 (last_frame)");
  CHECK(refused(changed("/halving", {{"rungs", {{"stages.camera.iterations", {1, 2, 4, 8}}}}})) ==
        "sweep.json:4: /search: 8 runs (\"runs\") are 4 points of 1 run; allowed: 8 points or more, of which halving "
        "leaves one in the last rung");
  CHECK(refused(changed("/halving", {{"rungs", {{"stages.camera.iterations", {1, 2}}}}, {"factor", 1}})) ==
        "sweep.json:25: /search/halving/factor: 1 is out of range; allowed: 2 to 1000");
  CHECK(
      refused(search_json(), {{"seeds", 9}}) ==
      "sweep.json:5: /search: 8 runs (\"runs\") are too few: each point is 9 runs, of clips, seeds and the other axes");
  CHECK(refused({{"metric", "mpjpe_mm"}, {"runs", 6}, {"over", {{"render.blur", {1, 2, 3}}}}}) ==
        "sweep.json:4: /search: there are 3 different points, and 6 runs (\"runs\") are 6; a grid has them all");
  CHECK(refused(search_json(), {{"grid", {{"color_net.use", {"on", "off"}}}}}) ==
        "sweep.json:19: color_net.use is set by grid and by search; one of them would not count");
  CHECK(refused(search_json(), {{"memory_retries", 11}}) ==
        "sweep.json:4: /memory_retries: 11 is out of range; allowed: 0 to 10");
  CHECK(refused(search_json(), {{"memory_retries", 0.5}}) ==
        "sweep.json:4: /memory_retries: 0.5 is not a whole number; allowed: 0 to 10");
  CHECK(refused(search_json(), {{"hours", -1}}) == "sweep.json:4: /hours: -1 is out of range; allowed: at least 0");
  Json many = search_json();
  for (int i = 0; i < 20; ++i) many["over"]["stages.x" + std::to_string(i) + ".lr"] = {1, 2};
  CHECK(refused(many) ==
        "sweep.json:7: /search/over: 22 settings are more than the 20 that Sobol's points are known for; \"method\": "
        "\"random\" takes any number");
}

}  // namespace search_test
