// A signed distance on a grid that is sampled where it is asked for, and its values at points of the tape.
//
// Space is cut into blocks of kBlockCells³ cells. A block is sampled at its nodes when a point first comes into it, and
// kept: over iterations, frames and stages. Where the distance at a block's centre says that no node of it can be
// nearer than `reach`, it takes no memory. Between nodes the distance is interpolated trilinearly:
//
//   d(x) = Σ_c w_c(x) d_c,   w_c = Π_i (c_i ? t_i : 1 − t_i),   t the place in the cell, 0 to 1
//
// What is sampled is a function of the place alone, so results do not depend on the order in which blocks come, on
// other users of the grid, or on threads.
#pragma once

#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <unordered_map>
#include <vector>

#include "autodiff/tape.h"
#include "core/linear.h"

namespace hsi4d {

inline constexpr Index kBlockCells = 8;

/// What is returned far from a surface and where nothing is known, metres: free space.
inline constexpr double kFarDistance = 1e3;

/// A value with its derivatives.
struct DistanceSample {
  double distance = kFarDistance;                      ///< metres
  Vector3<double> gradient = Vector3<double>::Zero();  ///< by the place
};

class DistanceGrid {
 public:
  /// The nodes of a block, x fastest; none: all is free.
  struct Block {
    std::vector<float> nodes;
  };
  /// Metres, NaN where it is not known. Above 0 it is no more than the distance to the nearest surface.
  using Distance = std::function<double(const Vector3<double>&)>;

  struct Settings {
    double cell = 0.02;  ///< metres
    double reach = 0;    ///< distances beyond this need not be told, metres
    Index most_bytes = Index{256} << 20U;
    std::string name;  ///< what messages call it
  };

  /// Samples nothing. @param distance  by several threads at once
  DistanceGrid(Distance distance, Settings settings);

  /// The number of a place's block; kNoBlock for one that is not finite, or beyond about 10⁵ blocks.
  std::int64_t block_number(const Vector3<double>& place) const;
  static constexpr std::int64_t kNoBlock = -1;

  /// The blocks of these numbers (null for kNoBlock); missing ones are sampled. By several threads at once.
  /// Throws UserError when the blocks would take more memory than the settings allow.
  void find(std::span<const std::int64_t> numbers, std::span<const Block*> found);

  /// Interpolates. Free where the block is null or one of the cell's nodes is not known.
  DistanceSample at(const Vector3<double>& place, const Block* block) const;
  /// As above; samples what is missing.
  DistanceSample at(const Vector3<double>& place);

  /// The cell of a place within its block, a number a cell.
  std::uint64_t cell_in_block(const Vector3<double>& place) const;

  /// Bytes of all blocks so far.
  Index memory_bytes() const;
  /// Blocks that were sampled at every node, and all that were looked at.
  Index sampled_blocks() const;
  Index blocks() const;

 private:
  Block sampled(std::int64_t number) const;

  Distance distance_;
  Settings settings_;
  mutable std::mutex mutex_;
  std::unordered_map<std::int64_t, std::unique_ptr<const Block>> blocks_;  // addresses stay
  Index bytes_ = 0, sampled_ = 0;
};

/// Signed distances of points.
///
///   y_p = d(x_p)   of the grid; kFarDistance far from surfaces and where nothing is known
///
/// @param points  [P,3] metres, world
/// @return        [P,1] metres; NaN for a point that is not finite
/// Adjoint: points, by the slope within each cell; none where the result is kFarDistance.
/// Throws, when run, as DistanceGrid::find.
template <class S>
Var<S> sampled_distance(Var<S> points, std::shared_ptr<DistanceGrid> grid, Source where = Source::current());

extern template Var<float> sampled_distance(Var<float>, std::shared_ptr<DistanceGrid>, Source);
extern template Var<double> sampled_distance(Var<double>, std::shared_ptr<DistanceGrid>, Source);

}  // namespace hsi4d
