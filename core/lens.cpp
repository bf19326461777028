#include "core/lens.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/check.h"
#include "core/parallel.h"

namespace hsi4d {

namespace {

/// Whether a place lies between the centres of the outermost of `size` pixels, with room for rounding.
bool is_between_centres(double place, int size) {
  constexpr double kRoom = 1e-6;
  return place >= 0.5 - kRoom && place <= size - 0.5 + kRoom;
}

/// The image between its pixels, at (u, v) in pixels, which lies between the centres of the outermost ones.
void sample(const Image& image, double u, double v, int row, int col, Image& out) {
  const double x = std::clamp(u - 0.5, 0.0, image.width() - 1.0), y = std::clamp(v - 0.5, 0.0, image.height() - 1.0);
  const int left = std::min(static_cast<int>(x), std::max(image.width() - 2, 0));
  const int top = std::min(static_cast<int>(y), std::max(image.height() - 2, 0));
  const int right = std::min(left + 1, image.width() - 1), bottom = std::min(top + 1, image.height() - 1);
  const auto a = static_cast<float>(x - left), b = static_cast<float>(y - top);
  for (int c = 0; c < image.channels(); ++c) {
    const float above = (1 - a) * image(c, top, left) + a * image(c, top, right);
    const float below = (1 - a) * image(c, bottom, left) + a * image(c, bottom, right);
    out(c, row, col) = (1 - b) * above + b * below;
  }
}

}  // namespace

Vector2<double> bent_by(const Lens& lens, const Vector2<double>& point) {
  const double x = point[0], y = point[1], r2 = x * x + y * y;
  const double s = 1 + r2 * (lens.k1 + r2 * (lens.k2 + r2 * lens.k3));
  return {x * s + 2 * lens.p1 * x * y + lens.p2 * (r2 + 2 * x * x),
          y * s + lens.p1 * (r2 + 2 * y * y) + 2 * lens.p2 * x * y};
}

namespace {

/// One step of Newton's method; the derivative is symmetric.
Vector2<double> newton_step(const Lens& lens, const Vector2<double>& point, const Vector2<double>& miss) {
  const double x = point[0], y = point[1], q = x * x + y * y;
  const double s = 1 + q * (lens.k1 + q * (lens.k2 + q * lens.k3));
  const double ds = lens.k1 + q * (2 * lens.k2 + 3 * q * lens.k3);  // ds/dq, and dq = 2 (x dx + y dy)
  const double xx = s + 2 * x * x * ds + 2 * lens.p1 * y + 6 * lens.p2 * x;
  const double xy = 2 * x * y * ds + 2 * lens.p1 * x + 2 * lens.p2 * y;
  const double yy = s + 2 * y * y * ds + 6 * lens.p1 * y + 2 * lens.p2 * x;
  return Vector2<double>(yy * miss[0] - xy * miss[1], xx * miss[1] - xy * miss[0]) / (xx * yy - xy * xy);
}

}  // namespace

/// Newton's method; a step that leads away is halved.
Vector2<double> straight_of(const Lens& lens, const Vector2<double>& bent) {
  constexpr int kMostSteps = 40, kMostHalvings = 10;
  Vector2<double> point = bent;
  for (int i = 0; i < kMostSteps; ++i) {
    const Vector2<double> miss = bent_by(lens, point) - bent;
    Vector2<double> step = newton_step(lens, point, miss);
    const auto is_nearer = [&] { return (bent_by(lens, point - step) - bent).norm() < miss.norm(); };
    for (int half = 0; half < kMostHalvings && !is_nearer(); ++half) step /= 2;
    if (!is_nearer()) break;
    point -= step;
  }
  return point;
}

double valid_radius_squared(const Lens& lens) {
  // d(r s)/dr = 1 + 3 k1 q + 5 k2 q² + 7 k3 q³ with q = r²: looked for in steps finer than a picture's pixels, up to
  // half angles of 84 degrees.
  constexpr double kWidest = 100;
  constexpr int kSteps = 20000;
  for (int i = 1; i <= kSteps; ++i) {
    const double r = std::sqrt(kWidest) * i / kSteps, q = r * r;
    if (1 + q * (3 * lens.k1 + q * (5 * lens.k2 + q * 7 * lens.k3)) <= 0) return q;
  }
  return std::numeric_limits<double>::infinity();
}

bool covers_picture(const Lens& lens, const Camera& camera) {
  const double valid = std::sqrt(valid_radius_squared(lens));
  if (!std::isfinite(valid)) return true;
  const Lens radial{.k1 = lens.k1, .k2 = lens.k2, .k3 = lens.k3};
  const double widest = bent_by(radial, {valid, 0})[0];
  const auto is_shown = [&](double from_center, double focal) { return std::abs(from_center) / focal <= widest; };
  return is_shown(camera.cx, camera.fx) && is_shown(camera.width - camera.cx, camera.fx) &&
         is_shown(camera.cy, camera.fy) && is_shown(camera.height - camera.cy, camera.fy);
}

StraightImage straightened(const Image& image, const Camera& camera, const Lens& lens, Sampling sampling) {
  HSI4D_CHECK_EQ(image.width(), camera.width);
  HSI4D_CHECK_EQ(image.height(), camera.height);
  StraightImage result{Image(image.channels(), image.height(), image.width()), Image(1, image.height(), image.width())};
  const double valid = valid_radius_squared(lens);
  parallel_for(image.height(), 16, [&](Index begin, Index end) {
    for (int row = static_cast<int>(begin); row < static_cast<int>(end); ++row) {
      for (int col = 0; col < image.width(); ++col) {
        const Vector2<double> point((col + 0.5 - camera.cx) / camera.fx, (row + 0.5 - camera.cy) / camera.fy);
        if (point.squaredNorm() >= valid) continue;
        const Vector2<double> bent = bent_by(lens, point);
        double u = camera.fx * bent[0] + camera.cx, v = camera.fy * bent[1] + camera.cy;
        if (!is_between_centres(u, image.width()) || !is_between_centres(v, image.height())) continue;
        if (sampling == Sampling::kNearest) u = std::floor(u) + 0.5, v = std::floor(v) + 0.5;
        sample(image, u, v, row, col, result.image);
        result.seen(0, row, col) = 1;
      }
    }
  });
  return result;
}

}  // namespace hsi4d
