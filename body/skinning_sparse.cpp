// Sparse kernels of skinning_kernel.h. A transform is three rows of four lanes; the inner loops are K (forward) or
// entries of a joint (adjoint) multiply-adds of whole transforms, and everything else is done for four vertices at
// once.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "body/skinning_sparse.cpp"
#define HWY_DISABLED_TARGETS (HWY_SSSE3 | HWY_SSE4 | HWY_AVX3_DL)
#include <algorithm>

#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "body/skinning_kernel.h"

HWY_BEFORE_NAMESPACE();
namespace hsi4d::detail::HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

/// Four lanes, in one register where the instruction set has room, else in two or more.
template <class S>
struct Quad {
  using D = hn::CappedTag<S, 4>;
  using V = hn::Vec<D>;
  static constexpr int kLanes = static_cast<int>(hn::MaxLanes(D()));
  static constexpr int kParts = 4 / kLanes;
  V part[kParts];

  HWY_INLINE static Quad load(const S* from) {
    Quad q;
    for (int i = 0; i < kParts; ++i) q.part[i] = hn::LoadU(D(), from + i * kLanes);
    return q;
  }
  HWY_INLINE static Quad fill(S value) {
    Quad q;
    for (int i = 0; i < kParts; ++i) q.part[i] = hn::Set(D(), value);
    return q;
  }
  HWY_INLINE void store(S* to) const {
    for (int i = 0; i < kParts; ++i) hn::StoreU(part[i], D(), to + i * kLanes);
  }
};

template <class S>
HWY_INLINE Quad<S> mul(const Quad<S>& a, const Quad<S>& b) {
  Quad<S> q;
  for (int i = 0; i < Quad<S>::kParts; ++i) q.part[i] = hn::Mul(a.part[i], b.part[i]);
  return q;
}
template <class S>
HWY_INLINE Quad<S> add(const Quad<S>& a, const Quad<S>& b) {
  Quad<S> q;
  for (int i = 0; i < Quad<S>::kParts; ++i) q.part[i] = hn::Add(a.part[i], b.part[i]);
  return q;
}
/// a·b + c
template <class S>
HWY_INLINE Quad<S> mul_add(const Quad<S>& a, const Quad<S>& b, const Quad<S>& c) {
  Quad<S> q;
  for (int i = 0; i < Quad<S>::kParts; ++i) q.part[i] = hn::MulAdd(a.part[i], b.part[i], c.part[i]);
  return q;
}

/// (x, y, z, 1) of the point at `from`; reads one number past it.
template <class S>
HWY_INLINE Quad<S> load_point(const S* from) {
  using D = typename Quad<S>::D;
  Quad<S> q = Quad<S>::load(from);
  constexpr int kLast = Quad<S>::kParts - 1;
  q.part[kLast] = hn::IfThenElse(hn::FirstN(D(), Quad<S>::kLanes - 1), q.part[kLast], hn::Set(D(), S(1)));
  return q;
}

/// Sum of transforms: the first two rows share a register of eight lanes where there is one.
template <class S, bool kWide = (hn::MaxLanes(hn::CappedTag<S, 8>()) == 8)>
struct TransformSum {
  Quad<S> row[3];

  HWY_INLINE static TransformSum zero() { return {{Quad<S>::fill(0), Quad<S>::fill(0), Quad<S>::fill(0)}}; }

  HWY_INLINE void add_scaled(const S* transform, S weight) {
    const Quad<S> w = Quad<S>::fill(weight);
    for (int r = 0; r < 3; ++r) row[r] = mul_add(Quad<S>::load(transform + 4 * r), w, row[r]);
  }
  HWY_INLINE Quad<S> get(int r) const { return row[r]; }
  HWY_INLINE void add(const TransformSum& other) {
    for (int r = 0; r < 3; ++r) row[r] = HWY_NAMESPACE::add(row[r], other.row[r]);
  }
  HWY_INLINE void store(S* to) const {
    for (int r = 0; r < 3; ++r) row[r].store(to + 4 * r);
  }
};

#if HWY_MAX_BYTES >= 32
template <class S>
struct TransformSum<S, true> {
  using D8 = hn::CappedTag<S, 8>;
  using D4 = hn::Half<D8>;
  hn::Vec<D8> rows01;
  hn::Vec<D4> row2;

  HWY_INLINE static TransformSum zero() { return {hn::Zero(D8()), hn::Zero(D4())}; }

  HWY_INLINE void add_scaled(const S* transform, S weight) {
    const auto w = hn::Set(D8(), weight);
    rows01 = hn::MulAdd(hn::LoadU(D8(), transform), w, rows01);
    row2 = hn::MulAdd(hn::LoadU(D4(), transform + 8), hn::LowerHalf(D4(), w), row2);
  }
  HWY_INLINE Quad<S> get(int r) const {
    return {{r == 0 ? hn::LowerHalf(D4(), rows01) : r == 1 ? hn::UpperHalf(D4(), rows01) : row2}};
  }
  HWY_INLINE void add(const TransformSum& other) {
    rows01 = hn::Add(rows01, other.rows01);
    row2 = hn::Add(row2, other.row2);
  }
  HWY_INLINE void store(S* to) const {
    hn::StoreU(rows01, D8(), to);
    hn::StoreU(row2, D4(), to + 8);
  }
};
#endif

/// B_v of `Count` vertices, together so that their chains of additions overlap. K = 0: as many weights as the table
/// has.
template <class S, int K, int Count>
HWY_INLINE void blend(const SparseTable<S>& table, const S* HWY_RESTRICT transforms, Index v,
                      TransformSum<S> (&sum)[Count]) {
  const Index weights_per_vertex = K == 0 ? table.per_vertex : K;
  const std::int32_t* HWY_RESTRICT offsets = table.offsets.data() + v * weights_per_vertex;
  const S* HWY_RESTRICT weights = table.weights.data() + v * weights_per_vertex;
  for (int i = 0; i < Count; ++i) sum[i] = TransformSum<S>::zero();
  for (Index k = 0; k < weights_per_vertex; ++k) {
    for (int i = 0; i < Count; ++i) {
      const Index at = i * weights_per_vertex + k;
      sum[i].add_scaled(transforms + offsets[at], weights[at]);
    }
  }
}

/// The four quads with lanes and numbers exchanged.
template <class S>
HWY_INLINE void transpose(const Quad<S> (&in)[4], Quad<S> (&out)[4]) {
#if HWY_TARGET != HWY_SCALAR
  if constexpr (Quad<S>::kParts == 1) {
    const typename Quad<S>::D d;
    const auto low01 = hn::InterleaveLower(d, in[0].part[0], in[1].part[0]);
    const auto low23 = hn::InterleaveLower(d, in[2].part[0], in[3].part[0]);
    const auto high01 = hn::InterleaveUpper(d, in[0].part[0], in[1].part[0]);
    const auto high23 = hn::InterleaveUpper(d, in[2].part[0], in[3].part[0]);
    // A 256-bit register interleaves within its 128-bit halves, which swaps the roles of lanes 1 and 2.
    constexpr int kSecond = sizeof(S) == 8 ? 2 : 1;
    out[0].part[0] = hn::ConcatLowerLower(d, low23, low01);
    out[kSecond].part[0] = hn::ConcatUpperUpper(d, low23, low01);
    out[3 - kSecond].part[0] = hn::ConcatLowerLower(d, high23, high01);
    out[3].part[0] = hn::ConcatUpperUpper(d, high23, high01);
    return;
  }
#endif
  S a[4][4], b[4][4];
  for (int i = 0; i < 4; ++i) in[i].store(a[i]);
  for (int i = 0; i < 4; ++i) {
    for (int k = 0; k < 4; ++k) b[i][k] = a[k][i];
  }
  for (int i = 0; i < 4; ++i) out[i] = Quad<S>::load(b[i]);
}

/// Lane sums of four quads, as one quad.
template <class S>
HWY_INLINE Quad<S> lane_sums(const Quad<S> (&in)[4]) {
#if HWY_TARGET != HWY_SCALAR
  if constexpr (Quad<S>::kParts == 1) {
    const typename Quad<S>::D d;
    const auto pair = [&](const Quad<S>& a, const Quad<S>& b) HWY_ATTR {
      return hn::Add(hn::InterleaveLower(d, a.part[0], b.part[0]), hn::InterleaveUpper(d, a.part[0], b.part[0]));
    };
    const auto u01 = pair(in[0], in[1]);
    const auto u23 = pair(in[2], in[3]);
    return {{hn::Add(hn::ConcatLowerLower(d, u23, u01), hn::ConcatUpperUpper(d, u23, u01))}};
  }
#endif
  Quad<S> t[4];
  transpose(in, t);
  return add(add(t[0], t[1]), add(t[2], t[3]));
}

/// Writes x, y, z of four points side by side.
template <class S>
HWY_INLINE void store_points(const Quad<S>& x, const Quad<S>& y, const Quad<S>& z, S* to) {
  for (int i = 0; i < Quad<S>::kParts; ++i) {
    hn::StoreInterleaved3(x.part[i], y.part[i], z.part[i], typename Quad<S>::D(), to + 3 * i * Quad<S>::kLanes);
  }
}

template <class S>
HWY_INLINE void add_points(const Quad<S>& x, const Quad<S>& y, const Quad<S>& z, S* to) {
  const typename Quad<S>::D d;
  for (int i = 0; i < Quad<S>::kParts; ++i) {
    S* at = to + 3 * i * Quad<S>::kLanes;
    typename Quad<S>::V a, b, c;
    hn::LoadInterleaved3(d, at, a, b, c);
    hn::StoreInterleaved3(hn::Add(a, x.part[i]), hn::Add(b, y.part[i]), hn::Add(c, z.part[i]), d, at);
  }
}

/// y_v = B_v x1_v of four vertices; `points` has 13 numbers to read, `result` 12 to write.
template <class S, int K>
HWY_INLINE void four_points(const SparseTable<S>& table, const S* HWY_RESTRICT transforms, const S* points, S* result,
                            Index v) {
  TransformSum<S> b[4];
  blend<S, K>(table, transforms, v, b);
  Quad<S> product[3][4];
  for (int i = 0; i < 4; ++i) {
    const Quad<S> x1 = load_point(points + 3 * i);
    for (int r = 0; r < 3; ++r) product[r][i] = mul(b[i].get(r), x1);
  }
  store_points(lane_sums(product[0]), lane_sums(product[1]), lane_sums(product[2]), result);
}

/// d_x_v += B_v(:,0:3)ᵀ d_y_v of four vertices.
template <class S, int K>
HWY_INLINE void four_point_adjoints(const SparseTable<S>& table, const S* HWY_RESTRICT transforms, const S* d_result,
                                    S* d_points, Index v) {
  TransformSum<S> b[4];
  blend<S, K>(table, transforms, v, b);
  Quad<S> g[4], t[4];
  for (int i = 0; i < 4; ++i) {
    const S* d_y = d_result + 3 * i;
    g[i] = mul(b[i].get(0), Quad<S>::fill(d_y[0]));
    g[i] = mul_add(b[i].get(1), Quad<S>::fill(d_y[1]), g[i]);
    g[i] = mul_add(b[i].get(2), Quad<S>::fill(d_y[2]), g[i]);
  }
  transpose(g, t);
  add_points(t[0], t[1], t[2], d_points);
}

/// The last four or fewer vertices go through copies, so that nothing outside of the arrays is touched.
template <class S, int K>
void points_of(const SparseTable<S>& table, const S* transforms, const S* points, S* result, Index begin, Index end) {
  Index v = begin;
  for (; v + 4 <= end && v + 4 < table.vertices; v += 4) {
    four_points<S, K>(table, transforms, points + 3 * v, result + 3 * v, v);
  }
  if (v == end) return;
  S copy[13] = {}, y[12];
  std::copy(points + 3 * v, points + 3 * end, copy);
  four_points<S, K>(table, transforms, copy, y, v);
  std::copy(y, y + 3 * (end - v), result + 3 * v);
}

template <class S, int K>
void point_adjoint_of(const SparseTable<S>& table, const S* transforms, const S* d_result, S* d_points, Index begin,
                      Index end) {
  Index v = begin;
  for (; v + 4 <= end; v += 4) {
    four_point_adjoints<S, K>(table, transforms, d_result + 3 * v, d_points + 3 * v, v);
  }
  if (v == end) return;
  S d_y[12] = {}, d_x[12] = {};
  std::copy(d_result + 3 * v, d_result + 3 * end, d_y);
  std::copy(d_points + 3 * v, d_points + 3 * end, d_x);
  four_point_adjoints<S, K>(table, transforms, d_y, d_x, v);
  std::copy(d_x, d_x + 3 * (end - v), d_points + 3 * v);
}

template <class S, int K>
void blend_of(const SparseTable<S>& table, const S* transforms, S* blended, Index begin, Index end) {
  Index v = begin;
  for (; v + 4 <= end; v += 4) {
    TransformSum<S> b[4];
    blend<S, K>(table, transforms, v, b);
    for (int i = 0; i < 4; ++i) b[i].store(blended + kTransformSize * (v + i));
  }
  for (; v < end; ++v) {
    TransformSum<S> b[1];
    blend<S, K>(table, transforms, v, b);
    b[0].store(blended + kTransformSize * v);
  }
}

template <class S>
void sparse_points(const SparseTable<S>& table, const S* transforms, const S* points, S* result, Index begin,
                   Index end) {
  (table.per_vertex == 4 ? points_of<S, 4> : points_of<S, 0>)(table, transforms, points, result, begin, end);
}
template <class S>
void sparse_point_adjoint(const SparseTable<S>& table, const S* transforms, const S* d_result, S* d_points, Index begin,
                          Index end) {
  const auto run = table.per_vertex == 4 ? point_adjoint_of<S, 4> : point_adjoint_of<S, 0>;
  run(table, transforms, d_result, d_points, begin, end);
}
template <class S>
void sparse_blend(const SparseTable<S>& table, const S* transforms, S* blended, Index begin, Index end) {
  (table.per_vertex == 4 ? blend_of<S, 4> : blend_of<S, 0>)(table, transforms, blended, begin, end);
}

/// partial_j += Σ w O_v over the entries of joint j in one block, for every joint that the block has. The block's own
/// sum starts from zero, so that the rounding error does not grow with the length of a chunk.
template <class S>
void add_block(const SparseTable<S>& table, Index block, const S* HWY_RESTRICT outer, S* HWY_RESTRICT partial) {
  const std::int32_t* first = table.block_begin.data() + block;
  const std::int32_t* HWY_RESTRICT offset = table.entry_offset.data();
  const S* HWY_RESTRICT weight = table.entry_weight.data();
  Index e = first[0] == 0 ? 0 : table.segments[first[0] - 1].end;
  for (Index s = first[0]; s < first[1]; ++s) {
    const SkinSegment segment = table.segments[s];
    TransformSum<S> even = TransformSum<S>::zero(), odd = even;
    for (; e < segment.end; e += 2) {
      even.add_scaled(outer + offset[e], weight[e]);
      odd.add_scaled(outer + offset[e + 1], weight[e + 1]);
    }
    even.add(odd);
    S* to = partial + kTransformSize * segment.joint;
    even.add_scaled(to, S(1));
    even.store(to);
  }
}

template <class S>
HWY_INLINE void outer_product(const Quad<S>& x1, const S* d_y, S* to) {
  for (int r = 0; r < 3; ++r) mul(x1, Quad<S>::fill(d_y[r])).store(to + 4 * r);
}

template <class S>
void sparse_transform_adjoint(const SparseTable<S>& table, const S* points, const S* d_result, S* partial, Index begin,
                              Index end) {
  alignas(64) S outer[kSparseBlock * kTransformSize];
  std::fill(partial, partial + table.joints * kTransformSize, S(0));
  for (Index first = begin; first < end; first += kSparseBlock) {
    const Index last = std::min(first + kSparseBlock, end);
    for (Index v = first; v < last; ++v) {
      S* to = outer + (v - first) * kTransformSize;
      if (v + 1 < table.vertices) {
        outer_product(load_point(points + 3 * v), d_result + 3 * v, to);
      } else {
        const S copy[4] = {points[3 * v], points[3 * v + 1], points[3 * v + 2], S(1)};
        outer_product(Quad<S>::load(copy), d_result + 3 * v, to);
      }
    }
    add_block(table, first / kSparseBlock, outer, partial);
  }
}

template <class S>
void sparse_blend_adjoint(const SparseTable<S>& table, const S* d_blended, S* partial, Index begin, Index end) {
  std::fill(partial, partial + table.joints * kTransformSize, S(0));
  for (Index first = begin; first < end; first += kSparseBlock) {
    add_block(table, first / kSparseBlock, d_blended + first * kTransformSize, partial);
  }
}

/// x with another number in its last lane.
template <class S>
HWY_INLINE Quad<S> with_last(Quad<S> x, S last) {
  using D = typename Quad<S>::D;
  constexpr int kLast = Quad<S>::kParts - 1;
  x.part[kLast] = hn::IfThenElse(hn::FirstN(D(), Quad<S>::kLanes - 1), x.part[kLast], hn::Set(D(), last));
  return x;
}

/// The rows of [F | x]; reads one number past the frame.
template <class S>
HWY_INLINE void load_frame(const S* frame, const S* point, Quad<S> (&rows)[4]) {
  for (int r = 0; r < 3; ++r) rows[r] = with_last(Quad<S>::load(frame + 3 * r), point[r]);
  rows[3] = with_last(Quad<S>::fill(0), S(1));
}

/// B [F | x; 0 | 1], as frame and point; writes one number past the frame.
template <class S>
HWY_INLINE void pose_frame(const TransformSum<S>& b, const S* frame, const S* point, S* posed_point, S* posed_frame) {
  alignas(64) S transform[kTransformSize], posed[4];
  b.store(transform);
  Quad<S> rows[4];
  load_frame(frame, point, rows);
  for (int r = 0; r < 3; ++r) {
    const S* t = transform + 4 * r;
    Quad<S> y = add(mul(rows[0], Quad<S>::fill(t[0])), with_last(Quad<S>::fill(0), t[3]));
    y = mul_add(rows[1], Quad<S>::fill(t[1]), y);
    y = mul_add(rows[2], Quad<S>::fill(t[2]), y);
    y.store(posed_frame + 3 * r);
    y.store(posed);
    posed_point[r] = posed[3];
  }
}

/// The last four or fewer vertices go through copies, as those of a chunk must not touch what follows.
template <class S, int K>
void frames_of(const SparseTable<S>& table, const S* transforms, const S* points, const S* frames, S* posed_points,
               S* posed_frames, Index begin, Index end) {
  Index v = begin;
  for (; v + 4 < end; v += 4) {
    TransformSum<S> b[4];
    blend<S, K>(table, transforms, v, b);
    for (int i = 0; i < 4; ++i)
      pose_frame(b[i], frames + 9 * (v + i), points + 3 * (v + i), posed_points + 3 * (v + i),
                 posed_frames + 9 * (v + i));
  }
  for (; v < end; ++v) {
    TransformSum<S> b[1];
    blend<S, K>(table, transforms, v, b);
    S frame[10] = {}, posed[10];
    std::copy(frames + 9 * v, frames + 9 * v + 9, frame);
    pose_frame(b[0], frame, points + 3 * v, posed_points + 3 * v, posed);
    std::copy(posed, posed + 9, posed_frames + 9 * v);
  }
}

template <class S>
void sparse_frames(const SparseTable<S>& table, const S* transforms, const S* points, const S* frames, S* posed_points,
                   S* posed_frames, Index begin, Index end) {
  const auto run = table.per_vertex == 4 ? frames_of<S, 4> : frames_of<S, 0>;
  run(table, transforms, points, frames, posed_points, posed_frames, begin, end);
}

/// O = d_F' Fᵀ beside d_y ⊗ (x, 1): the rows of d_y and d_F' times those of [F | x; 0 | 1] transposed.
template <class S>
HWY_INLINE void frame_product(const S* frame, const S* point, const S* d_y, const S* d_f, S* to) {
  Quad<S> rows[4], columns[4];
  load_frame(frame, point, rows);
  transpose(rows, columns);
  for (int r = 0; r < 3; ++r) {
    Quad<S> sum = mul(columns[3], Quad<S>::fill(d_y[r]));
    for (int c = 0; c < 3; ++c) sum = mul_add(columns[c], Quad<S>::fill(d_f[3 * r + c]), sum);
    sum.store(to + 4 * r);
  }
}

template <class S>
void sparse_frames_adjoint(const SparseTable<S>& table, const S* points, const S* frames, const S* d_posed_points,
                           const S* d_posed_frames, S* partial, Index begin, Index end) {
  alignas(64) S outer[kSparseBlock * kTransformSize];
  constexpr S kZeros[9] = {};
  const Index point_step = d_posed_points == nullptr ? 0 : 3, frame_step = d_posed_frames == nullptr ? 0 : 9;
  const S* d_y = point_step == 0 ? kZeros : d_posed_points;
  const S* d_f = frame_step == 0 ? kZeros : d_posed_frames;
  std::fill(partial, partial + table.joints * kTransformSize, S(0));
  for (Index first = begin; first < end; first += kSparseBlock) {
    const Index last = std::min(first + kSparseBlock, end);
    for (Index v = first; v < last; ++v) {
      const S* frame = frames + 9 * v;
      S copy[10] = {};
      if (v + 1 == table.vertices) frame = std::copy(frame, frame + 9, copy) - 9;
      frame_product(frame, points + 3 * v, d_y + point_step * v, d_f + frame_step * v,
                    outer + (v - first) * kTransformSize);
    }
    add_block(table, first / kSparseBlock, outer, partial);
  }
}

}  // namespace

template <class S>
void set_sparse(SkinKernels<S>& kernels) {
  kernels.sparse_points = sparse_points<S>;
  kernels.sparse_point_adjoint = sparse_point_adjoint<S>;
  kernels.sparse_transform_adjoint = sparse_transform_adjoint<S>;
  kernels.sparse_blend = sparse_blend<S>;
  kernels.sparse_blend_adjoint = sparse_blend_adjoint<S>;
  kernels.sparse_frames = sparse_frames<S>;
  kernels.sparse_frames_adjoint = sparse_frames_adjoint<S>;
}
template void set_sparse(SkinKernels<float>&);
template void set_sparse(SkinKernels<double>&);

}  // namespace hsi4d::detail::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace hsi4d::detail {

template <class S>
void set_sparse_kernels(SkinKernels<S>& kernels, [[maybe_unused]] Isa isa) {
#if (HWY_TARGETS & HWY_AVX3) && HWY_STATIC_TARGET != HWY_AVX3
  if (isa == Isa::kAvx512) return N_AVX3::set_sparse(kernels);
#endif
#if (HWY_TARGETS & HWY_AVX2) && HWY_STATIC_TARGET != HWY_AVX2
  if (isa == Isa::kAvx2) return N_AVX2::set_sparse(kernels);
#endif
  HWY_STATIC_DISPATCH(set_sparse)(kernels);
}
template void set_sparse_kernels(SkinKernels<float>&, Isa);
template void set_sparse_kernels(SkinKernels<double>&, Isa);

}  // namespace hsi4d::detail
#endif
