#include "optim/row_adam.h"

#include <algorithm>
#include <cmath>

#include "core/parallel.h"
#include "core/simd.h"
#include "optim/adam.h"

namespace hsi4d {

namespace {

constexpr Index kGrain = 2048;  // rows

enum class RowGradient { kZero, kUsable, kBad };

template <class S>
RowGradient look_at(const S* gradient, Index cols) {
  S sum = 0;
  for (Index c = 0; c < cols; ++c) sum += std::fabs(gradient[c]);
  if (sum == 0) return RowGradient::kZero;
  return static_cast<double>(sum) <= kLargestGradient ? RowGradient::kUsable : RowGradient::kBad;
}

/// One row. @param step       rate over the correction of m
///          @param root_scale  1 over the correction of v
template <class S>
void move_row(const S* g, S* x, S* m, S* v, Index cols, const RowAdamRule& rule, S step, S root_scale) {
  const S beta1 = static_cast<S>(rule.beta1), beta2 = static_cast<S>(rule.beta2), eps = static_cast<S>(rule.eps);
  const S other1 = static_cast<S>(1 - rule.beta1), other2 = static_cast<S>(1 - rule.beta2);
  const float* const shares = rule.column_shares.empty() ? nullptr : rule.column_shares.data();
  for (Index c = 0; c < cols; ++c) {
    m[c] = beta1 * m[c] + other1 * g[c];
    v[c] = beta2 * v[c] + other2 * (g[c] * g[c]);
    const S way = step * m[c] / (std::sqrt(v[c] * root_scale) + eps);
    x[c] -= shares == nullptr ? way : way * static_cast<S>(shares[c]);
  }
}

}  // namespace

template <class S>
void RowMoments<S>::resize(Index rows, Index cols) {
  mean.resize(static_cast<std::size_t>(rows * cols));
  square.resize(static_cast<std::size_t>(rows * cols));
  steps.resize(static_cast<std::size_t>(rows));
}

template <class S>
void RowMoments<S>::clear_row(Index row, Index cols) {
  std::fill_n(mean.begin() + row * cols, cols, S(0));
  std::fill_n(square.begin() + row * cols, cols, S(0));
  steps[static_cast<std::size_t>(row)] = 0;
}

std::vector<double> bias_corrections(double beta, Index steps) {
  std::vector<double> corrections(static_cast<std::size_t>(steps + 1), 0.0);
  for (Index t = 1; t <= steps; ++t) corrections[static_cast<std::size_t>(t)] = bias_correction(beta, t);
  return corrections;
}

template <class S>
RowAdamReport step_rows(Var<S> leaf, RowMoments<S>& moments, const RowAdamRule& rule, std::span<const double> first,
                        std::span<const double> second) {
  Tape<S>& tape = leaf.owner();
  if (!tape.has_gradient(leaf)) return {};
  const ConstArray<S> gradient = tape.gradient(leaf);
  const Array<S> parameter = tape.write(leaf);
  const Index rows = gradient.total_rows(), cols = gradient.shape.cols;
  HSI4D_CHECK_EQ(std::ssize(moments.mean), rows * cols);
  HSI4D_CHECK_EQ(std::ssize(moments.steps), rows);
  HSI4D_CHECK(rule.column_shares.empty() || std::ssize(rule.column_shares) == cols, "a share a column");
  HSI4D_CHECK(first.size() > 1 && first.size() == second.size(), "corrections of a step");
  const auto most = static_cast<std::int32_t>(first.size() - 1);
  const Partition part{rows, kGrain};
  std::vector<RowAdamReport> reports(static_cast<std::size_t>(part.chunks()));
  parallel_chunks(part, [&](Index chunk, Index begin, Index end) {
    RowAdamReport& report = reports[static_cast<std::size_t>(chunk)];
    on_best_isa([&] {
      for (Index row = begin; row < end; ++row) {
        const S* const g = gradient.row(row);
        const RowGradient kind = look_at(g, cols);
        if (kind == RowGradient::kZero) continue;
        if (kind == RowGradient::kBad) {
          ++report.refused;
          continue;
        }
        std::int32_t& steps = moments.steps[static_cast<std::size_t>(row)];
        steps = std::min(steps + 1, most);
        const auto at = static_cast<std::size_t>(steps);
        move_row(g, parameter.row(row), moments.mean.data() + row * cols, moments.square.data() + row * cols, cols,
                 rule, static_cast<S>(rule.rate / first[at]), static_cast<S>(1 / second[at]));
        ++report.moved;
      }
    });
  });
  RowAdamReport total;
  for (const RowAdamReport& report : reports) {
    total.moved += report.moved;
    total.refused += report.refused;
  }
  return total;
}

template struct RowMoments<float>;
template struct RowMoments<double>;
template RowAdamReport step_rows(Var<float>, RowMoments<float>&, const RowAdamRule&, std::span<const double>,
                                 std::span<const double>);
template RowAdamReport step_rows(Var<double>, RowMoments<double>&, const RowAdamRule&, std::span<const double>,
                                 std::span<const double>);

}  // namespace hsi4d
