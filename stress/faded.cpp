#include "stress/faded.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "autodiff/elementwise.h"
#include "autodiff/reduce.h"
#include "core/parallel.h"
#include "core/stopwatch.h"
#include "optim/adam.h"
#include "stress/plain_adam.h"

namespace hsi4d::stress {

namespace {

constexpr double kFadedRate = 2e-3;

/// Adam on many numbers of one slope, on one thread; a plain loop without the remedy.
class ManyNumbers {
 public:
  explicit ManyNumbers(Remedy remedy) : remedy_(remedy) {}

  /// Processor seconds of a step.
  double step(int step, double slope) {
    if (remedy_ == Remedy::kOn) {
      const Array<double> all = tape_.write(slopes_);
      std::fill_n(all.data, kMany, slope);
      tape_.forward(loss_);
      tape_.backward(loss_);
    }
    Stopwatch watch;
    if (remedy_ == Remedy::kOn) {
      adam_.step(0, 1, tape_.value(loss_).scalar());
    } else {
      plain_step(step, slope);
    }
    return watch.lap();
  }

 private:
  static constexpr Index kMany = 1024;

  void plain_step(int step, double slope) {
    const double by_m = 1 / (1 - std::pow(0.9, step + 1)), by_v = 1 / (1 - std::pow(0.999, step + 1));
    for (std::size_t i = 0; i < x_.size(); ++i) {
      m_[i] = 0.9 * m_[i] + 0.1 * slope, v_[i] = 0.999 * v_[i] + 0.001 * slope * slope;
      x_[i] -= kFadedRate * by_m * m_[i] / (std::sqrt(by_v * v_[i]) + 1e-8);
    }
  }

  Remedy remedy_;
  Tape<double> tape_;
  Var<double> numbers_ = tape_.parameter("numbers", shape_of(kMany, 1));
  Var<double> slopes_ = tape_.constant("slopes", shape_of(kMany, 1));
  Var<double> loss_ = sum(numbers_ * slopes_);
  Adam<double> adam_{tape_, {moving_at<double>({numbers_}, kFadedRate)}, {}};
  std::vector<double> x_ = std::vector<double>(kMany, 0), m_ = x_, v_ = x_;
};

}  // namespace

double slowdown_of_faded(Remedy remedy, int steps) {
  constexpr int kTimed = 1000;
  double alive = std::numeric_limits<double>::infinity(), faded = alive;
  with_threads(1, [&] {
    ManyNumbers of_some(remedy), of_none(remedy);
    for (int step = 0; step < steps; ++step) {
      const double some = of_some.step(step, 1), none = of_none.step(step, step == 0 ? 1 : 0);
      if (step < steps - kTimed) continue;
      alive = std::min(alive, some);
      faded = std::min(faded, none);
    }
  });
  return alive > 0 ? faded / alive : 1;  // a clock that is too coarse to tell
}

}  // namespace hsi4d::stress
