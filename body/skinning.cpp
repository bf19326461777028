#include "body/skinning.h"

#include <array>
#include <cmath>

#include "body/skinning_kernel.h"
#include "body/skinning_movers.h"
#include "core/parallel.h"
#include "core/simd.h"

namespace hsi4d {

using detail::kSkinGrain;
using detail::kTransformSize;

namespace {

using detail::DenseTable;
using detail::SkinKernels;
using detail::SkinTables;
using detail::SparseTable;

template <class S>
const SkinKernels<S>& kernels() {
  static const SkinKernels<S> table = detail::skin_kernels<S>(best_isa());
  return table;
}

// --- tables ----------------------------------------------------------------------------------------------------------

/// Rounds the `count` weights of a vertex to S. In float their sum is then off by another 1e-7 at most: at a kilometre
/// no more than the rounding of the result itself.
template <class S>
void round_weights(const double* weights, Index count, Index vertex, S* rounded) {
  double sum = 0;
  for (Index k = 0; k < count; ++k) {
    rounded[k] = static_cast<S>(weights[k]);
    sum += weights[k];
  }
  HSI4D_CHECK(std::abs(sum - 1) <= kWeightRounding,
              "weights of vertex " + std::to_string(vertex) + " are not normalised");
}

/// Lists the entries of each block of vertices by joint, then by vertex; weights of 0 are left out.
template <class S>
void transpose(const SparseWeights& from, SparseTable<S>& to) {
  const Index blocks = (to.vertices + detail::kSparseBlock - 1) / detail::kSparseBlock;
  struct Entry {
    std::int32_t offset;
    S weight;
  };
  std::vector<std::vector<Entry>> of_joint(static_cast<std::size_t>(to.joints));
  std::vector<detail::SkinSegment> segments;
  std::vector<Entry> entries;
  to.block_begin.resize(blocks + 1);
  to.block_begin[0] = 0;
  for (Index block = 0; block < blocks; ++block) {
    const Index begin = block * detail::kSparseBlock;
    const Index end = std::min(begin + detail::kSparseBlock, to.vertices);
    for (Index i = begin * to.per_vertex; i < end * to.per_vertex; ++i) {
      if (to.weights[i] == 0) continue;
      const Index row = i / to.per_vertex - begin;
      of_joint[static_cast<std::size_t>(from.indices[static_cast<std::size_t>(i)])].push_back(
          {static_cast<std::int32_t>(row * kTransformSize), to.weights[i]});
    }
    for (std::size_t j = 0; j < of_joint.size(); ++j) {
      if (of_joint[j].empty()) continue;
      if (of_joint[j].size() % 2 != 0) of_joint[j].push_back({of_joint[j].back().offset, S(0)});
      entries.insert(entries.end(), of_joint[j].begin(), of_joint[j].end());
      segments.push_back({static_cast<std::int32_t>(j), static_cast<std::int32_t>(entries.size())});
      of_joint[j].clear();
    }
    to.block_begin[block + 1] = static_cast<std::int32_t>(segments.size());
  }
  to.segments.resize(static_cast<Index>(segments.size()));
  std::copy(segments.begin(), segments.end(), to.segments.data());
  to.entry_offset.resize(static_cast<Index>(entries.size()));
  to.entry_weight.resize(static_cast<Index>(entries.size()));
  for (std::size_t e = 0; e < entries.size(); ++e) {
    to.entry_offset[static_cast<Index>(e)] = entries[e].offset;
    to.entry_weight[static_cast<Index>(e)] = entries[e].weight;
  }
}

void check_sizes(const SparseWeights& w) {
  HSI4D_CHECK(w.per_vertex >= 1 && w.per_vertex <= kMaxWeightsPerVertex,
              std::to_string(w.per_vertex) + " weights per vertex; allowed: 1 to 8");
  HSI4D_CHECK_EQ(static_cast<Index>(w.indices.size()), w.vertices * w.per_vertex);
  HSI4D_CHECK_EQ(static_cast<Index>(w.weights.size()), w.vertices * w.per_vertex);
}

void check_sizes(const DenseWeights& w) { HSI4D_CHECK_EQ(static_cast<Index>(w.weights.size()), w.vertices * w.joints); }

template <class S>
void fill(SparseTable<S>& table, const SparseWeights& from) {
  const Index count = from.per_vertex;
  const Index padded = round_up(from.vertices, 4) * count;
  table.vertices = from.vertices;
  table.joints = from.joints;
  table.per_vertex = count;
  table.offsets.resize(padded);
  table.weights.resize(padded);
  std::fill(table.offsets.data(), table.offsets.data() + padded, 0);
  std::fill(table.weights.data(), table.weights.data() + padded, S(0));
  for (Index v = 0; v < from.vertices; ++v) {
    round_weights(from.weights.data() + v * count, count, v, table.weights.data() + v * count);
  }
  for (Index i = 0; i < from.vertices * count; ++i) {
    const std::int32_t joint = from.indices[static_cast<std::size_t>(i)];
    HSI4D_CHECK(joint >= 0 && joint < from.joints,
                "joint " + std::to_string(joint) + " of " + std::to_string(from.joints));
    table.offsets[i] = static_cast<std::int32_t>(joint * kTransformSize);
  }
  transpose(from, table);
}

template <class S>
void fill(DenseTable<S>& table, const DenseWeights& from) {
  const Index joints = from.joints;
  const Index size = round_up(from.vertices, detail::kPanel) * joints;
  table.vertices = from.vertices;
  table.joints = joints;
  table.panels.resize(size);
  std::fill(table.panels.data(), table.panels.data() + size, S(0));
  std::vector<S> row(static_cast<std::size_t>(joints));
  for (Index v = 0; v < from.vertices; ++v) {
    round_weights(from.weights.data() + v * joints, joints, v, row.data());
    S* panel = table.panels.data() + v / detail::kPanel * detail::kPanel * joints + v % detail::kPanel;
    for (Index j = 0; j < joints; ++j) panel[j * detail::kPanel] = row[static_cast<std::size_t>(j)];
  }
}

// --- untaped ---------------------------------------------------------------------------------------------------------

/// Three numbers again and again, as many as vectors of every width hold whole.
inline constexpr Index kRun = 48;

/// points += t
template <class S>
void move_points(const S* t, S* points, Index begin, Index end) {
  S run[kRun];
  for (Index i = 0; i < kRun; ++i) run[i] = t[i % 3];
  on_best_isa([&] {
    Index at = 3 * begin;
    for (; at + kRun <= 3 * end; at += kRun) {
      for (Index i = 0; i < kRun; ++i) points[at + i] += run[i];
    }
    for (Index i = 0; at + i < 3 * end; ++i) points[at + i] += run[i];
  });
}

/// sum[3] = Σ_v d_points_v of a chunk
template <class S>
void sum_points(const S* d_points, Index begin, Index end, double* sum) {
  S run[kRun] = {};
  on_best_isa([&] {
    Index at = 3 * begin;
    for (; at + kRun <= 3 * end; at += kRun) {
      for (Index i = 0; i < kRun; ++i) run[i] += d_points[at + i];
    }
    for (Index i = 0; at + i < 3 * end; ++i) run[i] += d_points[at + i];
  });
  for (Index i = 0; i < kRun; ++i) sum[i % 3] += static_cast<double>(run[i]);
}

/// `saved` receives the blended transforms of dense weights unless it is null; no `transl`: none.
template <class S>
void skin(const SkinTables<S>& tables, const S* transforms, const S* points, S* result, S* saved, const S* transl) {
  const Index vertices = tables.is_dense ? tables.dense.vertices : tables.sparse.vertices;
  parallel_for(vertices, kSkinGrain, [&](Index begin, Index end) {
    if (tables.is_dense) {
      kernels<S>().dense_points(tables.dense, transforms, points, result, saved, begin, end);
    } else {
      kernels<S>().sparse_points(tables.sparse, transforms, points, result, begin, end);
    }
    if (transl != nullptr) move_points(transl, result, begin, end);
  });
}

/// Runs `chunk(partial, begin, end)` over the vertices and adds the partial sums to `d_transforms`, in order.
template <class S, class F>
void gather_transforms(NodeIo<S>& io, const SkinTables<S>& tables, F&& chunk) {
  const Partition part{tables.is_dense ? tables.dense.vertices : tables.sparse.vertices, kSkinGrain};
  const Index numbers = kTransformSize * (tables.is_dense ? tables.dense.joints : tables.sparse.joints);
  const Index partial = tables.is_dense ? numbers * detail::kMaxLanes : numbers;
  const std::span<S> partials = io.scratch(part.chunks() * partial);
  parallel_chunks(part, [&](Index c, Index begin, Index end) { chunk(partials.data() + c * partial, begin, end); });
  S* d_transforms = io.d_in(0).data;
  if (tables.is_dense) return kernels<S>().dense_reduce(tables.dense, partials.data(), part.chunks(), d_transforms);
  on_best_isa([&] {
    for (Index first = 0; first < numbers; first += kTransformSize) {
      double sum[kTransformSize] = {};
      for (Index c = 0; c < part.chunks(); ++c) {
        const S* term = partials.data() + c * numbers + first;
        for (Index i = 0; i < kTransformSize; ++i) sum[i] += static_cast<double>(term[i]);
      }
      for (Index i = 0; i < kTransformSize; ++i) d_transforms[first + i] += static_cast<S>(sum[i]);
    }
  });
}

// --- operators -------------------------------------------------------------------------------------------------------

/// Inputs: transforms, points, and a translation or none.
template <class S>
struct SkinPoints {
  static constexpr const char* kName = "skin_points";
  SkinWeights<S> weights;
  Buffer<S> blended;  // of dense weights, where the adjoint of the points needs them

  void forward(NodeIo<S>& io) {
    const auto& tables = weights.tables();
    const bool save = tables.is_dense && io.wants(1);
    if (save) blended.resize(round_up(tables.dense.vertices, detail::kPanel) * kTransformSize);
    const S* transl = io.inputs() == 3 ? io.in(2).data : nullptr;
    skin(tables, io.in(0).data, io.in(1).data, io.out().data, save ? blended.data() : nullptr, transl);
  }

  void transl_adjoint(NodeIo<S>& io) const {
    const Partition part{weights.vertices(), kSkinGrain};
    double* sums = io.template scratch<double>(3 * part.chunks()).data();
    std::fill(sums, sums + 3 * part.chunks(), 0.0);
    parallel_chunks(part,
                    [&](Index c, Index begin, Index end) { sum_points(io.d_out().data, begin, end, sums + 3 * c); });
    for (Index i = 0; i < 3; ++i) {
      double sum = 0;
      for (Index c = 0; c < part.chunks(); ++c) sum += sums[3 * c + i];
      io.d_in(2).data[i] += static_cast<S>(sum);
    }
  }

  void backward(NodeIo<S>& io) {
    const auto& tables = weights.tables();
    const S* transforms = io.in(0).data;
    const S* points = io.in(1).data;
    const S* d_result = io.d_out().data;
    if (io.wants(0)) {
      gather_transforms(io, tables, [&](S* partial, Index begin, Index end) {
        if (tables.is_dense) {
          kernels<S>().dense_transform_adjoint(tables.dense, points, d_result, partial, begin, end);
        } else {
          kernels<S>().sparse_transform_adjoint(tables.sparse, points, d_result, partial, begin, end);
        }
      });
    }
    if (io.inputs() == 3 && io.wants(2)) transl_adjoint(io);
    if (!io.wants(1)) return;
    S* d_points = io.d_in(1).data;
    parallel_for(weights.vertices(), kSkinGrain, [&](Index begin, Index end) {
      if (tables.is_dense) {
        kernels<S>().dense_point_adjoint(blended.data(), d_result, d_points, begin, end);
      } else {
        kernels<S>().sparse_point_adjoint(tables.sparse, transforms, d_result, d_points, begin, end);
      }
    });
  }

  Index saved_bytes() const { return blended.capacity_bytes(); }
};

template <class S>
struct BlendTransforms {
  static constexpr const char* kName = "blend_transforms";
  SkinWeights<S> weights;

  void forward(NodeIo<S>& io) {
    const auto& tables = weights.tables();
    const S* transforms = io.in(0).data;
    S* blended = io.out().data;
    parallel_for(weights.vertices(), kSkinGrain, [&](Index begin, Index end) {
      if (tables.is_dense) {
        kernels<S>().dense_blend(tables.dense, transforms, blended, begin, end);
      } else {
        kernels<S>().sparse_blend(tables.sparse, transforms, blended, begin, end);
      }
    });
  }

  void backward(NodeIo<S>& io) {
    if (!io.wants(0)) return;
    const auto& tables = weights.tables();
    const S* d_blended = io.d_out().data;
    gather_transforms(io, tables, [&](S* partial, Index begin, Index end) {
      if (tables.is_dense) {
        kernels<S>().dense_blend_adjoint(tables.dense, d_blended, partial, begin, end);
      } else {
        kernels<S>().sparse_blend_adjoint(tables.sparse, d_blended, partial, begin, end);
      }
    });
  }
};

/// y = B (x, 1)
template <class S>
void transform_point(const S* b, const S* x, S* y) {
  for (int r = 0; r < 3; ++r) y[r] = (b[4 * r] * x[0] + b[4 * r + 1] * x[1]) + (b[4 * r + 2] * x[2] + b[4 * r + 3]);
}

/// d_B += d_y ⊗ (x, 1)
template <class S>
void add_outer_product(const S* d_y, const S* x, S* d_b) {
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) d_b[4 * r + c] += d_y[r] * x[c];
    d_b[4 * r + 3] += d_y[r];
  }
}

/// d_x += B(:,0:3)ᵀ d_y
template <class S>
void add_transposed(const S* b, const S* d_y, S* d_x) {
  for (int c = 0; c < 3; ++c) d_x[c] += (b[c] * d_y[0] + b[4 + c] * d_y[1]) + b[8 + c] * d_y[2];
}

template <class S>
struct TransformPoints {
  static constexpr const char* kName = "transform_points";

  void forward(NodeIo<S>& io) {
    const ConstArray<S> b = io.in(0), x = io.in(1);
    const Array<S> y = io.out();
    parallel_for(x.shape.rows, kSkinGrain, [&](Index begin, Index end) {
      on_best_isa([&] {
        for (Index v = begin; v < end; ++v) transform_point(b.row(v), x.row(v), y.row(v));
      });
    });
  }

  void backward(NodeIo<S>& io) {
    const ConstArray<S> b = io.in(0), x = io.in(1), d_y = io.d_out();
    const Array<S> d_b = io.wants(0) ? io.d_in(0) : Array<S>{};
    const Array<S> d_x = io.wants(1) ? io.d_in(1) : Array<S>{};
    parallel_for(x.shape.rows, kSkinGrain, [&](Index begin, Index end) {
      on_best_isa([&] {
        for (Index v = begin; d_b && v < end; ++v) add_outer_product(d_y.row(v), x.row(v), d_b.row(v));
        for (Index v = begin; d_x && v < end; ++v) add_transposed(b.row(v), d_y.row(v), d_x.row(v));
      });
    });
  }
};

/// d_F += B(:,0:3)ᵀ d_F'
template <class S>
void add_transposed_frame(const S* b, const S* d_posed, S* d_frame) {
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c)
      d_frame[3 * r + c] += (b[r] * d_posed[c] + b[4 + r] * d_posed[3 + c]) + b[8 + r] * d_posed[6 + c];
  }
}

/// Inputs: transforms, points, frames. Outputs: points, frames.
template <class S>
struct SkinFrames {
  static constexpr const char* kName = "skin_frames";
  SkinWeights<S> weights;

  void forward(NodeIo<S>& io) {
    const auto& table = weights.tables().sparse;
    parallel_for(weights.vertices(), kSkinGrain, [&](Index begin, Index end) {
      kernels<S>().sparse_frames(table, io.in(0).data, io.in(1).data, io.in(2).data, io.out(0).data, io.out(1).data,
                                 begin, end);
    });
  }

  void backward(NodeIo<S>& io) {
    const SkinTables<S>& tables = weights.tables();
    const ConstArray<S> d_y = io.d_out(0), d_f = io.d_out(1);
    if (io.wants(0)) {
      gather_transforms(io, tables, [&](S* partial, Index begin, Index end) {
        kernels<S>().sparse_frames_adjoint(tables.sparse, io.in(1).data, io.in(2).data, d_y ? d_y.data : nullptr,
                                           d_f ? d_f.data : nullptr, partial, begin, end);
      });
    }
    const bool points = io.wants(1) && d_y, frames = io.wants(2) && d_f;
    if (!points && !frames) return;
    const std::span<S> blended = io.scratch(weights.vertices() * kTransformSize);
    S* d_points = points ? io.d_in(1).data : nullptr;
    S* d_frames = frames ? io.d_in(2).data : nullptr;
    parallel_for(weights.vertices(), kSkinGrain, [&](Index begin, Index end) {
      kernels<S>().sparse_blend(tables.sparse, io.in(0).data, blended.data(), begin, end);
      for (Index v = begin; v < end; ++v) {
        const S* b = blended.data() + v * kTransformSize;
        if (points) add_transposed(b, d_y.row(v), d_points + 3 * v);
        if (frames) add_transposed_frame(b, d_f.row(v), d_frames + 9 * v);
      }
    });
  }

  void push(NodeIo<S>& io, Movers<S>& movers) { detail::push_joints(io, weights.tables().sparse, movers); }
};

}  // namespace

template <class S>
SkinWeights<S>::SkinWeights(const SparseWeights& weights) {
  check_sizes(weights);
  auto tables = std::make_shared<SkinTables<S>>();
  fill(tables->sparse, weights);
  tables_ = std::move(tables);
}

template <class S>
SkinWeights<S>::SkinWeights(const DenseWeights& weights) {
  check_sizes(weights);
  auto tables = std::make_shared<SkinTables<S>>();
  tables->is_dense = true;
  fill(tables->dense, weights);
  tables_ = std::move(tables);
}

template <class S>
Index SkinWeights<S>::vertices() const {
  return tables_->is_dense ? tables_->dense.vertices : tables_->sparse.vertices;
}

template <class S>
Index SkinWeights<S>::joints() const {
  return tables_->is_dense ? tables_->dense.joints : tables_->sparse.joints;
}

template <class S>
void skin_points(const SkinWeights<S>& weights, const S* transforms, const S* points, S* result) {
  skin<S>(weights.tables(), transforms, points, result, nullptr, nullptr);
}

template <class S>
Var<S> skin_points(const SkinWeights<S>& weights, Var<S> transforms, Var<S> points, Source where) {
  HSI4D_CHECK_EQ(transforms.shape(), shape_of(weights.joints(), kTransformSize));
  HSI4D_CHECK_EQ(points.shape(), shape_of(weights.vertices(), 3));
  return transforms.owner().record(SkinPoints<S>{weights, {}}, {transforms, points}, points.shape(), where);
}

template <class S>
Var<S> skin_points(const SkinWeights<S>& weights, Var<S> transforms, Var<S> points, Var<S> transl, Source where) {
  HSI4D_CHECK_EQ(transforms.shape(), shape_of(weights.joints(), kTransformSize));
  HSI4D_CHECK_EQ(points.shape(), shape_of(weights.vertices(), 3));
  HSI4D_CHECK_EQ(transl.shape(), shape_of(1, 3));
  return transforms.owner().record(SkinPoints<S>{weights, {}}, {transforms, points, transl}, points.shape(), where);
}

template <class S>
Var<S> blend_transforms(const SkinWeights<S>& weights, Var<S> transforms, Source where) {
  HSI4D_CHECK_EQ(transforms.shape(), shape_of(weights.joints(), kTransformSize));
  return transforms.owner().record(BlendTransforms<S>{weights}, {transforms},
                                   shape_of(weights.vertices(), kTransformSize), where);
}

template <class S>
SkinnedFrames<S> skin_frames(const SkinWeights<S>& weights, Var<S> transforms, Var<S> points, Var<S> frames,
                             Source where) {
  HSI4D_CHECK(!weights.tables().is_dense, "frames need sparse weights");
  HSI4D_CHECK_EQ(transforms.shape(), shape_of(weights.joints(), kTransformSize));
  HSI4D_CHECK_EQ(points.shape(), shape_of(weights.vertices(), 3));
  HSI4D_CHECK_EQ(frames.shape(), shape_of(weights.vertices(), 9));
  Tape<S>& tape = transforms.owner();
  const std::array<Var<S>, 3> inputs = {transforms, points, frames};
  const std::array<Shape, 2> outputs = {points.shape(), frames.shape()};
  const Var<S> posed = tape.record(SkinFrames<S>{weights}, std::span<const Var<S>>(inputs), outputs, where);
  return {posed, tape.output(posed, 1)};
}

template <class S>
Var<S> transform_points(Var<S> transforms, Var<S> points, Source where) {
  HSI4D_CHECK_EQ(points.shape(), shape_of(points.shape().rows, 3));
  HSI4D_CHECK_EQ(transforms.shape(), shape_of(points.shape().rows, kTransformSize));
  return transforms.owner().record(TransformPoints<S>{}, {transforms, points}, points.shape(), where);
}

#define HSI4D_INSTANTIATE(S)                                                                    \
  template class SkinWeights<S>;                                                                \
  template void skin_points(const SkinWeights<S>&, const S*, const S*, S*);                     \
  template Var<S> skin_points(const SkinWeights<S>&, Var<S>, Var<S>, Source);                   \
  template Var<S> skin_points(const SkinWeights<S>&, Var<S>, Var<S>, Var<S>, Source);           \
  template Var<S> blend_transforms(const SkinWeights<S>&, Var<S>, Source);                      \
  template SkinnedFrames<S> skin_frames(const SkinWeights<S>&, Var<S>, Var<S>, Var<S>, Source); \
  template Var<S> transform_points(Var<S>, Var<S>, Source);
HSI4D_INSTANTIATE(float)
HSI4D_INSTANTIATE(double)
#undef HSI4D_INSTANTIATE

}  // namespace hsi4d
