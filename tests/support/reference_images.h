// Images of test scenes by the brute-force renderer, and what tests of it share.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include <catch2/catch.hpp>

#include "splat/reference/reference.h"
#include "tests/support/measures.h"
#include "tests/support/splat_scenes.h"

namespace hsi4d::test {

/// Settings under which nothing is cut.
inline RenderSettings uncut(RenderSettings settings = {}) {
  apply_quality(settings, Quality::kReference);
  return settings;
}

template <class T = double>
reference::Image<T> render(const SplatScene& scene, const RenderSettings& settings) {
  return reference::render(reference_scene<T>(scene), reference_pinhole<T>(scene.camera),
                           reference_background<T>(scene), settings);
}

inline std::vector<reference::Fragment<double>> fragments(const SplatScene& scene, const RenderSettings& settings,
                                                          int row, int column) {
  return reference::fragments(reference_scene<double>(scene), reference_pinhole<double>(scene.camera), settings, row,
                              column)
      .composited;
}

template <class A, class B>
long double largest_gap(const A& a, const B& b) {
  REQUIRE(a.size() == b.size());
  long double largest = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    REQUIRE(std::isfinite(a[i]));
    largest = larger(largest, std::abs(static_cast<long double>(a[i]) - static_cast<long double>(b[i])));
  }
  return largest;
}

/// Largest difference of colours and transmittances.
template <class T, class U>
long double difference(const reference::Image<T>& a, const reference::Image<U>& b) {
  return std::max(largest_gap(a.color, b.color), largest_gap(a.transmittance, b.transmittance));
}

inline double logit(double opacity) { return std::log(opacity / (1 - opacity)); }

}  // namespace hsi4d::test
