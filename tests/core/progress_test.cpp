#include "core/progress.h"

#include <cmath>
#include <limits>
#include <vector>

#include <catch2/catch.hpp>

namespace progress_test {

using namespace hsi4d;

namespace {

double now = 0;
double fake_clock() { return now; }

struct Shown {
  std::int64_t done;
  double rate, left;
  bool is_finished;
  std::string line;
};

ProgressSink keep_in(std::vector<Shown>& shown) {
  return [&shown](const ProgressState& state) {
    shown.push_back({state.done, state.steps_per_second, state.seconds_left, state.is_finished, progress_line(state)});
  };
}

}  // namespace

TEST_CASE("progress reports first, then at the interval, then the end") {
  now = 100;
  std::vector<Shown> shown;
  {
    Progress progress("camera", 100, keep_in(shown), 1.0, fake_clock);
    for (int i = 0; i < 50; ++i) {
      now += 0.1;
      progress.step_with("loss", 1.0 / (i + 1));
    }
  }
  REQUIRE(shown.size() == 6);
  CHECK(shown.front().done == 1);
  CHECK(shown[1].done > 9);
  CHECK(shown[1].rate == Approx(10).epsilon(1e-9));
  CHECK(shown[1].left == Approx(static_cast<double>(100 - shown[1].done) / 10).epsilon(1e-9));
  CHECK_FALSE(shown[4].is_finished);
  CHECK(shown.back().is_finished);
  CHECK(shown.back().done == 50);
  CHECK(shown.back().line == "camera 50/100, 50%, 10 steps/s, loss 0.02, took 5 s");
}

TEST_CASE("steps of an earlier process count as done, and not as speed") {
  now = 0;
  std::vector<Shown> shown;
  {
    Progress progress("x", 1000, keep_in(shown), 1.0, fake_clock);
    now += 0.001;
    progress.skip(900);
    CHECK(shown.empty());
    for (int i = 0; i < 50; ++i) now += 0.1, progress.step();
  }
  REQUIRE(shown.size() > 2);
  CHECK(shown.front().done == 901);
  CHECK(shown.front().rate < 11);
  CHECK(shown[1].rate == Approx(10).epsilon(0.02));
  CHECK(shown[1].left == Approx((1000 - static_cast<double>(shown[1].done)) / 10).epsilon(0.02));
  CHECK(shown.back().done == 950);
  CHECK(shown.back().rate == Approx(10).epsilon(0.01));
}

TEST_CASE("steps that are dropped are not waited for") {
  now = 0;
  std::vector<std::string> lines;
  {
    Progress progress(
        "run", 1000, [&](const ProgressState& state) { lines.push_back(progress_line(state)); }, 1, fake_clock);
    progress.step(900);
    progress.drop(60);
    now = 9;
    progress.step(40);
  }
  CHECK(lines.back() == "run 940/940, 100%, 104 steps/s, took 9 s");
}

TEST_CASE("the rate follows a change of speed") {
  now = 0;
  std::vector<Shown> shown;
  Progress progress("x", 0, keep_in(shown), 1.0, fake_clock);
  for (int i = 0; i < 100; ++i) now += 0.1, progress.step();
  for (int i = 0; i < 60; ++i) now += 1, progress.step();
  CHECK(shown.back().rate == Approx(1).margin(0.01));
  CHECK(shown.back().left < 0);
}

TEST_CASE("finishing twice reports once, and nobody listening costs nothing") {
  std::vector<Shown> shown;
  now = 0;
  Progress progress("x", 3, keep_in(shown), 1.0, fake_clock);
  progress.finish();
  progress.finish();
  progress.step();
  CHECK(shown.size() == 1);
  Progress silent("y", 3, {});
  CHECK_NOTHROW(silent.step(3));
}

TEST_CASE("a sink that throws in the destructor does not end the program") {
  const auto use = [] { const Progress progress("x", 1, [](const ProgressState&) { throw 1; }); };
  CHECK_NOTHROW(use());
}

TEST_CASE("durations read well") {
  CHECK(duration_text(0.2) == "0 s");
  CHECK(duration_text(59.4) == "59 s");
  CHECK(duration_text(59.6) == "1:00");
  CHECK(duration_text(187) == "3:07");
  CHECK(duration_text(3765) == "1:02:45");
  CHECK(duration_text(360000) == "100:00:00");
  CHECK(duration_text(-1) == "?");
  CHECK(duration_text(std::nan("")) == "?");
  CHECK(duration_text(std::numeric_limits<double>::infinity()) == "?");
}

TEST_CASE("parts of a value stand behind it, as many as fit") {
  const std::vector<ProgressPart> parts = {{"photometric", 0.020123}, {"center", 0.0012}, {"mask", 3}};
  ProgressState state;
  state.task = "x";
  state.done = 1;
  state.total = 4;
  state.value_name = "loss";
  state.value = 0.0216;
  state.parts = parts;
  state.seconds_left = 3;
  CHECK(progress_line(state) == "x 1/4, 25%, loss 0.0216 (photometric 0.0201, center 0.0012, mask 3), 3 s left");
  const std::string two = "x 1/4, 25%, loss 0.0216 (photometric 0.0201, center 0.0012, …), 3 s left";
  CHECK(progress_bar(state, 73) == two);
  CHECK(progress_bar(state, 65) == "x 1/4, 25%, loss 0.0216 (photometric 0.0201, …), 3 s left");
  CHECK(progress_bar(state, 40) == "x 1/4, 25%, loss 0.0216, 3 s left");
  CHECK(progress_bar(state, 10) == "x 1/4, 25%");
}

TEST_CASE("parts are those of the step that is reported, and the end has none") {
  now = 0;
  std::vector<Shown> shown;
  Progress progress("x", 3, keep_in(shown), 1.0, fake_clock);
  for (int i = 1; i <= 2; ++i) {
    now += 2;
    progress.step_with("loss", i, std::vector<ProgressPart>{{"a", i - 0.5}});
  }
  progress.finish();
  REQUIRE(shown.size() == 3);
  CHECK_THAT(shown[0].line, Catch::Matchers::Contains("loss 1 (a 0.5)"));
  CHECK_THAT(shown[1].line, Catch::Matchers::Contains("loss 2 (a 1.5)"));
  CHECK_THAT(shown[2].line, Catch::Matchers::Contains("loss 2, took"));
}

TEST_CASE("lines and bars hold what fits") {
  ProgressState state;
  state.task = "interaction";
  state.done = 120;
  state.total = 300;
  state.steps_per_second = 52.08;
  state.seconds_left = 3.4;
  state.value_name = "loss";
  state.value = 0.0123456;
  const std::string line = "interaction 120/300, 40%, 52.1 steps/s, loss 0.01235, 3 s left";
  CHECK(progress_line(state) == line);
  CHECK(progress_bar(state, 200) == "[" + std::string(16, '#') + std::string(24, '.') + "] " + line);
  const int columns = static_cast<int>(line.size());
  CHECK(progress_bar(state, columns + 13) == "[####......] " + line);
  CHECK(progress_bar(state, columns + 12) == line);
  CHECK(progress_bar(state, 11) == "interaction");
  CHECK(progress_bar(state, 0).empty());
  CHECK(progress_bar(state, -5).empty());
  state.value = std::nan("");
  state.done = 400;
  CHECK(progress_line(state) == "interaction 400/300, 100%, 52.1 steps/s, loss nan, 3 s left");
  state.task = "\xC3\xA4\xC3\xB6";
  CHECK(progress_bar(state, 1) == "\xC3\xA4");
}

}  // namespace progress_test
