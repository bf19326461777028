// Walk over one to many arrays of equal or broadcast shape in short blocks, the common ground of elementwise operators.
//
// A block is up to kBlock numbers of every operand, contiguous in memory: an operand that is broadcast along columns is
// spread into a small buffer first. Loops over a block are plain counted loops, which the compiler turns into vector
// code. The walk is cut into units for parallel loops: single numbers where all operands are dense, else rows (each
// with all its planes), so that an operand that is broadcast over planes is touched by one chunk only.
#pragma once

#include <algorithm>
#include <array>

#include "autodiff/array.h"
#include "core/check.h"
#include "core/parallel.h"

namespace hsi4d {

/// Numbers of one block.
inline constexpr Index kBlock = 512;
/// Numbers of one parallel chunk, at least.
inline constexpr Index kChunkNumbers = 16384;

/// Shape of `a` combined with `b`: each of planes, rows, columns equal, or 1 in one of them. Where sizes are equal the
/// padding of `a` is kept. Throws InternalError naming both shapes when they do not fit.
Shape broadcast_shape(const Shape& a, const Shape& b);

template <class S, std::size_t K>
struct Block {
  Index n = 0;                  ///< numbers in this block
  Index out = 0;                ///< offset of the first in the output
  std::array<Index, K> in{};    ///< offset of the first in each operand
  std::array<const S*, K> x{};  ///< the numbers of each operand
};

/// The walk over K operands that are broadcast to `out`.
template <class S, std::size_t K>
class BlockWalk {
 public:
  BlockWalk(const Shape& out, const std::array<ConstArray<S>, K>& in) : out_(out), in_(in) {
    flat_ = out.dense();
    for (std::size_t k = 0; k < K; ++k) {
      const Shape& s = in[k].shape;
      column_step_[k] = s.cols == 1 && out.cols != 1 ? 0 : 1;
      row_step_[k] = s.rows == 1 && out.rows != 1 ? 0 : s.stride;
      plane_step_[k] = s.planes == 1 && out.planes != 1 ? 0 : s.rows * s.stride;
      scalar_[k] = s.is_scalar();
      flat_ = flat_ && (scalar_[k] || (s.same_size(out) && s.dense()));
    }
  }

  /// True when operand k is one number for many of the output's.
  bool broadcast(std::size_t k) const { return !in_[k].shape.same_size(out_); }
  /// True when different units of the walk meet the same number of operand k.
  bool shared_by_units(std::size_t k) const {
    return broadcast(k) && (flat_ || (in_[k].shape.rows == 1 && out_.rows != 1));
  }
  Index column_step(std::size_t k) const { return flat_ ? (scalar_[k] && out_.count() != 1 ? 0 : 1) : column_step_[k]; }

  /// Numbers of the output that one unit of the walk covers.
  Index numbers_per_unit() const { return flat_ ? 1 : out_.planes * out_.cols; }
  /// How the walk is cut for parallel loops.
  Partition partition() const {
    if (flat_) return {out_.count(), kChunkNumbers};
    return {out_.rows, std::max<Index>(1, kChunkNumbers / std::max<Index>(1, out_.cols * out_.planes))};
  }

  /// Calls body(const Block<S, K>&) for the units [begin, end), in order.
  template <class F>
  void run(Index begin, Index end, F&& body) const {
    alignas(kAlignment) S spread[K][kBlock];
    Block<S, K> block;
    if (flat_) {
      run_line(begin, begin, end - begin, spread, block, body);
      return;
    }
    for (Index r = begin; r < end; ++r) {
      for (Index p = 0; p < out_.planes; ++p) {
        for (std::size_t k = 0; k < K; ++k) block.in[k] = p * plane_step_[k] + r * row_step_[k];
        run_line((p * out_.rows + r) * out_.stride, 0, out_.cols, spread, block, body);
      }
    }
  }

 private:
  /// One contiguous line of the output; block.in holds the operands' line starts (dense walks set them here).
  template <class F>
  void run_line(Index out, Index flat_start, Index n, S (&spread)[K][kBlock], Block<S, K>& block, F&& body) const {
    std::array<Index, K> step;
    for (std::size_t k = 0; k < K; ++k) {
      step[k] = column_step(k);
      if (flat_) block.in[k] = step[k] * flat_start;
      block.x[k] = in_[k].data + block.in[k];
      if (step[k] != 0) continue;
      const S value = *block.x[k];
      for (Index i = 0; i < std::min(n, kBlock); ++i) spread[k][i] = value;
      block.x[k] = spread[k];
    }
    for (Index done = 0; done < n; done += kBlock) {
      block.n = std::min(kBlock, n - done);
      block.out = out + done;
      body(static_cast<const Block<S, K>&>(block));
      for (std::size_t k = 0; k < K; ++k) {
        block.x[k] += step[k] * kBlock;
        block.in[k] += step[k] * kBlock;
      }
    }
  }

  Shape out_;
  std::array<ConstArray<S>, K> in_;
  std::array<Index, K> plane_step_, row_step_, column_step_;
  std::array<bool, K> scalar_;
  bool flat_ = true;
};

}  // namespace hsi4d
