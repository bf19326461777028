// Exponentials of plain loops and of the kernels of pixels, and what is made of them; sines.
#include <cmath>

#include "autodiff/dual.h"
#include "core/vector_exp.h"
#include "stress/function_table.h"
#include "stress/pixel_powers.h"
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

std::vector<hsi4d::FunctionErrors> hsi4d::function_errors(Index points) {
  std::vector<FunctionErrors> table;
  for (const auto add : {stress::add_exponentials, stress::add_rotations, stress::add_harmonics}) add(table, points);
  return table;
}
