// A Gaussian's ellipse in the image: determinant, exponent, extent, the factor of antialias (A1, A4 to A7).
#include <array>
#include <cmath>
#include <numbers>

#include "autodiff/complex_step.h"
#include "core/random.h"
#include "splat/render/block_kernel.h"
#include "splat/render/covariance.h"
#include "stress/measures.h"
#include "stress/rows.h"
#include "stress/splat_scene.h"
#include "stress/textbook_splat.h"

namespace hsi4d::stress {

namespace {

constexpr double kInf = std::numeric_limits<double>::infinity(), kNan = std::numeric_limits<double>::quiet_NaN();

using Factor = std::array<double, 6>;

/// Factor of a needle in the image, turned by any angle. Not inlined: where the numbers become double again, g++ 12
/// with -O3 (its vectors of straight-line code) leaves out the rounding to float.
[[gnu::noinline]] std::array<float, 6> needle(RandomSequence& random, double length, double width) {
  const double angle = random.uniform(0, std::numbers::pi), mix = random.uniform(0, 2 * std::numbers::pi);
  const double c = std::cos(angle), s = std::sin(angle);
  // A rotation times diag(length, width) times two rows of a rotation in space.
  const double along[3] = {std::cos(mix), std::sin(mix), 0};
  const double across[3] = {-0.6 * std::sin(mix), 0.6 * std::cos(mix), 0.8};
  std::array<float, 6> v;
  for (std::size_t k = 0; k < 3; ++k) {
    v[k] = static_cast<float>(c * length * along[k] - s * width * across[k]);
    v[3 + k] = static_cast<float>(s * length * along[k] + c * width * across[k]);
  }
  return v;
}

Factor in_double(const std::array<float, 6>& v) {
  Factor result;
  std::copy(v.begin(), v.end(), result.begin());
  return result;
}

std::array<float, 6> in_float(const Factor& v) {
  std::array<float, 6> result;
  std::transform(v.begin(), v.end(), result.begin(), [](double x) { return static_cast<float>(x); });
  return result;
}

/// cov in long double, and what a renderer needs of it.
struct ExactEllipse {
  long double xx, xy, yy, sharp, determinant;

  ExactEllipse(const Factor& v, long double blur) : xx(blur), xy(0), yy(blur), sharp(0) {
    for (std::size_t i = 0; i < 3; ++i) {
      const long double x = v[i], y = v[3 + i];
      const std::size_t j = (i + 1) % 3;
      const long double minor = x * v[3 + j] - y * v[j];
      xx += x * x, xy += x * y, yy += y * y;
      sharp += minor * minor;
    }
    determinant = sharp + blur * (xx + yy - 2 * blur) + blur * blur;
  }
  /// ½ dᵀ cov⁻¹ d, the pivot on the larger entry.
  long double exponent(long double dx, long double dy) const {
    const bool flat = xx >= yy;
    const long double p = flat ? xx : yy, first = flat ? dx : dy, across = (flat ? dy : dx) - xy / p * first;
    return (first * first / p + across * across * p / determinant) / 2;
  }
};

/// −log α of an opaque Gaussian at a pixel, by the compositor in float.
double composited_exponent(const detail::Conic& conic, double x, double y, Index row, Index col) {
  detail::SplatRecord<float> record{};
  record.x = x, record.y = y;
  record.l11 = static_cast<float>(conic.l11);
  record.l21 = static_cast<float>(conic.l21);
  record.l22 = static_cast<float>(conic.l22);
  record.opacity = 1;
  RenderSettings settings;
  apply_quality(settings, Quality::kReference);
  const Index left = col / 16 * 16, top = row / 16 * 16;
  const auto rules = detail::composite_rules<float>(settings);
  return -std::log(
      static_cast<double>(detail::block_pixel_alpha(16, record, rules, left, top, row - top, col - left).alpha));
}

/// Errors of determinants and exponents, and how often these are below 0.
struct NeedleErrors {
  Largest determinant, exponent;
  double flat = 0, negative = 0;
};

void try_determinant(const Factor& v, double blur, Remedy remedy, NeedleErrors& errors) {
  const long double exact = ExactEllipse(v, blur).determinant;
  detail::Conic conic;
  detail::conic_of(v.data(), blur, conic);
  const double determinant = remedy == Remedy::kOn
                                 ? conic.determinant
                                 : static_cast<double>(textbook_splat(in_float(v), float(blur)).determinant);
  errors.determinant.add(static_cast<double>(std::abs((determinant - exact) / exact)));
  errors.flat += !(determinant > 0);
}

/// At a pixel near the axis, within the image that the needle reaches over.
void try_exponent(const Factor& v, double length, double blur, RandomSequence& random, Remedy remedy,
                  NeedleErrors& errors) {
  detail::Conic conic;
  detail::conic_of(v.data(), blur, conic);
  const double norm = std::hypot(conic.xx, conic.xy), along = random.uniform(-1, 1) * std::min(length, 1000.0);
  const double x = 500 + random.uniform(), y = 500 + random.uniform();
  const Index col = static_cast<Index>(std::clamp(x + along * conic.xx / norm + random.uniform(-2, 2), 0., 999.));
  const Index row = static_cast<Index>(std::clamp(y + along * conic.xy / norm + random.uniform(-2, 2), 0., 999.));
  const double dx = static_cast<double>(col) + 0.5 - x, dy = static_cast<double>(row) + 0.5 - y;
  const double exact = static_cast<double>(ExactEllipse(v, blur).exponent(dx, dy));
  const double exponent =
      remedy == Remedy::kOn
          ? composited_exponent(conic, x, y, row, col)
          : static_cast<double>(
                textbook_splat(in_float(v), float(blur)).exponent(static_cast<float>(dx), static_cast<float>(dy)));
  if (exact < 10) errors.exponent.add(std::abs(exponent - exact));
  errors.negative += exponent < 0;
}

}  // namespace

std::vector<StressFigure> needles(Remedy remedy) {
  RandomSequence random(1, random_stream("needles"));
  NeedleErrors errors;
  for (int i = 0; i < 20000; ++i) {
    const double length = std::pow(10, random.uniform(0, 5));
    const Factor v = in_double(needle(random, length, 0.01));
    for (const double blur : {0., 0.1, 0.3}) try_determinant(v, blur, remedy, errors);
    if (length > 1e4) continue;
    for (const double blur : {0.1, 0.3}) try_exponent(v, length, blur, random, remedy, errors);
  }
  // Tighter than the catalogue's 1e-6: the program has them in double, of factors in float.
  return {{"relative error of det", errors.determinant.value(), 1e-12},
          {"determinants that are not above 0", errors.flat, 0},
          {"error of exponents below 10", errors.exponent.value(), 1e-3},
          {"exponents below 0", errors.negative, 0}};
}

// --- A4: any size at any depth

namespace {

/// Gaussians of 1e-12 to 1e12 m at 1e-6 to 1e6 m, in front of the camera and beside.
struct SizesAtDepths {
  Scene scene;
  std::vector<double> axes;

  explicit SizesAtDepths(const Camera& camera) : scene(empty_scene(camera)) {
    for (int z = -6; z <= 6; ++z) {
      for (int size = -12; size <= 12; ++size) add(std::pow(10.0, z), std::pow(10.0, size));
    }
  }
  void add(double z, double size) {
    for (const double x : {0., 0.3 * z, 1e4}) {
      scene.add({x, -x, z}, {1, 1, 1}, -5, {0.2, 0.5, 0.9});
      for (int i = 0; i < 9; ++i) axes.push_back(static_cast<float>(size * (i % 4 == 0 ? 1 : 0.1)));
    }
  }
};

/// What the program makes of them that is not finite, gradients and all.
double not_finite_in_render(const SizesAtDepths& sizes) {
  TapedScene<float> taped(sizes.scene, sizes.axes);
  taped.run();
  double count = not_finite(taped.value(taped.rendered.image)) + not_finite(taped.value(taped.rendered.transmittance));
  for (const Var<float> var : {taped.means, taped.axes, taped.opacity_logits, taped.sh, taped.xi}) {
    count += not_finite(taped.gradient(var));
  }
  return count;
}

/// The same of the textbook's ellipses, at any depth in front of the camera.
double not_finite_in_textbook(const SizesAtDepths& sizes) {
  double count = 0;
  for (Index n = 0; n < sizes.scene.gaussians.count(); ++n) {
    const float* const p = sizes.scene.gaussians.means.data() + 3 * n;
    const float focal = static_cast<float>(sizes.scene.camera.fx) / p[2];
    std::array<float, 6> v;
    for (std::size_t i = 0; i < 6; ++i) {
      const double* const axes = sizes.axes.data() + 9 * n;
      v[i] = focal * (static_cast<float>(axes[i]) - p[i / 3] / p[2] * static_cast<float>(axes[6 + i % 3]));
    }
    const auto s = textbook_splat(v, 0.3F);
    count += not_finite(std::array{s.determinant, s.a, s.b, s.c});
  }
  return count;
}

}  // namespace

std::vector<StressFigure> near_and_far(Remedy remedy) {
  Camera camera = front_camera(32, 24);
  camera.fx = camera.fy = 1000;
  SizesAtDepths sizes(camera);
  apply_quality(sizes.scene.settings, Quality::kReference);
  const double broken = remedy == Remedy::kOn ? not_finite_in_render(sizes) : not_finite_in_textbook(sizes);
  // What is behind the camera or nearer than `near` must leave no trace.
  Scene close = empty_scene(camera);
  for (const double z : {-3., -0.5, -0.01, 0., 1e-6, 1e-3, 0.00999}) close.add({0, 0, z}, {1, 1, 1}, 3, {1, 1, 1});
  if (remedy == Remedy::kOff) close.settings.near = 1e-30;
  double painted = 0;
  for (const double t : render_scene<float>(close).transmittance) painted += t != 1;
  return {{"numbers of render and gradients not finite", broken, 0},
          {"pixels painted by what is too near or behind", painted, 0}};
}

// --- A5: log-scales of any size

namespace {

constexpr std::array<double, 12> kLogScales = {-kInf, -200, -88, -40, -20.5, 0, 20.5, 40, 88, 200, kInf, kNan};

/// Gaussians, each with one of these log-scales.
Scene wild_scene() {
  Scene scene = random_scene(4 * std::ssize(kLogScales), 5, 48, 32);
  for (std::size_t i = 0; i < kLogScales.size(); ++i) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      scene.gaussians.log_scales[3 * (4 * i + axis) + axis] = static_cast<float>(kLogScales[i]);
    }
  }
  return scene;
}

/// Rotations times exp(log-scale), and the gradients of the sum of these axes.
struct Axes {
  std::vector<double> axes, d_log_scales;
};

Axes axes_by_program(const Scene& scene) {
  TapedScene<float> taped(scene);
  taped.tape.forward(taped.axes);
  const std::vector<float> ones(static_cast<std::size_t>(taped.axes.shape().count()), 1.0F);
  taped.tape.backward(taped.axes, ones);
  return {taped.value(taped.axes), taped.gradient(taped.log_scales)};
}

Axes axes_without_limits(Scene scene) {
  const std::vector<float> wild = scene.gaussians.log_scales;
  std::fill(scene.gaussians.log_scales.begin(), scene.gaussians.log_scales.end(), 0.0F);
  Axes result = axes_by_program(scene);  // rotations; the gradients are the sums of their columns
  for (std::size_t i = 0; i < result.axes.size(); ++i) {
    result.axes[i] = static_cast<float>(result.axes[i]) * std::exp(wild[i / 9 * 3 + i % 3]);
  }
  for (std::size_t i = 0; i < wild.size(); ++i) {
    result.d_log_scales[i] = static_cast<float>(result.d_log_scales[i]) * std::exp(wild[i]);
  }
  return result;
}

}  // namespace

std::vector<StressFigure> wild_log_scales(Remedy remedy) {
  const Scene scene = wild_scene();
  const Axes axes = remedy == Remedy::kOn ? axes_by_program(scene) : axes_without_limits(scene);
  double passed = 0;  // exp(−20.5) and less has no gradient either
  for (std::size_t i = 0; i < axes.d_log_scales.size(); ++i) {
    const bool is_held = !(std::abs(scene.gaussians.log_scales[i]) <= kLogScaleLimit);
    passed += is_held && axes.d_log_scales[i] != 0;
  }
  const Rendering r = render_scene<float>(scene);
  return {{"axes that are not finite", not_finite(axes.axes), 0},
          {"their gradients that are not finite", not_finite(axes.d_log_scales), 0},
          {"gradients where a scale is held", passed, 0},
          {"numbers of render and gradients not finite",
           not_finite(r.image) + not_finite(r.transmittance) + not_finite(r.gradients()), 0}};
}

// --- A6: from float to int

namespace {

/// A Gaussian in the image that no image should hold.
struct WildPlace {
  double size, at, opacity;
};

std::vector<WildPlace> wild_corpus() {
  std::vector<WildPlace> corpus;
  for (const double size : {0., 1e-300, 1e-8, 1., 1e8, 1e15, 1e18, 1e150, 1e300, kInf, kNan}) {
    for (const double at : {-kInf, -1e300, -1e20, -1., 0., 20., 1e10, 1e300, kInf, kNan}) {
      for (const double opacity : {0., 1e-30, 0.5, 1., kInf, kNan}) corpus.push_back({size, at, opacity});
    }
  }
  return corpus;
}

Factor factor_of(double size) { return {size, 0.1 * size, 0, 0, size, -0.1 * size}; }

/// Rows, blocks and tiles of the program's extents that are not in the image.
double outside_of_image(const WildPlace& place, const detail::TileGrid& grid, const RenderSettings& settings) {
  const Factor v = factor_of(place.size);
  detail::Conic conic;
  if (!detail::conic_of(v.data(), settings.blur, conic)) return 0;
  const detail::ExtentRules rules = detail::extent_rules(settings, 1e-7);
  const double log2_opacity = std::log2(std::max(place.opacity, kLeastOpacity));
  const detail::Extent e = detail::extent_of(conic, place.at, place.at, place.opacity,
                                             detail::reach_of(conic, place.at, log2_opacity, rules), grid, rules);
  double count = !(e.row_begin >= 0 && e.row_end <= grid.height);
  detail::for_each_tile(e, grid, [&](Index tile, std::uint32_t blocks) {
    count += !(tile >= 0 && tile < grid.count() && blocks > 0 && blocks <= detail::all_blocks(grid.tile));
  });
  return count;
}

/// Borders of the square of three standard deviations, in tiles, that no int can hold: to cast them is undefined.
double undefined_casts(const WildPlace& place, const detail::TileGrid& grid) {
  const auto s = textbook_splat(in_float(factor_of(place.size)), 0.3F);
  const float mid = 0.5F * (s.xx + s.yy), at = static_cast<float>(place.at);
  const float radius = std::ceil(3 * std::sqrt(mid + std::sqrt(std::max(0.1F, mid * mid - s.determinant))));
  double count = 0;
  for (const float border :
       {radius, (at - radius) / static_cast<float>(grid.tile), (at + radius) / static_cast<float>(grid.tile)}) {
    count += !(border > -0x1p31F && border < 0x1p31F);
  }
  return count;
}

}  // namespace

std::vector<StressFigure> wild_places(Remedy remedy) {
  const detail::TileGrid grid = detail::tile_grid(40, 30, 8);
  double count = 0;
  for (const WildPlace& place : wild_corpus()) {
    if (remedy == Remedy::kOff) {
      count += undefined_casts(place, grid);
      continue;
    }
    for (const Footprint footprint : {Footprint::kExact, Footprint::kSquare3Sigma}) {
      for (const double alpha_min : {0., kAlphaMin}) {
        RenderSettings settings;
        settings.footprint = footprint;
        settings.alpha_min = alpha_min;
        count += outside_of_image(place, grid, settings);
      }
    }
  }
  return {{"borders outside of the image, or of an int", count, 0}};
}

// --- A7: the factor of antialias

namespace {

/// Σ of squared minors, and of squares, for any kind of number.
template <class T>
T antialias_of(const std::array<T, 6>& v, double blur) {
  T sharp(0.0), trace(0.0);
  for (std::size_t i = 0; i < 3; ++i) {
    const std::size_t j = (i + 1) % 3;
    const T minor = v[i] * v[3 + j] - v[3 + i] * v[j];
    sharp += minor * minor;
    trace += v[i] * v[i] + v[3 + i] * v[3 + i];
  }
  return sqrt(sharp / (sharp + blur * trace + T(blur * blur)));
}

struct AntialiasFactor {
  double value;
  Factor d_factor;
};

AntialiasFactor factor_by_program(const Factor& v, double blur) {
  AntialiasFactor f{};
  detail::Conic conic;
  detail::conic_of(v.data(), blur, conic);
  f.value = detail::blur_compensation(conic);
  detail::blur_compensation_adjoint(v.data(), blur, conic, 1, f.d_factor.data());
  return f;
}

/// sqrt(max(0, det/det')) of determinants that cancel, with the derivative ½/f of the root.
AntialiasFactor factor_by_textbook(const Factor& v, double blur) {
  const std::array<float, 6> narrow = in_float(v);
  const auto sharp = textbook_splat(narrow, 0.0F), wide = textbook_splat(narrow, static_cast<float>(blur));
  const float ratio = sharp.determinant / wide.determinant, value = std::sqrt(std::max(0.0F, ratio));
  AntialiasFactor f{value, {}};
  for (std::size_t i = 0; i < 6; ++i) {
    const std::size_t other = (i + 3) % 6;
    const float x = narrow[i], y = narrow[other];
    const auto d_determinant = [&](const auto& s) { return 2 * ((i < 3 ? s.yy : s.xx) * x - s.xy * y); };
    f.d_factor[i] = (d_determinant(sharp) - ratio * d_determinant(wide)) / wide.determinant / (2 * value);
  }
  return f;
}

}  // namespace

std::vector<StressFigure> antialias_factor(Remedy remedy) {
  const auto factor = remedy == Remedy::kOn ? factor_by_program : factor_by_textbook;
  RandomSequence random(3, random_stream("antialias"));
  Largest value, gradient;
  for (int exponent = -8; exponent <= 1; ++exponent) {
    for (int i = 0; i < 200; ++i) {
      const double size = std::pow(10.0, exponent);
      const Factor v = in_double(needle(random, size, size * random.uniform(0.01, 1)));
      const AntialiasFactor f = factor(v, kBlur);
      value.add(std::abs(f.value / antialias_of(v, kBlur) - 1));
      Largest error, norm;
      for (std::size_t k = 0; k < 6; ++k) {
        const double exact =
            complex_step_derivative<6>([](auto... x) { return antialias_of(std::array{x...}, kBlur); }, v, k);
        error.add(std::abs(f.d_factor[k] - exact));
        norm.add(std::abs(exact));
      }
      gradient.add(error.value() / norm.value());
    }
  }
  const AntialiasFactor flat = factor({1, 0, 0, 2, 0, 0}, kBlur);  // without area: the factor is 0
  Largest of_flat;
  for (const double d : flat.d_factor) of_flat.add(std::abs(d));
  // Tighter than the catalogue's 1e-6 and 1e-4: the program has them in double, of factors in float.
  return {{"relative error of the factor", value.value(), 1e-12},
          {"relative error of its gradient", gradient.value(), 1e-9},
          {"gradient of a Gaussian without area", of_flat.value(), 0}};
}

}  // namespace hsi4d::stress
