#include "autodiff/blocks.h"

namespace hsi4d {

namespace {

Index common(Index a, Index b, const Shape& left, const Shape& right) {
  if (a == b || b == 1) return a;
  if (a == 1) return b;
  throw InternalError("shapes do not fit: " + detail::both_values(left, right));
}

}  // namespace

Shape broadcast_shape(const Shape& a, const Shape& b) {
  Shape shape{common(a.planes, b.planes, a, b), common(a.rows, b.rows, a, b), common(a.cols, b.cols, a, b), 0};
  shape.stride = shape.cols == a.cols ? a.stride : shape.cols == b.cols ? b.stride : shape.cols;
  return shape;
}

}  // namespace hsi4d
