// The spherical harmonics of splat/sh_basis.h, in lanes as sh_colors has them.
#include <array>
#include <cstring>
#include <numbers>

#include "core/lanes.h"
#include "splat/limits.h"
#include "splat/sh_basis.h"
#include "stress/function_table.h"

namespace hsi4d::stress {

namespace {

constexpr int kBasis = 16;

/// Y_k by their closed forms, and the largest value of each on the sphere. [Sloan 2008, Stupid Spherical Harmonics
/// Tricks, appendix A2; signs of INRIA's files]
std::array<long double, kBasis> exact_basis(long double x, long double y, long double z) {
  static const auto over_pi = [](long double number) { return std::sqrt(number / std::numbers::pi_v<long double>); };
  static const long double c0 = over_pi(1) / 2, c1 = over_pi(3) / 2, c4 = over_pi(15) / 2, c6 = over_pi(5) / 4,
                           c8 = over_pi(15) / 4, c9 = over_pi(17.5L) / 4, c10 = over_pi(105) / 2,
                           c11 = over_pi(10.5L) / 4, c12 = over_pi(7) / 4, c14 = over_pi(105) / 4;
  const long double xx = x * x, yy = y * y, zz = z * z;
  return {c0,
          -c1 * y,
          c1 * z,
          -c1 * x,
          c4 * x * y,
          -c4 * y * z,
          c6 * (2 * zz - xx - yy),
          -c4 * x * z,
          c8 * (xx - yy),
          -c9 * y * (3 * xx - yy),
          c10 * x * y * z,
          -c11 * y * (4 * zz - xx - yy),
          c12 * z * (2 * zz - 3 * xx - 3 * yy),
          -c11 * x * (4 * zz - xx - yy),
          c14 * z * (xx - yy),
          -c9 * x * (xx - 3 * yy)};
}

/// The largest |Y_k| on the sphere.
constexpr std::array<double, kBasis> kLargest = {0.282, 0.489, 0.489, 0.489, 0.546, 0.546, 0.631, 0.546,
                                                 0.546, 0.590, 0.556, 0.629, 0.746, 0.629, 0.556, 0.590};

/// Of the errors by degree; that of degree 0 is the rounding of a constant.
constexpr double kBounds[] = {0.5, 1, 2.5, 3.5};

int degree_of(int k) { return k < 1 ? 0 : k < 4 ? 1 : k < 9 ? 2 : 3; }

/// Directions, of unit length to rounding: random, and some along axes and in planes.
template <class S>
std::vector<std::array<S, 3>> directions(Index count) {
  RandomSequence random(21);
  std::vector<std::array<S, 3>> all;
  for (Index n = 0; n < count; ++n) {
    std::array<double, 3> r = {random.normal(), random.normal(), random.normal()};
    if (n % 8 < 3) r[static_cast<std::size_t>(n % 8)] = 0;
    if (n % 64 < 9) r[static_cast<std::size_t>(n % 3)] *= 1e-6;
    const double length = std::sqrt(r[0] * r[0] + r[1] * r[1] + r[2] * r[2]);
    all.push_back({static_cast<S>(r[0] / length), static_cast<S>(r[1] / length), static_cast<S>(r[2] / length)});
  }
  return all;
}

/// Bases of all directions, [16] each.
template <class S>
std::vector<S> bases_of(const std::vector<std::array<S, 3>>& r, Isa isa) {
  std::vector<S> all(r.size() * kBasis);
  on_isa(isa, [&] {
    for (std::size_t n = 0; n < r.size(); n += kLanes) {
      const auto count = static_cast<Index>(std::min<std::size_t>(kLanes, r.size() - n));
      Lanes<S> basis[kBasis];
      sh_basis(kHighestShDegree, load_lanes(&r[n][0], 3, count), load_lanes(&r[n][1], 3, count),
               load_lanes(&r[n][2], 3, count), basis);
      for (int k = 0; k < kBasis; ++k)
        store_lanes<S>(basis[k], &all[n * kBasis + static_cast<std::size_t>(k)], kBasis, count);
    }
  });
  return all;
}

template <class S>
void add_bases(FunctionTable& table, Index points) {
  const std::vector<std::array<S, 3>> r = directions<S>(points);
  for (const Isa isa : allowed_isas()) {
    const std::vector<S> bases = bases_of(r, isa);
    std::array<ErrorSum<S>, kHighestShDegree + 1> errors;
    for (std::size_t n = 0; n < r.size(); ++n) {
      const auto exact = exact_basis(r[n][0], r[n][1], r[n][2]);
      for (std::size_t k = 0; k < kBasis; ++k)
        errors[static_cast<std::size_t>(degree_of(static_cast<int>(k)))].add(
            static_cast<double>(r[n][2]), bases[n * kBasis + k], exact[k], ulp_of<S>(kLargest[k]));
    }
    for (std::size_t degree = 0; degree < errors.size(); ++degree)
      table.push_back(errors[degree].row(
          {"harmonics of degree " + std::to_string(degree), "z", -1, 1, kBounds[degree], 1}, isa_name(isa)));
  }
}

}  // namespace

void add_harmonics(FunctionTable& table, Index points) {
  add_bases<float>(table, points);
  add_bases<double>(table, points);
}

}  // namespace hsi4d::stress
