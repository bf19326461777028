#include "optim/adam.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <sstream>
#include <utility>

#include "autodiff/inspect.h"
#include "core/parallel.h"
#include "core/simd.h"

namespace hsi4d {

namespace {

/// Numbers of one parallel chunk.
constexpr Index kChunk = 8192;

/// Calls run(offset in memory, offset without padding, count) for runs that together are all numbers of an array, in
/// parallel.
template <class F>
void for_runs(const Shape& shape, const F& run) {
  if (shape.dense()) {
    parallel_for(shape.count(), kChunk, [&](Index begin, Index end) { run(begin, begin, end - begin); });
    return;
  }
  parallel_for(shape.planes * shape.rows, std::max<Index>(1, kChunk / std::max<Index>(1, shape.cols)),
               [&](Index begin, Index end) {
                 for (Index r = begin; r < end; ++r) run(r * shape.stride, r * shape.cols, shape.cols);
               });
}

/// Σ x² in double, eight running sums, the same bits on every instruction set.
template <class S>
double sum_of_squares(const S* x, Index n) {
  double total = 0;
  on_best_isa([&] {
    constexpr Index kSums = 8;
    double sums[kSums] = {};
    Index i = 0;
    for (; i + kSums <= n; i += kSums) {
      for (Index lane = 0; lane < kSums; ++lane) {
        const double value = static_cast<double>(x[i + lane]);
        sums[lane] += value * value;
      }
    }
    for (; i < n; ++i) sums[0] += static_cast<double>(x[i]) * static_cast<double>(x[i]);
    for (const double sum : sums) total += sum;
  });
  return total;
}

template <class S>
double sum_of_squares(const ConstArray<S>& array) {
  const Shape& shape = array.shape;
  if (shape.dense()) {
    return parallel_sum(shape.count(), kChunk,
                        [&](Index begin, Index end) { return sum_of_squares(array.data + begin, end - begin); });
  }
  return parallel_sum(array.total_rows(), std::max<Index>(1, kChunk / std::max<Index>(1, shape.cols)),
                      [&](Index begin, Index end) {
                        double sum = 0;
                        for (Index r = begin; r < end; ++r) sum += sum_of_squares(array.row(r), shape.cols);
                        return sum;
                      });
}

}  // namespace

std::string BadNumber::text() const {
  std::ostringstream text;
  if (group.empty()) {
    text << "the loss is " << value;
    return text.str();
  }
  text << "the gradient of group '" << group << "', array '" << block << "', ";
  if (plane != 0) text << "plane " << plane << ", ";
  text << "row " << row << ", column " << col << " is " << value;
  return text.str();
}

bool moves_in(const ParameterGroupSettings& settings, Index iteration) {
  return iteration >= settings.from && (!settings.until || iteration < *settings.until) &&
         (iteration - settings.from) % settings.every == 0;
}

double scheduled_rate(const ParameterGroupSettings& settings, Index iteration, Index iterations) {
  if (iterations <= 1 || settings.lr_final_share == 1) return settings.lr;
  return settings.lr *
         std::pow(settings.lr_final_share, static_cast<double>(iteration) / static_cast<double>(iterations - 1));
}

// m̂ = Σ a_k g_k with a_k ∝ β1ᵏ, v̂ = Σ b_k g_k² with b_k ∝ β2ᵏ, so that m̂² ≤ v̂ Σ a_k²/b_k. Moments are the stage's own.
double longest_adam_way(const ParameterGroupSettings& settings, Index iterations, const OptimizerSettings& optimizer) {
  const double beta1 = optimizer.beta1, beta2 = optimizer.beta2;
  double way = 0, first_sum = 0, second_sum = 0, ratio_sum = 0;  // Σ β1ᵏ, Σ β2ᵏ, Σ (β1²/β2)ᵏ
  double first = 1, second = 1, ratio = 1;
  for (Index i = 0; i < iterations; ++i) {
    if (!moves_in(settings, i)) continue;
    first_sum += std::exchange(first, first * beta1);
    second_sum += std::exchange(second, second * beta2);
    ratio_sum += std::exchange(ratio, beta2 > 0 ? ratio * beta1 * beta1 / beta2 : 0.0);
    way += scheduled_rate(settings, i, iterations) * std::sqrt(second_sum * ratio_sum) / first_sum;
  }
  return way;
}

double bias_correction(double beta, Index steps) { return -std::expm1(static_cast<double>(steps) * std::log(beta)); }

template <class S>
Adam<S>::Adam(Tape<S>& tape, std::vector<OptimizerGroup<S>> groups, const OptimizerSettings& settings)
    : tape_(tape), settings_(settings) {
  std::set<std::uint32_t> seen;
  for (OptimizerGroup<S>& given : groups) {
    Group group;
    group.name = std::move(given.parameters.name);
    group.settings = given.settings;
    for (const Var<S> var : given.parameters.blocks) {
      HSI4D_CHECK(var.tape == &tape, "group '" + group.name + "' has an array of another tape");
      HSI4D_CHECK(TapeInspector<S>(tape).is_leaf(var.id), "group '" + group.name + "' has an array that is computed");
      HSI4D_CHECK(seen.insert(var.id).second, "an array of group '" + group.name + "' is given twice");
      Block block;
      block.var = var;
      const std::size_t count = static_cast<std::size_t>(tape.shape(var).count());
      block.mean.assign(count, 0);
      block.square.assign(count, 0);
      block.other_mean.assign(count, 0);
      block.other_square.assign(count, 0);
      block.before.assign(count, 0);
      group.blocks.push_back(std::move(block));
    }
    groups_.push_back(std::move(group));
  }
  for (const Group& group : groups_) reports_.push_back({group.name});
}

template <class S>
StepReport Adam<S>::step(Index iteration, Index iterations, double loss) {
  StepReport report;
  report.bad = look_for_bad_numbers(iteration, loss);
  report.rolled_back = report.bad.has_value();
  if (report.rolled_back) {
    ++rollbacks_;
    ++bad_in_a_row_;
    rate_ *= 0.5;
    report.undone = undo();
  } else {
    for (std::size_t g = 0; g < groups_.size(); ++g) {
      const double rate = reports_[g].moved ? rate_ * scheduled_rate(groups_[g].settings, iteration, iterations) : 0.0;
      groups_[g].moved = reports_[g].moved;
      reports_[g].learning_rate = rate;
      if (reports_[g].moved) move(groups_[g], rate);
    }
    can_undo_ = true;
    bad_in_a_row_ = 0;
    rate_ = std::min(1.0, rate_ * kRateRecovery);
  }
  report.rollbacks = rollbacks_;
  report.groups = reports_;
  return report;
}

/// Fills reports_: which groups are on and have a gradient, and their norms.
template <class S>
std::optional<BadNumber> Adam<S>::look_for_bad_numbers(Index iteration, double loss) {
  std::optional<BadNumber> bad;
  if (!std::isfinite(loss)) {
    bad.emplace();
    bad->value = loss;
  }
  for (std::size_t g = 0; g < groups_.size(); ++g) {
    const Group& group = groups_[g];
    reports_[g] = {group.name};
    if (!moves_in(group.settings, iteration)) continue;
    double squares = 0;
    for (const Block& block : group.blocks) {
      if (!tape_.has_gradient(block.var)) continue;
      const double sum = sum_of_squares(tape_.gradient(block.var));
      squares += sum;
      reports_[g].moved = true;
      // Otherwise no number is beyond the limit, for the sum would be.
      if (!bad && !(sum <= kLargestGradient * kLargestGradient)) bad = first_bad(group, block);
    }
    reports_[g].gradient_norm = std::sqrt(squares);
  }
  if (bad) {
    for (GroupStep& report : reports_) report.moved = false;
  }
  return bad;
}

template <class S>
std::optional<BadNumber> Adam<S>::first_bad(const Group& group, const Block& block) const {
  const ConstArray<S> gradient = tape_.gradient(block.var);
  const Shape& shape = gradient.shape;
  for (Index r = 0; r < gradient.total_rows(); ++r) {
    for (Index c = 0; c < shape.cols; ++c) {
      const double value = static_cast<double>(gradient.row(r)[c]);
      if (std::fabs(value) <= kLargestGradient) continue;
      return BadNumber{group.name, TapeInspector<S>(tape_).array_name(block.var.id), r / shape.rows, r % shape.rows, c,
                       value};
    }
  }
  return std::nullopt;
}

template <class S>
void Adam<S>::move(Group& group, double learning_rate) {
  ++group.steps;
  const double step = learning_rate / bias_correction(settings_.beta1, group.steps);
  const double root_scale = 1 / bias_correction(settings_.beta2, group.steps);
  for (Block& block : group.blocks) {
    block.moved = tape_.has_gradient(block.var);
    if (block.moved) move(block, step, root_scale);
  }
}

/// One block: reads g, m and v; writes the new m and v beside the old ones, keeps x, writes x.
template <class S>
void Adam<S>::move(Block& block, double step, double root_scale) {
  const ConstArray<S> gradient = tape_.gradient(block.var);
  const Array<S> parameter = tape_.write(block.var);
  const double beta1 = settings_.beta1, beta2 = settings_.beta2, eps = settings_.eps;
  for_runs(gradient.shape, [&](Index memory, Index number, Index n) {
    const S* g = gradient.data + memory;
    S *x = parameter.data + memory, *x_before = block.before.data() + number;
    const double *m = block.mean.data() + number, *v = block.square.data() + number;
    double *m_new = block.other_mean.data() + number, *v_new = block.other_square.data() + number;
    on_best_isa([=] {
#pragma GCC ivdep
      for (Index i = 0; i < n; ++i) {
        const double slope = static_cast<double>(g[i]);
        const double mean = beta1 * m[i] + (1 - beta1) * slope;
        const double square = beta2 * v[i] + (1 - beta2) * (slope * slope);
        m_new[i] = mean;
        v_new[i] = square;
        x_before[i] = x[i];
        x[i] = static_cast<S>(static_cast<double>(x[i]) - step * mean / (std::sqrt(square * root_scale) + eps));
      }
    });
  });
  block.mean.swap(block.other_mean);
  block.square.swap(block.other_square);
}

template <class S>
bool Adam<S>::undo() {
  if (!can_undo_) return false;
  can_undo_ = false;
  for (Group& group : groups_) {
    if (!group.moved) continue;
    group.moved = false;
    --group.steps;
    for (Block& block : group.blocks) {
      if (!block.moved) continue;
      block.mean.swap(block.other_mean);
      block.square.swap(block.other_square);
      tape_.set(block.var, std::span<const S>(block.before));
    }
  }
  return true;
}

template <class S>
typename Adam<S>::Group& Adam<S>::group_named(std::string_view name) {
  for (Group& group : groups_) {
    if (group.name == name) return group;
  }
  throw InternalError("the optimiser has no group '" + std::string(name) + "'");
}

template <class S>
GroupMoments Adam<S>::moments(std::string_view name) const {
  const Group& group = const_cast<Adam*>(this)->group_named(name);
  GroupMoments result;
  result.steps = group.steps;
  for (const Block& block : group.blocks) result.blocks.push_back({block.mean, block.square});
  return result;
}

template <class S>
void Adam<S>::set_moments(std::string_view name, const GroupMoments& moments) {
  Group& group = group_named(name);
  bool fits = group.blocks.size() == moments.blocks.size() && moments.steps >= 0;
  for (std::size_t b = 0; fits && b < group.blocks.size(); ++b) {
    const std::size_t count = group.blocks[b].mean.size();
    fits = moments.blocks[b].mean.size() == count && moments.blocks[b].square.size() == count;
  }
  if (!fits) throw DataError("the moments of group '" + group.name + "' are not of the sizes of its parameters");
  group.steps = moments.steps;
  for (std::size_t b = 0; b < group.blocks.size(); ++b) {
    group.blocks[b].mean = moments.blocks[b].mean;
    group.blocks[b].square = moments.blocks[b].square;
  }
  can_undo_ = false;
}

template <class S>
void Adam<S>::clear_mean(Var<S> var, Index row) {
  for (Group& group : groups_) {
    for (Block& block : group.blocks) {
      if (block.var.id != var.id) continue;
      const Shape& shape = tape_.shape(var);
      HSI4D_CHECK(row >= 0 && row < shape.planes * shape.rows, "row " + std::to_string(row));
      std::fill_n(block.mean.begin() + row * shape.cols, shape.cols, 0.0);
      return;
    }
  }
  throw InternalError("the optimiser does not have this array");
}

template class Adam<float>;
template class Adam<double>;

}  // namespace hsi4d
