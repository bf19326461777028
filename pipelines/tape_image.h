// Images on a tape and in memory.
#pragma once

#include <algorithm>

#include "autodiff/tape.h"
#include "core/image.h"

namespace hsi4d {

/// Writes an image into a leaf [C,H,W] of its size. Throws InternalError for another.
template <class S>
void write_image(Var<S> leaf, const Image& image) {
  const Array<S> array = leaf.owner().write(leaf);
  HSI4D_CHECK_EQ(array.shape.planes, static_cast<Index>(image.channels()));
  HSI4D_CHECK_EQ(array.shape.rows, static_cast<Index>(image.height()));
  HSI4D_CHECK_EQ(array.shape.cols, static_cast<Index>(image.width()));
  for (int c = 0; c < image.channels(); ++c) {
    for (int y = 0; y < image.height(); ++y) {
      std::copy_n(image.row(c, y), image.width(), array.row(c * array.shape.rows + y));
    }
  }
}

/// Fills a leaf with one number.
template <class S>
void fill(Var<S> leaf, S number) {
  const Array<S> array = leaf.owner().write(leaf);
  for (Index r = 0; r < array.total_rows(); ++r) std::fill_n(array.row(r), array.shape.cols, number);
}

/// Planes [first, first + count) of an array of images, held in [0, 1].
template <class S>
Image held_image(const ConstArray<S>& values, int first, int count) {
  Image image(count, static_cast<int>(values.shape.rows), static_cast<int>(values.shape.cols));
  for (int c = 0; c < count; ++c) {
    for (int y = 0; y < image.height(); ++y) {
      for (int x = 0; x < image.width(); ++x)
        image(c, y, x) = std::clamp(static_cast<float>(values(first + c, y, x)), 0.0F, 1.0F);
    }
  }
  return image;
}

}  // namespace hsi4d
