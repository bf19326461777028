// Shapes, and views of the tape's arrays.
#pragma once

#include <array>
#include <ostream>
#include <type_traits>

#include "core/types.h"

namespace hsi4d {

/// Shape of an array: `planes` × `rows` × `cols` numbers, row-major, rows `stride` numbers apart, planes following each
/// other.
///
/// A plain array such as points [N,3] has one plane, N rows and stride = cols = 3. Transforms [J,3,4] are J rows of 12.
/// An image [C,H,W] has C planes, H rows, W columns and a padded stride (see image_shape).
struct Shape {
  Index planes = 1;
  Index rows = 1;
  Index cols = 1;
  Index stride = 1;

  /// Numbers that the array holds, padding not counted.
  Index count() const { return planes * rows * cols; }
  /// Numbers of memory, padding included.
  Index memory() const { return planes * rows * stride; }
  /// True when there is no padding.
  bool dense() const { return stride == cols; }
  bool is_scalar() const { return count() == 1; }
  /// Same planes, rows and columns; the padding may differ.
  bool same_size(const Shape& other) const {
    return planes == other.planes && rows == other.rows && cols == other.cols;
  }
  bool operator==(const Shape&) const = default;
};

/// "[planes,rows,cols]", or "[rows,cols]" for one plane.
std::ostream& operator<<(std::ostream& stream, const Shape& shape);

/// Shape of a plain array [rows, cols].
constexpr Shape shape_of(Index rows, Index cols) { return {1, rows, cols, cols}; }

/// Shape of an image [channels, height, width] with padded rows.
template <class S>
constexpr Shape image_shape(Index channels, Index height, Index width) {
  return {channels, height, width, padded_row<S>(width)};
}

/// One number.
inline constexpr Shape kScalarShape = {1, 1, 1, 1};

/// Non-owning view of an array; S is const where it must not be written.
template <class S>
struct Array {
  S* data = nullptr;
  Shape shape;

  S& operator()(Index row, Index col) const { return data[row * shape.stride + col]; }
  S& operator()(Index plane, Index row, Index col) const {
    return data[(plane * shape.rows + row) * shape.stride + col];
  }
  /// First number of `row`, rows counted through all planes.
  S* row(Index row) const { return data + row * shape.stride; }
  /// Rows of all planes.
  Index total_rows() const { return shape.planes * shape.rows; }
  /// The only number of a scalar array.
  S& scalar() const { return *data; }
  explicit operator bool() const { return data != nullptr; }
  operator Array<const S>() const  // NOLINT(google-explicit-constructor): as T* becomes const T*
      requires(!std::is_const_v<S>) {
    return {data, shape};
  }
};

template <class S>
using ConstArray = Array<const S>;

}  // namespace hsi4d
