// Rows P1 to P3: the operators of autodiff.
#include "autodiff/centroid.h"
#include "autodiff/difference.h"
#include "autodiff/frozen_linear.h"
#include "autodiff/map.h"
#include "autodiff/mlp.h"
#include "autodiff/nearest.h"
#include "autodiff/rotations.h"
#include "autodiff/ssim.h"
#include "autodiff/weighted_image.h"
#include "stress/poison.h"

namespace hsi4d::stress {

namespace {

constexpr Index kRows = 40;

/// An operator on one array [kRows,cols].
template <class S, class F>
PoisonedOperator<S> of_rows(Index cols, double low, double high, F f) {
  return {{{shape_of(kRows, cols), {}, low, high}}, [f](const Vars<S>& in) { return f(in[0]); }};
}

/// An operator on two arrays [kRows,3], of which the second may be one row for all.
template <class S, class F>
PoisonedOperator<S> of_pairs(bool is_shared, F f) {
  const PoisonInput other =
      is_shared ? PoisonInput{shape_of(1, 3), shared, 0.5, 2} : PoisonInput{shape_of(kRows, 3), {}, 0.5, 2};
  return {{{shape_of(kRows, 3), {}, 0.5, 2}, other}, [f](const Vars<S>& in) { return f(in[0], in[1]); }};
}

/// One whose result is a number of all rows.
template <class S>
PoisonedOperator<S> to_scalar(PoisonedOperator<S> op) {
  op.outputs = {shared};
  return op;
}

struct Elements {
  template <class S>
  std::vector<PoisonedOperator<S>> operator()() const {
    using V = Var<S>;
    std::vector<PoisonedOperator<S>> all;
    const auto one = [&](double low, double high, auto f) { all.push_back(of_rows<S>(3, low, high, f)); };
    one(-1, 1, [](V x) { return abs(x); });
    one(-1, 1, [](V x) { return square(x); });
    one(0.1, 1, [](V x) { return sqrt(x); });
    one(-1, 1, [](V x) { return exp(x); });
    one(0.1, 1, [](V x) { return log(x); });
    one(-1, 1, [](V x) { return sin(x); });
    one(-1, 1, [](V x) { return cos(x); });
    one(-1, 1, [](V x) { return tanh(x); });
    one(-1, 1, [](V x) { return sigmoid(x); });
    one(-1, 1, [](V x) { return softplus(x); });
    one(-1, 1, [](V x) { return leaky_relu(x, 0.01); });
    one(-1, 1, [](V x) { return clamp(x, -0.5, 0.5); });
    one(-1, 1, [](V x) { return -x; });
    one(-1, 1, [](V x) { return stop_gradient(x) * x; });
    one(0.1, 1, [](V x) { return 1.0 / x + 2.0 * x; });
    one(-1, 1, [](V x) {
      return map({x}, [](auto y) {
        using namespace hsi4d;
        return y * exp(y) / (1.0 + y * y);
      });
    });
    for (const bool is_shared : {false, true}) {
      const auto two = [&](auto f) { all.push_back(of_pairs<S>(is_shared, f)); };
      two([](V a, V b) { return a + b; });
      two([](V a, V b) { return a - b; });
      two([](V a, V b) { return a * b; });
      two([](V a, V b) { return a / b; });
      two([](V a, V b) { return min(a, b); });
      two([](V a, V b) { return max(a, b); });
    }
    return all;
  }
};

template <class S>
PoisonedOperator<S> of_images(Index planes, Index height, Index width, const std::function<Var<S>(Var<S>, Var<S>)>& f) {
  const PoisonInput image{image_shape<S>(planes, height, width), {}, 0, 1};
  return {{image, image}, [f](const Vars<S>& in) { return f(in[0], in[1]); }};
}

struct Arrays {
  template <class S>
  std::vector<PoisonedOperator<S>> operator()() const {
    using V = Var<S>;
    std::vector<PoisonedOperator<S>> all;
    const auto one = [&](auto f) -> PoisonedOperator<S>& {
      all.push_back(of_rows<S>(3, -1, 1, f));
      return all.back();
    };
    one([](V x) { return sum_cols(x); });
    one([](V x) { return norm_cols(x); });
    one([](V x) { return sum(x); }).outputs = {shared};
    one([](V x) { return mean(x); }).outputs = {shared};
    one([](V x) { return sum_rows(x); }).outputs = {shared};
    one([](V x) { return transpose(x); }).outputs = {shared};
    one([](V x) { return reshape(x, 3 * kRows, 1); }).outputs = {units_of(3)};
    one([](V x) { return slice_rows(x, 5, 20); }).outputs = {[](Index row) { return row + 5; }};
    one([](V x) { return slice_cols(x, 1, 2); });
    one([](V x) {
      return gather_rows(x, {7, 3, 3, 30, 0, 39});
    }).outputs = {[](Index row) {
      return Index(std::array{7, 3, 3, 30, 0, 39}[static_cast<std::size_t>(row)]);
    }};
    all.push_back(of_pairs<S>(false, [](V a, V b) { return concat_rows(std::span<const V>(std::array{a, b})); }));
    all.back().outputs = {[](Index row) { return row % kRows; }};
    all.push_back(of_pairs<S>(false, [](V a, V b) { return concat_cols(std::span<const V>(std::array{a, b})); }));
    all.push_back(
        {{{shape_of(kRows, 3)}, {shape_of(3, 5), shared}}, [](const Vars<S>& in) { return matmul(in[0], in[1]); }});
    const auto two = [&](auto f) { all.push_back(to_scalar(of_pairs<S>(false, f))); };
    two([](V a, V b) { return l1(a, b); });
    two([](V a, V b) { return l2(a, b); });
    two([](V a, V b) { return huber(a, b, 0.3); });
    two([](V a, V b) { return charbonnier(a, b, 0.1); });
    two([](V a, V b) {
      return sum_over({a, b}, [](auto x, auto y) {
        using namespace hsi4d;
        return x * exp(-y);
      });
    });
    all.push_back(of_pairs<S>(false, [](V a, V b) {
      std::vector<NearestSet> sets;
      for (Index i = 0; i < kRows; ++i) sets.push_back({i, 1, i, 1});
      return nearest_pairs(a, b, sets);
    }));
    all.push_back(to_scalar(of_images<S>(1, 24, 16, [](V a, V b) { return l1(a, b); })));
    all.push_back(to_scalar(of_images<S>(1, 24, 16, [](V a, V b) { return l2(a, b); })));
    all.push_back(of_images<S>(1, 24, 16, [](V a, V b) { return weighted_image(a, b); }));
    for (const Index height : {8, 24}) {  // as arrays, and as images with squares
      const PoisonInput image{image_shape<S>(1, height, 16), {}, 0, 1};
      const auto weighted = [&](auto f) {
        all.push_back({{image, image, image}, [f](const Vars<S>& in) { return f(in[0], in[1], in[2]); }, {shared}});
      };
      weighted([](V a, V b, V w) { return l1(a, b, w); });
      weighted([](V a, V b, V w) { return l2(a, b, w); });
    }
    all.push_back(to_scalar(of_images<S>(1, 40, 16, [](V a, V b) { return d_ssim(a, b); })));
    all.back().reach = 10;  // two windows of 11
    all.push_back(
        {{{{image_shape<S>(4, 8, 16)}, units_of(8), 0, 1}}, [](const Vars<S>& in) { return centroids(in[0]); }});
    all.push_back({{{image_shape<S>(4, 8, 16), {}, 0, 1}},
                   [](const Vars<S>& in) { return slice_planes(in[0], 1, 2); },
                   {[](Index row) { return row + 8; }}});
    return all;
  }
};

struct Networks {
  template <class S>
  std::vector<PoisonedOperator<S>> operator()() const {
    using V = Var<S>;
    std::vector<PoisonedOperator<S>> all;
    all.push_back(of_rows<S>(3, -1, 1, [](V x) { return rotations_from_axis_angle(x); }));
    all.push_back(of_rows<S>(6, -1, 1, [](V x) { return rotations_from_6d(x); }));
    all.push_back(of_rows<S>(9, -1, 1, [](V x) { return axis_angle_from_rotations(x); }));
    all.back().inputs[0].numbers = some_rotations(kRows);
    std::vector<double> weight(20), bias(4);
    for (std::size_t i = 0; i < weight.size(); ++i) weight[i] = std::sin(static_cast<double>(i));
    const FrozenLinear<S> linear(weight, bias);
    all.push_back(of_rows<S>(5, -1, 1, [linear](V x) { return frozen_linear(linear, x); }));
    for (const MlpOutput output : {MlpOutput::kLinear, MlpOutput::kSigmoid}) {
      constexpr Index kMany = 400;  // more than two blocks of rows
      all.push_back({{{shape_of(kMany, 4)},
                      {shape_of(kMany, 2)},
                      {shape_of(1, 5), shared},
                      {shape_of(kMany, 3)},
                      {shape_of(11, 6), shared},
                      {shape_of(1, 6), shared},
                      {shape_of(6, 3), shared},
                      {shape_of(1, 3), shared}},
                     [output](const Vars<S>& in) {
                       const MlpLayer<S> layers[] = {{in[4], in[5]}, {in[6], in[7]}};
                       return mlp<S>({in[0], in[1], in[2], in[3]}, layers, output);
                     }});
    }
    return all;
  }
};

}  // namespace

std::vector<StressFigure> poisoned_elements(Remedy remedy) { return family_leaks(Elements(), remedy); }
std::vector<StressFigure> poisoned_arrays(Remedy remedy) { return family_leaks(Arrays(), remedy); }
std::vector<StressFigure> poisoned_networks(Remedy remedy) { return family_leaks(Networks(), remedy); }

void add_autodiff_operators(OperatorNames& names) {
  add_family_operators(Elements(), names);
  add_family_operators(Arrays(), names);
  add_family_operators(Networks(), names);
}

}  // namespace hsi4d::stress
