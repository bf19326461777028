// Rows E: losses.
#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "autodiff/difference.h"
#include "autodiff/elementwise.h"
#include "autodiff/ssim.h"
#include "autodiff/weighted_image.h"
#include "core/image.h"
#include "core/parallel.h"
#include "core/random.h"
#include "optim/metrics.h"
#include "stress/rotation_measures.h"
#include "stress/rows.h"
#include "stress/tape_numbers.h"

namespace hsi4d::stress {

namespace {

// --- structural similarity

/// A grey image.
template <class S>
struct Picture {
  Index rows = 0, cols = 0;
  std::vector<S> numbers;

  S operator()(Index r, Index c) const {  // zeros outside
    return r < 0 || c < 0 || r >= rows || c >= cols ? S(0) : numbers[static_cast<std::size_t>(r * cols + c)];
  }
};

/// level + noise·uniform(−1, 1), rounded to float.
Picture<float> flat_picture(double level, double noise, double scale, std::uint64_t stream) {
  constexpr Index kRows = 19, kCols = 27;
  Picture<float> picture{kRows, kCols, {}};
  const Random random(5, stream);
  for (std::uint64_t i = 0; i < kRows * kCols; ++i) {
    picture.numbers.push_back(static_cast<float>(scale * (level + noise * random.uniform(i, -1, 1))));
  }
  return picture;
}

struct Similarity {
  std::vector<double> map;  ///< ssim of every pixel
  std::vector<double> d_x;  ///< of 1 − mean ssim
};

/// Mean and (co)variances under the window about a pixel.
template <class S>
struct Moments {
  S mx = 0, my = 0, vx = 0, vy = 0, vxy = 0;
};

template <class S>
std::array<S, 11> window_weights() {
  std::array<double, 11> w;
  double total = 0;
  for (int i = 0; i < 11; ++i) total += w[static_cast<std::size_t>(i)] = std::exp(-(i - 5) * (i - 5) / 4.5);
  std::array<S, 11> weights;
  for (std::size_t i = 0; i < 11; ++i) weights[i] = static_cast<S>(w[i] / total);
  return weights;
}

template <class Visit>
void over_window(Index r, Index c, const Visit& visit) {
  for (Index i = 0; i < 11; ++i) {
    for (Index j = 0; j < 11; ++j)
      visit(static_cast<std::size_t>(i), static_cast<std::size_t>(j), r + i - 5, c + j - 5);
  }
}

/// @param by_squares  variances as E[x²] − E[x]²; else about the mean
template <class S>
Moments<S> window_moments(const Picture<S>& x, const Picture<S>& y, Index r, Index c, bool by_squares) {
  static const std::array<S, 11> w = window_weights<S>();
  Moments<S> m;
  over_window(r, c, [&](std::size_t i, std::size_t j, Index row, Index col) {
    m.mx += w[i] * w[j] * x(row, col);
    m.my += w[i] * w[j] * y(row, col);
  });
  const S shift_x = by_squares ? S(0) : m.mx, shift_y = by_squares ? S(0) : m.my;
  over_window(r, c, [&](std::size_t i, std::size_t j, Index row, Index col) {
    const S a = x(row, col) - shift_x, b = y(row, col) - shift_y;
    m.vx += w[i] * w[j] * a * a;
    m.vy += w[i] * w[j] * b * b;
    m.vxy += w[i] * w[j] * a * b;
  });
  if (!by_squares) return m;
  m.vx -= m.mx * m.mx;
  m.vy -= m.my * m.my;
  m.vxy -= m.mx * m.my;
  return m;
}

/// The definition, window by window; see autodiff/ssim.h.
template <class S>
Similarity similarity_by_windows(const Picture<S>& x, const Picture<S>& y, bool by_squares) {
  static const std::array<S, 11> w = window_weights<S>();
  const S c1 = S(1e-4), c2 = S(9e-4), count = static_cast<S>(x.numbers.size());
  std::vector<S> d_x(x.numbers.size());
  Similarity result;
  for (Index r = 0; r < x.rows; ++r) {
    for (Index c = 0; c < x.cols; ++c) {
      const Moments<S> m = window_moments(x, y, r, c, by_squares);
      const S a1 = 2 * m.mx * m.my + c1, a2 = 2 * m.vxy + c2;
      const S b1 = m.mx * m.mx + m.my * m.my + c1, b2 = m.vx + m.vy + c2;
      const S value = a1 * a2 / (b1 * b2);
      result.map.push_back(static_cast<double>(value));
      const S d_mean = 2 * m.my * a2 / (b1 * b2) - 2 * m.mx * value / b1;
      over_window(r, c, [&](std::size_t i, std::size_t j, Index row, Index col) {
        if (row < 0 || col < 0 || row >= x.rows || col >= x.cols) return;
        const S d = d_mean - 2 * value / b2 * (x(row, col) - m.mx) + 2 * a1 / (b1 * b2) * (y(row, col) - m.my);
        d_x[static_cast<std::size_t>(row * x.cols + col)] -= w[i] * w[j] * d / count;
      });
    }
  }
  result.d_x.assign(d_x.begin(), d_x.end());
  return result;
}

Var<float> put(Tape<float>& tape, const Picture<float>& picture) {
  return leaf(tape, "image", image_shape<float>(1, picture.rows, picture.cols), picture.numbers);
}

Similarity similarity(const Picture<float>& x, const Picture<float>& y, double data_range = 1) {
  Tape<float> tape;
  const Var<float> image = put(tape, x), target = put(tape, y), map = put(tape, x);
  ssim_map(tape.value(image), tape.value(target), tape.write(map), {data_range});
  const Var<float> loss = d_ssim(image, target, {data_range});
  tape.forward(loss);
  tape.backward(loss);
  return {numbers_of<float>(tape.value(map)), numbers_of<float>(tape.gradient(image))};
}

Picture<double> widened(const Picture<float>& x) { return {x.rows, x.cols, {x.numbers.begin(), x.numbers.end()}}; }

// --- logarithms

/// −z log o − (1 − z) log(1 − o) of o = 1/(1 + e⁻ˣ) and its derivative, as they stand.
std::array<float, 2> plain_cross_entropy(float x, float z) {
  const float o = 1 / (1 + std::exp(-x)), d_o = o * (1 - o);
  return {-z * std::log(o) - (1 - z) * std::log(1 - o), (-z / o + (1 - z) / (1 - o)) * d_o};
}

/// By operators: softplus(x) − x z.
std::array<float, 2> taped_cross_entropy(float x, float z) {
  Tape<float> tape;
  const Var<float> logit = leaf(tape, "x", kScalarShape, {x});
  const Var<float> loss = softplus(logit) - logit * static_cast<double>(z);
  tape.forward(loss);
  tape.backward(loss);
  return {tape.value(loss).scalar(), tape.gradient(logit).scalar()};
}

Image grey_image(float value) {
  Image image(1, 4, 5);
  for (int r = 0; r < 4; ++r) {
    for (int c = 0; c < 5; ++c) image(0, r, c) = value;
  }
  return image;
}

/// A mean of floats in floats, each thread of `threads` its share.
float plain_mean(const std::vector<float>& numbers, std::size_t threads) {
  float total = 0;
  for (std::size_t t = 0; t < threads; ++t) {
    float sum = 0;
    for (std::size_t i = t * numbers.size() / threads; i < (t + 1) * numbers.size() / threads; ++i) sum += numbers[i];
    total += sum;
  }
  return total / static_cast<float>(numbers.size());
}

}  // namespace

/// E1: flat images with little noise.
std::vector<StressFigure> flat_areas(Remedy remedy) {
  double error = 0, above = 0, gradient = 0, same = 0;
  const auto computed = [remedy](const Picture<float>& x, const Picture<float>& y) {
    return remedy == Remedy::kOn ? similarity(x, y) : similarity_by_windows(x, y, true);
  };
  for (const double level : {0.1, 0.6, 0.9}) {
    for (const double noise : {0.0, 1e-7, 1e-4, 1e-2}) {
      const Picture<float> x = flat_picture(level, noise, 1, 1), y = flat_picture(level + 0.01, noise, 1, 2);
      const Similarity found = computed(x, y), truth = similarity_by_windows(widened(x), widened(y), false);
      for (std::size_t i = 0; i < truth.map.size(); ++i) {
        error = larger(error, std::abs(found.map[i] - truth.map[i]));
        above = larger(above, found.map[i] - 1);
      }
      gradient = larger(gradient, relative_l2(found.d_x, truth.d_x));
      for (const double value : computed(x, x).map) same = larger(same, std::abs(value - 1));
    }
  }
  return {{"error of a pixel's similarity", error, 1e-6},
          {"similarity above 1", above, 1e-6},
          {"1 - similarity of an image to itself", same, 0},
          {"error of the gradient, share of its norm", gradient, 1e-4}};
}

/// E2: the same images in [0, 1] and in [0, 255].
std::vector<StressFigure> data_ranges(Remedy remedy) {
  double pixel = 0, mean = 0;
  for (const double noise : {1e-3, 1e-2, 0.1}) {
    const Similarity one = similarity(flat_picture(0.5, noise, 1, 3), flat_picture(0.5, noise, 1, 4));
    const Similarity other =
        similarity(flat_picture(0.5, noise, 255, 3), flat_picture(0.5, noise, 255, 4), remedy == Remedy::kOn ? 255 : 1);
    double sum = 0;
    for (std::size_t i = 0; i < one.map.size(); ++i) {
      pixel = larger(pixel, std::abs(one.map[i] - other.map[i]));
      sum += one.map[i] - other.map[i];
    }
    mean = larger(mean, std::abs(sum) / static_cast<double>(one.map.size()));
  }
  // A pixel's is right to 1e-6 in each of the two.
  return {{"difference of mean similarities", mean, 1e-6}, {"difference of a pixel's", pixel, 2e-6}};
}

/// E3: opacities that are 0 and 1 to rounding, and images without a difference.
std::vector<StressFigure> logarithms_of_zero(Remedy remedy) {
  double value = 0, gradient = 0;
  for (const float x : {-200.0f, -100.0f, -30.0f, -17.0f, -3.0f, 0.0f, 3.0f, 17.0f, 30.0f, 100.0f, 200.0f}) {
    for (const float z : {0.0f, 1.0f}) {
      const auto [loss, slope] = remedy == Remedy::kOn ? taped_cross_entropy(x, z) : plain_cross_entropy(x, z);
      // log(1 + e^u), u > 0 where the target is missed
      const long double u = z > 0.5f ? -static_cast<long double>(x) : static_cast<long double>(x);
      const long double truth = std::max(u, 0.0L) + std::log1p(std::exp(-std::abs(u)));
      const long double exact_slope = (z > 0.5f ? -1 : 1) / (1 + std::exp(-u));
      value = larger(value, std::abs(static_cast<double>(loss - truth)) / std::max(1.0, static_cast<double>(truth)));
      gradient = larger(gradient, std::abs(static_cast<double>(slope - exact_slope)));
    }
  }
  const Image image = grey_image(0.25f);
  const double psnr = remedy == Remedy::kOn ? psnr_db(image, image) : -10 * std::log10(0.0);
  return {{"relative error of the cross entropy", value, 1e-6},
          {"error of its gradient", gradient, 1e-6},
          {"PSNR of equal images, dB", psnr, kLargestPsnrDb}};
}

/// E4: mean |a − b| and its gradient, where every third pair is equal.
std::vector<StressFigure> equal_numbers(Remedy remedy) {
  constexpr int kCount = 30;
  std::vector<float> a, b, gradient(kCount);
  for (int i = 0; i < kCount; ++i) {
    a.push_back(0.1f * static_cast<float>(i));
    b.push_back(a.back() + static_cast<float>(i % 3 - 1) * 1e-3f);
  }
  if (remedy == Remedy::kOn) {
    Tape<float> tape;
    const Var<float> x = leaf(tape, "a", shape_of(1, kCount), a), y = tape.constant("b", shape_of(1, kCount));
    tape.set(y, b);
    const Var<float> loss = l1(x, y);
    tape.forward(loss);
    tape.backward(loss);
    std::copy_n(tape.gradient(x).data, kCount, gradient.begin());
  } else {  // the derivative of √(d²)
    for (std::size_t i = 0; i < kCount; ++i) {
      const float d = a[i] - b[i];
      gradient[i] = d / std::sqrt(d * d) / kCount;
    }
  }
  double at_zero = 0, elsewhere = 0;
  for (std::size_t i = 0; i < kCount; ++i) {
    const double d = static_cast<double>(gradient[i]) * kCount;
    if (i % 3 == 1) at_zero = larger(at_zero, std::abs(d));
    if (i % 3 != 1) elsewhere = larger(elsewhere, std::abs(d - (i % 3 == 0 ? 1 : -1)));
  }
  return {{"gradient where both are equal", at_zero, 0}, {"error of the gradient elsewhere", elsewhere, 1e-6}};
}

/// E5: means over two million numbers, on 1 and on 16 threads.
std::vector<StressFigure> long_means(Remedy remedy) {
  constexpr Index kRows = 1080, kCols = 1920;
  const Random random(9, random_stream("stress.E5"));
  std::vector<float> numbers(static_cast<std::size_t>(kRows * kCols));
  long double sum = 0, squares = 0;
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    numbers[i] = 0.3f + 0.5f * random.uniform<float>(i);
    sum += numbers[i];
    squares += static_cast<long double>(numbers[i]) * numbers[i];
  }
  const auto count = static_cast<long double>(numbers.size());
  Tape<float> tape;
  const Var<float> x = tape.parameter("x", image_shape<float>(1, kRows, kCols));
  const Var<float> zero = tape.constant("zero", kScalarShape), first = l1(x, zero), second = l2(x, zero);
  std::vector<float> squared(numbers);
  for (float& v : squared) v *= v;
  const auto means = [&](int threads) {
    std::array<float, 2> result{};
    if (remedy == Remedy::kOff) {
      return std::array{plain_mean(numbers, static_cast<std::size_t>(threads)),
                        plain_mean(squared, static_cast<std::size_t>(threads))};
    }
    with_threads(threads, [&] {
      tape.set(x, numbers);
      tape.forward(first);
      tape.forward(second);
      result = {tape.value(first).scalar(), tape.value(second).scalar()};
    });
    return result;
  };
  const std::array<float, 2> one = means(1), many = means(16);
  const double error = larger(relative(one[0], sum / count), relative(one[1], squares / count));
  const double threads =
      larger(std::abs(static_cast<double>(one[0] - many[0])), std::abs(static_cast<double>(one[1] - many[1])));
  return {{"relative error of the mean", error, 1e-7}, {"difference of 1 and 16 threads", threads, 0}};
}

namespace {

/// A disc that a mask shows, where two pictures are alike or `off` apart; outside they have nothing in common.
struct MaskedPictures {
  Picture<float> x = flat_picture(0.5, 0.3, 1, 5), y = x, mask = x;

  explicit MaskedPictures(float off) {
    const Picture<float> other = flat_picture(0.5, 0.5, 1, 6);
    for (Index r = 0; r < x.rows; ++r) {
      for (Index c = 0; c < x.cols; ++c) {
        const auto i = static_cast<std::size_t>(r * x.cols + c);
        const bool is_seen = (r - 9) * (r - 9) + (c - 15) * (c - 15) < 50;
        mask.numbers[i] = is_seen ? 1 : 0;
        y.numbers[i] = is_seen ? x.numbers[i] + off : other.numbers[i];
      }
    }
  }
  /// Black where the mask is 0.
  Picture<double> seen(const Picture<float>& of) const {
    Picture<double> result = widened(of);
    for (std::size_t i = 0; i < result.numbers.size(); ++i) result.numbers[i] *= static_cast<double>(mask.numbers[i]);
    return result;
  }
};

/// 1 − ssim of pictures under their mask, and its gradient by the first.
std::pair<double, std::vector<double>> masked_difference(const MaskedPictures& of, Remedy remedy) {
  Tape<float> tape;
  const Var<float> x = put(tape, of.x), y = put(tape, of.y), mask = put(tape, of.mask);
  tape.freeze(mask);
  const bool on = remedy == Remedy::kOn;
  const Var<float> loss = d_ssim(on ? weighted_image(x, mask) : x, on ? weighted_image(y, mask) : y);
  tape.forward(loss);
  tape.backward(loss);
  return {static_cast<double>(tape.value(loss).scalar()), numbers_of<float>(tape.gradient(x))};
}

}  // namespace

/// G11: at a mask's edge and at the image's border what is not there is black in both pictures. Known: nothing where
/// they are alike under the mask, and the definition, window by window, where they are not.
std::vector<StressFigure> masks_and_borders(Remedy remedy) {
  const auto [alike, d_alike] = masked_difference(MaskedPictures(0), remedy);
  double slope = 0;
  for (const double d : d_alike) slope = larger(slope, std::abs(d));
  const MaskedPictures pictures(0.2f);
  const auto [found, d_found] = masked_difference(pictures, remedy);
  const Similarity exact = similarity_by_windows(pictures.seen(pictures.x), pictures.seen(pictures.y), false);
  double sum = 0, outside = 0;
  std::vector<double> d_exact = exact.d_x;
  for (std::size_t i = 0; i < exact.map.size(); ++i) {
    sum += 1 - exact.map[i];
    if (pictures.mask.numbers[i] > 0) continue;
    d_exact[i] = 0;
    outside += d_found[i] == 0 ? 0 : 1;
  }
  const double mean = sum / static_cast<double>(exact.map.size());
  return {{"difference of pictures that are alike under the mask", alike, 0},
          {"its largest gradient", slope, 0},
          {"difference off its definition, relative", std::abs(found - mean) / mean, 3e-8},
          {"gradient off its definition, relative", relative_l2(d_found, d_exact), 5e-7},
          {"pixels of weight 0 with a gradient", outside, 0}};
}

}  // namespace hsi4d::stress
