#include "pipelines/metrics/background_errors.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

#include "core/check.h"

namespace hsi4d {

namespace {

constexpr int kLookedAt = 256, kLeastSide = 24;  // pixels of the longer side, of the shorter one
constexpr int kMostRounds = 12;                  // at each size
constexpr double kLeastStep = 0.005;             // pixels
constexpr double kLeastColorStep = 1e-4;         // of gain and offset
constexpr double kSpoiled = 0.1;                 // a difference beyond which pixels hardly count
constexpr double kNoise = 0.02, kMostUncertain = 0.1;
constexpr double kOtherColor = 0.1;
constexpr double kLeastShare = 0.01;
constexpr double kMostGain = 2;
constexpr double kRidge = 1e-6;  // of a pixel's weight: what nothing tells stays

using Vector6d = Eigen::Matrix<double, 6, 1>;
using Matrix6d = Eigen::Matrix<double, 6, 6>;

struct Pictures {
  Image render, frame;  // [C,H,W]
  Image background;     // [1,H,W]
};

/// Shift right and down, growth and turn about the middle: pixels there, and at the corners.
using Displacement = Eigen::Vector4d;

/// How frame(x + u) becomes the render.
struct Agreement {
  Displacement displacement = Displacement::Zero();
  double gain = 1, offset = 0;
  Eigen::Matrix4d information = Eigen::Matrix4d::Zero();  // of the displacement, gain and offset being free
};

Image resized_to(const Image& image, int longest) {
  const int now = std::max(image.width(), image.height());
  if (now <= longest) return image;
  const auto side = [=](int pixels) { return std::max(1, (pixels * longest + now / 2) / now); };
  return resize_area(image, side(image.height()), side(image.width()));
}

Pictures resized_to(const Pictures& pictures, int longest) {
  return {resized_to(pictures.render, longest), resized_to(pictures.frame, longest),
          resized_to(pictures.background, longest)};
}

Image grey_of(const Image& image) {
  Image grey(1, image.height(), image.width());
  for (int c = 0; c < image.channels(); ++c) {
    for (int y = 0; y < image.height(); ++y) {
      for (int x = 0; x < image.width(); ++x) grey(0, y, x) += image(c, y, x) / static_cast<float>(image.channels());
    }
  }
  return grey;
}

/// Of a pixel that is reduced from several: all of them.
bool is_background(const Image& background, int y, int x) { return background(0, y, x) > 0.999F; }

/// u(x) by the numbers of a displacement.
Eigen::Matrix<double, 2, 4> way_by(const Image& picture, int y, int x) {
  const double width = picture.width(), height = picture.height();
  const double corner = std::sqrt(width * width + height * height) / 2;
  const double right = (x - (width - 1) / 2) / corner, down = (y - (height - 1) / 2) / corner;
  Eigen::Matrix<double, 2, 4> by;
  by << 1, 0, right, -down, 0, 1, down, right;
  return by;
}

/// Between pixel centres; nothing beyond them.
std::optional<double> sample(const Image& image, int c, double y, double x) {
  if (!(x >= 0 && y >= 0 && x <= image.width() - 1 && y <= image.height() - 1)) return {};
  const int left = std::min(static_cast<int>(x), image.width() - 2),
            top = std::min(static_cast<int>(y), image.height() - 2);
  const double across = x - left, down = y - top;
  const auto row = [&](int at) {
    return (1 - across) * static_cast<double>(image(c, at, left)) +
           across * static_cast<double>(image(c, at, left + 1));
  };
  return (1 - down) * row(top) + down * row(top + 1);
}

double slope(const Image& image, int y, int x, int down, int right) {
  return static_cast<double>(image(0, y + down, x + right) - image(0, y - down, x - right)) / 2;
}

double weight_of(double difference, double spoiled = kSpoiled) {
  const double share = 1 + difference * difference / (spoiled * spoiled);
  return 1 / (share * share);
}

/// A step of Gauss and Newton. Returns its length in pixels.
/// @param spoiled  as kSpoiled
double improve(const Pictures& grey, double spoiled, Agreement& at) {
  Matrix6d normal = Matrix6d::Zero();
  Vector6d right = Vector6d::Zero();
  for (int y = 1; y + 1 < grey.render.height(); ++y) {
    for (int x = 1; x + 1 < grey.render.width(); ++x) {
      if (!is_background(grey.background, y, x)) continue;
      const Eigen::Matrix<double, 2, 4> by = way_by(grey.render, y, x);
      const Eigen::Vector2d way = by * at.displacement;
      const std::optional<double> seen = sample(grey.frame, 0, y + way[1], x + way[0]);
      if (!seen) continue;
      const double drawn = grey.render(0, y, x), difference = at.gain * drawn + at.offset - *seen;
      const Eigen::RowVector2d slopes(slope(grey.render, y, x, 0, 1), slope(grey.render, y, x, 1, 0));
      Vector6d row;
      row << (at.gain * slopes * by).transpose(), -drawn, -1;
      const double weight = weight_of(difference, spoiled);
      normal += weight * row * row.transpose();
      right += weight * difference * row;
      normal.diagonal().array() += weight * kRidge;
    }
  }
  if (!(normal(5, 5) > 0)) return 0;
  const Vector6d step = normal.ldlt().solve(right);
  at.displacement += step.head<4>();
  at.gain = std::clamp(at.gain + step[4], 1 / kMostGain, kMostGain);
  at.offset += step[5];
  at.information =
      normal.topLeftCorner<4, 4>() -
      normal.topRightCorner<4, 2>() * normal.bottomRightCorner<2, 2>().ldlt().solve(normal.bottomLeftCorner<2, 4>());
  return step.head<4>().norm();
}

/// From coarse to fine.
Agreement agreement_of(const Pictures& grey) {
  const int longest = std::max(grey.render.width(), grey.render.height()),
            shortest = std::min(grey.render.width(), grey.render.height());
  int halvings = 0;
  while (shortest >> (halvings + 1) >= kLeastSide) ++halvings;
  Agreement found;
  for (int halving = halvings; halving >= 0; --halving) {
    const Pictures level = resized_to(grey, longest >> halving);
    const double spoiled = kSpoiled * (1 + halving);  // far from the answer differences are larger
    for (int round = 0; round < kMostRounds && improve(level, spoiled, found) > kLeastStep; ++round) {
    }
    if (halving > 0) found.displacement *= 2;
  }
  return found;
}

bool is_certain(const Agreement& found) {
  const double least =
      Eigen::SelfAdjointEigenSolver<Eigen::Matrix4d>(found.information, Eigen::EigenvaluesOnly).eigenvalues()[0];
  return least > 0 && kNoise / std::sqrt(least) <= kMostUncertain;
}

double mean_way(const Image& background, const Displacement& displacement) {
  double sum = 0, count = 0;
  for (int y = 0; y < background.height(); ++y) {
    for (int x = 0; x < background.width(); ++x) {
      if (!is_background(background, y, x)) continue;
      sum += (way_by(background, y, x) * displacement).norm();
      count += 1;
    }
  }
  return sum / count;
}

/// Takes the displacement back; what comes from beyond the border is background no more.
void take_back(const Displacement& displacement, Pictures& pictures) {
  const Image frame = pictures.frame;
  for (int y = 0; y < frame.height(); ++y) {
    for (int x = 0; x < frame.width(); ++x) {
      const Eigen::Vector2d way = way_by(frame, y, x) * displacement;
      for (int c = 0; c < frame.channels(); ++c) {
        const std::optional<double> seen = sample(frame, c, y + way[1], x + way[0]);
        if (seen)
          pictures.frame(c, y, x) = static_cast<float>(*seen);
        else
          pictures.background(0, y, x) = 0;
      }
    }
  }
}

/// Gives the render the brightness of the frame, channel by channel.
void match_exposure(Pictures& pictures) {
  for (int c = 0; c < pictures.render.channels(); ++c) {
    double gain = 1, offset = 0;
    for (int round = 0; round < kMostRounds; ++round) {
      Eigen::Matrix2d normal = Eigen::Matrix2d::Zero();
      Eigen::Vector2d right = Eigen::Vector2d::Zero();
      for (int y = 0; y < pictures.render.height(); ++y) {
        for (int x = 0; x < pictures.render.width(); ++x) {
          if (!is_background(pictures.background, y, x)) continue;
          const Eigen::Vector2d row(static_cast<double>(pictures.render(c, y, x)), 1);
          const double difference = static_cast<double>(pictures.frame(c, y, x)) - gain * row[0] - offset;
          const double weight = weight_of(difference);
          normal += weight * row * row.transpose();
          right += weight * difference * row;
          normal.diagonal().array() += weight * kRidge;
        }
      }
      if (!(normal(1, 1) > 0)) break;
      const Eigen::Vector2d step = normal.ldlt().solve(right);
      gain = std::clamp(gain + step[0], 1 / kMostGain, kMostGain);
      offset += step[1];
      if (step.norm() < kLeastColorStep) break;
    }
    for (int y = 0; y < pictures.render.height(); ++y) {
      for (int x = 0; x < pictures.render.width(); ++x)
        pictures.render(c, y, x) = static_cast<float>(gain * static_cast<double>(pictures.render(c, y, x)) + offset);
    }
  }
}

/// How far a colour of the frame is beyond all of the render there and one pixel around.
double beyond(const Pictures& pictures, int c, int y, int x) {
  float low = pictures.render(c, y, x), high = low;
  for (int row = std::max(0, y - 1); row <= std::min(pictures.render.height() - 1, y + 1); ++row) {
    for (int column = std::max(0, x - 1); column <= std::min(pictures.render.width() - 1, x + 1); ++column) {
      low = std::min(low, pictures.render(c, row, column));
      high = std::max(high, pictures.render(c, row, column));
    }
  }
  const float seen = pictures.frame(c, y, x);
  return static_cast<double>(std::max(low - seen, seen - high));
}

std::optional<double> share_of_others(const Pictures& pictures) {
  double others = 0, count = 0;
  for (int y = 0; y < pictures.render.height(); ++y) {
    for (int x = 0; x < pictures.render.width(); ++x) {
      if (!is_background(pictures.background, y, x)) continue;
      count += 1;
      bool is_other = false;
      for (int c = 0; c < pictures.render.channels(); ++c) is_other |= beyond(pictures, c, y, x) > kOtherColor;
      others += is_other ? 1 : 0;
    }
  }
  return count > 0 ? std::optional(others / count) : std::optional<double>();
}

bool has_background(const Image& background) {
  double count = 0;
  for (int y = 0; y < background.height(); ++y) {
    for (int x = 0; x < background.width(); ++x) count += is_background(background, y, x) ? 1 : 0;
  }
  return count >= kLeastShare * background.width() * background.height();
}

}  // namespace

MetricValues background_errors(const Image& render, const Image& frame, const Image& background) {
  HSI4D_CHECK(render.width() == frame.width() && render.height() == frame.height(), "pictures have one size");
  Pictures pictures = resized_to({render, frame, background}, kLookedAt);
  if (std::min(pictures.render.width(), pictures.render.height()) < 2 || !has_background(pictures.background))
    return {};
  MetricValues errors;
  const Agreement found = agreement_of({grey_of(pictures.render), grey_of(pictures.frame), pictures.background});
  if (is_certain(found)) {
    const double larger = static_cast<double>(render.width()) / pictures.render.width();
    errors.emplace_back("camera_drift_px", larger * mean_way(pictures.background, found.displacement));
    take_back(found.displacement, pictures);
  }
  match_exposure(pictures);
  if (const std::optional<double> change = share_of_others(pictures)) errors.emplace_back("background_change", *change);
  return errors;
}

}  // namespace hsi4d
