#include "splat/project.h"

#include <algorithm>
#include <cmath>

#include "core/parallel.h"
#include "core/simd.h"

namespace hsi4d {

namespace {

constexpr Index kGrain = 512;

/// x held within [low, high].
struct Held {
  double value;
  bool held;
};

Held hold(double x, double low, double high) {
  if (x < low) return {low, true};
  if (x > high) return {high, true};
  return {x, false};
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

// --- one Gaussian, in double -----------------------------------------------------------------------------------------

/// Mean and axes in the camera's frame, and what both passes make of them.
struct InCamera {
  double x, y, z, inverse_z;
  double axes[3][3];  // W M
  Held ratio_x, ratio_y;
};

template <class S>
Vector3<double> point_in_camera(const Lens& lens, const S* mean) {
  const Vector3<double> m(static_cast<double>(mean[0]), static_cast<double>(mean[1]), static_cast<double>(mean[2]));
  return lens.camera.rotation * (m - lens.camera.center);
}

template <class S>
void take_into_camera(const Lens& lens, const Vector3<double>& p, const S* axes, InCamera& g) {
  g.x = p[0], g.y = p[1], g.z = p[2];
  g.inverse_z = 1 / g.z;
  const Matrix3<double>& w = lens.camera.rotation;
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) {
      g.axes[r][c] = w(r, 0) * static_cast<double>(axes[c]) + w(r, 1) * static_cast<double>(axes[3 + c]) +
                     w(r, 2) * static_cast<double>(axes[6 + c]);
    }
  }
  g.ratio_x = hold(g.x * g.inverse_z, lens.low_x, lens.high_x);
  g.ratio_y = hold(g.y * g.inverse_z, lens.low_y, lens.high_y);
}

template <class S>
bool all_finite(const S* x, int n) {
  bool finite = true;
  for (int i = 0; i < n; ++i) finite = finite && std::isfinite(x[i]);
  return finite;
}

/// Whether a Gaussian has a depth, drawn or not: a smooth function of mean and camera, before `near` too.
template <class S>
bool has_depth(const Vector3<double>& p) {
  return std::isfinite(p[0]) && std::isfinite(p[1]) && std::isfinite(static_cast<S>(p[2]));
}

/// Mean and factor in the image. False, and all zeros, for a Gaussian that is not to be drawn.
template <class S>
bool project_gaussian(const Lens& lens, const Vector3<double>& p, const S* axes, S* mean_px, S* mean_rest, S* factor) {
  if (std::isfinite(p[0]) && std::isfinite(p[1]) && p[2] > lens.near && std::isfinite(p[2])) {
    InCamera g;
    take_into_camera(lens, p, axes, g);
    const double mean[2] = {lens.fx * g.x * g.inverse_z + lens.cx, lens.fy * g.y * g.inverse_z + lens.cy};
    for (int i = 0; i < 2; ++i) {
      mean_px[i] = static_cast<S>(mean[i]);
      mean_rest[i] = static_cast<S>(mean[i] - static_cast<double>(mean_px[i]));
    }
    for (int c = 0; c < 3; ++c) {
      factor[c] = static_cast<S>(lens.fx * g.inverse_z * (g.axes[0][c] - g.ratio_x.value * g.axes[2][c]));
      factor[3 + c] = static_cast<S>(lens.fy * g.inverse_z * (g.axes[1][c] - g.ratio_y.value * g.axes[2][c]));
    }
    if (all_finite(mean_px, 2) && all_finite(factor, 6) && is_drawn(factor)) return true;
  }
  std::fill_n(mean_px, 2, S(0));
  std::fill_n(mean_rest, 2, S(0));
  std::fill_n(factor, 6, S(0));
  return false;
}

/// Gradients of one drawn Gaussian in the camera's frame: of the point p, of the axes U = W M.
struct InCameraGradient {
  Vector3<double> d_p = Vector3<double>::Zero();
  double d_axes[3][3] = {};
};

/// V_0 = fx/z (U_0 − h_x U_2), V_1 likewise, u = fx x/z + cx. With a = d_V_0 · U: d_h_x = −fx/z a_2 unless held, and
/// since V ∝ 1/z, d_z −= (V·d_V)/z.
void project_adjoint(const Lens& lens, const InCamera& g, const double d_mean_px[2], const double d_factor[6],
                     InCameraGradient& d) {
  const double focal[2] = {lens.fx * g.inverse_z, lens.fy * g.inverse_z};
  const Held* const ratio[2] = {&g.ratio_x, &g.ratio_y};
  const double place[2] = {g.x, g.y};
  for (int i = 0; i < 2; ++i) {
    const double h = ratio[i]->value;
    double along = 0, d_ratio = 0;  // V_i · d_V_i, and the gradient of h
    for (int c = 0; c < 3; ++c) {
      const double d_v = d_factor[3 * i + c] * focal[i];
      along += d_v * (g.axes[i][c] - h * g.axes[2][c]);
      d_ratio -= d_v * g.axes[2][c];
      d.d_axes[i][c] += d_v;
      d.d_axes[2][c] -= h * d_v;
    }
    double d_place = focal[i] * d_mean_px[i];
    d.d_p[2] -= along * g.inverse_z + d_place * (place[i] * g.inverse_z);
    if (!ratio[i]->held) {
      d_place += d_ratio * g.inverse_z;
      d.d_p[2] -= d_ratio * h * g.inverse_z;
    }
    d.d_p[i] += d_place;
  }
}

/// Gradients of the four intrinsics through one drawn Gaussian. V_0 and u − cx are proportional to fx; at a limit
/// h = (±(clamp − 1) W/2 + {0, W} − cx)/fx, so that d_fx −= d_h h/fx and d_cx −= d_h/fx.
void intrinsics_adjoint(const Lens& lens, const InCamera& g, const double d_mean_px[2], const double d_factor[6],
                        Vector4<double>& d_intrinsics) {
  const double focal[2] = {lens.fx, lens.fy};
  const Held* const ratio[2] = {&g.ratio_x, &g.ratio_y};
  const double place[2] = {g.x, g.y};
  for (int i = 0; i < 2; ++i) {
    const double h = ratio[i]->value;
    double d_focal = d_mean_px[i] * place[i], d_ratio = 0;  // both with a factor 1/z still to come
    for (int c = 0; c < 3; ++c) {
      d_focal += d_factor[3 * i + c] * (g.axes[i][c] - h * g.axes[2][c]);
      d_ratio -= d_factor[3 * i + c] * focal[i] * g.axes[2][c];
    }
    d_intrinsics[i] += d_focal * g.inverse_z;
    d_intrinsics[2 + i] += d_mean_px[i];
    if (!ratio[i]->held) continue;
    d_intrinsics[i] -= d_ratio * g.inverse_z * h / focal[i];
    d_intrinsics[2 + i] -= d_ratio * g.inverse_z / focal[i];
  }
}

template <class S>
struct Project {
  static constexpr const char* kName = "project";
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

  void forward(NodeIo<S>& io) {
    const ConstArray<S> means = io.in(0), axes = io.in(1);
    const Array<S> means_px = io.out(kMeans), factors = io.out(kFactors);
    const Array<S> depths = io.out(kDepths), rest = io.out(kRest), means_rest = io.out(kMeansRest);
    const Lens lens = this->lens(io);
    parallel_for(means.shape.rows, kGrain, [&](Index begin, Index end) {
      on_best_isa([&] {
        for (Index n = begin; n < end; ++n) {
          const Vector3<double> p = point_in_camera(lens, means.row(n));
          project_gaussian(lens, p, axes.row(n), means_px.row(n), means_rest.row(n), factors.row(n));
          const S depth = static_cast<S>(p[2]);
          const bool usable = has_depth<S>(p);
          depths.data[n] = usable ? depth : S(0);
          rest.data[n] = usable ? static_cast<S>(p[2] - static_cast<double>(depth)) : S(0);
        }
      });
    });
  }

  void backward(NodeIo<S>& io) {
    const ConstArray<S> means = io.in(0), axes = io.in(1), xi = io.in(2), factors = io.out(kFactors);
    const ConstArray<S> d_means_px = io.d_out(kMeans), d_factors = io.d_out(kFactors), d_depths = io.d_out(kDepths);
    const Array<S> d_means = io.wants(0) ? io.d_in(0) : Array<S>{};
    const Array<S> d_axes = io.wants(1) ? io.d_in(1) : Array<S>{};
    const bool wants_camera = io.wants(kXi), wants_intrinsics = !own_intrinsics && io.wants(kIntrinsics);
    const Lens lens = this->lens(io);
    const Matrix3<double> transposed = lens.camera.rotation.transpose();
    const Partition part = reduction_partition(means.shape.rows, kGrain);
    const std::span<double> partials = io.template scratch<double>(6 * part.chunks());
    const std::span<double> lens_partials = io.template scratch<double>(wants_intrinsics ? 4 * part.chunks() : 0);
    parallel_chunks(part, [&](Index chunk, Index begin, Index end) {
      Vector6<double> d_delta = Vector6<double>::Zero();
      Vector4<double> d_intrinsics = Vector4<double>::Zero();
      on_best_isa([&] {
        for (Index n = begin; n < end; ++n) {
          const bool drawn = is_drawn(factors.row(n));
          const double d_depth = d_depths ? static_cast<double>(d_depths.data[n]) : 0;
          if (!drawn && d_depth == 0) continue;
          const Vector3<double> p = point_in_camera(lens, means.row(n));
          if (!drawn) {
            if (has_depth<S>(p)) add_depth_alone(transposed, p, d_depth, d_means ? d_means.row(n) : nullptr, d_delta);
            continue;
          }
          double d_mean_px[2] = {}, d_factor[6] = {};
          for (int i = 0; i < 2 && d_means_px; ++i) d_mean_px[i] = static_cast<double>(d_means_px.row(n)[i]);
          for (int i = 0; i < 6 && d_factors; ++i) d_factor[i] = static_cast<double>(d_factors.row(n)[i]);
          InCamera g;
          take_into_camera(lens, p, axes.row(n), g);
          InCameraGradient d;
          d.d_p[2] = d_depth;
          project_adjoint(lens, g, d_mean_px, d_factor, d);
          if (d_means) {
            const Vector3<double> d_m = transposed * d.d_p;
            for (int i = 0; i < 3; ++i) d_means.row(n)[i] += static_cast<S>(d_m[i]);
          }
          if (d_axes) {
            for (int r = 0; r < 3; ++r) {
              for (int c = 0; c < 3; ++c) {
                d_axes.row(n)[3 * r + c] +=
                    static_cast<S>(transposed(r, 0) * d.d_axes[0][c] + transposed(r, 1) * d.d_axes[1][c] +
                                   transposed(r, 2) * d.d_axes[2][c]);
              }
            }
          }
          if (wants_camera) add_camera(g, d, d_delta);
          if (wants_intrinsics) intrinsics_adjoint(lens, g, d_mean_px, d_factor, d_intrinsics);
        }
      });
      for (Index i = 0; i < 6; ++i) partials[static_cast<std::size_t>(6 * chunk + i)] = d_delta[i];
      for (Index i = 0; wants_intrinsics && i < 4; ++i)
        lens_partials[static_cast<std::size_t>(i * part.chunks() + chunk)] = d_intrinsics[i];
    });
    for (Index i = 0; wants_intrinsics && i < 4; ++i)
      io.d_in(kIntrinsics).data[i] +=
          static_cast<S>(pairwise_sum(lens_partials.data() + i * part.chunks(), part.chunks()));
    if (wants_camera) detail::add_camera_gradient(xi, partials, part.chunks(), io.d_in(2));
  }

  /// p' = p + ρ + φ × p, and the same without ρ for the columns of U.
  static void add_camera(const InCamera& g, const InCameraGradient& d, Vector6<double>& d_delta) {
    d_delta.head<3>() += d.d_p;
    Vector3<double> turn = cross(Vector3<double>(g.x, g.y, g.z), d.d_p);
    for (int c = 0; c < 3; ++c) {
      turn += cross(Vector3<double>(g.axes[0][c], g.axes[1][c], g.axes[2][c]),
                    Vector3<double>(d.d_axes[0][c], d.d_axes[1][c], d.d_axes[2][c]));
    }
    d_delta.tail<3>() += turn;
  }

  /// Of a Gaussian that is not drawn: z = the third of p = W (m − c).
  static void add_depth_alone(const Matrix3<double>& transposed, const Vector3<double>& p, double d_depth, S* d_mean,
                              Vector6<double>& d_delta) {
    const Vector3<double> d_p(0, 0, d_depth), d_m = transposed * d_p;
    for (int i = 0; i < 3 && d_mean != nullptr; ++i) d_mean[i] += static_cast<S>(d_m[i]);
    d_delta.head<3>() += d_p;
    d_delta.tail<3>() += cross(p, d_p);
  }

  /// What is drawn, and which ratios are held.
  void add_signature(Signature& signature, NodeIo<S>& io) {
    const ConstArray<S> means = io.in(0), axes = io.in(1);
    const Lens lens = this->lens(io);
    for (Index n = 0; n < means.shape.rows; ++n) {
      const Vector3<double> p = point_in_camera(lens, means.row(n));
      S mean_px[2], mean_rest[2], factor[6];
      if (!project_gaussian(lens, p, axes.row(n), mean_px, mean_rest, factor)) {
        signature.add(1);
        continue;
      }
      InCamera g;
      take_into_camera(lens, p, axes.row(n), g);
      signature.add(2 + static_cast<std::uint64_t>(g.ratio_x.held) + 2 * static_cast<std::uint64_t>(g.ratio_y.held));
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
