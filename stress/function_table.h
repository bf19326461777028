// What the table of stress/functions.h is made with: arguments, errors in units in the last place, loops on every
// instruction set.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "core/random.h"
#include "core/simd.h"
#include "stress/functions.h"

namespace hsi4d::stress {

using FunctionTable = std::vector<FunctionErrors>;

/// What a row is of, before anything is measured.
struct FunctionRow {
  std::string function, argument;
  double low, high, bound;
  double largest =
      0;  ///< the function's largest value where its ulp are what errors are told in; 0: those of the value
};

template <class S>
constexpr const char* precision_name() {
  return std::is_same_v<S, float> ? "float" : "double";
}

/// A unit in the last place of x in S.
template <class S>
long double ulp_of(long double x) {
  return std::ldexp(
      1.0L, std::max(std::ilogb(x), std::numeric_limits<S>::min_exponent - 1) + 1 - std::numeric_limits<S>::digits);
}

/// Errors of one row.
template <class S>
class ErrorSum {
 public:
  /// @param unit  0: that of `exact`
  void add(double argument, long double value, long double exact, long double unit = 0) {
    const long double off = std::abs(value - exact);
    add_error(argument, off == 0 ? 0.0 : static_cast<double>(off / (unit > 0 ? unit : ulp_of<S>(exact))));
  }
  void add_error(double argument, double error) {
    ++tried_;
    sum_ += error;
    if (error <= worst_) return;  // what is not a number is the worst
    worst_ = std::isnan(error) ? std::numeric_limits<double>::infinity() : error;
    worst_at_ = argument;
  }
  FunctionErrors row(const FunctionRow& of, const std::string& isa) const {
    return {of.function,
            precision_name<S>(),
            of.argument,
            of.low,
            of.high,
            isa,
            of.largest > 0 ? ErrorUnit::kLargestUlp : ErrorUnit::kUlp,
            of.bound,
            tried_,
            worst_,
            tried_ > 0 ? sum_ / static_cast<double>(tried_) : 0,
            worst_at_};
  }

 private:
  Index tried_ = 0;
  double sum_ = 0, worst_ = -1, worst_at_ = 0;
};

/// `count` numbers of [low, high]: half of them random, a quarter spaced by their bits on each side of 0, and a quarter
/// neighbours of the ends and of `switches`, where a formula changes.
template <class S>
std::vector<S> arguments(double low, double high, Index count, std::span<const double> switches = {}) {
  std::vector<S> x;
  const auto add = [&](S value) {
    if (static_cast<double>(value) >= low && static_cast<double>(value) <= high) x.push_back(value);
  };
  RandomSequence random(19);
  for (Index i = 0; i < count / 2; ++i) {  // a random number of each of so many equal parts
    const double part = (static_cast<double>(i) + random.uniform(0, 1)) / static_cast<double>(count / 2);
    add(static_cast<S>(low + (high - low) * part));
  }
  constexpr int kOctaves = 30;  // below the larger end
  const double largest = std::max(std::abs(low), std::abs(high));
  for (Index i = 0; i < count / 4; ++i) {
    const double octave = kOctaves * (static_cast<double>(i) + random.uniform(0, 1)) / static_cast<double>(count / 4);
    const double whole = std::floor(octave);
    const double size = std::ldexp(largest * (1 - (octave - whole) / 2), -static_cast<int>(whole));
    add(static_cast<S>(i % 2 == 0 ? size : -size));
  }
  std::vector<double> dense = {low, high, 0};
  dense.insert(dense.end(), switches.begin(), switches.end());
  const Index each = count / 4 / std::ssize(dense);
  for (const double at : dense) {
    S above = static_cast<S>(at), below = above;
    add(above);
    for (Index i = 0; i < each / 2; ++i) {
      add(above = std::nextafter(above, std::numeric_limits<S>::max()));
      add(below = std::nextafter(below, std::numeric_limits<S>::lowest()));
    }
  }
  return x;
}

/// Instruction sets for which plain loops are compiled and which are allowed here.
inline std::vector<Isa> allowed_isas() {
  std::vector<Isa> all;
  for (const Isa isa : {Isa::kBaseline, Isa::kAvx2, Isa::kAvx512}) {
    if (isa <= best_isa()) all.push_back(isa);
  }
  return all;
}

/// exact(x) of all arguments.
template <class S, class G>
std::vector<long double> exact_values(const std::vector<S>& x, const G& exact) {
  std::vector<long double> all;
  all.reserve(x.size());
  for (const S argument : x) all.push_back(exact(static_cast<long double>(argument)));
  return all;
}

/// Adds the row of some values.
template <class S>
void add_row(FunctionTable& table, const FunctionRow& row, const std::string& isa, const std::vector<S>& x,
             const std::vector<S>& y, const std::vector<long double>& exact) {
  ErrorSum<S> errors;
  const long double unit = row.largest > 0 ? ulp_of<S>(row.largest) : 0;
  for (std::size_t i = 0; i < x.size(); ++i)
    errors.add(static_cast<double>(x[i]), static_cast<long double>(y[i]), exact[i], unit);
  table.push_back(errors.row(row, isa));
}

/// Adds a row for each instruction set, of f in a plain loop.
template <class S, class F, class G>
void add_loops(FunctionTable& table, const FunctionRow& row, Index points, std::span<const double> switches, const F& f,
               const G& exact) {
  const std::vector<S> x = arguments<S>(row.low, row.high, points, switches);
  const std::vector<long double> values = exact_values(x, exact);
  for (const Isa isa : allowed_isas()) {
    std::vector<S> y(x.size());
    const S* const from = x.data();
    S* const to = y.data();
    const std::size_t count = x.size();
    on_isa(isa, [&] {
      for (std::size_t i = 0; i < count; ++i) to[i] = f(from[i]);
    });
    add_row(table, row, isa_name(isa), x, y, values);
  }
}

/// Adds one row, of f as it is compiled here.
template <class S, class F, class G>
void add_plain(FunctionTable& table, const FunctionRow& row, Index points, std::span<const double> switches, const F& f,
               const G& exact) {
  const std::vector<S> x = arguments<S>(row.low, row.high, points, switches);
  std::vector<S> y;
  for (const S argument : x) y.push_back(f(argument));
  add_row(table, row, "all", x, y, exact_values(x, exact));
}

// The parts of the table, by file.
void add_exponentials(FunctionTable& table, Index points);  ///< function_exponentials.cpp
void add_rotations(FunctionTable& table, Index points);     ///< function_rotations.cpp
void add_harmonics(FunctionTable& table, Index points);     ///< function_harmonics.cpp

}  // namespace hsi4d::stress
