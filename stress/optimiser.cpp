// Rows F1 to F4: Adam.
#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>

#include "autodiff/elementwise.h"
#include "autodiff/reduce.h"
#include "core/random.h"
#include "optim/adam.h"
#include "stress/faded.h"
#include "stress/measures.h"
#include "stress/plain_adam.h"
#include "stress/rows.h"

namespace hsi4d::stress {

namespace {

OptimizerSettings with_eps(double eps) {
  OptimizerSettings settings;
  settings.eps = eps;
  return settings;
}

/// Parameters whose gradient is whatever `slopes` hold: loss = Σ slopes · x.
template <class S>
struct Slopes {
  Tape<S> tape;
  Var<S> x, slopes, loss;
  Adam<S> adam;

  Slopes(Index count, double lr, double eps)
      : x(tape.parameter("x", shape_of(count, 1))),
        slopes(tape.constant("slopes", shape_of(count, 1))),
        loss(sum(x * slopes)),
        adam(tape, {moving_at<S>({x}, lr)}, with_eps(eps)) {}
  StepReport step(const std::vector<double>& gradient) {
    tape.set(slopes, std::vector<S>(gradient.begin(), gradient.end()));
    tape.forward(loss);
    tape.backward(loss);
    return adam.step(0, 1, 0);
  }
  std::vector<double> numbers() const {
    const ConstArray<S> value = tape.value(x);
    return {value.data, value.data + value.shape.count()};
  }
};

std::vector<double> some_gradient(Index count, int step) {
  const Random random(31, static_cast<std::uint64_t>(step));
  std::vector<double> gradient;
  for (Index i = 0; i < count; ++i) gradient.push_back(random.uniform(static_cast<std::uint64_t>(i), 0.1, 1));
  return gradient;
}

/// What one bad number among good gradients does.
struct Damage {
  double changed = 0;  ///< numbers of the state that are not as before the step that led to it
  double stuck = 0;    ///< numbers that the next good step does not move
  double lost = 0;     ///< numbers that twenty good steps after it do not move far, or that are none
  double counted = 0;  ///< bad evaluations that are told

  void add(const Damage& other) {
    changed += other.changed, stuck += other.stuck, lost += other.lost, counted += other.counted;
  }
};

/// @param step   of the gradient; returns how many bad ones were counted so far
/// @param state  all numbers, moments included
Damage damage_of(double bad, const std::function<double(const std::vector<double>&)>& step,
                 const std::function<std::vector<double>()>& parameters,
                 const std::function<std::vector<double>()>& state) {
  constexpr Index kCount = 30;
  Damage damage;
  for (int i = 0; i < 5; ++i) step(some_gradient(kCount, i));
  const std::vector<double> before = state();
  step(some_gradient(kCount, 5));
  std::vector<double> gradient = some_gradient(kCount, 6);
  gradient[10] = bad;
  step(gradient);
  const std::vector<double> after = state(), at = parameters();
  for (std::size_t i = 0; i < after.size(); ++i) damage.changed += after[i] == before[i] ? 0 : 1;
  step(some_gradient(kCount, 7));
  const std::vector<double> next = parameters();
  for (std::size_t i = 0; i < next.size(); ++i) damage.stuck += std::abs(next[i] - at[i]) > 0 ? 0 : 1;
  for (int i = 8; i < 27; ++i) damage.counted = step(some_gradient(kCount, i));
  const std::vector<double> end = parameters();
  for (std::size_t i = 0; i < end.size(); ++i) damage.lost += std::abs(end[i] - at[i]) > 1e-3 ? 0 : 1;
  return damage;
}

Damage damage_to_adam(double bad) {
  Slopes<float> problem(30, 0.01, 1e-8);
  return damage_of(
      bad, [&](const auto& gradient) { return static_cast<double>(problem.step(gradient).rollbacks); },
      [&] { return problem.numbers(); },
      [&] {
        std::vector<double> all = problem.numbers();
        for (const GroupMoments::Block& block : problem.adam.moments("all").blocks) {
          all.insert(all.end(), block.mean.begin(), block.mean.end());
          all.insert(all.end(), block.square.begin(), block.square.end());
        }
        return all;
      });
}

Damage damage_to_plain_adam(double bad) {
  std::vector<PlainAdam<float>> numbers(30, {.lr = 0.01f});
  const auto all = [&](const auto& of) {
    std::vector<double> result;
    for (const PlainAdam<float>& number : numbers) of(number, result);
    return result;
  };
  return damage_of(
      bad,
      [&](const auto& gradient) {
        for (std::size_t i = 0; i < numbers.size(); ++i) numbers[i].step(static_cast<float>(gradient[i]));
        return 0.0;
      },
      [&] { return all([](const auto& n, auto& to) { to.push_back(static_cast<double>(n.x)); }); },
      [&] {
        return all([](const auto& n, auto& to) {
          for (const float x : {n.x, n.m, n.v}) to.push_back(static_cast<double>(x));
        });
      });
}

/// Steps that gradients of 10^-13 to 1 give in ten steps, with eps = 1e-15; all divided by `scale`, eps too.
std::vector<double> traced(double scale, Remedy remedy) {
  constexpr Index kCount = 40;
  constexpr double kRate = 0.01, kEps = 1e-15;
  const auto gradient = [&](int step) {
    std::vector<double> g = some_gradient(kCount, step);
    for (std::size_t i = 0; i < g.size(); ++i) g[i] *= std::pow(10.0, -static_cast<double>(i) / 3) / scale;
    return g;
  };
  if (remedy == Remedy::kOn) {
    Slopes<double> problem(kCount, kRate, kEps / scale);
    for (int step = 0; step < 10; ++step) problem.step(gradient(step));
    return problem.numbers();
  }
  std::vector<double> x(kCount, 0), m(kCount, 0), v(kCount, 0);
  for (int t = 1; t <= 10; ++t) {
    const std::vector<double> g = gradient(t - 1);
    for (std::size_t i = 0; i < x.size(); ++i) {
      m[i] = 0.9 * m[i] + 0.1 * g[i], v[i] = 0.999 * v[i] + 0.001 * g[i] * g[i];
      x[i] -= kRate * m[i] / (1 - std::pow(0.9, t)) / std::sqrt(v[i] / (1 - std::pow(0.999, t)) + kEps / scale);
    }
  }
  return x;
}

double largest_relative_of_moments(const std::vector<double>& a, const std::vector<double>& b) {
  double worst = 0;
  for (std::size_t i = 0; i < a.size(); ++i) worst = larger(worst, std::abs(a[i] - b[i]) / std::abs(b[i]));
  return worst;
}

/// Numbers that had one gradient of 1 and none after it, for as long as m takes to vanish; and in how many steps a
/// moment was denormal.
struct Fading {
  double denormals = 0;
  double x = 0;
};

Fading fade(Remedy remedy) {
  constexpr int kSteps = 100'000;  // 0.9^6700 is the least normal number, 0.9^7050 the least of all
  Fading result;
  if (remedy == Remedy::kOn) {
    constexpr Index kMany = 64;  // more than one vector
    Slopes<float> problem(kMany, 0.01, 1e-8);
    problem.step(std::vector<double>(kMany, 1));
    const std::vector<double> none(kMany, 0);
    for (int i = 0; i < kSteps; ++i) {
      problem.step(none);
      const GroupMoments moments = problem.adam.moments("all");
      const GroupMoments::Block& block = moments.blocks[0];
      result.denormals += std::any_of(block.mean.begin(), block.mean.end(), is_denormal) ||
                          std::any_of(block.square.begin(), block.square.end(), is_denormal);
    }
    result.x = problem.numbers()[0];
  } else {
    PlainAdam<double> number{.lr = 0.01};
    number.step(1);
    for (int i = 0; i < kSteps; ++i) {
      number.step(0);
      result.denormals += is_denormal(number.m) + is_denormal(number.v);
    }
    result.x = number.x;
  }
  return result;
}

}  // namespace

std::vector<StressFigure> bad_gradients(Remedy remedy) {
  Damage sum;
  double miscounted = 0;
  for (const double bad : {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity(),
                           -std::numeric_limits<double>::infinity(), 3e38}) {
    const Damage damage = remedy == Remedy::kOn ? damage_to_adam(bad) : damage_to_plain_adam(bad);
    sum.add(damage);
    miscounted += std::abs(1 - damage.counted);
  }
  // The least denormal is a gradient like any other.
  const Damage least = remedy == Remedy::kOn ? damage_to_adam(1e-45) : damage_to_plain_adam(1e-45);
  return {{"numbers that one bad gradient does not take back", sum.changed, 0},
          {"parameters that the next good step does not move", sum.stuck, 0},
          {"parameters that are lost or stand still in the end", sum.lost, 0},
          {"bad evaluations counted, off one each, of 4", miscounted, 0},
          {"evaluations with one gradient of 1e-45 that count", least.counted, 0},
          {"parameters that stand still after these", least.stuck + least.lost, 0}};
}

std::vector<StressFigure> place_of_eps(Remedy remedy) {
  constexpr double kScale = 0x1p20;
  std::vector<double> expected;
  for (Index i = 0; i < 40; ++i) {
    PlainAdam<long double> number{.lr = 0.01L, .beta1 = 0.9, .beta2 = 0.999, .eps = 1e-15};
    for (int step = 0; step < 10; ++step) {
      number.step(static_cast<long double>(some_gradient(40, step)[static_cast<std::size_t>(i)] *
                                           std::pow(10.0, -static_cast<double>(i) / 3)));
    }
    expected.push_back(static_cast<double>(number.x));
  }
  const std::vector<double> computed = traced(1, remedy);
  return {{"relative error of ten steps", largest_relative_of_moments(computed, expected), 2e-15},
          {"change of the steps when the loss is 2^-20 of itself",
           largest_relative_of_moments(traced(kScale, remedy), computed), 0}};
}

std::vector<StressFigure> bias_corrections(Remedy remedy) {
  double worst = 0;
  for (const double beta : {0.9, 0.99, 0.999, 0.9999}) {
    for (double at = 1; at <= 1e6; at = std::ceil(at * 1.1)) {
      const auto t = static_cast<Index>(at);
      const long double exact = -std::expm1(static_cast<long double>(t) * std::log(static_cast<long double>(beta)));
      const double computed =
          remedy == Remedy::kOn ? bias_correction(beta, t)
                                : static_cast<double>(1.0f - std::pow(static_cast<float>(beta), static_cast<float>(t)));
      worst = larger(worst, static_cast<double>(std::abs((computed - exact) / exact)));
    }
  }
  return {{"relative error of 1 - beta^t, t to 10^6", worst, 1e-12}};
}

std::vector<StressFigure> fading_moments(Remedy remedy) {
  const Fading computed = fade(remedy), unflushed = fade(Remedy::kOff);
  return {{"steps of 100,000 with a denormal moment", computed.denormals, 0},
          {"what flushing changes in the parameter", std::abs(computed.x - unflushed.x), 1e-6},
          {"time of a step with faded moments over one with others", slowdown_of_faded(remedy, 100'000), 1.2}};
}

}  // namespace hsi4d::stress
