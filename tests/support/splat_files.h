// Small Gaussians for tests of file formats, and what differs after a format's rounding.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstring>
#include <random>
#include <string>
#include <vector>

#include "core/check.h"
#include "core/quaternion.h"
#include "splat/gaussians.h"
#include "splat/sh_basis.h"
#include "tests/support/measures.h"

namespace hsi4d::test {

/// n Gaussians within ±2 m whose numbers every format holds: quaternions of length 0.1 to 10, log-scales −6 to −1,
/// logits ±4, colours within 0 to 1, harmonics within ±0.9.
inline Gaussians plain_gaussians(Index n, int degree, unsigned seed = 7) {
  std::mt19937 random(seed);
  const auto number = [&](double least, double most) {
    return static_cast<float>(least + (most - least) * (static_cast<double>(random() >> 8) / 16777216.0));
  };
  Gaussians g;
  g.sh_degree = degree;
  for (Index i = 0; i < n; ++i) {
    for (int c = 0; c < 3; ++c) g.means.push_back(number(-2, 2));
    Vector4<double> q;
    do q = Vector4<double>(number(-1, 1), number(-1, 1), number(-1, 1), number(-1, 1));
    while (!(q.norm() > 0.1));
    const double length = std::pow(10.0, static_cast<double>(number(-1, 1)));
    for (int c = 0; c < 4; ++c) g.quats.push_back(static_cast<float>(q[c] / q.norm() * length));
    for (int c = 0; c < 3; ++c) g.log_scales.push_back(number(-6, -1));
    g.opacity_logits.push_back(number(-4, 4));
    for (int k = 0; k < g.sh_coefficients(); ++k) {
      for (int c = 0; c < 3; ++c)
        g.sh.push_back(k == 0 ? static_cast<float>((static_cast<double>(number(0, 1)) - 0.5) / kShC0)
                              : number(-0.9, 0.9));
    }
  }
  return g;
}

inline double opacity_of(float logit) { return 1 / (1 + std::exp(-static_cast<double>(logit))); }

inline double largest_opacity_difference(const Gaussians& a, const Gaussians& b) {
  HSI4D_CHECK_EQ(a.count(), b.count());
  double largest = 0;
  for (std::size_t n = 0; n < a.opacity_logits.size(); ++n)
    largest = larger(largest, std::fabs(opacity_of(a.opacity_logits[n]) - opacity_of(b.opacity_logits[n])));
  return largest;
}

/// The largest angle between the rotations of two sets of Gaussians, radians.
inline double largest_angle(const Gaussians& a, const Gaussians& b) {
  HSI4D_CHECK_EQ(a.count(), b.count());
  const auto unit = [](const Gaussians& g, Index n) {
    const float* q = g.quats.data() + 4 * n;
    return quaternion_normalized(Vector4<double>(q[0], q[1], q[2], q[3]));
  };
  double largest = 0;
  for (Index n = 0; n < a.count(); ++n) {
    const Vector4<double> p = unit(a, n), q = unit(b, n);
    const double chord = (p - (dot(p, q) < 0 ? -1.0 : 1.0) * q).norm();
    largest = larger(largest, 4 * std::asin(std::min(1.0, chord / 2)));
  }
  return largest;
}

/// Harmonics of degree 1 and more, [N,3(K−1)].
inline std::vector<float> rest_of(const Gaussians& g) {
  std::vector<float> rest;
  const auto width = static_cast<std::size_t>(3 * g.sh_coefficients());
  for (std::size_t i = 0; i < g.sh.size(); ++i) {
    if (i % width >= 3) rest.push_back(g.sh[i]);
  }
  return rest;
}

/// Colours f_dc, [N,3].
inline std::vector<float> dc_of(const Gaussians& g) {
  std::vector<float> dc;
  const auto width = static_cast<std::size_t>(3 * g.sh_coefficients());
  for (std::size_t i = 0; i < g.sh.size(); ++i) {
    if (i % width < 3) dc.push_back(g.sh[i]);
  }
  return dc;
}

inline bool same_numbers(const Gaussians& a, const Gaussians& b) {
  const auto same = [](const std::vector<float>& x, const std::vector<float>& y) {
    return x.size() == y.size() && (x.empty() || std::memcmp(x.data(), y.data(), x.size() * sizeof(float)) == 0);
  };
  return a.sh_degree == b.sh_degree && same(a.means, b.means) && same(a.quats, b.quats) &&
         same(a.log_scales, b.log_scales) && same(a.opacity_logits, b.opacity_logits) && same(a.sh, b.sh);
}

}  // namespace hsi4d::test
