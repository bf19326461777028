#include "core/frame_times.h"

#include <cmath>

#include <catch2/catch.hpp>

namespace frame_times_test {

using namespace hsi4d;

namespace {

/// Times of frames at multiples of 1/rate.
FrameTimes at_multiples(const std::vector<int>& multiples, double rate) {
  FrameTimes times{{}, 1e-5};
  for (const int m : multiples) times.seconds.push_back(m / rate);
  return times;
}

/// As a file with a clock of milliseconds has them.
FrameTimes rounded_to_ms(int frames, double rate) {
  FrameTimes times{{}, 1e-3};
  for (int i = 0; i < frames; ++i) times.seconds.push_back(std::round(1000 * i / rate) / 1000);
  return times;
}

const std::vector<int> kPauses = {0,  1,  2,  3,  10, 11, 12, 13, 20, 21, 22, 23,
                                  24, 25, 26, 27, 28, 29, 30, 31, 40, 41, 42, 43};

}  // namespace

TEST_CASE("times that a file rounds count as even, times with one frame left out do not") {
  CHECK(are_even({}));
  CHECK(are_even(at_multiples({0, 5}, 30)));
  for (const double rate : {10.0, 23.976, 29.97, 30.0, 60.0, 120.0, 240.0}) CHECK(are_even(rounded_to_ms(500, rate)));
  for (int count = 3; count < 60; ++count) {  // as many multiples as there are but one
    for (int left_out = 1; left_out < count; ++left_out) {
      std::vector<int> multiples;
      for (int m = 0; m <= count; ++m) {
        if (m != left_out) multiples.push_back(m);
      }
      FrameTimes times = at_multiples(multiples, 30);
      INFO(count << " frames, without " << left_out);
      CHECK_FALSE(are_even(times));
    }
  }
  CHECK_FALSE(are_even(at_multiples(kPauses, 30)));
  FrameTimes jitter = at_multiples({0, 1, 2, 3, 4, 5, 6, 7}, 30);
  for (std::size_t i = 1; i < 7; i += 2) jitter.seconds[i] += 0.004;
  CHECK(are_even(jitter));
}

TEST_CASE("the usual and the widest step") {
  const FrameTimes times = at_multiples(kPauses, 30);
  CHECK(usual_step(times) == Approx(1.0 / 30));
  CHECK(widest_step(times).before == 19);
  CHECK(widest_step(times).seconds == Approx(9.0 / 30));
  CHECK(usual_step(at_multiples({0}, 30)) == 0);
}

TEST_CASE("the frame that is nearest to a moment") {
  const FrameTimes times = at_multiples({0, 1, 2, 10}, 10);
  const auto at = [&times](double seconds) { return nearest_frame(times, seconds); };
  CHECK(at(-1) == 0);
  CHECK(at(0.04) == 0);
  CHECK(at(0.05) == 1);  // equally near: the later
  CHECK(at(0.1) == 1);
  CHECK(at(0.59) == 2);
  CHECK(at(0.61) == 3);
  CHECK(at(99) == 3);
}

TEST_CASE("frames are the nearest in time") {
  CHECK(nearest_frames(at_multiples(kPauses, 30), 10) ==
        std::vector<Index>{0, 3, 3, 4, 6, 7, 8, 9, 12, 15, 18, 19, 20, 20, 22});
  CHECK(nearest_frames(at_multiples({0, 1, 2, 3, 4, 5, 6}, 30), 10) == std::vector<Index>{0, 3, 6});
  CHECK(nearest_frames(at_multiples({0, 1, 2, 3}, 20), 40).size() == 7);
  CHECK(nearest_frames(at_multiples({0, 2}, 2), 2) == std::vector<Index>{0, 1, 1});  // equally near: the later
  CHECK(nearest_frames({}, 10).empty());
}

}  // namespace frame_times_test
