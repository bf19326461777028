#include "pipelines/sweep/sobol.h"

#include <array>

#include "core/check.h"

namespace hsi4d {
namespace {

constexpr int kBits = 32;

/// A primitive polynomial x^degree + a_1 x^(degree−1) + … + 1 over two elements, and the first direction numbers.
struct SobolPolynomial {
  int degree;
  unsigned inner;  ///< a_1 … a_(degree−1), the first one as the highest bit
  std::array<std::uint32_t, 7> numbers;
};

constexpr std::array<SobolPolynomial, kMostSobolDimensions - 1> kPolynomials = {{
    // Of dimensions 1 to 19; 0 is the van der Corput sequence.
    {1, 0, {1}},
    {2, 1, {1, 3}},
    {3, 1, {1, 3, 1}},
    {3, 2, {1, 1, 1}},
    {4, 1, {1, 1, 3, 3}},
    {4, 4, {1, 3, 5, 13}},
    {5, 2, {1, 1, 5, 5, 17}},
    {5, 4, {1, 1, 5, 5, 5}},
    {5, 7, {1, 1, 7, 11, 19}},
    {5, 11, {1, 1, 5, 1, 1}},
    {5, 13, {1, 1, 1, 3, 11}},
    {5, 14, {1, 3, 5, 5, 31}},
    {6, 1, {1, 3, 3, 9, 7, 49}},
    {6, 13, {1, 1, 1, 15, 21, 21}},
    {6, 16, {1, 3, 1, 13, 27, 49}},
    {6, 19, {1, 1, 1, 15, 7, 5}},
    {6, 22, {1, 3, 1, 15, 13, 25}},
    {6, 25, {1, 1, 5, 5, 19, 61}},
    {7, 1, {1, 3, 7, 11, 23, 15, 103}},
}};

using Directions = std::array<std::uint32_t, kBits>;  // v_k times 2³²

Directions directions_of(int dimension) {
  Directions v{};
  if (dimension == 0) {
    for (int k = 0; k < kBits; ++k) v[k] = std::uint32_t{1} << (kBits - 1 - k);
    return v;
  }
  const auto& [degree, inner, numbers] = kPolynomials[dimension - 1];
  for (int k = 0; k < kBits; ++k) {
    if (k < degree) {
      v[k] = numbers[k] << (kBits - 1 - k);
      continue;
    }
    v[k] = v[k - degree] ^ (v[k - degree] >> degree);
    for (int j = 1; j < degree; ++j) {
      if (inner >> (degree - 1 - j) & 1) v[k] ^= v[k - j];
    }
  }
  return v;
}

}  // namespace

std::uint32_t sobol_point(std::uint32_t index, int dimension) {
  static const std::array<Directions, kMostSobolDimensions> all = [] {
    std::array<Directions, kMostSobolDimensions> made;
    for (int d = 0; d < kMostSobolDimensions; ++d) made[d] = directions_of(d);
    return made;
  }();
  HSI4D_CHECK(dimension >= 0 && dimension < kMostSobolDimensions, "there are no direction numbers of this dimension");
  std::uint32_t x = 0;
  for (int k = 0; k < kBits && index >> k != 0; ++k) {
    if (index >> k & 1) x ^= all[dimension][k];
  }
  return x;
}

}  // namespace hsi4d
