// Shapes that move over a patterned ground, with their true masks.
#include "pipelines/follow/object_follower.h"

#include <cmath>
#include <functional>

#include <catch2/catch.hpp>

#include "core/check.h"
#include "core/parallel.h"
#include "optim/metrics.h"
#include "pipelines/follow/first_mask.h"
#include "pipelines/follow/follow.h"
#include "pipelines/follow/vision_library.h"
#include "tests/support/moving_shapes.h"

namespace object_follower_test {

using namespace hsi4d;
using namespace hsi4d::test;
using Catch::Matchers::Contains;

namespace {

double iou(const Image& mask, const Image& truth) { return mask_iou(mask, truth).value_or(1); }

struct Outcome {
  double mean = 0, least = 1;
  std::vector<FollowedMask> masks;  ///< of frames 1 to the last
};

Outcome follow(const MovingShapes& clip, Image first, bool human_is_known) {
  const auto human = [&](int t) { return human_is_known ? clip.bar_mask(t) : Image(); };
  ObjectFollower follower(clip.frame(0), {std::move(first)}, human(0), kFollowSide);
  Outcome outcome;
  for (int t = 1; t < clip.frames; ++t) {
    outcome.masks.push_back(follower.next(clip.frame(t), human(t)).front());
    const double overlap = iou(outcome.masks.back().mask, clip.object_mask(t));
    outcome.mean += overlap / (clip.frames - 1);
    outcome.least = std::min(outcome.least, overlap);
  }
  return outcome;
}

}  // namespace

TEST_CASE("an object that moves, turns and grows is followed") {
  const MovingShapes clip{.turn_deg = 4, .growth = 1.015};
  const Outcome outcome = follow(clip, clip.object_mask(0), false);
  CHECK(outcome.mean > 0.95);
  CHECK(outcome.least > 0.9);
  for (const FollowedMask& mask : outcome.masks) {
    CHECK(mask.state == Followed::kSeen);
    CHECK(mask.score > 0.7);
  }
}

TEST_CASE("what hides an object takes its part of the mask, and gives it back") {
  const MovingShapes clip{.bar_width = 14};
  for (const bool human_is_known : {true, false}) {
    INFO(human_is_known);
    const Outcome outcome = follow(clip, clip.object_mask(0), human_is_known);
    CHECK(outcome.mean > 0.9);
    CHECK(outcome.least > 0.8);
  }
}

TEST_CASE("an object that was hidden is told to be, and is found again") {
  const MovingShapes clip{.frames = 24, .bar_width = 60};
  const Outcome outcome = follow(clip, clip.object_mask(0), true);
  int hidden = 0;
  for (int t = 1; t < clip.frames; ++t) {
    const FollowedMask& found = outcome.masks[static_cast<std::size_t>(t - 1)];
    const double seen = mask_area(clip.object_mask(t)) / mask_area(clip.object_mask(0));
    INFO(t << ": " << seen << " of it is seen, score " << found.score);
    if (seen == 0) {
      ++hidden;
      CHECK(found.state == Followed::kHidden);
      CHECK(mask_area(found.mask) == 0);
    }
    if (seen > 0.6) CHECK(iou(found.mask, clip.object_mask(t)) > 0.75);
  }
  CHECK(hidden >= 2);
}

TEST_CASE("two objects do not share a pixel") {
  const MovingShapes clip{.bar_width = 20};
  ObjectFollower follower(clip.frame(0), {clip.object_mask(0), clip.bar_mask(0)}, {}, kFollowSide);
  for (int t = 1; t < clip.frames; ++t) {
    const std::vector<FollowedMask> masks = follower.next(clip.frame(t), {});
    REQUIRE(masks.size() == 2);
    if (mask_area(clip.object_mask(t)) > 0.6 * mask_area(clip.object_mask(0)))
      CHECK(iou(masks[0].mask, clip.object_mask(t)) > 0.75);
    CHECK(iou(masks[1].mask, clip.bar_mask(t)) > 0.75);
    for (int y = 0; y < clip.height; ++y) {
      for (int x = 0; x < clip.width; ++x) REQUIRE(masks[0].mask(0, y, x) + masks[1].mask(0, y, x) <= 1);
    }
  }
}

TEST_CASE("pictures that are larger than what is looked at have masks of their size") {
  const MovingShapes clip{.frames = 6};
  ObjectFollower follower(clip.frame(0), {clip.object_mask(0)}, {}, 80);
  for (int t = 1; t < clip.frames; ++t) {
    const Image mask = follower.next(clip.frame(t), {}).front().mask;
    REQUIRE(mask.width() == clip.width);
    REQUIRE(mask.height() == clip.height);
    CHECK(iou(mask, clip.object_mask(t)) > 0.85);
  }
}

TEST_CASE("masks have the same bits for any number of threads", "[parallel]") {
  const MovingShapes clip{.frames = 5, .bar_width = 14};
  std::vector<FollowedMask> first;
  for (const int threads : {1, 2, 7}) {
    with_threads(threads, [&] {
      const std::vector<FollowedMask> masks = follow(clip, clip.object_mask(0), true).masks;
      if (first.empty()) first = masks;
      for (std::size_t i = 0; i < masks.size(); ++i) {
        CHECK(masks[i].mask == first[i].mask);
        CHECK(masks[i].score == first[i].score);
      }
    });
  }
}

TEST_CASE("a box around an object and a click on it give its mask") {
  const MovingShapes clip;
  const Image frame = clip.frame(0), truth = clip.object_mask(0);
  const auto [x, y] = clip.object_center(0);
  const double r = clip.object_size + 4;
  for (const ObjectHint& hint : {ObjectHint{{}, {x - r, y - r, x + r, y + r}, {}}, ObjectHint{{}, {}, {{x, y}}},
                                 ObjectHint{{}, {}, {{x, y}, {x + 3, y}}}}) {
    const Image mask = first_mask(hint, frame, {}, kFollowSide, "can");
    CHECK(iou(mask, truth) > 0.85);
    CHECK(iou(first_mask(hint, frame, {}, 100, "can"), truth) > 0.75);
  }
}

TEST_CASE("a click or a box outside of the first frame is refused") {
  const MovingShapes clip;
  const Image frame = clip.frame(0);
  const auto fault = [&](const ObjectHint& hint) {
    try {
      first_mask(hint, frame, {}, kFollowSide, "can");
    } catch (const UserError& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  CHECK(fault({{}, {}, {{160, 20}}}) == "can: 160,20 is outside of the first frame, which has 160x120 pixels");
  CHECK(fault({{}, {}, {{20, -1}}}) == "can: 20,-1 is outside of the first frame, which has 160x120 pixels");
  CHECK_THAT(fault({{}, {200, 10, 300, 60}, {}}), Contains("can: the box has nothing in it of the first frame"));
  CHECK_THAT(fault({{}, {40, 10, 30, 60}, {}}), Contains("allowed: X0,Y0,X1,Y1 with X0 < X1 and Y0 < Y1"));
}

TEST_CASE("the cut is the least of all labellings") {
  // Of 3 x 3 pixels all 512 are tried.
  constexpr int kSide = 3;
  Image odds(1, kSide, kSide), links(kCutLinks, kSide, kSide), labels(1, kSide, kSide);
  double value = 0.37;
  const auto next = [&value] { return value = std::fmod(value * 7.31 + 0.193, 1.0); };
  for (int round = 0; round < 20; ++round) {
    for (int y = 0; y < kSide; ++y) {
      for (int x = 0; x < kSide; ++x) {
        odds(0, y, x) = static_cast<float>(4 * next() - 2);
        for (int k = 0; k < kCutLinks; ++k) links(k, y, x) = static_cast<float>(next());
      }
    }
    const auto energy = [&](const std::function<bool(int, int)>& label) {
      double sum = 0;
      for (int y = 0; y < kSide; ++y) {
        for (int x = 0; x < kSide; ++x) {
          if (label(y, x)) sum -= odds(0, y, x);
          const std::array<std::array<int, 2>, kCutLinks> others = {
              {{y, x + 1}, {y + 1, x}, {y + 1, x + 1}, {y + 1, x - 1}}};
          for (int k = 0; k < kCutLinks; ++k) {
            const auto [v, u] = others[static_cast<std::size_t>(k)];
            if (u >= 0 && u < kSide && v < kSide && label(y, x) != label(v, u)) sum += links(k, y, x);
          }
        }
      }
      return sum;
    };
    CHECK(vision_library().cut(odds, links, labels).empty());
    double least = 1e9;
    for (int bits = 0; bits < 512; ++bits)
      least = std::min(least, energy([bits](int y, int x) { return (bits >> (kSide * y + x) & 1) != 0; }));
    CHECK(energy([&labels](int y, int x) { return labels(0, y, x) > 0.5F; }) == Approx(least).margin(1e-5));
  }
}

}  // namespace object_follower_test
