// Squares of pixels of an image, so that one operator can tell another where work is left to do.
#pragma once

#include <algorithm>
#include <cstdint>

#include "autodiff/array.h"
#include "core/buffer.h"

namespace hsi4d {

/// Side of the squares in pixels.
inline constexpr Index kMaskSquare = 16;

/// Squares that `pixels` take.
constexpr Index mask_squares(Index pixels) { return (pixels + kMaskSquare - 1) / kMaskSquare; }

/// A set of squares, the same in all planes of an image.
class TileMask {
 public:
  /// The empty set, of an image of that size.
  void clear(Index height, Index width) {
    rows_ = mask_squares(height);
    cols_ = mask_squares(width);
    marks_.resize(rows_ * cols_);
    std::fill_n(marks_.data(), marks_.size(), std::uint8_t(0));
  }
  void add(Index row, Index col) { marks_[row * cols_ + col] = 1; }
  bool has(Index row, Index col) const { return marks_[row * cols_ + col] != 0; }
  Index rows() const { return rows_; }
  Index cols() const { return cols_; }
  Index count() const { return std::count(marks_.data(), marks_.data() + marks_.size(), std::uint8_t(1)); }
  Index capacity_bytes() const { return marks_.capacity_bytes(); }

 private:
  Index rows_ = 0, cols_ = 0;
  Buffer<std::uint8_t> marks_;
};

}  // namespace hsi4d
