#include "autodiff/matrix.h"

#include <Eigen/Core>

#include "autodiff/curvature_weights.h"
#include "autodiff/twists.h"
#include "core/parallel.h"

namespace hsi4d {

namespace {

/// Rows of one parallel chunk of a product.
constexpr Index kProductRows = 256;
/// Numbers moved by one parallel chunk.
constexpr Index kMovedNumbers = 32768;

template <class S>
using Matrix = Eigen::Matrix<S, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

template <class S>
auto rows_of(const Array<S>& x, Index first, Index count) {
  using Stored = std::conditional_t<std::is_const_v<S>, const Matrix<std::remove_const_t<S>>, Matrix<S>>;
  return Eigen::Map<Stored, 0, Eigen::OuterStride<>>(x.row(first), count, x.shape.cols,
                                                     Eigen::OuterStride<>(x.shape.stride));
}

template <class S>
auto matrix_of(const Array<S>& x) {
  return rows_of(x, 0, x.shape.rows);
}

void check_plane(const Shape& shape) {
  HSI4D_CHECK(shape.planes == 1, detail::both_values("one plane is wanted", shape));
}

/// y = a b.   d_a = d_y bᵀ,   d_b = aᵀ d_y.   Rows of the result are cut into fixed chunks, so that the order of every
/// sum is that of the product kernel and does not depend on the threads.
template <class S>
struct MatmulOp {
  static constexpr const char* kName = "matmul";

  void forward(NodeIo<S>& io) {
    const ConstArray<S> a = io.in(0), b = io.in(1);
    const Array<S> y = io.out();
    parallel_for(y.shape.rows, kProductRows, [&](Index begin, Index end) {
      rows_of(y, begin, end - begin).noalias() = rows_of(a, begin, end - begin).lazyProduct(matrix_of(b));
    });
  }
  void backward(NodeIo<S>& io) {
    const ConstArray<S> a = io.in(0), b = io.in(1), d_y = io.d_out();
    if (io.wants(0)) {
      const Array<S> d_a = io.d_in(0);
      parallel_for(d_a.shape.rows, kProductRows, [&](Index begin, Index end) {
        rows_of(d_a, begin, end - begin).noalias() +=
            rows_of(d_y, begin, end - begin).lazyProduct(matrix_of(b).transpose());
      });
    }
    if (io.wants(1)) {
      const Array<S> d_b = io.d_in(1);
      parallel_for(d_b.shape.rows, kProductRows, [&](Index begin, Index end) {
        rows_of(d_b, begin, end - begin).noalias() +=
            matrix_of(a).middleCols(begin, end - begin).transpose().lazyProduct(matrix_of(d_y));
      });
    }
  }
};

/// y = xᵀ.   d_x = d_yᵀ.
template <class S>
struct TransposeOp {
  static constexpr const char* kName = "transpose";
  void forward(NodeIo<S>& io) { matrix_of(io.out()) = matrix_of(io.in(0)).transpose(); }
  void backward(NodeIo<S>& io) { matrix_of(io.d_in(0)) += matrix_of(io.d_out()).transpose(); }
};

/// Copies row-major numbers from one padding to another.
template <class S>
struct ReshapeOp {
  static constexpr const char* kName = "reshape";
  void forward(NodeIo<S>& io) {
    const ConstArray<S> x = io.in(0);
    const Array<S> y = io.out();
    for (Index r = 0; r < x.total_rows(); ++r) std::copy_n(x.row(r), x.shape.cols, y.data + r * x.shape.cols);
  }
  void backward(NodeIo<S>& io) {
    const Array<S> d_x = io.d_in(0);
    const ConstArray<S> d_y = io.d_out();
    for (Index r = 0; r < d_x.total_rows(); ++r) {
      for (Index c = 0; c < d_x.shape.cols; ++c) d_x.row(r)[c] += d_y.data[r * d_x.shape.cols + c];
    }
  }
};

/// A block of x.   d_x gets d_y there.
template <class S>
struct SliceOp {
  static constexpr const char* kName = "slice";
  Index row, col;
  void forward(NodeIo<S>& io) {
    const Array<S> y = io.out();
    matrix_of(y) = matrix_of(io.in(0)).block(row, col, y.shape.rows, y.shape.cols);
  }
  void backward(NodeIo<S>& io) {
    const ConstArray<S> d_y = io.d_out();
    matrix_of(io.d_in(0)).block(row, col, d_y.shape.rows, d_y.shape.cols) += matrix_of(d_y);
  }
};

/// Parts one after the other, along rows or columns.
template <class S>
struct ConcatOp {
  static constexpr const char* kName = "concat";
  static constexpr bool kAssigns = true;
  static constexpr bool kPersistentOutputs = true;  // parts that are as they were are not copied again
  bool along_rows;

  /// Calls f(part, row of it, row and column of the output, numbers) for all that lies together in both, of parts for
  /// which `counts`: a row, or the rows of a chunk.
  template <class Counts, class F>
  void for_runs(const NodeIo<S>& io, const Counts& counts, const F& f) const {
    Index row = 0, col = 0;
    for (int i = 0; i < io.inputs(); ++i) {
      const Shape& part = io.in(i).shape;
      if (counts(i)) {
        parallel_for(part.rows, kMovedNumbers / std::max<Index>(1, part.cols) + 1, [&](Index begin, Index end) {
          if (along_rows && part.dense()) return f(i, begin, row + begin, col, (end - begin) * part.cols);
          for (Index r = begin; r < end; ++r) f(i, r, row + r, col, part.cols);
        });
      }
      (along_rows ? row : col) += along_rows ? part.rows : part.cols;
    }
  }
  void forward(NodeIo<S>& io) {
    const auto counts = [&io](int i) { return io.is_changed(i); };
    for_runs(io, counts, [&io](int i, Index r, Index row, Index col, Index numbers) {
      std::copy_n(io.in(i).row(r), numbers, io.out().row(row) + col);
    });
  }
  void backward(NodeIo<S>& io) {
    const auto counts = [&io](int i) { return io.wants(i); };
    for_runs(io, counts, [&io](int i, Index r, Index row, Index col, Index numbers) {
      const S* const from = io.d_out().row(row) + col;
      S* const to = io.d_in(i).row(r);
      if (io.must_assign(i)) {
        std::copy_n(from, numbers, to);
      } else {
        for (Index k = 0; k < numbers; ++k) to[k] += from[k];
      }
    });
  }

  /// Rows follow the movers of their part.
  void push(NodeIo<S>& io, Movers<S>& movers) {
    Index per_row = 0, dims = 0;
    for (int i = 0; along_rows && i < io.inputs(); ++i) {
      const Twists<S>* const part = movers.of_input(io, i);
      if (part == nullptr) continue;
      per_row = std::max(per_row, part->per_row);
      dims = part->dims;
    }
    if (per_row == 0) return;
    Twists<S>& all = movers.of_output(io, 0, io.out().shape.rows, per_row, dims);
    Index row = 0;
    for (int i = 0; i < io.inputs(); row += io.in(i++).shape.rows) {
      const Twists<S>* const part = movers.of_input(io, i);
      if (part == nullptr) continue;
      parallel_for(io.in(i).shape.rows, kMovedNumbers / (per_row * dims * kTwist) + 1, [&](Index begin, Index end) {
        for (Index r = begin; r < end; ++r) {
          std::copy_n(&part->movers[r * part->per_row], part->per_row, &all.mover(row + r, 0));
          std::copy_n(part->rate(r, 0), part->per_row * dims * kTwist, all.rate(row + r, 0));
        }
      });
    }
  }
};

/// y_i = x_{index[i]}.   d_x_j = Σ_{i: index[i] = j} d_y_i, by the transposed index: users_[starts_[j] … starts_[j+1]).
template <class S>
struct GatherRowsOp {
  static constexpr const char* kName = "gather_rows";
  std::vector<std::uint32_t> index, starts, users;

  GatherRowsOp(std::vector<std::uint32_t> rows, Index x_rows)
      : index(std::move(rows)), starts(static_cast<std::size_t>(x_rows) + 1, 0), users(index.size()) {
    for (const std::uint32_t j : index) ++starts[j + 1];
    for (std::size_t j = 1; j < starts.size(); ++j) starts[j] += starts[j - 1];
    std::vector<std::uint32_t> next(starts.begin(), starts.end() - 1);
    for (std::size_t i = 0; i < index.size(); ++i) users[next[index[i]]++] = static_cast<std::uint32_t>(i);
  }
  Index saved_bytes() const {
    return static_cast<Index>((index.size() + starts.size() + users.size()) * sizeof(std::uint32_t));
  }

  void forward(NodeIo<S>& io) {
    const ConstArray<S> x = io.in(0);
    const Array<S> y = io.out();
    parallel_for(y.shape.rows, kMovedNumbers / std::max<Index>(1, y.shape.cols) + 1, [&](Index begin, Index end) {
      for (Index i = begin; i < end; ++i) {
        std::copy_n(x.row(index[static_cast<std::size_t>(i)]), x.shape.cols, y.row(i));
      }
    });
  }
  void backward(NodeIo<S>& io) {
    const Array<S> d_x = io.d_in(0);
    const ConstArray<S> d_y = io.d_out();
    parallel_for(d_x.shape.rows, kMovedNumbers / std::max<Index>(1, d_x.shape.cols) + 1, [&](Index begin, Index end) {
      for (Index j = begin; j < end; ++j) {
        for (std::uint32_t u = starts[static_cast<std::size_t>(j)]; u < starts[static_cast<std::size_t>(j) + 1]; ++u) {
          for (Index c = 0; c < d_x.shape.cols; ++c) d_x.row(j)[c] += d_y.row(users[u])[c];
        }
      }
    });
  }
};

template <class S>
Var<S> concat(std::span<const Var<S>> parts, bool along_rows, const Source& where) {
  HSI4D_CHECK(!parts.empty(), "concat of nothing");
  Shape shape = parts[0].shape();
  check_plane(shape);
  for (const Var<S>& part : parts.subspan(1)) {
    const Shape& next = part.shape();
    const bool fits = next.planes == 1 && (along_rows ? next.cols == shape.cols : next.rows == shape.rows);
    HSI4D_CHECK(fits, detail::both_values(shape, next));
    (along_rows ? shape.rows : shape.cols) += along_rows ? next.rows : next.cols;
  }
  return parts[0].owner().record(ConcatOp<S>{along_rows}, parts, std::array{shape_of(shape.rows, shape.cols)}, where);
}

template <class S>
Var<S> slice(Var<S> x, Index row, Index col, Index rows, Index cols, const Source& where) {
  const Shape& shape = x.shape();
  check_plane(shape);
  HSI4D_CHECK(row >= 0 && col >= 0 && rows >= 0 && cols >= 0 && row + rows <= shape.rows && col + cols <= shape.cols,
              detail::both_values(shape_of(row + rows, col + cols), shape));
  return x.owner().record(SliceOp<S>{row, col}, {x}, shape_of(rows, cols), where);
}

/// Planes [first, first + planes of the output).
template <class S>
struct SlicePlanesOp {
  static constexpr const char* kName = "slice_planes";
  Index first;

  void forward(NodeIo<S>& io) {
    const Array<S> part = io.out();
    const S* from = io.in(0).row(first * part.shape.rows);
    std::copy_n(from, part.shape.memory(), part.data);
  }
  void backward(NodeIo<S>& io) {
    if (!io.wants(0)) return;
    const ConstArray<S> g = io.d_out();
    const Array<S> d = io.d_in(0);
    for (Index r = 0; r < g.total_rows(); ++r) {
      S* to = d.row(first * g.shape.rows + r);
      for (Index x = 0; x < g.shape.cols; ++x) to[x] += g.row(r)[x];
    }
  }
  bool weigh(NodeIo<S>& io, CurvatureWeights<S>& weights) {
    const ConstArray<S> w = weights.of_output(io);
    if (!w || !io.wants(0)) return true;
    const Array<S> to = weights.of_input(io, 0);
    for (Index r = 0; r < w.total_rows(); ++r) {
      for (Index x = 0; x < w.shape.cols; ++x) to.row(first * w.shape.rows + r)[x] += w.row(r)[x];
    }
    return true;
  }
};

}  // namespace

template <class S>
Var<S> matmul(Var<S> a, Var<S> b, Source where) {
  check_plane(a.shape());
  check_plane(b.shape());
  HSI4D_CHECK(a.shape().cols == b.shape().rows, detail::both_values(a.shape(), b.shape()));
  return a.owner().record(MatmulOp<S>{}, {a, b}, shape_of(a.shape().rows, b.shape().cols), where);
}

template <class S>
Var<S> transpose(Var<S> x, Source where) {
  check_plane(x.shape());
  return x.owner().record(TransposeOp<S>{}, {x}, shape_of(x.shape().cols, x.shape().rows), where);
}

template <class S>
Var<S> reshape(Var<S> x, Index rows, Index cols, Source where) {
  HSI4D_CHECK_EQ(rows * cols, x.shape().count());
  return x.owner().record(ReshapeOp<S>{}, {x}, shape_of(rows, cols), where);
}

template <class S>
Var<S> slice_rows(Var<S> x, Index first, Index count, Source where) {
  return slice(x, first, 0, count, x.shape().cols, where);
}

template <class S>
Var<S> slice_cols(Var<S> x, Index first, Index count, Source where) {
  return slice(x, 0, first, x.shape().rows, count, where);
}

template <class S>
Var<S> slice_planes(Var<S> x, Index first, Index count, Source where) {
  Shape shape = x.shape();
  HSI4D_CHECK(first >= 0 && count >= 0 && first + count <= shape.planes, "planes [" + std::to_string(first) + ", " +
                                                                             std::to_string(first + count) + ") of " +
                                                                             std::to_string(shape.planes));
  shape.planes = count;
  return x.owner().record(SlicePlanesOp<S>{first}, {x}, shape, where);
}

template <class S>
Var<S> concat_rows(std::span<const Var<S>> parts, Source where) {
  return concat(parts, true, where);
}

template <class S>
Var<S> concat_cols(std::span<const Var<S>> parts, Source where) {
  return concat(parts, false, where);
}

template <class S>
Var<S> gather_rows(Var<S> x, std::vector<std::uint32_t> index, Source where) {
  const Shape shape = x.shape();
  check_plane(shape);
  for (std::size_t i = 0; i < index.size(); ++i) {
    HSI4D_CHECK(index[i] < shape.rows,
                "index[" + std::to_string(i) + "] = " + std::to_string(index[i]) + " of " + std::to_string(shape.rows));
  }
  const auto rows = static_cast<Index>(index.size());
  return x.owner().record(GatherRowsOp<S>(std::move(index), shape.rows), {x}, shape_of(rows, shape.cols), where);
}

#define HSI4D_MATRIX(S)                                         \
  template Var<S> matmul(Var<S>, Var<S>, Source);               \
  template Var<S> transpose(Var<S>, Source);                    \
  template Var<S> reshape(Var<S>, Index, Index, Source);        \
  template Var<S> slice_rows(Var<S>, Index, Index, Source);     \
  template Var<S> slice_cols(Var<S>, Index, Index, Source);     \
  template Var<S> slice_planes(Var<S>, Index, Index, Source);   \
  template Var<S> concat_rows(std::span<const Var<S>>, Source); \
  template Var<S> concat_cols(std::span<const Var<S>>, Source); \
  template Var<S> gather_rows(Var<S>, std::vector<std::uint32_t>, Source);
HSI4D_MATRIX(float)
HSI4D_MATRIX(double)
#undef HSI4D_MATRIX

}  // namespace hsi4d
