#include "pipelines/scan/state.h"

#include <algorithm>
#include <limits>

#include "core/check.h"
#include "optim/checkpoint.h"
#include "pipelines/scan/settings.h"

namespace hsi4d {

namespace {

std::string checkpoint_fault(const std::string& file) { return file + ": is no checkpoint of a reconstruction"; }

std::string moments_name(std::size_t group, const char* what) { return scan_groups()[group] + "." + what; }

void set_exposures(const ScanState& state, Checkpoint& checkpoint) {
  std::vector<float> mean, square;
  std::vector<std::int64_t> steps;
  for (const RowMoments<float>& moments : state.exposure_moments) {
    mean.insert(mean.end(), moments.mean.begin(), moments.mean.end());
    square.insert(square.end(), moments.square.begin(), moments.square.end());
    steps.insert(steps.end(), moments.steps.begin(), moments.steps.end());
  }
  checkpoint.set("exposures", state.exposures);
  checkpoint.set("exposures.mean", mean);
  checkpoint.set("exposures.square", square);
  checkpoint.set("exposures.steps", steps);
}

bool all_count(const std::vector<std::int64_t>& numbers) {
  constexpr std::int64_t kMost = std::numeric_limits<std::int32_t>::max();
  return std::all_of(numbers.begin(), numbers.end(), [](std::int64_t n) { return n >= 0 && n <= kMost; });
}

/// Whether moments are of so many rows, or of none.
bool fits(const RowMoments<float>& moments, Index rows, Index columns) {
  if (moments.mean.empty() && moments.square.empty() && moments.steps.empty()) return true;
  return std::ssize(moments.steps) == rows && std::ssize(moments.mean) == rows * columns &&
         std::ssize(moments.square) == rows * columns;
}

/// Whether all parts of a state are as large as they say.
bool fits_together(const ScanState& state) {
  const Index rows = state.gaussians.count();
  const auto columns = state.columns();
  for (std::size_t i = 0; i < kScanGroups; ++i) {
    if (!fits(state.moments[i], rows, columns[i])) return false;
  }
  return state.gradient_sums.size() == state.gradient_counts.size() &&
         (state.gradient_sums.empty() || std::ssize(state.gradient_sums) == rows);
}

void read_exposures(const std::string& file, const Checkpoint& checkpoint, ScanState& state) {
  state.exposures = checkpoint.floats("exposures");
  const std::vector<float>&mean = checkpoint.floats("exposures.mean"), &square = checkpoint.floats("exposures.square");
  const std::vector<std::int64_t>& steps = checkpoint.integers("exposures.steps");
  const std::size_t count = state.exposures.size();
  if (count % kExposureNumbers != 0 || mean.size() != count || square.size() != count || steps.size() != count ||
      !all_count(steps))
    throw DataError(checkpoint_fault(file));
  for (Index i = 0; i < std::ssize(state.exposures); i += kExposureNumbers) {
    const Index end = i + kExposureNumbers;
    RowMoments<float>& moments = state.exposure_moments.emplace_back();
    moments.mean.assign(mean.begin() + i, mean.begin() + end);
    moments.square.assign(square.begin() + i, square.begin() + end);
    moments.steps.assign(steps.begin() + i, steps.begin() + end);
  }
}

}  // namespace

std::array<std::vector<float>*, kScanGroups> arrays_of(Gaussians& g) {
  return {&g.means, &g.quats, &g.log_scales, &g.opacity_logits, &g.sh};
}

std::array<Index, kScanGroups> ScanState::columns() const { return {3, 4, 3, 1, 3 * gaussians.sh_coefficients()}; }

void save_scan_state(const std::string& file, const ScanState& state, const std::string& identity) {
  Checkpoint checkpoint;
  const Gaussians& g = state.gaussians;
  checkpoint.set("state", std::vector<std::int64_t>{state.iteration, state.refused, g.sh_degree});
  checkpoint.set("curve", state.curve);
  checkpoint.set("curve_sum", std::vector<double>{state.curve_sum});
  checkpoint.set("origin", std::vector<double>(g.origin_world.data(), g.origin_world.data() + 3));
  checkpoint.set("means", g.means);
  checkpoint.set("quats", g.quats);
  checkpoint.set("log_scales", g.log_scales);
  checkpoint.set("opacity_logits", g.opacity_logits);
  checkpoint.set("sh", g.sh);
  set_exposures(state, checkpoint);
  checkpoint.set("gradient_sums", state.gradient_sums);
  checkpoint.set("gradient_counts",
                 std::vector<std::int64_t>(state.gradient_counts.begin(), state.gradient_counts.end()));
  for (std::size_t i = 0; i < kScanGroups; ++i) {
    const RowMoments<float>& moments = state.moments[i];
    checkpoint.set(moments_name(i, "mean"), moments.mean);
    checkpoint.set(moments_name(i, "square"), moments.square);
    checkpoint.set(moments_name(i, "steps"), std::vector<std::int64_t>(moments.steps.begin(), moments.steps.end()));
  }
  checkpoint.save(file, text_hash(identity));
}

ScanState load_scan_state(const std::string& file, const std::string& identity) {
  const Checkpoint checkpoint = load_checkpoint(file, text_hash(identity));
  ScanState state;
  const std::vector<std::int64_t>& numbers = checkpoint.integers("state");
  const std::vector<double>&origin = checkpoint.doubles("origin"), &sum = checkpoint.doubles("curve_sum");
  if (numbers.size() != 3 || origin.size() != 3 || sum.size() != 1) throw DataError(checkpoint_fault(file));
  state.iteration = numbers[0];
  state.refused = numbers[1];
  state.curve = checkpoint.doubles("curve");
  state.curve_sum = sum[0];
  Gaussians& g = state.gaussians;
  g.sh_degree = static_cast<int>(numbers[2]);
  g.origin_world = Vector3<double>(origin.data());
  g.means = checkpoint.floats("means");
  g.quats = checkpoint.floats("quats");
  g.log_scales = checkpoint.floats("log_scales");
  g.opacity_logits = checkpoint.floats("opacity_logits");
  g.sh = checkpoint.floats("sh");
  read_exposures(file, checkpoint, state);
  state.gradient_sums = checkpoint.floats("gradient_sums");
  const std::vector<std::int64_t>& counts = checkpoint.integers("gradient_counts");
  state.gradient_counts.assign(counts.begin(), counts.end());
  bool are_counts = all_count(counts);
  for (std::size_t i = 0; i < kScanGroups; ++i) {
    RowMoments<float>& moments = state.moments[i];
    moments.mean = checkpoint.floats(moments_name(i, "mean"));
    moments.square = checkpoint.floats(moments_name(i, "square"));
    const std::vector<std::int64_t>& steps = checkpoint.integers(moments_name(i, "steps"));
    moments.steps.assign(steps.begin(), steps.end());
    are_counts = are_counts && all_count(steps);
  }
  check_sizes(g);
  if (!are_counts || !fits_together(state)) throw DataError(checkpoint_fault(file));
  return state;
}

}  // namespace hsi4d
