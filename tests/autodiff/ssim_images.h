// Images for the tests of structural similarity, and its definition, slow and obvious.
#pragma once

#include <cmath>
#include <random>
#include <vector>

#include "autodiff/ssim.h"
#include "tests/support/measures.h"
#include "tests/support/operator_check.h"

namespace hsi4d::test {

/// An image with its own memory; the padding is NaN, so that reading it shows.
template <class S>
struct PaddedImage {
  explicit PaddedImage(Shape s) : shape(s), data(static_cast<std::size_t>(s.memory()), S(NAN)) {}
  Array<S> view() { return {data.data(), shape}; }
  ConstArray<S> view() const { return {data.data(), shape}; }
  Shape shape;
  std::vector<S> data;
};

class TestRandom {
 public:
  explicit TestRandom(std::uint64_t seed) : engine_(seed) {}
  double operator()(double low, double high) {
    return low + (high - low) * static_cast<double>(engine_() >> 11) * 0x1p-53;
  }

 private:
  std::mt19937_64 engine_;
};

/// value(r, c) + noise·uniform(−1, 1).
template <class S, class F>
PaddedImage<S> noisy(const Shape& shape, double noise, TestRandom& random, const F& value) {
  PaddedImage<S> image(shape);
  for (Index p = 0; p < shape.planes; ++p) {
    for (Index r = 0; r < shape.rows; ++r) {
      for (Index c = 0; c < shape.cols; ++c) {
        image.view()(p, r, c) = static_cast<S>(value(r, c) + noise * random(-1, 1));
      }
    }
  }
  return image;
}
template <class S>
PaddedImage<S> random_image(const Shape& shape, TestRandom& random, double range = 1) {
  return noisy<S>(shape, range / 2, random, [&](Index, Index) { return range / 2; });
}

/// The obvious SSIM: a 121-tap window in double around every pixel.
struct ReferenceSsim {
  double mean = 0;
  std::vector<double> map, d_x;  // without padding
};
template <class S>
ReferenceSsim reference_ssim(const PaddedImage<S>& x, const PaddedImage<S>& y, double range = 1) {
  const Shape& s = x.shape;
  std::vector<double> w(11);
  double total = 0;
  for (int i = 0; i < 11; ++i) total += w[i] = std::exp(-(i - 5) * (i - 5) / (2 * 1.5 * 1.5));
  for (double& v : w) v /= total;
  const double c1 = 0.01 * range * 0.01 * range, c2 = 0.03 * range * 0.03 * range;
  ReferenceSsim result;
  result.map.resize(static_cast<std::size_t>(s.count()));
  result.d_x.resize(static_cast<std::size_t>(s.count()));
  for (Index p = 0; p < s.planes; ++p) {
    const auto inside = [&](Index r, Index c) { return r >= 0 && c >= 0 && r < s.rows && c < s.cols; };
    const auto at = [&](const PaddedImage<S>& image, Index r, Index c) {
      return inside(r, c) ? static_cast<double>(image.view()(p, r, c)) : 0.0;
    };
    const auto over_window = [&](Index r, Index c, const auto& f) {
      for (Index i = -5; i <= 5; ++i) {
        for (Index j = -5; j <= 5; ++j) f(w[i + 5] * w[j + 5], r + i, c + j);
      }
    };
    for (Index r = 0; r < s.rows; ++r) {
      for (Index c = 0; c < s.cols; ++c) {
        double mx = 0, my = 0, vx = 0, vy = 0, vxy = 0;
        over_window(r, c, [&](double q, Index i, Index j) {
          mx += q * at(x, i, j);
          my += q * at(y, i, j);
        });
        over_window(r, c, [&](double q, Index i, Index j) {
          vx += q * (at(x, i, j) - mx) * (at(x, i, j) - mx);
          vy += q * (at(y, i, j) - my) * (at(y, i, j) - my);
          vxy += q * (at(x, i, j) - mx) * (at(y, i, j) - my);
        });
        const double a1 = 2 * mx * my + c1, a2 = 2 * vxy + c2, b1 = mx * mx + my * my + c1, b2 = vx + vy + c2;
        const double value = a1 * a2 / (b1 * b2);
        result.map[static_cast<std::size_t>((p * s.rows + r) * s.cols + c)] = value;
        result.mean += value / static_cast<double>(s.count());
        const double d_mean = 2 * my * a2 / (b1 * b2) - 2 * mx * value / b1, d_vx = -value / b2;
        const double d_vxy = 2 * a1 / (b1 * b2);
        over_window(r, c, [&](double q, Index i, Index j) {
          if (!inside(i, j)) return;
          result.d_x[static_cast<std::size_t>((p * s.rows + i) * s.cols + j)] -=
              q * (d_mean + 2 * d_vx * (at(x, i, j) - mx) + d_vxy * (at(y, i, j) - my)) /
              static_cast<double>(s.count());
        });
      }
    }
  }
  return result;
}

template <class S>
struct SsimResult {
  double value = 0;  // d_ssim as the tape holds it
  double mean = 0;   // mean ssim in double
  std::vector<double> map, d_x;
};
template <class S>
std::vector<double> wide(const ConstArray<S>& a) {
  const std::vector<S> numbers = detail::numbers<S>(a);
  return {numbers.begin(), numbers.end()};
}
template <class S>
SsimResult<S> compute_ssim(const PaddedImage<S>& x, const PaddedImage<S>& y, double range = 1) {
  Tape<S> tape;
  const auto image = tape.parameter("image", x.shape), target = tape.constant("target", y.shape);
  std::copy(x.data.begin(), x.data.end(), tape.write(image).data);
  std::copy(y.data.begin(), y.data.end(), tape.write(target).data);
  const auto loss = d_ssim(image, target, {range});
  tape.forward(loss);
  tape.backward(loss);
  PaddedImage<S> map(x.shape);
  SsimResult<S> result;
  result.mean = ssim_map(x.view(), y.view(), map.view(), {range});
  result.value = static_cast<double>(tape.value(loss).scalar());
  result.map = wide<S>(map.view());
  result.d_x = wide<S>(tape.gradient(image));
  return result;
}

inline double norm(const std::vector<double>& a) {
  double sum = 0;
  for (const double v : a) sum += v * v;
  return std::sqrt(sum);
}
}  // namespace hsi4d::test
