// Operators of autodiff against complex steps of formulas that are written down here a second time.
#include <array>
#include <cmath>

#include "autodiff/centroid.h"
#include "autodiff/difference.h"
#include "autodiff/elementwise.h"
#include "autodiff/frozen_linear.h"
#include "autodiff/image_difference.h"
#include "autodiff/map.h"
#include "autodiff/matrix.h"
#include "autodiff/mlp.h"
#include "autodiff/nearest.h"
#include "autodiff/reduce.h"
#include "autodiff/rotations.h"
#include "autodiff/ssim.h"
#include "autodiff/weighted_image.h"
#include "core/rotation.h"
#include "core/rotation_6d.h"
#include "tests/support/complex_formulas.h"
#include "tests/support/complex_step_check.h"

namespace complex_step_test {

using namespace hsi4d;
using namespace hsi4d::test;

namespace {

using V = Var<double>;
using Vars = std::vector<V>;

const Shape kSmall = shape_of(5, 3);

/// An elementwise function of one array.
template <class F, class G>
void check_one(double low, double high, const F& f, const G& formula) {
  check_complex_step(
      {{"x", kSmall, low, high}}, [&f](const Vars& in) { return f(in[0]); },
      [&formula](const ComplexInputs& in) {
        Complexes y;
        for (const Complex x : in[0]) y.push_back(formula(x));
        return y;
      });
}

/// One of two arrays.
template <class F, class G>
void check_two(const F& f, const G& formula) {
  check_complex_step(
      {{"a", kSmall, 0.5, 2}, {"b", kSmall, 0.5, 2}}, [&f](const Vars& in) { return f(in[0], in[1]); },
      [&formula](const ComplexInputs& in) {
        Complexes y;
        for (std::size_t i = 0; i < in[0].size(); ++i) y.push_back(formula(in[0][i], in[1][i]));
        return y;
      });
}

Complexes product(const Complexes& a, const Complexes& b, std::size_t rows, std::size_t cols) {
  const std::size_t inner = a.size() / rows;
  Complexes y(rows * cols, 0);
  for (std::size_t i = 0; i < rows; ++i) {
    for (std::size_t j = 0; j < cols; ++j) {
      for (std::size_t k = 0; k < inner; ++k) y[i * cols + j] += a[i * inner + k] * b[k * cols + j];
    }
  }
  return y;
}

/// Numbers at some places.
Complexes picked(const Complexes& x, const std::vector<std::size_t>& places) {
  Complexes y;
  for (const std::size_t i : places) y.push_back(x[i]);
  return y;
}

/// p − q of the rows whose real parts are nearest to each other.
Complexes nearest_difference(const ComplexInputs& in, const std::vector<std::size_t>& points,
                             const std::vector<std::size_t>& targets) {
  double least = 1e9;
  Complexes y;
  for (const std::size_t i : points) {
    for (const std::size_t j : targets) {
      Complexes apart;
      double squared = 0;
      for (std::size_t c = 0; c < 3; ++c) {
        apart.push_back(in[0][3 * i + c] - in[1][3 * j + c]);
        squared += std::real(apart[c]) * std::real(apart[c]);
      }
      if (squared < least) y = apart;
      least = std::min(least, squared);
    }
  }
  return y;
}

/// f of each row of `cols` numbers.
template <class F>
Complexes by_rows(const Complexes& x, std::size_t cols, const F& f) {
  Complexes y;
  for (std::size_t i = 0; i < x.size(); i += cols) {
    const Complexes row = f(&x[i]);
    y.insert(y.end(), row.begin(), row.end());
  }
  return y;
}

Complexes rows_of(const Matrix3<Complex>& m) {
  Complexes y;
  for (int i = 0; i < 9; ++i) y.push_back(m(i / 3, i % 3));
  return y;
}

Vector3<Complex> vector_at(const Complex* x) { return {x[0], x[1], x[2]}; }

Complex logistic(Complex x) { return 1.0 / (1.0 + std::exp(-x)); }

/// Σ w f(a − b) / n over planes of an image; the weight of one plane, or none.
template <class F>
Complexes image_mean(const ComplexInputs& in, const F& f) {
  Complex sum = 0;
  for (std::size_t i = 0; i < in[0].size(); ++i) {
    const Complex term = f(in[0][i] - in[1][i]);
    sum += in.size() > 2 ? in[2][i % in[2].size()] * term : term;
  }
  return {sum / static_cast<double>(in[0].size())};
}

}  // namespace

TEST_CASE("elementwise functions have the gradients of complex steps") {
  check_one(
      -1, 1, [](V x) { return -x; }, [](Complex x) { return -x; });
  check_one(
      -1, 1, [](V x) { return x + 0.5; }, [](Complex x) { return x + 0.5; });
  check_one(
      -1, 1, [](V x) { return 0.5 - x; }, [](Complex x) { return 0.5 - x; });
  check_one(
      -1, 1, [](V x) { return x * 0.3; }, [](Complex x) { return x * 0.3; });
  check_one(
      0.5, 2, [](V x) { return x / 0.3; }, [](Complex x) { return x / 0.3; });
  check_one(
      0.5, 2, [](V x) { return 0.3 / x; }, [](Complex x) { return 0.3 / x; });
  check_one(
      -1, 1, [](V x) { return abs(x); }, complex_abs);
  check_one(
      -1, 1, [](V x) { return square(x); }, [](Complex x) { return x * x; });
  check_one(
      0.01, 2, [](V x) { return sqrt(x); }, [](Complex x) { return std::sqrt(x); });
  check_one(
      -30, 30, [](V x) { return exp(x); }, [](Complex x) { return std::exp(x); });
  check_one(
      0.01, 2, [](V x) { return log(x); }, [](Complex x) { return std::log(x); });
  check_one(
      -9, 9, [](V x) { return sin(x); }, [](Complex x) { return std::sin(x); });
  check_one(
      -9, 9, [](V x) { return cos(x); }, [](Complex x) { return std::cos(x); });
  check_one(
      -3, 3, [](V x) { return tanh(x); }, [](Complex x) { return std::tanh(x); });
  check_one(
      -30, 30, [](V x) { return sigmoid(x); }, logistic);
  check_one(
      -9, 9, [](V x) { return softplus(x); }, [](Complex x) { return std::log(1.0 + std::exp(x)); });
  check_one(
      -1, 1, [](V x) { return leaky_relu(x, 0.01); }, [](Complex x) { return x.real() > 0 ? x : 0.01 * x; });
  check_one(
      -1, 1, [](V x) { return clamp(x, -0.5, 0.25); },
      [](Complex x) { return x.real() < -0.5   ? Complex(-0.5)
                             : x.real() > 0.25 ? Complex(0.25)
                                               : x; });
}

TEST_CASE("operators of two arrays have the gradients of complex steps") {
  check_two([](V a, V b) { return a + b; }, [](Complex a, Complex b) { return a + b; });
  check_two([](V a, V b) { return a - b; }, [](Complex a, Complex b) { return a - b; });
  check_two([](V a, V b) { return a * b; }, [](Complex a, Complex b) { return a * b; });
  check_two([](V a, V b) { return a / b; }, [](Complex a, Complex b) { return a / b; });
  check_two([](V a, V b) { return max(a, b); }, complex_max);
  check_two([](V a, V b) { return min(a, b); }, [](Complex a, Complex b) { return -complex_max(-a, -b); });
  const auto bump = [](auto x, auto y) {
    using namespace hsi4d;
    using std::exp;
    return exp(-(x - y) * (x - y) / (y + 1.0)) * x;
  };
  check_two([&](V a, V b) { return map({a, b}, bump); }, bump);
  check_complex_step(
      {{"a", kSmall, 0.5, 2}, {"b", kSmall, 0.5, 2}},
      [&](const Vars& in) {
        return sum_over({in[0], in[1]}, bump);
      },
      [&](const ComplexInputs& in) {
        Complex sum = 0;
        for (std::size_t i = 0; i < in[0].size(); ++i) sum += bump(in[0][i], in[1][i]);
        return Complexes{sum};
      });
}

TEST_CASE("operators of arrays have the gradients of complex steps") {
  const std::vector<OperatorInput> x = {{"x", kSmall}};
  check_complex_step(
      {{"a", shape_of(4, 5)}, {"b", shape_of(5, 3)}}, [](const Vars& in) { return matmul(in[0], in[1]); },
      [](const ComplexInputs& in) { return product(in[0], in[1], 4, 3); });
  check_complex_step(
      x, [](const Vars& in) { return transpose(in[0]); },
      [](const ComplexInputs& in) {
        return picked(in[0], {0, 3, 6, 9, 12, 1, 4, 7, 10, 13, 2, 5, 8, 11, 14});
      });
  check_complex_step(
      x, [](const Vars& in) { return reshape(in[0], 3, 5); }, [](const ComplexInputs& in) { return in[0]; });
  check_complex_step(
      x, [](const Vars& in) { return slice_rows(in[0], 1, 2); },
      [](const ComplexInputs& in) {
        return picked(in[0], {3, 4, 5, 6, 7, 8});
      });
  check_complex_step(
      {{"x", image_shape<double>(3, 2, 2)}}, [](const Vars& in) { return slice_planes(in[0], 1, 1); },
      [](const ComplexInputs& in) {
        return picked(in[0], {4, 5, 6, 7});
      });
  check_complex_step(
      x,
      [](const Vars& in) {
        return gather_rows(in[0], {4, 0, 0});
      },
      [](const ComplexInputs& in) {
        return picked(in[0], {12, 13, 14, 0, 1, 2, 0, 1, 2});
      });
  check_complex_step(
      {{"x", shape_of(2, 3)}, {"y", shape_of(1, 3)}},
      [](const Vars& in) { return concat_rows(std::span<const V>(in)); },
      [](const ComplexInputs& in) {
        Complexes y = in[0];
        y.insert(y.end(), in[1].begin(), in[1].end());
        return y;
      });
  check_complex_step(
      {{"points", shape_of(4, 3)}, {"targets", shape_of(5, 3)}},
      [](const Vars& in) {
        return nearest_pairs(in[0], in[1], {{0, 3, 1, 4}, {3, 1, 0, 1}});
      },
      [](const ComplexInputs& in) {
        Complexes y = nearest_difference(in, {0, 1, 2}, {1, 2, 3, 4});
        const Complexes second = nearest_difference(in, {3}, {0});
        y.insert(y.end(), second.begin(), second.end());
        return y;
      });
  const auto total = [](const Complexes& of) {
    Complex sum = 0;
    for (const Complex number : of) sum += number;
    return sum;
  };
  check_complex_step(
      x, [](const Vars& in) { return sum(in[0]); }, [&](const ComplexInputs& in) { return Complexes{total(in[0])}; });
  check_complex_step(
      x, [](const Vars& in) { return sum_cols(in[0]); },
      [](const ComplexInputs& in) {
        return by_rows(in[0], 3, [](const Complex* r) { return Complexes{r[0] + r[1] + r[2]}; });
      });
  check_complex_step(
      x, [](const Vars& in) { return sum_rows(in[0]); },
      [](const ComplexInputs& in) {
        Complexes y(3, 0);
        for (std::size_t i = 0; i < in[0].size(); ++i) y[i % 3] += in[0][i];
        return y;
      });
}

TEST_CASE("rotations have the gradients of complex steps") {
  check_complex_step(
      {{"axis_angle", shape_of(9, 3), -3, 3}}, [](const Vars& in) { return rotations_from_axis_angle(in[0]); },
      [](const ComplexInputs& in) {
        return by_rows(in[0], 3, [](const Complex* w) { return rows_of(so3_exp(vector_at(w))); });
      });
  check_complex_step(
      {{"columns", shape_of(9, 6), 0.2, 1, {}}}, [](const Vars& in) { return rotations_from_6d(in[0]); },
      [](const ComplexInputs& in) {
        return by_rows(in[0], 6, [](const Complex* x) {
          const Vector3<Complex> a = vector_at(x), b = vector_at(x + 3);
          const Vector3<Complex> first = a / std::sqrt(dot(a, a));
          const Vector3<Complex> rest = b - first * dot(first, b);
          const Vector3<Complex> second = rest / std::sqrt(dot(rest, rest));
          Matrix3<Complex> r;
          r << first, second, cross(first, second);
          return rows_of(r);
        });
      },
      {.tolerance = 1e-11});
  std::vector<double> matrices;
  for (const double size : {1e-5, 0.3, 1.2, 2.5, 3.1}) {
    const Matrix3<double> r = so3_exp(Vector3<double>(0.6 * size, -0.64 * size, 0.48 * size));
    for (int i = 0; i < 9; ++i) matrices.push_back(r(i / 3, i % 3));
  }
  check_complex_step(
      {{"rotations", shape_of(5, 9), 0, 0, matrices}}, [](const Vars& in) { return axis_angle_from_rotations(in[0]); },
      [](const ComplexInputs& in) {
        return by_rows(in[0], 9, [](const Complex* x) {
          Matrix3<Complex> r;
          r << x[0], x[1], x[2], x[3], x[4], x[5], x[6], x[7], x[8];
          const Vector3<Complex> w = so3_log(r);
          return Complexes{w[0], w[1], w[2]};
        });
      },
      {.tolerance = 1e-10});
}

TEST_CASE("operators of images have the gradients of complex steps") {
  const Shape image = image_shape<double>(2, 18, 19), weight = image_shape<double>(1, 18, 19);
  const std::vector<OperatorInput> two = {{"a", image}, {"b", image}},
                                   three = {{"a", image}, {"b", image}, {"weight", weight, 0, 1}};
  const auto squared = [](Complex d) { return d * d; };
  // The means are a sum and a factor: the operator alone is tried.
  const auto count = static_cast<double>(image.count());
  const auto sum_of = [count](const Complexes& mean) { return Complexes{mean[0] * count}; };
  const auto inner = [](V a, V b, V w) {
    return hsi4d::detail::image_difference<double, hsi4d::detail::SquaredDifference>(a, b, w, Source::current());
  };
  const auto inner_l1 = [](V a, V b, V w) {
    return hsi4d::detail::image_difference<double, hsi4d::detail::AbsoluteDifference>(a, b, w, Source::current());
  };
  check_complex_step(
      two, [&](const Vars& in) { return inner(in[0], in[1], V{}); },
      [&](const ComplexInputs& in) { return sum_of(image_mean(in, squared)); });
  check_complex_step(
      three, [&](const Vars& in) { return inner(in[0], in[1], in[2]); },
      [&](const ComplexInputs& in) { return sum_of(image_mean(in, squared)); });
  check_complex_step(
      three, [&](const Vars& in) { return inner_l1(in[0], in[1], in[2]); },
      [&](const ComplexInputs& in) { return sum_of(image_mean(in, complex_abs)); });
  check_complex_step(
      {{"image", image}, {"weight", weight, 0, 1}}, [](const Vars& in) { return weighted_image(in[0], in[1]); },
      [](const ComplexInputs& in) {
        Complexes y;
        for (std::size_t i = 0; i < in[0].size(); ++i) y.push_back(in[0][i] * in[1][i % in[1].size()]);
        return y;
      });
  check_complex_step(
      {{"masks", image_shape<double>(1, 5, 7), 0, 1}}, [](const Vars& in) { return centroids(in[0]); },
      [](const ComplexInputs& in) {
        Complex x = 0, y = 0, mass = 0;
        for (std::size_t i = 0; i < 35; ++i) {
          mass += in[0][i];
          x += in[0][i] * (static_cast<double>(i % 7) + 0.5);
          y += in[0][i] * (static_cast<double>(i / 7) + 0.5);
        }
        return Complexes{x / mass, y / mass, mass};
      });
  const Shape small = image_shape<double>(1, 9, 13);
  check_complex_step(
      {{"image", small, 0, 1}, {"target", small, 0, 1}}, [](const Vars& in) { return d_ssim(in[0], in[1]); },
      [](const ComplexInputs& in) { return plain_d_ssim(in[0], in[1], 9, 13); });
}

TEST_CASE("networks have the gradients of complex steps") {
  std::vector<double> weight(15), bias(3);
  for (std::size_t i = 0; i < weight.size(); ++i) weight[i] = std::sin(static_cast<double>(i));
  for (std::size_t i = 0; i < bias.size(); ++i) bias[i] = std::cos(static_cast<double>(i));
  const FrozenLinear<double> linear(weight, bias);
  check_complex_step(
      {{"x", shape_of(4, 5)}}, [&](const Vars& in) { return frozen_linear(linear, in[0]); },
      [&](const ComplexInputs& in) {
        return by_rows(in[0], 5, [&](const Complex* x) {
          Complexes y(bias.begin(), bias.end());
          for (std::size_t i = 0; i < 15; ++i) y[i / 5] += weight[i] * x[i % 5];
          return y;
        });
      });
  const auto layer = [](const Complexes& x, const Complexes& w, const Complexes& b) {
    Complexes y = product(x, w, x.size() / (w.size() / b.size()), b.size());
    for (std::size_t i = 0; i < y.size(); ++i) y[i] += b[i % b.size()];
    return y;
  };
  check_complex_step(
      {{"rows", shape_of(4, 3)},
       {"more", shape_of(4, 2)},
       {"code", shape_of(1, 2)},
       {"offset", shape_of(4, 3)},
       {"weights", shape_of(7, 5)},
       {"bias", shape_of(1, 5)},
       {"weights", shape_of(5, 3)},
       {"bias", shape_of(1, 3)}},
      [](const Vars& in) {
        const MlpLayer<double> layers[] = {{in[4], in[5]}, {in[6], in[7]}};
        return mlp<double>({in[0], in[1], in[2], in[3]}, layers, MlpOutput::kSigmoid);
      },
      [&](const ComplexInputs& in) {
        Complexes x;
        for (std::size_t n = 0; n < 4; ++n) {
          x.insert(x.end(), &in[0][3 * n], &in[0][3 * n] + 3);
          x.insert(x.end(), &in[1][2 * n], &in[1][2 * n] + 2);
          x.insert(x.end(), in[2].begin(), in[2].end());
        }
        Complexes hidden = layer(x, in[4], in[5]);
        for (Complex& z : hidden) z = z * (1.0 + z / std::sqrt(1.0 + z * z)) / 2.0;
        Complexes y = layer(hidden, in[6], in[7]);
        for (std::size_t i = 0; i < y.size(); ++i) y[i] = logistic(y[i] + in[3][i]);
        return y;
      });
}

}  // namespace complex_step_test
