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

/// Columns [begin, end) of an image.
struct PixelRun {
  Index begin, end;
};

/// Runs of neighbouring squares of a row of squares, as columns of pixels.
///
/// @param mask  null: all of them
template <class Body>
void for_runs(const TileMask* mask, Index square_row, Index cols, const Body& body) {
  if (mask == nullptr) return body(PixelRun{0, cols});
  const Index squares = mask->cols();
  for (Index c = 0; c < squares; ++c) {
    if (!mask->has(square_row, c)) continue;
    const Index first = c;
    while (c < squares && mask->has(square_row, c)) ++c;
    body(PixelRun{first * kMaskSquare, std::min(c * kMaskSquare, cols)});
  }
}

/// Squares in which some number of an image of weights is not 0.
template <class S>
class WeighedSquares {
 public:
  /// @param version  of the weights: they are looked at again where it is another
  const TileMask& of(const ConstArray<S>& weight, std::uint64_t version) {
    if (version == version_) return squares_;
    version_ = version;
    squares_.clear(weight.shape.rows, weight.shape.cols);
    for (Index r = 0; r < weight.total_rows(); ++r) {
      for (Index c = 0; c < weight.shape.cols; ++c) {
        if (weight.row(r)[c] != S(0)) squares_.add(r % weight.shape.rows / kMaskSquare, c / kMaskSquare);
      }
    }
    return squares_;
  }
  Index capacity_bytes() const { return squares_.capacity_bytes(); }

 private:
  TileMask squares_;
  std::uint64_t version_ = 0;
};

}  // namespace hsi4d
