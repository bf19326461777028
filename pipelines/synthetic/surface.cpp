#include "pipelines/synthetic/surface.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "core/angles.h"
#include "core/check.h"
#include "core/quaternion.h"
#include "core/random.h"
#include "core/rotation.h"
#include "splat/render/sh.h"

namespace hsi4d {
namespace {

/// Standard deviation of a disc in cells: where four cells meet, 2 to 3 % of what is behind shows through.
constexpr double kOverlap = 0.66;

/// Half the thickness of a disc, in parts of the smaller of its widths.
constexpr double kFlatness = 0.05;

constexpr double kOpacityLogit = 5;

/// How much deeper the solids of boxes without a bottom go, metres: these stand on something.
constexpr double kBuried = 0.02;

/// Towards where the baked highlights come from.
const Vector3<double> kHighlight = Vector3<double>(-0.35, -0.55, 0.76).normalized();

/// Value of the first spherical harmonics, as the renderer has them.
constexpr double kShBand0 = kShC0, kShBand1 = 0.4886025119029199;

/// Lengths of a sheet along u and v, metres: means of a few lines across it.
Vector2<double> lengths_of(const Sheet& sheet) {
  constexpr int kLines = 5, kSteps = 16;
  double u_length = 0, v_length = 0;
  for (int line = 0; line < kLines; ++line) {
    const double across = (line + 0.5) / kLines;
    for (int step = 0; step < kSteps; ++step) {
      const double a = double(step) / kSteps, b = double(step + 1) / kSteps;
      u_length += (sheet.point(b, across) - sheet.point(a, across)).norm();
      v_length += (sheet.point(across, b) - sheet.point(across, a)).norm();
    }
  }
  return {u_length / kLines, v_length / kLines};
}

struct Cells {
  Index along_u, along_v;
};

Cells cells_of(const Vector2<double>& lengths, double cell) {
  const auto count = [cell](double length) { return std::max<Index>(1, static_cast<Index>(length / cell + 0.5)); };
  return {count(lengths[0]), count(lengths[1])};
}

/// Calls visit(u, v) at the centre of every cell that is kept.
void for_cells(const Sheet& sheet, const Cells& cells, FunctionRef<void(double, double)> visit) {
  for (Index j = 0; j < cells.along_v; ++j)
    for (Index i = 0; i < cells.along_u; ++i) {
      const double u = (double(i) + 0.5) / double(cells.along_u), v = (double(j) + 0.5) / double(cells.along_v);
      if (!sheet.keep || sheet.keep(sheet.point(u, v))) visit(u, v);
    }
}

Index kept_cells(const Sheet& sheet, const Cells& cells) {
  if (!sheet.keep) return cells.along_u * cells.along_v;
  Index count = 0;
  for_cells(sheet, cells, [&](double, double) { ++count; });
  return count;
}

/// ∂p/∂u or ∂p/∂v by a central difference that stays inside of the sheet.
Vector3<double> tangent(const SheetShape& point, double u, double v, bool along_u) {
  constexpr double kStep = 1e-3;
  const double x = along_u ? u : v;
  const double a = std::max(0.0, x - kStep), b = std::min(1.0, x + kStep);
  const Vector3<double> difference = along_u ? point(b, v) - point(a, v) : point(u, b) - point(u, a);
  return difference / (b - a);
}

void add_number(std::vector<float>& values, double x) { values.push_back(static_cast<float>(x)); }

/// The coefficients of degree 1 that make the colour vary by `gloss` as the view turns to where the light is mirrored.
void add_highlight(std::vector<float>& sh, const Vector3<double>& normal, double gloss) {
  const Vector3<double> mirrored = 2 * dot(normal, kHighlight) * normal - kHighlight;
  const Vector3<double> peak = -mirrored;  // the direction from the camera to the surface that looks into the light
  for (const double x : {-peak[1], peak[2], -peak[0]})
    for (int c = 0; c < 3; ++c) add_number(sh, gloss * x / kShBand1);
}

/// One disc at (u, v) of a sheet.
void add_disc(Gaussians& out, const Sheet& sheet, const Cells& cells, double u, double v, const Light& light,
              double grain) {
  const Vector3<double> p = sheet.point(u, v);
  const Vector3<double> along_u = tangent(sheet.point, u, v, true), along_v = tangent(sheet.point, u, v, false);
  Vector3<double> normal = cross(along_u, along_v);
  normal = normal.norm() > 1e-12 ? normal.normalized() : Vector3<double>::UnitZ();
  Matrix3<double> axes;
  axes.col(2) = normal;
  const bool u_first = along_u.norm() > 1e-9;
  const Vector3<double> first = u_first ? along_u.normalized() : along_v.normalized();
  const Vector3<double> side = u_first ? first : cross(first, normal);
  axes.col(0) = side;
  axes.col(1) = cross(normal, side);
  const double width = std::max(1e-4, kOverlap * along_u.norm() / double(cells.along_u));
  const double height = std::max(1e-4, kOverlap * along_v.norm() / double(cells.along_v));
  const Vector4<double> q = quaternion_from_matrix(axes);
  for (int i = 0; i < 3; ++i) add_number(out.means, p[i]);
  for (int i = 0; i < 4; ++i) add_number(out.quats, q[i]);
  for (const double s : {width, height, kFlatness * std::min(width, height)}) add_number(out.log_scales, std::log(s));
  add_number(out.opacity_logits, kOpacityLogit);
  const Rgb color = sheet.color(u, v) * (light(p, normal) * (1 + grain));
  for (int c = 0; c < 3; ++c) add_number(out.sh, (std::clamp(color[c], 0.0, 1.0) - 0.5) / kShBand0);
  add_highlight(out.sh, normal, sheet.gloss);
}

double smoothed(double x) { return x * x * (3 - 2 * x); }

}  // namespace

SmoothNoise::SmoothNoise(std::uint64_t seed, std::string_view stream) : seed_(seed), stream_(random_stream(stream)) {}

double SmoothNoise::at(const Vector3<double>& point) const {
  const Random random(seed_, stream_);
  std::array<std::int64_t, 3> low;
  std::array<double, 3> part;
  for (std::size_t i = 0; i < 3; ++i) {
    const double floor = std::floor(point[Eigen::Index(i)]);
    low[i] = static_cast<std::int64_t>(floor);
    part[i] = smoothed(point[Eigen::Index(i)] - floor);
  }
  double sum = 0;
  for (int corner = 0; corner < 8; ++corner) {
    std::uint64_t index = 0;
    double weight = 1;
    for (std::size_t i = 0; i < 3; ++i) {
      const int bit = corner >> i & 1;
      index = index << 21U | (static_cast<std::uint64_t>(low[i] + bit) & 0x1FFFFFU);
      weight *= bit != 0 ? part[i] : 1 - part[i];
    }
    sum += weight * (2 * random.uniform(index) - 1);
  }
  return sum;
}

void SurfaceModel::add_rectangle(const Vector3<double>& corner, const Vector3<double>& edge_u,
                                 const Vector3<double>& edge_v, Paint color, double detail, double gloss) {
  add({[=](double u, double v) { return Vector3<double>(corner + u * edge_u + v * edge_v); }, std::move(color), detail,
       gloss});
}

void SurfaceModel::add_box(const Vector3<double>& center, const Vector3<double>& half, double turn,
                           const std::function<Paint(int face)>& paint, double detail, double gloss, bool with_bottom) {
  const Matrix3<double> axes = so3_exp(Vector3<double>(0, 0, turn));
  const Vector3<double> x = axes.col(0) * half[0], y = axes.col(1) * half[1], z = axes.col(2) * half[2];
  add_rectangle(center - x + y - z, -2 * y, 2 * z, paint(0), detail, gloss);
  add_rectangle(center + x - y - z, 2 * y, 2 * z, paint(1), detail, gloss);
  add_rectangle(center - x - y - z, 2 * x, 2 * z, paint(2), detail, gloss);
  add_rectangle(center + x + y - z, -2 * x, 2 * z, paint(3), detail, gloss);
  if (with_bottom) add_rectangle(center - x + y - z, 2 * x, -2 * y, paint(4), detail, gloss);
  add_rectangle(center - x - y + z, 2 * x, 2 * y, paint(5), detail, gloss);
  Matrix3<double> half_axes;
  half_axes << x, y, z;
  add_solid(center, half_axes, with_bottom ? 0 : kBuried);
}

void SurfaceModel::add_solid(const Vector3<double>& center, const Matrix3<double>& half_axes, double deeper) {
  const auto first = static_cast<std::int32_t>(boxes_.vertices.size());
  for (int corner = 0; corner < 8; ++corner) {
    const Vector3<double> signs((corner & 1) != 0 ? 1 : -1, (corner & 2) != 0 ? 1 : -1, (corner & 4) != 0 ? 1 : -1);
    boxes_.vertices.emplace_back(center + half_axes * signs - Vector3<double>(0, 0, signs[2] < 0 ? deeper : 0));
  }
  for (const std::array<int, 4>& side : std::array<std::array<int, 4>, 6>{
           {{0, 2, 3, 1}, {4, 5, 7, 6}, {0, 1, 5, 4}, {2, 6, 7, 3}, {0, 4, 6, 2}, {1, 3, 7, 5}}}) {
    std::array<std::int32_t, 4> corners{};
    for (std::size_t i = 0; i < 4; ++i) corners[i] = first + side[i];
    detail::add_polygon(corners, boxes_);
  }
}

void SurfaceModel::add_revolution(const Vector3<double>& base, const std::function<Vector2<double>(double v)>& profile,
                                  Paint color, double detail, double gloss) {
  add({[=](double u, double v) {
         const Vector2<double> rz = profile(v);
         return Vector3<double>(base +
                                Vector3<double>(rz[0] * std::cos(2 * kPi * u), rz[0] * std::sin(2 * kPi * u), rz[1]));
       },
       std::move(color), detail, gloss});
}

void SurfaceModel::add_tube(const std::function<Vector3<double>(double v)>& curve,
                            const std::function<double(double v)>& radius, Paint color, double detail, double gloss) {
  // one side direction for the whole tube: the normal of the plane that it bends in
  const Vector3<double> chord = curve(1) - curve(0), bow = curve(0.5) - curve(0);
  Vector3<double> across = cross(chord, bow);
  const bool is_upright = std::abs(chord.z()) > 0.9 * chord.norm();
  if (across.norm() < 1e-9) across = cross(chord, Vector3<double>(is_upright ? 1 : 0, 0, is_upright ? 0 : 1));
  across.normalize();
  add({[=](double u, double v) {
         constexpr double kStep = 1e-3;
         const double a = std::max(0.0, v - kStep), b = std::min(1.0, v + kStep);
         const Vector3<double> along = (curve(b) - curve(a)).normalized();
         const Vector3<double> first = (across - along * dot(across, along)).normalized();
         const Vector3<double> second = cross(along, first);
         const double angle = 2 * kPi * u, r = radius(v);
         return Vector3<double>(curve(v) + r * std::cos(angle) * first + r * std::sin(angle) * second);
       },
       std::move(color), detail, gloss});
}

Gaussians SurfaceModel::covered(Index most, const Light& light, std::uint64_t seed) const {
  HSI4D_CHECK(most >= sheets(), "a sheet needs a Gaussian at least");
  std::vector<Vector2<double>> lengths;
  lengths.reserve(sheets_.size());
  for (const Sheet& sheet : sheets_) lengths.push_back(lengths_of(sheet) * std::sqrt(sheet.detail));
  const auto count = [&](double cell) {
    Index total = 0;
    for (std::size_t s = 0; s < sheets_.size() && total <= most; ++s)
      total += kept_cells(sheets_[s], cells_of(lengths[s], cell));
    return total;
  };
  double fine = 1e-4, coarse = 1e2;  // the count falls as the cell grows
  for (int step = 0; step < 40; ++step) {
    const double middle = std::sqrt(fine * coarse);
    (count(middle) > most ? fine : coarse) = middle;
  }
  Gaussians out;
  out.sh_degree = 1;
  const SmoothNoise grain(seed, "synthetic.grain");
  for (std::size_t s = 0; s < sheets_.size(); ++s) {
    const Cells cells = cells_of(lengths[s], coarse);
    for_cells(sheets_[s], cells, [&](double u, double v) {
      add_disc(out, sheets_[s], cells, u, v, light, 0.03 * grain.at(sheets_[s].point(u, v) * 60));
    });
  }
  return out;
}

}  // namespace hsi4d
