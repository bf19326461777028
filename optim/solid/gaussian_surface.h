// The signed distance to what Gaussians show: positive in free space, negative in the solid.
//
// Only opaque, flat Gaussians count: those of scenes that were trained on pictures of surfaces mostly are. Such a one
// is a disc, round or elongated, whose normal is its shortest axis. Which of its sides is free is seen: the first of
// some viewpoints, known to lie in free space, from which the disc is not hidden by others tells it. A disc that none
// of them sees is left out: nothing is known of it.
//
// At a point x let p₀ be the nearest disc, n₀ its normal, and pᵢ those of the kNeighbours nearest whose normals make no
// more than a right angle with n₀. The distance is
//
//   d(x) = Σ wᵢ nᵢ·(x − pᵢ) / Σ wᵢ,    wᵢ = exp(−(|x − pᵢ|² − |x − p₀|²) / 2h²),   h the width of the nearest disc
//
// [implicit moving least squares: Shen, O'Brien and Shewchuk 2004; Kolluri 2008]. Behind a surface nobody has seen
// how thick the solid is. Down to `thickness` it is solid; what is deeper, and what is behind the nearest disc but
// beside it, past the edge of what it belongs to, is unknown.
#pragma once

#include <memory>
#include <vector>

#include "core/linear.h"
#include "splat/gaussians.h"

namespace hsi4d {

/// A Gaussian as a piece of surface.
struct SurfaceDisc {
  Vector3<double> center;  ///< metres, world
  Vector3<double> normal;  ///< of length 1, towards free space once it is known
  double width;            ///< the larger of its standard deviations along the surface, metres
  Vector3<double> along;   ///< of length 1: the direction of that one
  double narrow;           ///< the smaller one, across it, metres
};

/// The opaque and flat Gaussians (opacity of kOpaque at least, shortest axis kFlat of the middle one at most), in their
/// order, each normal as the file has the axis.
std::vector<SurfaceDisc> surface_discs(const Gaussians& gaussians);

/// Discs but those that float alone: at least two others have their centres within kReach widths of a disc's.
std::vector<SurfaceDisc> without_floaters(const std::vector<SurfaceDisc>& discs);

/// At most so many discs, in their order, chosen at random but the same each time (one in every ten of a sorted file
/// would be stripes), and wider by the square root of how many one stands for, so that together they cover what all
/// did.
std::vector<SurfaceDisc> thinned(const std::vector<SurfaceDisc>& discs, std::size_t most);

/// Discs that some viewpoint sees, turned to the side of the first that does. What is farther than 6.4 m along an axis
/// from the viewpoints' middle hides nothing, where the discs reach farther than twice that.
/// @param viewpoints  metres, world
std::vector<SurfaceDisc> facing(const std::vector<SurfaceDisc>& discs, const std::vector<Vector3<double>>& viewpoints);

/// The same, turned to the side that more of the viewpoints see: a ray that slips between two discs of the near side
/// sees the far side's back, which one viewpoint alone would take for its front. Those whose sides are seen by as many
/// are left out.
std::vector<SurfaceDisc> facing_most(const std::vector<SurfaceDisc>& discs,
                                     const std::vector<Vector3<double>>& viewpoints);

/// Where a point is, by the discs.
class GaussianDistance {
 public:
  /// @param discs      turned to free space; at least one, else InternalError
  /// @param thickness  metres
  GaussianDistance(std::vector<SurfaceDisc> discs, double thickness);
  ~GaussianDistance();
  GaussianDistance(const GaussianDistance&) = delete;
  GaussianDistance& operator=(const GaussianDistance&) = delete;

  /// Metres; NaN where it is not known. By several threads at once.
  double at(const Vector3<double>& point) const;

 private:
  struct Tree;
  std::unique_ptr<const Tree> tree_;
  double thickness_;
};

}  // namespace hsi4d
