// Rows F9, F15, F16: what a tape, and the tests of its operators, can get wrong.
#include <cmath>
#include <limits>

#include "autodiff/complex_step.h"
#include "autodiff/elementwise.h"
#include "autodiff/gradcheck.h"
#include "core/random.h"
#include "stress/rows.h"
#include "stress/splat_scene.h"
#include "stress/tape_numbers.h"

namespace hsi4d::stress {

namespace {

/// y = a b, whose adjoint is assigned where it has to be added.
template <class S>
struct AssigningProduct {
  static constexpr const char* kName = "assigning_product";
  void forward(NodeIo<S>& io) {
    for (Index i = 0; i < io.out().shape.count(); ++i) io.out().data[i] = io.in(0).data[i] * io.in(1).data[i];
  }
  void backward(NodeIo<S>& io) {
    for (Index i = 0; i < io.out().shape.count(); ++i) {
      if (io.wants(0)) io.d_in(0).data[i] = io.in(1).data[i] * io.d_out().data[i];
      if (io.wants(1)) io.d_in(1).data[i] = io.in(0).data[i] * io.d_out().data[i];
    }
  }
};

/// f(x, w) = h² − x e^w, h = x w + sin x: x is used four times, h twice, w in two places.
template <class T>
T formula(T x, T w) {
  using std::exp, std::sin;
  const T h = x * w + sin(x);
  return h * h - x * exp(w);
}

/// Σ u f on a tape.
template <class S>
struct Formula {
  Tape<S> tape;
  Var<S> x, w, y;

  Formula(Index count, Remedy remedy) {
    x = tape.parameter("x", shape_of(count, 1));
    w = tape.parameter("w", shape_of(count, 1));
    const auto product = [&](Var<S> a, Var<S> b) {
      return remedy == Remedy::kOn ? a * b : tape.record(AssigningProduct<S>{}, {a, b}, a.shape(), Source::current());
    };
    const Var<S> h = product(x, w) + sin(x);
    y = product(h, h) - product(x, exp(w));
  }
};

/// |<u, J v> − <Jᵀ u, v>| over the sum of the products' magnitudes, J v by complex steps. The gradient is that of a
/// second backward run, after others with frozen inputs and another cotangent.
template <class S>
double vjp_error(Remedy remedy) {
  constexpr Index kCount = 50;
  RandomSequence random(9);
  std::vector<double> at[2], along[2], u;
  for (Index i = 0; i < kCount; ++i) {
    for (int k = 0; k < 2; ++k) {
      at[k].push_back(static_cast<double>(static_cast<float>(random.uniform(-1.5, 1.5))));
      along[k].push_back(static_cast<double>(static_cast<float>(random.uniform(-1, 1))));
    }
    u.push_back(static_cast<double>(static_cast<float>(random.uniform(-1, 1))));
  }
  Formula<S> taped(kCount, remedy);
  set_numbers(taped.tape, taped.x, at[0]);
  set_numbers(taped.tape, taped.w, at[1]);
  const std::vector<S> cotangent(u.begin(), u.end()), ones(u.size(), S(1));
  taped.tape.forward(taped.y);
  taped.tape.backward(taped.y, ones);
  taped.tape.freeze(taped.w);
  taped.tape.forward(taped.y);
  taped.tape.backward(taped.y, ones);
  taped.tape.unfreeze(taped.w);
  for (int repeat = 0; repeat < 2; ++repeat) {
    taped.tape.forward(taped.y);
    taped.tape.backward(taped.y, cotangent);
  }
  const std::vector<double> d[2] = {numbers_of<S>(taped.tape.gradient(taped.x)),
                                    numbers_of<S>(taped.tape.gradient(taped.w))};
  double difference = 0, size = 0;
  for (std::size_t i = 0; i < u.size(); ++i) {
    const auto moved = [&](ComplexStep t) {
      return formula(ComplexStep(at[0][i]) + t * ComplexStep(along[0][i]),
                     ComplexStep(at[1][i]) + t * ComplexStep(along[1][i]));
    };
    const double forward = u[i] * complex_step_derivative<1>(moved, {0.0}, 0);
    const double backward = d[0][i] * along[0][i] + d[1][i] * along[1][i];
    difference += forward - backward;
    size += std::abs(forward);
  }
  return std::abs(difference) / size;
}

/// Projection that leaves the rows of what is not to be drawn as it found them, those of the gradient in memory of its
/// own, from one iteration to the next.
struct ProjectingOnlyTheVisible {
  static constexpr const char* kName = "projecting_only_the_visible";
  void forward(NodeIo<float>& io) {
    const ConstArray<float> p = io.in(0);
    for (Index n = 0; n < p.shape.rows; ++n) {
      if (p(n, 2) <= static_cast<float>(kNear)) continue;
      for (Index i = 0; i < 2; ++i) io.out()(n, i) = p(n, i) / p(n, 2);
    }
  }
  void backward(NodeIo<float>& io) {
    const ConstArray<float> p = io.in(0), d = io.d_out();
    kept.resize(static_cast<std::size_t>(3 * p.shape.rows));
    for (Index n = 0; n < p.shape.rows; ++n) {
      float* const row = kept.data() + 3 * n;
      if (p(n, 2) > static_cast<float>(kNear)) {
        const float x = d(n, 0) / p(n, 2), y = d(n, 1) / p(n, 2);
        row[0] = x, row[1] = y, row[2] = -(x * p(n, 0) + y * p(n, 1)) / p(n, 2);
      }
      for (Index c = 0; io.wants(0) && c < 3; ++c) io.d_in(0)(n, c) += row[c];
    }
  }

  std::vector<float> kept = {};
};

double not_zero_at(const std::vector<double>& numbers, const std::vector<Index>& rows, Index cols) {
  double count = 0;
  for (const Index row : rows) {
    for (Index c = 0; c < cols; ++c) count += numbers[static_cast<std::size_t>(row * cols + c)] == 0 ? 0 : 1;
  }
  return count;
}

/// How an adjoint of y = x² may be wrong.
enum class Fault { kNone, kZeroInSomeRows, kHalf, kOneMissing, kOfOneSign };

struct FaultySquare {
  static constexpr const char* kName = "faulty_square";
  Fault fault;
  void forward(NodeIo<double>& io) {
    for (Index i = 0; i < io.out().shape.count(); ++i) io.out().data[i] = io.in(0).data[i] * io.in(0).data[i];
  }
  void backward(NodeIo<double>& io) {
    for (Index i = 0; i < io.out().shape.count(); ++i) {
      const double x = io.in(0).data[i];
      double slope = 2 * x;
      if (fault == Fault::kZeroInSomeRows && i % 3 == 1) slope = 0;
      if (fault == Fault::kHalf) slope = x;
      if (fault == Fault::kOneMissing && i == 17) slope = 0;
      if (fault == Fault::kOfOneSign) slope = std::abs(slope);
      io.d_in(0).data[i] += slope * io.d_out().data[i];
    }
  }
};

/// Whether a check takes the adjoint for right, where numbers are of 1e-5. Without: |a − b| ≤ 1e-3 for all, by central
/// differences.
bool is_taken_for_right(Fault fault, Remedy remedy) {
  constexpr Index kCount = 60;
  Tape<double> tape;
  const Var<double> x = tape.parameter("x", shape_of(kCount, 1));
  RandomSequence random(16);
  std::vector<double> at;
  for (Index i = 0; i < kCount; ++i) at.push_back(1e-5 * random.uniform(0.5, 2) * (i % 2 == 0 ? 1 : -1));
  tape.set(x, at);
  const Var<double> y = tape.record(FaultySquare{fault}, {x}, x.shape(), Source::current());
  if (remedy == Remedy::kOn) return gradcheck(tape, y).ok();
  tape.forward(y);
  tape.backward(y, std::vector<double>(kCount, 1));
  for (std::size_t i = 0; i < at.size(); ++i) {
    constexpr double kStep = 1e-7;
    const double up = at[i] + kStep, down = at[i] - kStep;
    const double difference = (up * up - down * down) / (2 * kStep);
    if (std::abs(tape.gradient(x).data[i] - difference) > 1e-3) return false;
  }
  return true;
}

}  // namespace

std::vector<StressFigure> products_with_vectors(Remedy remedy) {
  return {{"<u, J v> - <J^T u, v> in double, relative", vjp_error<double>(remedy), 1e-10},
          {"in float", vjp_error<float>(remedy), 1e-4}};
}

// A third of the Gaussians goes behind the camera after an iteration in which it was before it: their rows hold what
// they held then, and the adjoints NaN.
std::vector<StressFigure> rows_not_drawn(Remedy remedy) {
  Scene scene = small_scene(60, 32, 24, 15);
  TapedScene<float> taped(scene);
  const Index count = scene.gaussians.count();
  std::vector<Index> behind;
  for (Index n = 0; n < count; n += 3) {
    scene.gaussians.means[static_cast<std::size_t>(3 * n + 2)] *= -1;
    behind.push_back(n);
  }
  Tape<float>& tape = taped.tape;
  if (remedy == Remedy::kOff) {
    const Var<float> places =
        tape.record(ProjectingOnlyTheVisible{}, {taped.means}, shape_of(count, 2), Source::current());
    const auto numbers = static_cast<std::size_t>(places.shape().count());
    tape.forward(places);
    tape.backward(places, std::vector<float>(numbers, std::numeric_limits<float>::quiet_NaN()));
    tape.set(taped.means, scene.gaussians.means);
    tape.forward(places);
    tape.backward(places, std::vector<float>(numbers, 1));
    return {{"numbers of culled rows that are not 0", not_zero_at(taped.value(places), behind, 2), 0},
            {"gradients of culled rows that are not 0", not_zero_at(taped.gradient(taped.means), behind, 3), 0}};
  }
  const Var<float> image = taped.rendered.image;
  const auto pixels = static_cast<std::size_t>(image.shape().count());
  tape.forward(image);
  tape.backward(image, std::vector<float>(pixels, std::numeric_limits<float>::quiet_NaN()));
  tape.set(taped.means, scene.gaussians.means);
  tape.forward(image);
  tape.backward(image, std::vector<float>(pixels, 1));
  const Projected<float>& projected = taped.rendered.projected;
  double gradients = 0;
  for (const auto& [leaf, cols] :
       {std::pair(taped.means, Index(3)), std::pair(taped.quats, Index(4)), std::pair(taped.log_scales, Index(3)),
        std::pair(taped.opacity_logits, Index(1)), std::pair(taped.sh, Index(12))}) {
    gradients += not_zero_at(taped.gradient(leaf), behind, cols);
  }
  return {
      {"numbers of culled rows that are not 0",
       not_zero_at(taped.value(projected.means_px), behind, 2) + not_zero_at(taped.value(projected.factors), behind, 6),
       0},
      {"gradients of culled rows that are not 0", gradients, 0}};
}

std::vector<StressFigure> wrong_but_finite(Remedy remedy) {
  double passed = 0;
  for (const Fault fault : {Fault::kZeroInSomeRows, Fault::kHalf, Fault::kOneMissing, Fault::kOfOneSign}) {
    passed += is_taken_for_right(fault, remedy) ? 1 : 0;
  }
  return {{"wrong adjoints that pass, of 4", passed, 0},
          {"right adjoints that do not", is_taken_for_right(Fault::kNone, remedy) ? 0.0 : 1.0, 0}};
}

}  // namespace hsi4d::stress
