// Images on a tape and in memory.
#pragma once

#include <algorithm>
#include <vector>

#include "autodiff/tape.h"
#include "core/image.h"

namespace hsi4d {

/// Writes an image into planes of an array [C,H,W] from plane `first` on. Throws InternalError where it does not fit.
template <class S>
void write_planes(const Array<S>& array, Index first, const Image& image) {
  HSI4D_CHECK(first + static_cast<Index>(image.channels()) <= array.shape.planes, "more channels than planes");
  HSI4D_CHECK_EQ(array.shape.rows, static_cast<Index>(image.height()));
  HSI4D_CHECK_EQ(array.shape.cols, static_cast<Index>(image.width()));
  for (int c = 0; c < image.channels(); ++c) {
    for (int y = 0; y < image.height(); ++y) {
      std::copy_n(image.row(c, y), image.width(), array.row((first + c) * array.shape.rows + y));
    }
  }
}

/// Writes an image into a leaf [C,H,W] of its size. Throws InternalError for another.
template <class S>
void write_image(Var<S> leaf, const Image& image) {
  const Array<S> array = leaf.owner().write(leaf);
  HSI4D_CHECK_EQ(array.shape.planes, static_cast<Index>(image.channels()));
  write_planes(array, 0, image);
}

/// Writes images of one channel into the planes of a leaf [C,H,W]. Throws InternalError for another number or size.
template <class S>
void write_images(Var<S> leaf, const std::vector<const Image*>& images) {
  const Array<S> array = leaf.owner().write(leaf);
  HSI4D_CHECK_EQ(array.shape.planes, std::ssize(images));
  for (Index i = 0; i < std::ssize(images); ++i) write_planes(array, i, *images[static_cast<std::size_t>(i)]);
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
