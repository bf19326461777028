// Exponentials of plain loops and of the kernels of pixels, and what is made of them; sines.
#include <cmath>

#include "autodiff/dual.h"
#include "core/vector_exp.h"
#include "splat/limits.h"
#include "splat/render/block_kernel.h"
#include "splat/render/composite_kernel.h"
#include "stress/function_table.h"
#include "stress/vector_targets.h"

namespace hsi4d::stress {

namespace {

/// 1/(1 + e^−x)
long double exact_sigmoid(long double x) {
  const long double e = std::exp(-std::abs(x));
  return (x >= 0 ? 1 : e) / (1 + e);
}
long double exact_slope(long double x) {
  const long double e = std::exp(-std::abs(x));
  return e / ((1 + e) * (1 + e));
}
long double exact_softplus(long double x) { return std::max(x, 0.0L) + std::log1p(std::exp(-std::abs(x))); }

template <class S>
void add_loop_exponentials(FunctionTable& table, Index points) {
  constexpr bool kIsFloat = std::is_same_v<S, float>;
  constexpr double kLow = kIsFloat ? -87.3 : -708.3, kHigh = kIsFloat ? 88.7 : 709.7, kFar = kIsFloat ? 87 : 708;
  constexpr double kHalf = 0.34657359027997264;  // ½ ln 2, where the power of two changes
  const double switches[] = {-3 * kHalf, -kHalf, kHalf, 3 * kHalf};
  add_loops<S>(
      table, {"exp", "x", kLow, kHigh, 1.5}, points, switches, [](S x) { return vector_exp(x); },
      [](long double x) { return std::exp(x); });
  add_loops<S>(
      table, {"sigmoid", "x", -kFar, kFar, 2.5}, points, switches, [](S x) { return sigmoid(x); }, exact_sigmoid);
  add_loops<S>(
      table, {"sigmoid'", "x", -kFar, kFar, 5}, points, switches, [](S x) { return sigmoid_derivative(x); },
      exact_slope);
  add_loops<S>(
      table, {"softplus", "x", -kFar, kFar, 2.5}, points, switches, [](S x) { return softplus(x); }, exact_softplus);
}

/// The C library's, which rotations and the operators of the tape call.
template <class S>
void add_sines(FunctionTable& table, Index points) {
  const double switches[] = {-3.141592653589793, 1.5707963267948966, 3.141592653589793, 6.283185307179586};
  add_plain<S>(
      table, {"sin (C library)", "x", -10, 10, 0.8}, points, switches, [](S x) { return std::sin(x); },
      [](long double x) { return std::sin(x); });
  add_plain<S>(
      table, {"cos (C library)", "x", -10, 10, 0.8}, points, switches, [](S x) { return std::cos(x); },
      [](long double x) { return std::cos(x); });
}

/// A function of the kernels of pixels: what it is given for a wanted argument, and its value.
template <class S>
struct Pixel {
  S argument, value;
};

/// Adds a row for each set of vector instructions.
/// @param f  of a wanted argument: a Pixel
template <class S, class F, class G>
void add_pixels(FunctionTable& table, const FunctionRow& row, Index points, std::span<const double> switches,
                const F& f, const G& exact) {
  const std::vector<S> wanted = arguments<S>(row.low, row.high, points, switches);
  on_every_vector_target([&](const char* isa) {
    std::vector<S> x, y;
    for (const S argument : wanted) {
      const Pixel<S> pixel = f(argument);
      x.push_back(pixel.argument);
      y.push_back(pixel.value);
    }
    add_row(table, row, isa, x, y, exact_values(x, exact));
  });
}

/// exp(−d²/2) of a row of pixels, for d = √(−2 x).
template <class S>
Pixel<S> row_exponential(S wanted) {
  const double distance = std::sqrt(-2 * static_cast<double>(wanted));
  detail::SplatRecord<S> record{};
  record.l22 = record.opacity = 1;
  record.y = 0.5 - distance;
  detail::TileJob<S> job{};
  job.width = job.height = 16;
  const auto mean = static_cast<S>(record.y);
  const S d = S(0.5) - mean;  // as the kernel has it
  const detail::CompositeRules<S> rules{S(1), S(0), S(0), false, false};
  return {S(-0.5) * (d * d), detail::pixel_alpha(record, rules, job, 0, 0).alpha};
}

/// 2ᵖ of a block of pixels: with L = 0 what is left of the exponent is log₂ o.
Pixel<float> block_exponential(float p) {
  detail::SplatRecord<float> record{};
  record.opacity = 1;
  record.log2_opacity = p;
  const detail::CompositeRules<float> rules{1, kExactBelowAlpha, 1e-4f, false, false, 0.3f};
  return {p, detail::block_pixel_alpha(16, record, rules, 0, 0, 0, 0).alpha};
}

/// Its better form, which settings without cuts have, as `reference`, and small blurs. There log₂ o is not in the
/// exponent, which is −w² here: of a mean so far away, and an l22 so small, that where in the tile the pixel lies is
/// lost beside it.
Pixel<float> exact_block_exponential(float p) {
  constexpr auto kScale = static_cast<float>(detail::kLog2Scale);
  detail::SplatRecord<float> record{};
  record.opacity = 1;
  record.l22 = 0x1p-60f;
  const double y = std::sqrt(-static_cast<double>(p)) / static_cast<double>(kScale);
  record.y = -0x1p60 * y;
  const auto w = static_cast<float>(static_cast<double>(kScale) * y);
  const detail::CompositeRules<float> rules{1, kLeastAlpha, 0, false, false, 0.3f};
  return {-(w * w), detail::block_pixel_alpha(16, record, rules, 0, 0, 0, 0).alpha};
}

void add_pixel_exponentials(FunctionTable& table, Index points) {
  const double steps[] = {-0.5, -1, -1.5, -2, -2.5, -3, -4, -8};
  const auto exp2 = [](long double p) { return std::exp2(p); };
  const auto exp = [](long double x) { return std::exp(x); };
  add_pixels<float>(table, {"2^p, blocks of pixels", "p", -19.9, 0, 3.2}, points, steps, block_exponential, exp2);
  add_pixels<float>(table, {"2^p, blocks of pixels, exact form", "p", -125, 0, 1.25}, points, steps,
                    exact_block_exponential, exp2);
  const double halves[] = {-0.34657359027997264, -1.0397207708399179, -1.732867951399863};
  add_pixels<float>(table, {"exp, rows of pixels", "x", -87, 0, 1.5}, points, halves, row_exponential<float>, exp);
  add_pixels<double>(table, {"exp, rows of pixels", "x", -708, 0, 1.5}, points, halves, row_exponential<double>, exp);
}

}  // namespace

void add_exponentials(FunctionTable& table, Index points) {
  add_loop_exponentials<float>(table, points);
  add_loop_exponentials<double>(table, points);
  add_pixel_exponentials(table, points);
  add_sines<float>(table, points);
  add_sines<double>(table, points);
}

}  // namespace hsi4d::stress
