#include "autodiff/gradcheck.h"

#include <algorithm>
#include <cmath>
#include <functional>

#include "autodiff/inspect.h"
#include "core/random.h"

namespace hsi4d {

namespace {

/// Stands for an operator's name where the gradient is that of a leaf through everything.
constexpr const char* kWholeTape = "whole tape";

std::vector<double> random_cotangent(std::uint64_t seed, Index count) {
  std::vector<double> u(static_cast<std::size_t>(count));
  const Random random(seed, random_stream("gradcheck.cotangent"));
  for (std::size_t i = 0; i < u.size(); ++i) u[i] = random.uniform(i, -1, 1);
  return u;
}

/// Σ u_i y_i over the numbers of y, without padding.
double dot(const std::vector<double>& u, const ConstArray<double>& y) {
  double sum = 0;
  for (Index r = 0; r < y.total_rows(); ++r) {
    for (Index c = 0; c < y.shape.cols; ++c) sum += u[static_cast<std::size_t>(r * y.shape.cols + c)] * y.row(r)[c];
  }
  return sum;
}

double root_mean_square(const ConstArray<double>& x) {
  double sum = 0;
  for (Index r = 0; r < x.total_rows(); ++r) {
    for (Index c = 0; c < x.shape.cols; ++c) sum += x.row(r)[c] * x.row(r)[c];
  }
  return std::sqrt(sum / static_cast<double>(std::max<Index>(1, x.shape.count())));
}

/// A scalar function of one array, its value and the discrete choices that were made on the way.
struct Probe {
  Array<double> x;
  ConstArray<double> gradient;  // what the adjoint says
  std::function<double()> value;
  std::function<std::uint64_t()> choices;
  GradcheckFailure place;  // filled but for the entry
  int input = -1;          // of the operator
};

class Checker {
 public:
  Checker(const GradcheckOptions& options, GradcheckReport& report)
      : options_(options), report_(report), entries_(options.seed, random_stream("gradcheck.entries")) {}

  void check(const Probe& probe) {
    const std::uint64_t choices = probe.choices();
    const double scale = std::max(root_mean_square(probe.x), 1e-3);
    const double typical = root_mean_square(probe.gradient);
    const Index count = probe.x.shape.count();
    report_.arrays.push_back({probe.place.node, probe.place.array, probe.input, 0, 0, 0});
    for (Index k = 0; k < std::min(count, options_.entries); ++k) {
      const Index entry =
          count <= options_.entries
              ? k
              : static_cast<Index>(entries_.below(static_cast<std::uint64_t>(k), static_cast<std::uint64_t>(count)));
      check_entry(probe, entry, choices, scale, typical);
    }
  }

  /// Checks that every entry of `twice` is two times that of `once` (both with padding).
  void check_doubled(const Array<double>& twice, const std::vector<double>& once, const GradcheckFailure& place) {
    double size = 0;
    for (const double g : once) size = std::max(size, std::fabs(g));
    for (Index i = 0; i < twice.shape.count(); ++i) {
      const Index row = i / twice.shape.cols, col = i % twice.shape.cols;
      const double expected = 2 * once[static_cast<std::size_t>(row * twice.shape.stride + col)];
      if (!(std::fabs(twice.row(row)[col] - expected) <= 1e-12 * size))
        fail_at(place, twice.shape, i, expected, twice.row(row)[col]);
    }
  }

 private:
  void fail_at(GradcheckFailure failure, const Shape& shape, Index entry, double expected, double computed) {
    const Index row = entry / shape.cols;
    failure.plane = row / shape.rows;
    failure.row = row % shape.rows;
    failure.col = entry % shape.cols;
    failure.expected = expected;
    failure.computed = computed;
    report_.failures.push_back(std::move(failure));
  }

  /// Puts a number back, also when an evaluation throws.
  struct Restore {
    double* x;
    double value;
    ~Restore() { *x = value; }
  };

  /// Central difference of sixth order; false when a discrete choice changed on the way.
  bool difference(const Probe& probe, double* x, double step, std::uint64_t choices, double& derivative) const {
    static constexpr double kWeights[3] = {45.0 / 60, -9.0 / 60, 1.0 / 60};
    const Restore centre{x, *x};
    bool smooth = true;
    derivative = 0;
    for (int i = 1; i <= 3; ++i) {
      for (const int side : {1, -1}) {
        *x = centre.value + side * i * step;
        derivative += side * kWeights[i - 1] * probe.value();
        smooth = smooth && probe.choices() == choices;
      }
    }
    derivative /= step;
    return smooth;
  }

  /// How much steeper the function is to the right than to the left, by one-sided differences of third order. A kink at
  /// the point itself shows in nothing else: central differences of all steps are the mean of both sides.
  static double bend(const Probe& probe, double* x, double step) {
    static constexpr double kWeights[4] = {-11.0 / 6, 3, -1.5, 1.0 / 3};
    const Restore centre{x, *x};
    double difference = 2 * kWeights[0] * probe.value();
    for (int i = 1; i <= 3; ++i) {
      for (const int side : {1, -1}) {
        *x = centre.value + side * i * step;
        difference += kWeights[i] * probe.value();
      }
    }
    return difference / step;
  }

  void check_entry(const Probe& probe, Index entry, std::uint64_t choices, double scale, double typical) {
    ++report_.entries;
    ++report_.arrays.back().entries;
    const Index cols = probe.x.shape.cols;
    double* x = probe.x.row(entry / cols) + entry % cols;
    const double computed = probe.gradient.row(entry / cols)[entry % cols];
    const double size_of_x = std::max(std::fabs(*x), scale);
    double step = options_.step * size_of_x;
    const auto error_of = [&](double expected) {
      const double size = std::max({std::fabs(expected), std::fabs(computed), typical, 1e-30});
      const double error = std::fabs(computed - expected) / size;
      return std::isfinite(error) ? error : HUGE_VAL;
    };
    double expected = 0;
    while (!difference(probe, x, step, choices, expected)) {
      if (!(step / 10 > 0) || step / 10 < options_.shortest_step * size_of_x) return add_kink();
      step /= 10;
    }
    double error = error_of(expected);
    // Further opinions, with a longer step (less rounding) and a shorter one (less curvature, no kink); where that one
    // differs by more than allowed the difference is no judge.
    double other = 0;
    if (error > options_.tolerance && difference(probe, x, step * 8, choices, other) && error_of(other) < error) {
      expected = other;
      error = error_of(other);
    }
    if (error > options_.tolerance) {
      const bool smooth = difference(probe, x, step / 8, choices, other);
      const double size = std::max({std::fabs(expected), std::fabs(other), typical, 1e-30});
      const double disagreement = std::max(std::fabs(expected - other), std::fabs(bend(probe, x, step / 8))) / size;
      if (error_of(other) < error) error = error_of(other);
      if (error > options_.tolerance && (!smooth || disagreement > 0.1 * error)) return add_kink();
      expected = other;
    }
    report_.worst_error = std::max(report_.worst_error, error);
    report_.arrays.back().worst_error = std::max(report_.arrays.back().worst_error, error);
    if (error > options_.tolerance) fail_at(probe.place, probe.x.shape, entry, expected, computed);
  }

  void add_kink() {
    ++report_.kinks;
    ++report_.arrays.back().kinks;
  }

  const GradcheckOptions& options_;
  GradcheckReport& report_;
  Random entries_;
};

/// The gradient of each unfrozen leaf through the whole tape.
void check_leaves(Tape<double>& tape, Var<double> result, const std::vector<double>& u, Checker& checker) {
  TapeInspector<double> inspect(tape);
  for (std::uint32_t id = 0; id < inspect.arrays(); ++id) {
    if (!inspect.is_leaf(id) || !inspect.adjoint(id)) continue;
    Probe probe;
    probe.x = inspect.value(id);
    probe.gradient = inspect.adjoint(id);
    probe.value = [&] {
      tape.write(inspect.handle(id));
      tape.forward(result);
      return dot(u, tape.value(result));
    };
    probe.choices = [&] { return tape.signature(result); };
    probe.place = {kWholeTape, "", inspect.array_name(id)};
    checker.check(probe);
    tape.write(inspect.handle(id));
  }
  tape.forward(result);
}

/// An adjoint adds: called a second time it doubles what is there. Leaves the adjoints of one call.
void check_adds(TapeInspector<double>& inspect, std::uint32_t n, Checker& checker) {
  std::vector<std::vector<double>> once;
  for (const std::uint32_t id : inspect.inputs(n)) {
    const Array<double> d = inspect.adjoint(id);
    once.emplace_back(d.data, d.data + (d ? d.shape.memory() : 0));
  }
  inspect.backward(n);
  for (std::size_t i = 0; i < once.size(); ++i) {
    const std::uint32_t id = inspect.inputs(n)[i];
    const Array<double> d = inspect.adjoint(id);
    if (!d) continue;
    checker.check_doubled(d, once[i], {inspect.operator_name(n), inspect.source(n), inspect.array_name(id)});
  }
  for (std::size_t i = 0; i < once.size(); ++i)
    std::copy(once[i].begin(), once[i].end(), inspect.adjoint(inspect.inputs(n)[i]).data);
}

/// One operator by itself: its adjoint on random output adjoints against differences of its own forward.
void check_node(TapeInspector<double>& inspect, std::uint32_t n, std::uint64_t seed, Checker& checker) {
  std::vector<std::pair<std::uint32_t, std::vector<double>>> cotangents;
  for (const std::uint32_t id : inspect.outputs(n)) {
    const Array<double> d = inspect.adjoint(id);
    if (!d) continue;
    cotangents.emplace_back(id, random_cotangent(seed + id, d.shape.count()));
    const auto& u = cotangents.back().second;
    for (Index i = 0; i < d.shape.count(); ++i)
      d.row(i / d.shape.cols)[i % d.shape.cols] = u[static_cast<std::size_t>(i)];
  }
  if (cotangents.empty()) return;
  for (const std::uint32_t id : inspect.inputs(n)) {
    if (const Array<double> d = inspect.adjoint(id)) std::fill_n(d.data, d.shape.memory(), 0.0);
  }
  const std::vector<std::uint32_t> inputs = inspect.inputs(n);
  inspect.backward(n);
  check_adds(inspect, n, checker);
  for (auto id = inputs.begin(); id != inputs.end(); ++id) {
    if (!inspect.adjoint(*id) || std::find(inputs.begin(), id, *id) != id) continue;
    Probe probe;
    probe.x = inspect.value(*id);
    probe.gradient = inspect.adjoint(*id);
    probe.value = [&] {
      inspect.forward(n);
      double sum = 0;
      for (const auto& [output, u] : cotangents) sum += dot(u, inspect.value(output));
      return sum;
    };
    probe.choices = [&] { return inspect.signature(n); };
    probe.place = {inspect.operator_name(n), inspect.source(n), inspect.array_name(*id)};
    probe.input = static_cast<int>(id - inputs.begin());
    checker.check(probe);
  }
  inspect.forward(n);
}

}  // namespace

GradcheckReport gradcheck(Tape<double>& tape, Var<double> result, const GradcheckOptions& options) {
  GradcheckReport report;
  Checker checker(options, report);
  const std::vector<double> u = random_cotangent(options.seed, tape.shape(result).count());
  tape.forward(result);
  tape.backward(result, u);
  check_leaves(tape, result, u, checker);
  if (options.each_node) {
    TapeInspector<double> inspect(tape);
    for (const std::uint32_t n : inspect.nodes_of(result)) check_node(inspect, n, options.seed, checker);
    tape.backward(result, u);
  }
  report.too_many_kinks =
      static_cast<double>(report.kinks) > options.kink_share * static_cast<double>(std::max<Index>(1, report.entries));
  return report;
}

std::string GradcheckReport::text() const {
  std::ostringstream text;
  text << *this;
  return text.str();
}

std::ostream& operator<<(std::ostream& stream, const GradcheckReport& report) {
  stream << report.entries << " entries, " << report.kinks << " at kinks, worst relative error " << report.worst_error;
  if (report.too_many_kinks) stream << "\ntoo many entries at kinks to judge";
  // One line for each wrong gradient, with its worst entry; single operators first, for they are the culprits.
  std::vector<const GradcheckFailure*> worst;
  std::vector<Index> counts;
  for (const bool whole : {false, true}) {
    for (const GradcheckFailure& f : report.failures) {
      if ((f.node == kWholeTape) != whole) continue;
      const auto same = std::find_if(worst.begin(), worst.end(), [&](const GradcheckFailure* w) {
        return w->node == f.node && w->source == f.source && w->array == f.array;
      });
      if (same == worst.end()) {
        worst.push_back(&f);
        counts.push_back(1);
        continue;
      }
      ++counts[static_cast<std::size_t>(same - worst.begin())];
      if (std::fabs(f.computed - f.expected) > std::fabs((*same)->computed - (*same)->expected)) *same = &f;
    }
  }
  for (std::size_t i = 0; i < worst.size(); ++i) {
    const GradcheckFailure& f = *worst[i];
    stream << "\n" << f.node;
    if (!f.source.empty()) stream << " (" << f.source << ")";
    stream << ": gradient of '" << f.array << "' is wrong at " << counts[i] << (counts[i] == 1 ? " entry" : " entries")
           << ", most at ";
    if (f.plane != 0) stream << "plane " << f.plane << ", ";
    stream << "row " << f.row << ", column " << f.col << ": expected " << f.expected << ", computed " << f.computed;
  }
  return stream;
}

}  // namespace hsi4d
