#include "pipelines/follow/first_mask.h"

#include <algorithm>
#include <cmath>
#include <queue>

#include "core/check.h"
#include "core/mask_image.h"
#include "core/size_text.h"
#include "core/text.h"
#include "pipelines/follow/pictures.h"
#include "pipelines/follow/vision_library.h"

namespace hsi4d {

namespace {

using PixelAt = std::array<int, 2>;  // x, y

constexpr double kLeastStep = 0.01;     // of the distance between neighbours of one colour
constexpr double kLeastShare = 0.0005;  // of the picture, that an object has
constexpr double kLargestShare = 0.3;
constexpr double kCoreShare = 0.25;   // of the pixels around a click that are the object for certain
constexpr double kNearlyMost = 0.9;   // of the largest change across a border
constexpr double kClickMargin = 0.1;  // of a region's side, by which the object may be larger
constexpr double kBoxMargin = 0.25;   // of the box's side, of what is looked at around it

double color_distance(const Image& image, const PixelAt& a, const PixelAt& b) {
  double sum = 0;
  for (int c = 0; c < 3; ++c) {
    const double change = image(c, a[1], a[0]) - image(c, b[1], b[0]);
    sum += change * change;
  }
  return std::sqrt(sum);
}

/// Pixels around a click, nearest first, along ways on which colours change little, up to the border across which they
/// change nearly most.
std::vector<PixelAt> region_of(const Image& image, const PixelAt& click, const Image& barred) {
  struct Reached {
    double distance;
    PixelAt at;
    bool operator>(const Reached& other) const {
      return distance != other.distance ? distance > other.distance : at > other.at;
    }
  };
  const int width = image.width(), height = image.height();
  const double all = static_cast<double>(width) * height;
  Image done(1, height, width);
  std::priority_queue<Reached, std::vector<Reached>, std::greater<>> next;
  next.push({0, click});
  std::vector<PixelAt> order;
  std::vector<double> changes;  // the mean across the border, after each pixel
  double border = 0, links = 0;
  while (!next.empty() && static_cast<double>(order.size()) < kLargestShare * all) {
    const Reached now = next.top();
    next.pop();
    const auto [x, y] = now.at;
    if (done(0, y, x) > 0) continue;
    done(0, y, x) = 1;
    order.push_back(now.at);
    for (const PixelAt& step : {PixelAt{1, 0}, PixelAt{-1, 0}, PixelAt{0, 1}, PixelAt{0, -1}}) {
      const PixelAt other = {x + step[0], y + step[1]};
      if (other[0] < 0 || other[1] < 0 || other[0] >= width || other[1] >= height) {
        links += 1;  // the picture's border is no border of an object
        continue;
      }
      const double change = color_distance(image, now.at, other);
      const bool is_inside = done(0, other[1], other[0]) > 0;
      border += is_inside ? -change : change;
      links += is_inside ? -1 : 1;
      if (!is_inside && !(barred(0, other[1], other[0]) > 0.5F)) next.push({now.distance + kLeastStep + change, other});
    }
    changes.push_back(border / std::max(links, 1.0));
  }
  const auto least = std::min(order.size() - 1, static_cast<std::size_t>(kLeastShare * all));
  const auto begin = changes.begin() + static_cast<Index>(least);
  const double most = *std::max_element(begin, changes.end());
  const auto best = std::find_if(begin, changes.end(), [most](double change) { return change >= kNearlyMost * most; });
  order.resize(static_cast<std::size_t>(best - changes.begin()) + 1);
  return order;
}

/// 1 4 6 4 1 in both directions, against noise.
Image smoothed(const Image& image) {
  Image result = image;
  for (const bool across : {true, false}) {
    const Image from = result;
    for (int c = 0; c < 3; ++c) {
      for (int y = 0; y < image.height(); ++y) {
        for (int x = 0; x < image.width(); ++x) {
          const auto at = [&](int k) {
            return across ? from(c, y, std::clamp(x + k, 0, image.width() - 1))
                          : from(c, std::clamp(y + k, 0, image.height() - 1), x);
          };
          result(c, y, x) = (6 * at(0) + 4 * (at(-1) + at(1)) + at(-2) + at(2)) / 16;
        }
      }
    }
  }
  return result;
}

struct PixelBox {
  int left = 0, top = 0, right = 0, bottom = 0;  ///< the last two are not in it
};

PixelBox box_of(const std::vector<PixelAt>& pixels) {
  PixelBox box{pixels.front()[0], pixels.front()[1], pixels.front()[0] + 1, pixels.front()[1] + 1};
  for (const auto& [x, y] : pixels) {
    box.left = std::min(box.left, x);
    box.top = std::min(box.top, y);
    box.right = std::max(box.right, x + 1);
    box.bottom = std::max(box.bottom, y + 1);
  }
  return box;
}

PixelBox grown(const PixelBox& box, double share, const Image& within) {
  const auto margin = static_cast<int>(share * std::max(box.right - box.left, box.bottom - box.top)) + 4;
  return {std::max(0, box.left - margin), std::max(0, box.top - margin), std::min(within.width(), box.right + margin),
          std::min(within.height(), box.bottom + margin)};
}

/// What the labels say, looked at within the box alone; nothing where all in it is, or nothing can be, the object.
Image grabbed(const Image& image, Image labels, const PixelBox& box) {
  const auto part_of = [&box](const Image& whole) {
    return crop(whole, box.top, box.left, box.bottom - box.top, box.right - box.left);
  };
  Image part = part_of(labels), mask(1, image.height(), image.width());
  if (!shows_something(part) || !shows_something(complement(part))) return mask;  // nothing to tell apart
  must_work(vision_library().grab(part_of(image), part), "GrabCut");
  for (int y = 0; y < part.height(); ++y)
    std::copy_n(part.row(0, y), part.width(), mask.row(0, box.top + y) + box.left);
  return mask;
}

void label_box(Image& labels, const PixelBox& box, float label) {
  for (int y = box.top; y < box.bottom; ++y)
    std::fill(labels.row(0, y) + box.left, labels.row(0, y) + box.right, label);
}

/// What the human covers is not the object.
void leave_out(Image& labels, const Image& human) {
  for (int y = 0; y < labels.height() && !human.empty(); ++y) {
    for (int x = 0; x < labels.width(); ++x) {
      if (human(0, y, x) > 0.5F) labels(0, y, x) = 0;
    }
  }
}

Image mask_of_box(const Image& image, const Image& human, const PixelBox& box) {
  Image labels(1, image.height(), image.width());
  label_box(labels, box, 0.75F);
  leave_out(labels, human);
  return grabbed(image, labels, grown(box, kBoxMargin, image));
}

Image mask_of_clicks(const Image& image, const Image& human, const std::vector<PixelAt>& clicks) {
  const bool on_human = std::any_of(clicks.begin(), clicks.end(), [&human](const PixelAt& at) {
    return !human.empty() && human(0, at[1], at[0]) > 0.5F;
  });
  const Image barred = human.empty() || on_human ? Image(1, image.height(), image.width()) : human;
  const Image smooth = smoothed(image);
  Image labels(1, image.height(), image.width());
  std::vector<PixelAt> all, cores;
  for (const PixelAt& click : clicks) {
    const std::vector<PixelAt> region = region_of(smooth, click, barred);
    const auto core = static_cast<Index>(kCoreShare * static_cast<double>(region.size())) + 1;
    all.insert(all.end(), region.begin(), region.end());
    cores.insert(cores.end(), region.begin(), region.begin() + core);
  }
  const PixelBox box = box_of(all);
  label_box(labels, grown(box, kClickMargin, image), 0.25F);
  for (const auto& [x, y] : all) labels(0, y, x) = 0.75F;
  leave_out(labels, barred);
  for (const auto& [x, y] : cores) labels(0, y, x) = 1;
  return grabbed(image, labels, grown(box, kClickMargin + kBoxMargin, image));
}

PixelAt pixel_of(const std::array<double, 2>& click, const Image& frame, const Image& image, const std::string& name) {
  const auto [x, y] = click;
  if (!(x >= 0 && y >= 0 && x < frame.width() && y < frame.height()))
    throw UserError(name + ": " + number_text(x) + "," + number_text(y) + " is outside of the first frame, which has " +
                    size_text(frame) + " pixels");
  return {std::min(image.width() - 1, static_cast<int>(x * image.width() / frame.width())),
          std::min(image.height() - 1, static_cast<int>(y * image.height() / frame.height()))};
}

PixelBox pixels_of(const std::vector<double>& box, const Image& frame, const Image& image, const std::string& name) {
  const double x0 = std::max(box[0], 0.0), y0 = std::max(box[1], 0.0), x1 = std::min<double>(box[2], frame.width()),
               y1 = std::min<double>(box[3], frame.height());
  if (!(x0 < x1 && y0 < y1))
    throw UserError(name + ": the box has nothing in it of the first frame, which has " + size_text(frame) +
                    " pixels; allowed: X0,Y0,X1,Y1 with X0 < X1 and Y0 < Y1");
  const double to_x = static_cast<double>(image.width()) / frame.width(),
               to_y = static_cast<double>(image.height()) / frame.height();
  return {static_cast<int>(x0 * to_x), static_cast<int>(y0 * to_y), static_cast<int>(std::ceil(x1 * to_x)),
          static_cast<int>(std::ceil(y1 * to_y))};
}

Image read_first_mask(const std::filesystem::path& file, const Image& frame, const std::string& name) {
  const Image mask = read_mask_image(file.string());
  if (mask.width() != frame.width() || mask.height() != frame.height())
    throw DataError(file.string() + ": the mask is " + size_text(mask) + " pixels, the first frame " +
                    size_text(frame));
  if (!shows_something(mask))
    throw DataError(file.string() + ": the mask is empty; " + name + " is to show the object");
  return mask;
}

}  // namespace

Image first_mask(const ObjectHint& hint, const Image& frame, const Image& human, int longest_side_px,
                 const std::string& name) {
  if (!hint.mask.empty()) return read_first_mask(hint.mask, frame, name);
  const Image image = reduced_to(frame, longest_side_px),
              person = human.empty() ? human : resize_area(human, image.height(), image.width());
  Image mask;
  if (!hint.box.empty()) {
    mask = mask_of_box(image, person, pixels_of(hint.box, frame, image, name));
  } else {
    std::vector<PixelAt> clicks;
    for (const std::array<double, 2>& click : hint.clicks) clicks.push_back(pixel_of(click, frame, image, name));
    mask = mask_of_clicks(image, person, clicks);
  }
  if (!shows_something(mask))
    throw UserError(name + ": no object is found there that differs from what is around it; give its mask");
  return enlarged_mask(mask, frame.height(), frame.width());
}

}  // namespace hsi4d
