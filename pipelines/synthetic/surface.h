// Surfaces covered with flat Gaussians: what the synthetic room and its object are made of.
#pragma once

#include <cstdint>
#include <functional>
#include <string_view>
#include <vector>

#include "core/linear.h"
#include "core/types.h"
#include "optim/solid/mesh_file.h"
#include "splat/gaussians.h"

namespace hsi4d {

/// A colour as it is displayed: red, green, blue in [0, 1].
using Rgb = Vector3<double>;

/// The colour of a sheet at (u, v), before light falls on it.
using Paint = std::function<Rgb(double u, double v)>;

/// Point of a sheet at (u, v) in [0, 1]², metres. The outer side is that of ∂p/∂u × ∂p/∂v.
using SheetShape = std::function<Vector3<double>(double u, double v)>;

/// A piece of surface.
struct Sheet {
  SheetShape point;
  Paint color;
  double detail = 1;  ///< Gaussians per area, relative to other sheets
  double gloss = 0;   ///< how much the colour varies with the direction of view, 0 to about 0.2
  std::function<bool(const Vector3<double>& point)> keep = {};  ///< no Gaussian where it says no; empty: all
};

/// How much light reaches a point of a surface: factor of its colour.
using Light = std::function<double(const Vector3<double>& point, const Vector3<double>& normal)>;

/// Smooth noise in [-1, 1] with features of about one unit, a function of seed, stream and point.
class SmoothNoise {
 public:
  SmoothNoise(std::uint64_t seed, std::string_view stream);
  double at(const Vector3<double>& point) const;

 private:
  std::uint64_t seed_, stream_;
};

/// Collects sheets and covers them with Gaussians.
class SurfaceModel {
 public:
  void add(Sheet sheet) { sheets_.push_back(std::move(sheet)); }

  /// A parallelogram; u runs along edge_u, v along edge_v; the outer side is that of edge_u × edge_v.
  void add_rectangle(const Vector3<double>& corner, const Vector3<double>& edge_u, const Vector3<double>& edge_v,
                     Paint color, double detail = 1, double gloss = 0);

  /// A box given by its centre, half of its edges and a turn about z. The bottom is left out unless asked for.
  /// @param paint  makes the colour of a face: 0 -x, 1 +x, 2 -y, 3 +y, 4 bottom, 5 top; on the sides u runs along the
  /// ground and v upwards
  void add_box(const Vector3<double>& center, const Vector3<double>& half, double turn,
               const std::function<Paint(int face)>& paint, double detail = 1, double gloss = 0,
               bool with_bottom = false);

  /// The surface swept by a profile (radius and height as functions of v) around the z axis through `base`; u runs
  /// around.
  void add_revolution(const Vector3<double>& base, const std::function<Vector2<double>(double v)>& profile, Paint color,
                      double detail = 1, double gloss = 0);

  /// A tube around a curve, of a radius that may change along it; u runs around, v along the curve.
  void add_tube(const std::function<Vector3<double>(double v)>& curve, const std::function<double(double v)>& radius,
                Paint color, double detail = 1, double gloss = 0);

  /// The boxes that were added, closed, each a piece of its own; those without a bottom go kBuried deeper.
  const TriangleMesh& boxes() const { return boxes_; }

  Index sheets() const { return static_cast<Index>(sheets_.size()); }

  /// Covers every sheet with a grid of flat discs aligned with (u, v), wide enough to leave no holes. Cells are square
  /// where a sheet is wider than a cell, and of the sheet's own width where it is narrow, so that edges between sheets
  /// stay sharp with few Gaussians.
  ///
  /// @param most  the number of Gaussians: as near to it as whole cells allow, never more
  /// @return      spherical harmonics of degree 1 (zero where a sheet has no gloss), means in world coordinates
  /// Throws InternalError if `most` is smaller than the number of sheets.
  Gaussians covered(Index most, const Light& light, std::uint64_t seed) const;

 private:
  void add_solid(const Vector3<double>& center, const Matrix3<double>& half_axes, double deeper);

  std::vector<Sheet> sheets_;
  TriangleMesh boxes_;
};

}  // namespace hsi4d
