#include "pipelines/follow/object_follower.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "core/check.h"
#include "pipelines/follow/pictures.h"
#include "pipelines/follow/vision_library.h"

namespace hsi4d {

namespace {

// What is added up: log odds. All were chosen on three generated clips (docs/numerics/footage.md).
constexpr double kPersonOdds = 2;      // against a pixel that the human's mask covers
constexpr double kBackgroundOdds = 3;  // against one that looks as the background did there
constexpr double kMostInside = 2;      // for one in what is expected
constexpr double kMostOutside = 6;     // against one far from it
constexpr double kLinkStrength = 4;    // of a border between two pixels of one colour

// Distances, pixels.
constexpr double kGap = 3;             // around a mask, that are neither its colours nor those around it
constexpr double kLeastRing = 8;       // around a mask, whose colours count
constexpr double kRingShare = 0.35;    // of the root of the area, more
constexpr double kLeastReach = 1.5;    // from the border of what is expected, in which odds change by one
constexpr double kReachShare = 0.03;   // of the root of the area, more
constexpr double kSoughtShare = 0.03;  // of the longer side, farther away each frame
constexpr double kScoredBand = 4;      // about a border, in which colours are held against labels

// Colours.
constexpr double kInnerWeight = 0.3;       // of pixels at a mask's own border, which are mixed with others
constexpr double kRecentShare = 0.5;       // of late colours of an object, beside those of the first frame
constexpr double kFirstAroundShare = 0.2;  // of the first frame's colours around it, beside those of this one
constexpr double kLearningRate = 0.3;      // of late colours, a frame
constexpr double kLikeSpread = 0.03;       // of what looks alike

// States.
constexpr double kLeastLeft = 0.06;  // of an object's area: with less it is hidden
constexpr double kLeastFound = 0.1;  // of its area, with which it is found again
constexpr double kMostFound = 2;
constexpr double kFoundScore = 0.7;
constexpr double kDoubtfulScore = 0.7;
constexpr double kLearnedFrom = 0.25;                       // of its area: less is mostly what hides it
constexpr double kHiddenWeight = 0.9;                       // of a hidden part, in what is expected
constexpr double kKeptBehind = 0.98, kKeptElsewhere = 0.9;  // of a hidden part, a frame: what hides it is known, or not
constexpr double kApart = 0.1;  // of an object, that the human's mask may cover in the first frame

/// An image [1,H,W] of what a function gives for each row and column.
template <class Value>
Image plane_of(int height, int width, const Value& value) {
  Image image(1, height, width);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) image(0, y, x) = static_cast<float>(value(y, x));
  }
  return image;
}

/// Sum of what a function gives for each pixel of a mask.
template <class Value>
double sum_over(const Image& mask, const Value& value) {
  double sum = 0;
  for (int y = 0; y < mask.height(); ++y) {
    for (int x = 0; x < mask.width(); ++x) {
      if (mask(0, y, x) > 0.5F) sum += static_cast<double>(value(y, x));
    }
  }
  return sum;
}

double area_of(const Image& mask) {
  return sum_over(mask, [](int, int) { return 1; });
}

/// Distance from the border of what is above ½, positive in it; far away from everything where there is none.
Image signed_distance(const Image& shape) {
  constexpr double kFarAway = 1e4;
  const auto distances_to = [&shape](bool inside) {
    const Image part =
        plane_of(shape.height(), shape.width(), [&](int y, int x) { return (shape(0, y, x) > 0.5F) == inside; });
    if (!shows_something(part)) return plane_of(shape.height(), shape.width(), [](int, int) { return kFarAway; });
    Image distances(1, shape.height(), shape.width());
    must_work(vision_library().find_distances(part, distances), "distances");
    return distances;
  };
  const Image to_inside = distances_to(true), to_outside = distances_to(false);
  return plane_of(shape.height(), shape.width(), [&](int y, int x) {
    return shape(0, y, x) > 0.5F ? to_outside(0, y, x) - 0.5F : 0.5F - to_inside(0, y, x);
  });
}

// ---- The part of a picture that is looked at ----

struct Window {
  int top = 0, left = 0, height = 0, width = 0;
};

/// What is above ½, and so many pixels around it; nothing where there is none.
Window window_around(const Image& shape, int margin) {
  int top = shape.height(), left = shape.width(), bottom = -1, right = -1;
  for (int y = 0; y < shape.height(); ++y) {
    for (int x = 0; x < shape.width(); ++x) {
      if (!(shape(0, y, x) > 0.5F)) continue;
      top = std::min(top, y);
      bottom = std::max(bottom, y);
      left = std::min(left, x);
      right = std::max(right, x);
    }
  }
  if (bottom < 0) return {};
  top = std::max(0, top - margin);
  left = std::max(0, left - margin);
  return {top, left, std::min(shape.height(), bottom + margin + 1) - top,
          std::min(shape.width(), right + margin + 1) - left};
}

Image part_of(const Image& image, const Window& window) {
  return crop(image, window.top, window.left, window.height, window.width);
}

// ---- Odds and links ----

double ring_around(double area) { return kLeastRing + kRingShare * std::sqrt(area); }

/// Costs of borders between neighbours.   [Boykov and Jolly 2001]
///
///   strength (w + (1 − w) exp(−|Δc|² / 2⟨|Δc|²⟩)) / distance,   w = 0.05
Image links_of(const Image& image) {
  constexpr std::array<std::array<int, 2>, kCutLinks> kSteps = {{{1, 0}, {0, 1}, {1, 1}, {-1, 1}}};  // x, y
  constexpr double kLeast = 0.05;
  Image links(kCutLinks, image.height(), image.width());
  double sum = 0, count = 0;
  for (int k = 0; k < kCutLinks; ++k) {
    const auto [right, down] = kSteps[static_cast<std::size_t>(k)];
    for (int y = 0; y + down < image.height(); ++y) {
      for (int x = std::max(0, -right); x + std::max(0, right) < image.width(); ++x) {
        for (int c = 0; c < 3; ++c) {
          const float change = image(c, y, x) - image(c, y + down, x + right);
          links(k, y, x) += change * change;
        }
        sum += links(k, y, x);
        count += 1;
      }
    }
  }
  const double scale = count / (2 * sum + 1e-9);
  for (int k = 0; k < kCutLinks; ++k) {
    const double weight = k < 2 ? kLinkStrength : kLinkStrength / std::sqrt(2.0);
    for (int y = 0; y < image.height(); ++y) {
      for (int x = 0; x < image.width(); ++x)
        links(k, y, x) = static_cast<float>(weight * (kLeast + (1 - kLeast) * std::exp(-scale * links(k, y, x))));
    }
  }
  return links;
}

/// The colours in a mask, by the distance from its border.
ColorModel colors_in(const Image& frame, const Image& distance) {
  return colors_of(frame, plane_of(frame.height(), frame.width(), [&distance](int y, int x) {
                     return distance(0, y, x) > 1 ? 1 : distance(0, y, x) > 0 ? kInnerWeight : 0;
                   }));
}

/// The colours between two distances from it.
ColorModel colors_around(const Image& frame, const Image& distance, double nearest, double farthest) {
  return colors_of(frame, plane_of(frame.height(), frame.width(), [&](int y, int x) {
                     return -distance(0, y, x) > nearest && -distance(0, y, x) < farthest;
                   }));
}

/// How much a pixel looks as the background did there, 0 to 1: the best of it and its neighbours, as motions are not
/// quite exact.
Image likeness(const Image& frame, const Image& plate, const Image& known) {
  constexpr float kKnown = 0.99F;
  return plane_of(frame.height(), frame.width(), [&](int y, int x) {
    double least = 1;
    for (int v = std::max(0, y - 1); v <= std::min(frame.height() - 1, y + 1); ++v) {
      for (int u = std::max(0, x - 1); u <= std::min(frame.width() - 1, x + 1); ++u) {
        if (known(0, v, u) < kKnown) continue;
        double sum = 0;
        for (int c = 0; c < 3; ++c) {
          const double change = frame(c, y, x) - plate(c, v, u);
          sum += change * change;
        }
        least = std::min(least, sum);
      }
    }
    return std::exp(-least / (2 * kLikeSpread * kLikeSpread));
  });
}

/// 1 where neither an object nor the human is, nor near.
Image background_of(const std::vector<FollowedObject>& objects, const Image& human) {
  const Image& size = objects.front().mask;
  const Image taken = plane_of(size.height(), size.width(), [&](int y, int x) {
    const auto covers = [y, x](const FollowedObject& o) {
      return o.mask(0, y, x) > 0.5F || o.presence(0, y, x) > 0.5F;
    };
    return (!human.empty() && human(0, y, x) > 0.1F) || std::any_of(objects.begin(), objects.end(), covers);
  });
  const Image distance = signed_distance(taken);
  return plane_of(size.height(), size.width(), [&distance](int y, int x) { return distance(0, y, x) < -kGap; });
}

/// The motion of what is behind all; every third pixel tells it.
PlaneMotion camera_motion(const Image& background, const FlowPair& flow) {
  return common_motion(plane_of(background.height(), background.width(),
                                [&](int y, int x) { return x % 3 == 0 && y % 3 == 0 ? background(0, y, x) : 0; }),
                       flow, false);
}

// ---- One object ----

/// Where an object is expected, and where it is whether seen or not.
struct ExpectedObject {
  Image shape, presence;
};

ExpectedObject expected_object(const FollowedObject& o, const FlowPair& flow) {
  const bool is_hidden = o.hidden_for > 0;
  const PlaneMotion motion = common_motion(is_hidden ? o.presence : o.mask, flow, is_hidden);
  ExpectedObject expected{{}, carried(o.presence, motion)};
  expected.shape = expected.presence;
  if (is_hidden) return expected;
  const Image by_flow = carried(o.mask, flow.back), by_motion = carried(o.mask, motion);
  expected.shape = plane_of(o.mask.height(), o.mask.width(), [&](int y, int x) {
    return std::max((by_flow(0, y, x) + by_motion(0, y, x)) / 2.0, kHiddenWeight * expected.presence(0, y, x));
  });
  return expected;
}

/// A frame, and what of it is the same for all objects.
struct LookedAt {
  const Image& frame;
  const Image& human;       ///< empty: not known, or of no use
  const Image& background;  ///< likeness
};

/// A cut, at the frame's size.
struct CutObject {
  Image labels;      ///< [1,h,w]
  Image odds;        ///< [1,h,w], far below 0 where nothing was looked at
  double score = 0;  ///< 0 to 1
};

/// The share of pixels in the mask and about the expected border whose colours say what the labels say; of an object
/// that was seen before, less where mask and expectation overlap by less than half.
double score_of(const Image& labels, const Image& colors, const Image& distance, bool was_seen) {
  double looked_at = 0, agreeing = 0, both = 0, any = 0;
  for (int y = 0; y < labels.height(); ++y) {
    for (int x = 0; x < labels.width(); ++x) {
      const bool is_in = labels(0, y, x) > 0.5F, was_in = distance(0, y, x) > 0;
      if (is_in && was_in) both += 1;
      if (is_in || was_in) any += 1;
      if (!is_in && std::abs(distance(0, y, x)) > kScoredBand) continue;
      looked_at += 1;
      if ((colors(0, y, x) > 0) == is_in) agreeing += 1;
    }
  }
  if (any == 0 || looked_at == 0) return 0;
  return agreeing / looked_at * (was_seen ? std::min(1.0, 2 * both / any) : 1);
}

CutObject cut_object(const FollowedObject& o, const LookedAt& at, const Image& shape) {
  const int height = at.frame.height(), width = at.frame.width();
  CutObject cut{Image(1, height, width), plane_of(height, width, [](int, int) { return -1e6; })};
  const double sought = kSoughtShare * std::max(height, width) * o.hidden_for, ring = ring_around(o.area) + sought;
  const Window window = window_around(shape, static_cast<int>(ring) + 4);
  if (window.height == 0) return cut;
  const Image part = part_of(at.frame, window), distance = signed_distance(part_of(shape, window));
  const ColorModel inside = mixed(o.first_colors, o.colors, kRecentShare),
                   around =
                       mixed(colors_around(part, distance, kGap + sought, ring), o.first_around, kFirstAroundShare);
  const Image colors = color_odds(part, inside, around);
  const double reach = kLeastReach + kReachShare * std::sqrt(o.area) + sought;
  const double most_inside = o.hidden_for > 0 ? 0 : kMostInside;
  const Image odds = plane_of(window.height, window.width, [&](int y, int x) {
    const int v = window.top + y, u = window.left + x;
    return colors(0, y, x) + std::clamp(distance(0, y, x) / reach, -kMostOutside, most_inside) -
           kPersonOdds * (at.human.empty() ? 0 : at.human(0, v, u)) - kBackgroundOdds * at.background(0, v, u);
  });
  Image labels(1, window.height, window.width);
  must_work(vision_library().cut(odds, links_of(part), labels), "graph cut");
  for (int y = 0; y < window.height; ++y) {
    std::copy_n(labels.row(0, y), window.width, cut.labels.row(0, window.top + y) + window.left);
    std::copy_n(odds.row(0, y), window.width, cut.odds.row(0, window.top + y) + window.left);
  }
  cut.score = score_of(labels, colors, distance, o.hidden_for == 0);
  return cut;
}

/// A pixel that several objects want is that one's whose odds are best, the first one's of equal ones.
void settle(std::vector<CutObject>& cuts) {
  for (std::size_t i = 0; i < cuts.size(); ++i) {
    for (std::size_t k = i + 1; k < cuts.size(); ++k) {
      for (int y = 0; y < cuts[i].labels.height(); ++y) {
        for (int x = 0; x < cuts[i].labels.width(); ++x) {
          if (cuts[i].labels(0, y, x) < 0.5F || cuts[k].labels(0, y, x) < 0.5F) continue;
          (cuts[i].odds(0, y, x) < cuts[k].odds(0, y, x) ? cuts[i] : cuts[k]).labels(0, y, x) = 0;
        }
      }
    }
  }
}

/// Whether what was cut is no object: too little of one, or not what was sought.
bool is_nothing(const FollowedObject& o, const CutObject& cut, double area) {
  if (o.hidden_for == 0) return area < kLeastLeft * o.area;
  return area < kLeastFound * o.area || area > kMostFound * o.area || cut.score < kFoundScore;
}

/// 1 where the human is, or another object.
Image hiders_of(std::size_t object, const std::vector<CutObject>& cuts, const Image& human) {
  Image hiders = human.empty() ? Image(1, cuts.front().labels.height(), cuts.front().labels.width()) : human;
  for (std::size_t i = 0; i < cuts.size(); ++i) {
    if (i == object) continue;
    for (int y = 0; y < hiders.height(); ++y) {
      for (int x = 0; x < hiders.width(); ++x) hiders(0, y, x) = std::max(hiders(0, y, x), cuts[i].labels(0, y, x));
    }
  }
  return hiders;
}

/// Takes over what was found in a frame.
/// @param hiders    1 where others are
/// @param presence  carried along
FollowedMask update(FollowedObject& o, const CutObject& cut, const Image& frame, const Image& hiders,
                    const Image& presence) {
  const double area = area_of(cut.labels);
  const bool is_hidden = is_nothing(o, cut, area), was_hidden = o.hidden_for > 0;
  o.mask = is_hidden ? Image(1, frame.height(), frame.width()) : cut.labels;
  o.hidden_for = is_hidden ? o.hidden_for + 1 : 0;
  o.presence = plane_of(frame.height(), frame.width(), [&](int y, int x) -> double {
    if (o.mask(0, y, x) > 0.5F) return 1;
    if (was_hidden && !is_hidden) return 0;  // it is elsewhere
    return presence(0, y, x) * (is_hidden ? 1 : hiders(0, y, x) > 0.5F ? kKeptBehind : kKeptElsewhere);
  });
  if (is_hidden) return {o.mask, Followed::kHidden, 0};
  if (area > kLearnedFrom * o.area) {
    o.colors = mixed(o.colors, colors_in(frame, signed_distance(o.mask)), kLearningRate);
    o.area += kLearningRate / 3 * (area - o.area);
  }
  return {o.mask, cut.score < kDoubtfulScore ? Followed::kDoubtful : Followed::kSeen, cut.score};
}

FollowedObject first_object(const Image& mask, const Image& frame) {
  FollowedObject o;
  o.mask = plane_of(mask.height(), mask.width(), [&mask](int y, int x) { return mask(0, y, x) > 0.5F; });
  o.presence = o.mask;
  o.area = area_of(o.mask);
  const Image distance = signed_distance(o.mask);
  o.first_colors = o.colors = colors_in(frame, distance);
  o.first_around = colors_around(frame, distance, 1, ring_around(o.area));
  return o;
}

}  // namespace

ObjectFollower::ObjectFollower(const Image& frame, const std::vector<Image>& masks, const Image& human,
                               int longest_side_px)
    : longest_side_px_(longest_side_px), frame_(reduced_to(frame, longest_side_px)), plate_(frame_) {
  HSI4D_CHECK(!masks.empty(), "there is no object to follow");
  const Image person = human.empty() ? human : reduced_to(human, longest_side_px);
  for (const Image& mask : masks) {
    objects_.push_back(first_object(reduced_to(mask, longest_side_px), frame_));
    const FollowedObject& o = objects_.back();
    const auto covered = [&person](int y, int x) { return person(0, y, x); };
    human_is_apart_.push_back(!person.empty() && sum_over(o.mask, covered) < kApart * o.area);
  }
  background_ = background_of(objects_, person);
  plate_known_ = background_;
}

std::vector<FollowedMask> ObjectFollower::next(const Image& full, const Image& full_human) {
  const Image frame = reduced_to(full, longest_side_px_), none{},
              human = full_human.empty() ? full_human : reduced_to(full_human, longest_side_px_);
  const FlowPair flow = flow_between(frame_, frame);
  const PlaneMotion camera = camera_motion(background_, flow);
  plate_ = carried(plate_, camera);
  plate_known_ = carried(plate_known_, camera);
  const Image background = likeness(frame, plate_, plate_known_);
  std::vector<ExpectedObject> expected;
  std::vector<CutObject> cuts;
  for (std::size_t i = 0; i < objects_.size(); ++i) {
    expected.push_back(expected_object(objects_[i], flow));
    cuts.push_back(cut_object(objects_[i], {frame, human_is_apart_[i] ? human : none, background}, expected[i].shape));
  }
  settle(cuts);
  std::vector<FollowedMask> found;
  for (std::size_t i = 0; i < objects_.size(); ++i) {
    found.push_back(update(objects_[i], cuts[i], frame, hiders_of(i, cuts, human), expected[i].presence));
    found[i].mask = enlarged_mask(found[i].mask, full.height(), full.width());
  }
  background_ = background_of(objects_, human);
  for (int y = 0; y < frame.height(); ++y) {
    for (int x = 0; x < frame.width(); ++x) {
      if (background_(0, y, x) < 0.5F) continue;
      for (int c = 0; c < 3; ++c) plate_(c, y, x) = frame(c, y, x);
      plate_known_(0, y, x) = 1;
    }
  }
  frame_ = frame;
  return found;
}

}  // namespace hsi4d
