#include "splat/render/render.h"

#include <algorithm>
#include <array>

#include "autodiff/elementwise.h"
#include "autodiff/matrix.h"
#include "core/parallel.h"
#include "splat/limits.h"

namespace hsi4d {

namespace {

constexpr Index kRows = 16;  // of pixels a chunk
constexpr Index kColors = 3;

/// E = D/A, 0 where A = 0; D and A are planes of the channels. No gradient where A is too small for 1/A (row B14).
template <class S>
struct NormalizedDepth {
  static constexpr const char* kName = "normalized_depth";
  Index sum_plane, weight_plane;

  static bool has_gradient(S weight) { return weight > S(kLeastDepthWeight); }

  void forward(NodeIo<S>& io) {
    const ConstArray<S> channels = io.in(0);
    const Array<S> depth = io.out();
    parallel_for(depth.shape.rows, kRows, [&](Index begin, Index end) {
      for (Index r = begin; r < end; ++r) {
        for (Index x = 0; x < depth.shape.cols; ++x) {
          const S weight = channels(weight_plane, r, x);
          depth(r, x) = weight > S(0) ? channels(sum_plane, r, x) / weight : S(0);
        }
      }
    });
  }

  // d_D = g/A,  d_A = −g E/A
  void backward(NodeIo<S>& io) {
    if (!io.wants(0)) return;
    const ConstArray<S> channels = io.in(0), depth = io.out(), g = io.d_out();
    const Array<S> d_channels = io.d_in(0);
    parallel_for(depth.shape.rows, kRows, [&](Index begin, Index end) {
      for (Index r = begin; r < end; ++r) {
        for (Index x = 0; x < depth.shape.cols; ++x) {
          const S weight = channels(weight_plane, r, x);
          if (!has_gradient(weight)) continue;
          const S d_sum = g(r, x) / weight;
          d_channels(sum_plane, r, x) += d_sum;
          d_channels(weight_plane, r, x) -= d_sum * depth(r, x);
        }
      }
    });
  }

  void add_signature(Signature& signature, NodeIo<S>& io) {
    const ConstArray<S> channels = io.in(0);
    for (Index r = 0; r < channels.shape.rows; ++r) {
      for (Index x = 0; x < channels.shape.cols; ++x) {
        const S weight = channels(weight_plane, r, x);
        signature.add(has_gradient(weight) ? 1 : weight > S(0) ? 2 : 3);
      }
    }
  }
};

/// [N,1+G]: ones, and for each group 1 in its rows; without the ones when no mean depth is wanted.
///
/// @param first_row  what groups call row 0
template <class S>
Var<S> indicators(Tape<S>& tape, Index first_row, Index rows, const RenderRequest& request, Source where) {
  const Index first = request.depth ? 1 : 0, groups = static_cast<Index>(request.groups.size());
  const Var<S> result = tape.constant("indicators", shape_of(rows, first + groups), where);
  const Array<S> a = tape.write(result);
  for (Index n = 0; n < rows; ++n) {
    if (request.depth) a(n, 0) = S(1);
    for (Index k = 0; k < groups; ++k) {
      const auto& [begin, end] = request.groups[static_cast<std::size_t>(k)];
      a(n, first + k) = first_row + n >= begin && first_row + n < end ? S(1) : S(0);
    }
  }
  return result;
}

/// Projects Gaussians, and puts together what is composited of them: colours; depth and 1 if asked for; groups.
template <class S>
SplatSet<S> project_set(const SplatInputs<S>& inputs, Index first_row, Var<S> xi, const SplatView& view,
                        const RenderRequest& request, Var<S> intrinsics, Source where) {
  const Index rows = inputs.means.shape().rows;
  HSI4D_CHECK_EQ(inputs.colors.shape(), shape_of(rows, kColors));
  const Projected<S> projected = project(inputs.means, inputs.axes, xi, view, intrinsics, where);
  std::vector<Var<S>> features = {inputs.colors};
  if (request.depth || request.depth_moments) features.push_back(projected.depths);
  if (request.depth_moments) features.push_back(square(projected.depths, where));
  if (request.depth || !request.groups.empty()) {
    features.push_back(indicators(inputs.means.owner(), first_row, rows, request, where));
  }
  const Var<S> all = features.size() == 1 ? inputs.colors : concat_cols(std::span<const Var<S>>(features), where);
  return {projected, inputs.opacities, all};
}

/// @param still  null: there is none
template <class S>
Rendered<S> render_sets(const SplatInputs<S>* still, const SplatInputs<S>& moving, Var<S> xi, Var<S> background,
                        const SplatView& view, const RenderRequest& request, Var<S> intrinsics, Source where) {
  Tape<S>& tape = moving.means.owner();
  const Index first = still != nullptr ? still->means.shape().rows : 0, rows = first + moving.means.shape().rows;
  const auto groups = static_cast<Index>(request.groups.size());
  HSI4D_CHECK_EQ(background.shape(), shape_of(1, kColors));
  for (const auto& [begin, end] : request.groups) {
    HSI4D_CHECK(
        begin >= 0 && begin <= end && end <= rows,
        "group [" + std::to_string(begin) + ", " + std::to_string(end) + ") of " + std::to_string(rows) + " Gaussians");
  }
  const SplatSet<S> moved = project_set(moving, first, xi, view, request, intrinsics, where);
  const Composited<S> composited =
      still != nullptr
          ? composite(project_set(*still, 0, xi, view, request, intrinsics, where), moved, view, background, where)
          : composite(moved, view, background, where);

  const Shape one = image_shape<S>(1, view.camera.height, view.camera.width);
  Rendered<S> result;
  result.projected = moved.projected;
  result.counters = composited.counters;
  result.image = composited.channels;
  result.transmittance = composited.transmittance;
  const Index moments = request.depth_moments ? 2
                        : request.depth       ? 1
                                              : 0,
              first_group = moments + (request.depth ? 1 : 0);
  if (request.depth) result.depth = tape.record(NormalizedDepth<S>{0, moments}, {composited.more_channels}, one, where);
  const auto planes = [&](Index begin, Index count) {
    const Var<S> all = composited.more_channels;
    return count == all.shape().planes ? all : slice_planes(all, begin, count, where);
  };
  if (request.depth_moments) result.depth_moments = planes(0, moments);
  if (groups > 0) result.group_opacity = planes(first_group, groups);
  return result;
}

}  // namespace

template <class S>
Rendered<S> render(const SplatInputs<S>& inputs, Var<S> xi, Var<S> background, const SplatView& view,
                   const RenderRequest& request, Var<S> intrinsics, Source where) {
  return render_sets<S>(nullptr, inputs, xi, background, view, request, intrinsics, where);
}

template <class S>
Rendered<S> render(const SplatInputs<S>& still, const SplatInputs<S>& moving, Var<S> xi, Var<S> background,
                   const SplatView& view, const RenderRequest& request, Var<S> intrinsics, Source where) {
  return render_sets(&still, moving, xi, background, view, request, intrinsics, where);
}

#define HSI4D_INSTANTIATE(S)                                                                                         \
  template Rendered<S> render(const SplatInputs<S>&, Var<S>, Var<S>, const SplatView&, const RenderRequest&, Var<S>, \
                              Source);                                                                               \
  template Rendered<S> render(const SplatInputs<S>&, const SplatInputs<S>&, Var<S>, Var<S>, const SplatView&,        \
                              const RenderRequest&, Var<S>, Source);
HSI4D_INSTANTIATE(float)
HSI4D_INSTANTIATE(double)
#undef HSI4D_INSTANTIATE

}  // namespace hsi4d
