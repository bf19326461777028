#include "splat/render/project.h"

#include <algorithm>
#include <cmath>

#include "autodiff/twists.h"
#include "core/lanes.h"
#include "core/parallel.h"
#include "core/simd.h"

namespace hsi4d {

namespace {

constexpr Index kGrain = 512;

/// x held within [low, high].
template <class V>
struct Held {
  V value;
  LaneMask<V> held;
};

template <class V>
Held<V> hold(const V& x, double low, double high) {
  const LaneMask<V> below = x < low;
  const LaneMask<V> above = x > high;
  return {below ? low : (above ? high : x), below | above};
}

/// What all rows share.
struct Lens {
  detail::MovedCamera camera;
  double fx, fy, cx, cy, near;
  double low_x, high_x, low_y, high_y;  // of x/z and y/z in the Jacobian
};

Lens lens_of(const SplatView& view, const Camera& c, const Vector6<double>& xi) {
  const double margin_x = (view.settings.frustum_clamp - 1) * c.width / (2 * c.fx);
  const double margin_y = (view.settings.frustum_clamp - 1) * c.height / (2 * c.fy);
  return {detail::moved_camera(view, xi),
          c.fx,
          c.fy,
          c.cx,
          c.cy,
          view.settings.near,
          -c.cx / c.fx - margin_x,
          (c.width - c.cx) / c.fx + margin_x,
          -c.cy / c.fy - margin_y,
          (c.height - c.cy) / c.fy + margin_y};
}

// --- eight Gaussians or four, in double; V: lanes -------------------------------------------------------------------

/// Mean and axes in the camera's frame, and what both passes make of them.
template <class V>
struct InCamera {
  V p[3], inverse_z;
  V axes[3][3];  // W M
  Held<V> ratio[2];
};

/// p = W (m − c)
template <class V>
void point_in_camera(const Lens& lens, const V* mean, V* p) {
  const Matrix3<double>& w = lens.camera.rotation;
  const Vector3<double>& c = lens.camera.center;
  const V d[3] = {mean[0] - c[0], mean[1] - c[1], mean[2] - c[2]};
  for (int r = 0; r < 3; ++r) p[r] = w(r, 0) * d[0] + w(r, 1) * d[1] + w(r, 2) * d[2];
}

template <class V>
void take_into_camera(const Lens& lens, const V* axes, InCamera<V>& g) {
  g.inverse_z = 1.0 / g.p[2];
  const Matrix3<double>& w = lens.camera.rotation;
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) g.axes[r][c] = w(r, 0) * axes[c] + w(r, 1) * axes[3 + c] + w(r, 2) * axes[6 + c];
  }
  g.ratio[0] = hold(g.p[0] * g.inverse_z, lens.low_x, lens.high_x);
  g.ratio[1] = hold(g.p[1] * g.inverse_z, lens.low_y, lens.high_y);
}

/// Whether a Gaussian has a depth, drawn or not: a smooth function of mean and camera, before `near` too.
template <class S, class V>
LaneMask<V> has_depth(const V* p) {
  return lane_finite(p[0]) & lane_finite(p[1]) & lane_finite(rounded_to<S>(p[2]));
}

/// Mean and factor in the image. Numbers of Gaussians that are not drawn mean nothing.
template <class V>
struct InImage {
  V mean[2], mean_rest[2], factor[6];
  LaneMask<V> drawn;
};

/// @param S  what the results are rounded to
template <class S, class V>
InImage<V> project_gaussian(const Lens& lens, const InCamera<V>& g) {
  InImage<V> image;
  image.drawn = lane_finite(g.p[0]) & lane_finite(g.p[1]) & (g.p[2] > lens.near) & lane_finite(g.p[2]);
  const double focal[2] = {lens.fx, lens.fy}, center[2] = {lens.cx, lens.cy};
  LaneMask<V> some{};
  for (int i = 0; i < 2; ++i) {
    const V mean = focal[i] * g.p[i] * g.inverse_z + center[i];
    image.mean[i] = rounded_to<S>(mean);
    image.mean_rest[i] = mean - image.mean[i];
    image.drawn = image.drawn & lane_finite(image.mean[i]);
    for (int c = 0; c < 3; ++c) {
      const V v = rounded_to<S>(focal[i] * g.inverse_z * (g.axes[i][c] - g.ratio[i].value * g.axes[2][c]));
      image.factor[3 * i + c] = v;
      image.drawn = image.drawn & lane_finite(v);
      some = some | (v != 0.0);
    }
  }
  image.drawn = image.drawn & some;
  return image;
}

/// Gradients of a drawn Gaussian in the camera's frame: of the point p, of the axes U = W M.
template <class V>
struct InCameraGradient {
  V p[3], axes[3][3];
};

/// V_0 = fx/z (U_0 − h_x U_2), V_1 likewise, u = fx x/z + cx. With a = d_V_0 · U: d_h_x = −fx/z a_2 unless held, and
/// since V ∝ 1/z, d_z −= (V·d_V)/z.
///
/// @param d_depth  of p_z itself
template <class V>
InCameraGradient<V> project_adjoint(const Lens& lens, const InCamera<V>& g, const V* d_mean_px, const V* d_factor,
                                    const V& d_depth) {
  const V zero{};
  InCameraGradient<V> d;
  d.p[2] = d_depth;
  for (V& axis : d.axes[2]) axis = zero;
  const double lens_focal[2] = {lens.fx, lens.fy};
  for (int i = 0; i < 2; ++i) {
    const V h = g.ratio[i].value, focal = lens_focal[i] * g.inverse_z;
    V along = zero, d_ratio = zero;  // V_i · d_V_i, and the gradient of h
    for (int c = 0; c < 3; ++c) {
      const V d_v = d_factor[3 * i + c] * focal;
      along = along + d_v * (g.axes[i][c] - h * g.axes[2][c]);
      d_ratio = d_ratio - d_v * g.axes[2][c];
      d.axes[i][c] = d_v;
      d.axes[2][c] = d.axes[2][c] - h * d_v;
    }
    d_ratio = g.ratio[i].held ? zero : d_ratio;
    const V d_place = focal * d_mean_px[i];
    d.p[2] = d.p[2] - (along + d_place * g.p[i] + d_ratio * h) * g.inverse_z;
    d.p[i] = d_place + d_ratio * g.inverse_z;
  }
  return d;
}

/// Gradients of the four intrinsics through a drawn Gaussian. V_0 and u − cx are proportional to fx; at a limit
/// h = (±(clamp − 1) W/2 + {0, W} − cx)/fx, so that d_fx −= d_h h/fx and d_cx −= d_h/fx.
template <class V>
void intrinsics_adjoint(const Lens& lens, const InCamera<V>& g, const V* d_mean_px, const V* d_factor,
                        V* d_intrinsics) {
  const V zero{};
  const double focal[2] = {lens.fx, lens.fy};
  for (int i = 0; i < 2; ++i) {
    const V h = g.ratio[i].value;
    V d_focal = d_mean_px[i] * g.p[i], d_ratio = zero;  // both with a factor 1/z still to come
    for (int c = 0; c < 3; ++c) {
      d_focal = d_focal + d_factor[3 * i + c] * (g.axes[i][c] - h * g.axes[2][c]);
      d_ratio = d_ratio - d_factor[3 * i + c] * focal[i] * g.axes[2][c];
    }
    d_ratio = g.ratio[i].held ? d_ratio * g.inverse_z : zero;
    d_intrinsics[i] = d_focal * g.inverse_z - d_ratio * h / focal[i];
    d_intrinsics[2 + i] = d_mean_px[i] - d_ratio / focal[i];
  }
}

template <class S>
struct Project {
  static constexpr const char* kName = "project";
  static constexpr bool kAssigns = true;
  SplatView view;
  bool own_intrinsics = true;  ///< those of the view, not an input

  enum Input { kMeansIn, kAxesIn, kXi, kIntrinsics };
  enum Output { kMeans, kFactors, kDepths, kRest, kMeansRest };

  Lens lens(const NodeIo<S>& io) const {
    Camera camera = view.camera;
    if (!own_intrinsics) {
      const S* numbers = io.in(kIntrinsics).data;
      camera.fx = static_cast<double>(numbers[0]);
      camera.fy = static_cast<double>(numbers[1]);
      camera.cx = static_cast<double>(numbers[2]);
      camera.cy = static_cast<double>(numbers[3]);
      check_camera(camera, "intrinsics of project");
    }
    return lens_of(view, camera, detail::camera_update(io.in(kXi)));
  }

  /// Some Gaussians in the camera's frame.
  template <class V>
  static InCamera<V> taken(const Lens& lens, const S* mean, const S* axes, Index count) {
    InCamera<V> g;
    V m[3], a[9];
    for (Index i = 0; i < 3; ++i) m[i] = load_wide<kLanesOf<V>>(mean + i, 3, count);
    for (Index i = 0; i < 9; ++i) a[i] = load_wide<kLanesOf<V>>(axes + i, 9, count);
    point_in_camera(lens, m, g.p);
    take_into_camera(lens, a, g);
    return g;
  }

  void forward(NodeIo<S>& io) {
    const ConstArray<S> means = io.in(kMeansIn), axes = io.in(kAxesIn);
    const Array<S> means_px = io.out(kMeans), factors = io.out(kFactors);
    const Array<S> depths = io.out(kDepths), rest = io.out(kRest), means_low = io.out(kMeansRest);
    const Lens lens = this->lens(io);
    parallel_for(means.shape.rows, kGrain, [&](Index begin, Index end) {
      with_best_lanes([&](auto lanes) {
        using V = DoubleLanes<lanes()>;
        for (Index n = begin; n < end; n += lanes()) {
          const Index count = end - n;
          const V zero{};
          const InCamera<V> g = taken<V>(lens, means.row(n), axes.row(n), count);
          const InImage<V> image = project_gaussian<S>(lens, g);
          for (Index i = 0; i < 2; ++i) {
            store_lanes<S>(image.drawn ? image.mean[i] : zero, means_px.row(n) + i, 2, count);
            store_lanes<S>(image.drawn ? image.mean_rest[i] : zero, means_low.row(n) + i, 2, count);
          }
          for (Index i = 0; i < 6; ++i) {
            store_lanes<S>(image.drawn ? image.factor[i] : zero, factors.row(n) + i, 6, count);
          }
          const V depth = has_depth<S>(g.p) ? g.p[2] : zero, rounded = rounded_to<S>(depth);
          store_lanes<S>(rounded, depths.row(n), 1, count);
          store_lanes<S>(depth - rounded, rest.row(n), 1, count);
        }
      });
    });
  }

  /// What the adjoint reads and adds to; null where there is none.
  struct Adjoint {
    ConstArray<S> means, axes, factors, d_means_px, d_factors, d_depths;
    Array<S> d_means, d_axes;
    bool wants_camera, wants_intrinsics;
  };

  /// What all rows of a chunk add to.
  struct Sums {
    RowSum delta[6], intrinsics[4];
  };

  void backward(NodeIo<S>& io) {
    Adjoint a{io.in(kMeansIn),
              io.in(kAxesIn),
              io.out(kFactors),
              io.d_out(kMeans),
              io.d_out(kFactors),
              io.d_out(kDepths),
              {},
              {},
              io.wants(kXi),
              !own_intrinsics && io.wants(kIntrinsics)};
    io.begin_rows(kXi, 0, 1);
    if (!own_intrinsics) io.begin_rows(kIntrinsics, 0, 1);
    if (io.wants(kMeansIn)) a.d_means = io.d_in(kMeansIn);
    if (io.wants(kAxesIn)) a.d_axes = io.d_in(kAxesIn);
    const Lens lens = this->lens(io);
    const Partition part = reduction_partition(a.means.shape.rows, kGrain);
    const std::span<double> partials = io.template scratch<double>(6 * part.chunks());
    const std::span<double> lens_partials = io.template scratch<double>(a.wants_intrinsics ? 4 * part.chunks() : 0);
    parallel_chunks(part, [&](Index chunk, Index begin, Index end) {
      with_best_lanes([&](auto lanes) {
        Sums sums;
        for (const int input : {kMeansIn, kAxesIn}) io.begin_rows(input, begin, end);
        for (Index n = begin; n < end; n += lanes())
          adjoint_of_rows<DoubleLanes<lanes()>>(lens, a, begin, n, end - n, sums);
        for (Index i = 0; i < 6; ++i) partials[static_cast<std::size_t>(6 * chunk + i)] = sums.delta[i].total();
        for (Index i = 0; a.wants_intrinsics && i < 4; ++i) {
          lens_partials[static_cast<std::size_t>(i * part.chunks() + chunk)] = sums.intrinsics[i].total();
        }
      });
    });
    for (Index i = 0; a.wants_intrinsics && i < 4; ++i)
      io.d_in(kIntrinsics).data[i] +=
          static_cast<S>(pairwise_sum(lens_partials.data() + i * part.chunks(), part.chunks()));
    if (a.wants_camera) detail::add_camera_gradient(io.in(kXi), partials, part.chunks(), io.d_in(kXi));
  }

  /// Rows [n, n + count), up to as many as V has, of a chunk from row `begin` on. Of a Gaussian that is not drawn the
  /// depth alone has a gradient.
  template <class V>
  static void adjoint_of_rows(const Lens& lens, const Adjoint& a, Index begin, Index n, Index count, Sums& sums) {
    constexpr Index kCount = kLanesOf<V>;
    const V zero{};
    LaneMask<V> drawn{};
    for (Index i = 0; i < 6; ++i) drawn = drawn | (load_wide<kCount>(a.factors.row(n) + i, 6, count) != zero);
    const V d_depth = a.d_depths ? load_wide<kCount>(a.d_depths.row(n), 1, count) : zero;
    if (!any_lane(drawn | (d_depth != zero))) return;
    const InCamera<V> g = taken<V>(lens, a.means.row(n), a.axes.row(n), count);
    // Arrays are not cleared as wholes: GCC 12 does that by a slow instruction.
    V d_mean_px[2], d_factor[6];
    for (Index i = 0; i < 2; ++i)
      d_mean_px[i] = a.d_means_px ? load_wide<kCount>(a.d_means_px.row(n) + i, 2, count) : zero;
    for (Index i = 0; i < 6; ++i)
      d_factor[i] = a.d_factors ? load_wide<kCount>(a.d_factors.row(n) + i, 6, count) : zero;
    InCameraGradient<V> d = project_adjoint(lens, g, d_mean_px, d_factor, d_depth);
    const LaneMask<V> with_depth = has_depth<S>(g.p);
    for (int i = 0; i < 3; ++i) {
      const V of_depth = i == 2 ? (with_depth ? d_depth : zero) : zero;
      d.p[i] = drawn ? d.p[i] : of_depth;
    }
    const Matrix3<double>& w = lens.camera.rotation;
    for (int i = 0; i < 3 && a.d_means; ++i) {
      add_lanes<S>(w(0, i) * d.p[0] + w(1, i) * d.p[1] + w(2, i) * d.p[2], a.d_means.row(n) + i, 3, count);
    }
    for (int i = 0; i < 9 && a.d_axes; ++i) {
      const int r = i / 3, c = i % 3;
      const V turned = w(0, r) * d.axes[0][c] + w(1, r) * d.axes[1][c] + w(2, r) * d.axes[2][c];
      add_lanes<S>(drawn ? turned : zero, a.d_axes.row(n) + i, 9, count);
    }
    const LaneMask<V> rows = first_lanes<double, kCount>(count);
    if (a.wants_camera) add_camera(n - begin, g, d, drawn, rows & (drawn | with_depth), sums);
    if (!a.wants_intrinsics) return;
    V d_lens[4];
    intrinsics_adjoint(lens, g, d_mean_px, d_factor, d_lens);
    for (int i = 0; i < 4; ++i) sums.intrinsics[i].add(n - begin, rows & drawn ? d_lens[i] : zero);
  }

  /// p' = p + ρ + φ × p, and the same without ρ for the columns of U.
  ///
  /// @param row    of the chunk, the first lane's
  /// @param drawn  those whose axes count
  /// @param rows   those that count
  template <class V>
  static void add_camera(Index row, const InCamera<V>& g, const InCameraGradient<V>& d, const LaneMask<V>& drawn,
                         const LaneMask<V>& rows, Sums& sums) {
    const V zero{};
    for (int i = 0; i < 3; ++i) {
      const int j = (i + 1) % 3, k = (i + 2) % 3;
      V of_axes = zero;
      for (int c = 0; c < 3; ++c) {
        of_axes = of_axes + (g.axes[j][c] * d.axes[k][c] - g.axes[k][c] * d.axes[j][c]);
      }
      const V turn = g.p[j] * d.p[k] - g.p[k] * d.p[j] + (drawn ? of_axes : zero);
      sums.delta[i].add(row, rows ? d.p[i] : zero);
      sums.delta[3 + i].add(row, rows ? turn : zero);
    }
  }

  /// Places in the image follow points and the camera: d (u, v) = J (W d m + ρ + φ × p).
  void push(NodeIo<S>& io, Movers<S>& movers) {
    const Twists<S>* const points = movers.of_input(io, kMeansIn);
    const bool camera = io.wants(kXi);
    if (points == nullptr && !camera) return;
    const Lens lens = this->lens(io);
    const std::int32_t viewer = camera ? movers.add(io, kXi, 0, camera_cotangents(io.in(kXi))) : -1;
    const ConstArray<S> means = io.in(kMeansIn), factors = io.out(kFactors);
    const Index of_points = points != nullptr ? points->per_row : 0;
    Twists<S>& places = movers.of_output(io, kMeans, means.shape.rows, of_points + (camera ? 1 : 0), 2);
    parallel_for(means.shape.rows, kGrain, [&](Index begin, Index end) {
      for (Index n = begin; n < end; ++n) {
        const S* const factor = factors.row(n);
        if (std::all_of(factor, factor + 6, [](S v) { return v == S(0); })) continue;  // not drawn
        double mean[3], p[3];
        std::copy_n(means.row(n), 3, mean);
        point_in_camera(lens, mean, p);
        const double u = lens.fx / p[2], v = lens.fy / p[2];
        Eigen::Matrix<double, 2, 3> jacobian;
        jacobian << u, 0, -u * p[0] / p[2], 0, v, -v * p[1] / p[2];
        for (Index k = 0; k < of_points; ++k) {
          places.mover(n, k) = points->mover(n, k);
          if (places.mover(n, k) < 0) continue;
          const Eigen::Map<const RatesOf<3>> rates(points->rate(n, k));
          Eigen::Map<RatesOf<2>>(places.rate(n, k)) =
              (jacobian * lens.camera.rotation * rates.template cast<double>()).template cast<S>();
        }
        if (!camera) continue;
        places.mover(n, of_points) = viewer;
        Eigen::Matrix<double, 3, kTwist> turn;
        turn << Matrix3<double>::Identity(), -hat(Vector3<double>(p[0], p[1], p[2]));
        Eigen::Map<RatesOf<2>>(places.rate(n, of_points)) = (jacobian * turn).template cast<S>();
      }
    });
  }
  template <int kDims>
  using RatesOf = Eigen::Matrix<S, kDims, kTwist, Eigen::RowMajor>;

  /// What ξ is multiplied with to give a change of the moved camera from the left.
  static std::array<std::vector<double>, kTwist> camera_cotangents(const ConstArray<S>& xi) {
    std::array<std::vector<double>, kTwist> cotangents;
    for (Index k = 0; k < kTwist; ++k) {
      Vector6<double> d = Vector6<double>::Zero();
      detail::moved_camera_adjoint(detail::camera_update(xi), Vector6<double>::Unit(k), d);
      cotangents[static_cast<std::size_t>(k)].assign(d.data(), d.data() + kTwist);
    }
    return cotangents;
  }

  /// What is drawn, and which ratios are held.
  void add_signature(Signature& signature, NodeIo<S>& io) {
    const ConstArray<S> means = io.in(kMeansIn), axes = io.in(kAxesIn);
    const Lens lens = this->lens(io);
    for (Index n = 0; n < means.shape.rows; ++n) {
      const InCamera<WideLanes> g = taken<WideLanes>(lens, means.row(n), axes.row(n), 1);
      const std::uint64_t drawn = project_gaussian<S>(lens, g).drawn[0] != 0;
      const std::uint64_t held_x = g.ratio[0].held[0] != 0, held_y = g.ratio[1].held[0] != 0;
      signature.add(drawn ? 2 + held_x + 2 * held_y : 1);
    }
  }
};

}  // namespace

template <class S>
Projected<S> project(Var<S> means, Var<S> axes, Var<S> xi, const SplatView& view, Var<S> intrinsics, Source where) {
  check_camera(view.camera);
  const Index rows = means.shape().rows;
  HSI4D_CHECK_EQ(means.shape(), shape_of(rows, 3));
  HSI4D_CHECK_EQ(axes.shape(), shape_of(rows, 9));
  HSI4D_CHECK_EQ(xi.shape(), shape_of(1, 6));
  const bool own = intrinsics.tape == nullptr;
  if (!own) HSI4D_CHECK_EQ(intrinsics.shape(), shape_of(1, 4));
  const std::array inputs = {means, axes, xi, intrinsics};
  const std::array outputs = {shape_of(rows, 2), shape_of(rows, 6), shape_of(rows, 1), shape_of(rows, 1),
                              shape_of(rows, 2)};
  Tape<S>& tape = means.owner();
  const Var<S> first = tape.record(Project<S>{view, own}, std::span<const Var<S>>(inputs).first(own ? 3 : 4),
                                   std::span<const Shape>(outputs), where);
  return {first, tape.output(first, 1), tape.output(first, 2), tape.output(first, 3), tape.output(first, 4)};
}

template Projected<float> project(Var<float>, Var<float>, Var<float>, const SplatView&, Var<float>, Source);
template Projected<double> project(Var<double>, Var<double>, Var<double>, const SplatView&, Var<double>, Source);

}  // namespace hsi4d
