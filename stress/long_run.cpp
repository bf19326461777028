// Rows L: 10,000 steps of Adam on a small render.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "autodiff/difference.h"
#include "autodiff/elementwise.h"
#include "autodiff/reduce.h"
#include "stress/measures.h"
#include "stress/plain_adam.h"
#include "stress/rows.h"
#include "stress/splat_scene.h"
#include "stress/tape_numbers.h"
#include "stress/thread_order.h"

namespace hsi4d::stress {

namespace {

constexpr int kLongSteps = 10000;
constexpr int kBlindFrom =
    1000;                       ///< half of the image does not count from here on: what it alone shows has no gradient
constexpr int kBadStep = 5000;  ///< the frame has a pixel that is no number
constexpr double kLongRate = 2e-3;
constexpr int kLongWidth = 32, kLongHeight = 24;

/// How it is run.
struct Way {
  int threads = 1;
  bool plain_adam = false;    ///< without a look at gradients, without flushing
  bool thread_order = false;  ///< one gradient is a sum in the order of threads
  bool bad_step = false;
};

struct Outcome {
  std::vector<double> parameters;
  double decibels = 0;        ///< of the half that counts to the end
  double denormal_steps = 0;  ///< with a denormal moment
  double rollbacks = 0;
};

/// Adam number by number, in this thread's own mode.
template <class S>
class PlainStepper {
 public:
  void step(Tape<S>& tape, const std::vector<Var<S>>& leaves) {
    std::size_t at = 0;
    for (const Var<S> leaf : leaves) {
      std::vector<double> x = numbers_of<S>(tape.value(leaf));
      const std::vector<double> d = numbers_of<S>(tape.gradient(leaf));
      numbers_.resize(std::max(numbers_.size(), at + x.size()), {.lr = kLongRate});
      for (std::size_t i = 0; i < x.size(); ++i) {
        PlainAdam<double>& number = numbers_[at++];
        number.x = x[i];
        number.step(d[i]);
        x[i] = number.x;
      }
      set_numbers(tape, leaf, x);
    }
  }
  bool has_denormals() const {
    for (const PlainAdam<double>& number : numbers_) {
      if (is_denormal(number.m) || is_denormal(number.v)) return true;
    }
    return false;
  }

 private:
  std::vector<PlainAdam<double>> numbers_;
};

template <class S>
bool has_denormals(const Adam<S>& adam) {
  for (const GroupMoments::Block& block : adam.moments("all").blocks) {
    for (std::size_t i = 0; i < block.mean.size(); ++i) {
      if (is_denormal(block.mean[i]) || is_denormal(block.square[i])) return true;
    }
  }
  return false;
}

/// A scene that is fitted to the image of another.
template <class S>
struct Fit {
  TapedScene<S> taped{small_scene(16, kLongWidth, kLongHeight, 90)};
  std::vector<Var<S>> leaves = taped.leaves();
  std::vector<double> frame = exact_image(small_scene(16, kLongWidth, kLongHeight, 91));
  Var<S> target, weight, loss;

  explicit Fit(const Way& way) {
    Tape<S>& tape = taped.tape;
    leaves.push_back(tape.parameter("offset", kScalarShape));
    target = tape.constant("target", taped.rendered.image.shape());
    weight = tape.constant("weight", image_shape<S>(1, kLongHeight, kLongWidth));
    set_numbers(tape, target, frame);
    set_numbers(tape, weight, std::vector<double>(kLongWidth * kLongHeight, 1));
    const Var<S> image = way.thread_order ? offset_by_threads(taped.rendered.image, leaves.back())
                                          : taped.rendered.image + leaves.back();
    loss = l2(image, target, weight);
  }
  void prepare(int step, const Way& way) {
    Tape<S>& tape = taped.tape;
    if (step == kBlindFrom) {
      const Array<S> w = tape.write(weight);
      for (Index r = 0; r < kLongHeight; ++r) std::fill_n(w.row(r) + kLongWidth / 2, kLongWidth / 2, S(0));
    }
    if (!way.bad_step || (step != kBadStep && step != kBadStep + 1)) return;
    frame[0] = step == kBadStep ? std::numeric_limits<double>::quiet_NaN() : frame[1];
    set_numbers(tape, target, frame);
  }
};

template <class S>
Outcome run_steps(const Way& way) {
  Fit<S> fit(way);
  Tape<S>& tape = fit.taped.tape;
  Adam<S> adam(tape, {moving_at(fit.leaves, kLongRate)}, {});
  PlainStepper<S> plain;
  Outcome outcome;
  for (int step = 0; step < kLongSteps; ++step) {
    fit.prepare(step, way);
    tape.forward(fit.loss);
    tape.backward(fit.loss);
    if (way.plain_adam) {
      plain.step(tape, fit.leaves);
    } else {
      adam.step(step, kLongSteps, static_cast<double>(tape.value(fit.loss).scalar()));
    }
    outcome.denormal_steps += (way.plain_adam ? plain.has_denormals() : has_denormals(adam)) ? 1 : 0;
  }
  tape.forward(fit.loss);
  outcome.decibels = -10 * std::log10(static_cast<double>(tape.value(fit.loss).scalar()));
  outcome.rollbacks = static_cast<double>(adam.rollbacks());
  for (const Var<S> leaf : fit.leaves) {
    const std::vector<double> numbers = numbers_of<S>(tape.value(leaf));
    outcome.parameters.insert(outcome.parameters.end(), numbers.begin(), numbers.end());
  }
  return outcome;
}

template <class S>
Outcome run_on_threads(const Way& way) {
  Outcome outcome;
  with_threads(way.threads, [&] { outcome = run_steps<S>(way); });
  return outcome;
}

}  // namespace

/// L1: float and double end alike, though the single parameters do not; a bad frame on the way does no harm.
std::vector<StressFigure> to_the_end(Remedy remedy) {
  const Way way{.plain_adam = remedy == Remedy::kOff, .bad_step = true};
  const Outcome single = run_on_threads<float>(way), full = run_on_threads<double>(way);
  double lost = 0;
  for (const double x : single.parameters) lost += std::isfinite(x) ? 0 : 1;
  return {
      {"parameters that are not finite after 10,000 steps", lost, 0},
      {"bad evaluations not counted, of 1", std::abs(1 - single.rollbacks), 0},
      {"float's fit below double's, dB", full.decibels - single.decibels, 0.5},
      {"double's fit below 25 dB, dB", 25 - full.decibels, 0},
      {"float and double apart, relative (told, not bounded)", relative_l2(single.parameters, full.parameters), 10}};
}

/// L2: counted, not timed: what a denormal costs depends on the processor, and a time on what runs beside it.
std::vector<StressFigure> without_denormals(Remedy remedy) {
  const Outcome outcome = run_on_threads<float>({.plain_adam = remedy == Remedy::kOff});
  return {{"steps of 10,000 with a denormal moment", outcome.denormal_steps, 0}};
}

/// L3
std::vector<StressFigure> on_any_threads(Remedy remedy) {
  const bool thread_order = remedy == Remedy::kOff;
  const Outcome first = run_on_threads<float>({.threads = 1, .thread_order = thread_order});
  double different = 0;
  for (const int threads : {2, 3, 8}) {
    if (thread_order && threads > 2) break;
    const Outcome other = run_on_threads<float>({.threads = threads, .thread_order = thread_order});
    for (std::size_t i = 0; i < first.parameters.size(); ++i)
      different += first.parameters[i] == other.parameters[i] ? 0 : 1;
  }
  return {{"parameters that differ on 2, 3 or 8 threads", different, 0}};
}

}  // namespace hsi4d::stress
