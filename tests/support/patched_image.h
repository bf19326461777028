// An image of which a square moves, as an operator that tells where.
#pragma once

#include <algorithm>
#include <memory>

#include "autodiff/tape.h"

namespace hsi4d::test {

/// A square of pixels, cut off at the image's border.
struct Patch {
  Index row = 0, col = 0, side = 0;
  bool tells = true;  ///< else all of the image counts as new
};

/// base, and in the patch its half plus x. Adjoint: x alone.
template <class S>
struct PatchedImage {
  static constexpr const char* kName = "patched_image";
  static constexpr bool kPersistentOutputs = true;
  std::shared_ptr<const Patch> patch;
  Patch before = {};
  std::uint64_t base_version = 0;
  TileMask changed = {}, read = {};

  template <class F>
  static void for_pixels(const Shape& shape, const Patch& p, const F& f) {
    for (Index k = 0; k < shape.planes; ++k) {
      for (Index r = p.row; r < std::min(p.row + p.side, shape.rows); ++r) {
        for (Index c = p.col; c < std::min(p.col + p.side, shape.cols); ++c) f(k, r, c);
      }
    }
  }

  void forward(NodeIo<S>& io) {
    const ConstArray<S> base = io.in(0);
    const Array<S> out = io.out();
    const bool is_new = io.version(0) != base_version;
    if (is_new) std::copy_n(base.data, base.shape.memory(), out.data);
    base_version = io.version(0);
    changed.clear(out.shape.rows, out.shape.cols);
    read.clear(out.shape.rows, out.shape.cols);
    for_pixels(out.shape, before, [&](Index k, Index r, Index c) {
      out(k, r, c) = base(k, r, c);
      changed.add(r / kMaskSquare, c / kMaskSquare);
    });
    for_pixels(out.shape, *patch, [&](Index k, Index r, Index c) {
      out(k, r, c) = base(k, r, c) / 2 + io.in(1).scalar();
      changed.add(r / kMaskSquare, c / kMaskSquare);
      read.add(r / kMaskSquare, c / kMaskSquare);
    });
    before = *patch;
    if (patch->tells) io.set_dirty_tiles(0, is_new ? nullptr : &changed, &read);
  }
  void backward(NodeIo<S>& io) {
    double sum = 0;
    for_pixels(io.out().shape, *patch,
               [&](Index k, Index r, Index c) { sum += static_cast<double>(io.d_out()(k, r, c)); });
    io.d_in(1).scalar() += static_cast<S>(sum);
  }
};

template <class S>
Var<S> patched_image(Var<S> base, Var<S> x, std::shared_ptr<const Patch> patch) {
  PatchedImage<S> op;
  op.patch = std::move(patch);
  return base.owner().record(std::move(op), {base, x}, base.shape(), Source::current());
}

}  // namespace hsi4d::test
