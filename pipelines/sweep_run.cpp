#include "pipelines/sweep_run.h"

#include <algorithm>
#include <chrono>
#include <exception>
#include <filesystem>
#include <sys/resource.h>

#include "core/check.h"
#include "core/file.h"
#include "core/log.h"
#include "core/parallel.h"
#include "pipelines/chain.h"
#include "pipelines/chain_report.h"
#include "pipelines/json_text.h"
#include "pipelines/report.h"
#include "pipelines/run.h"
#include "pipelines/run_config.h"
#include "pipelines/source_lock.h"
#include "pipelines/synthetic.h"

namespace hsi4d {
namespace {

namespace fs = std::filesystem;

/// The most memory that this process has had, MB.
double peak_mb() {
  rusage used{};
  return ::getrusage(RUSAGE_SELF, &used) == 0 ? static_cast<double>(used.ru_maxrss) / 1024 : 0;
}

RunSummary summary_in(const RunPaths& paths) { return parse_summary(read_text_file(paths.summary()), paths.summary()); }

/// A run that was killed between its results and its report gets the report now.
void complete_report(const RunPaths& paths) {
  if (fs::exists(paths.report())) return;
  const std::string folder = paths.folder.string();
  if (is_chain_folder(folder)) {
    write_chain_report(folder);
  } else {
    write_report(folder);
  }
}

/// Folders of datasets that were being made by processes that are gone. Called while nobody else makes this dataset.
void remove_leftovers(const fs::path& dataset) {
  std::vector<fs::path> left;
  std::error_code error;
  const std::string name = dataset.filename().string();
  for (fs::directory_iterator it(dataset.parent_path(), error), end; !error && it != end; it.increment(error)) {
    const std::string other = it->path().filename().string();
    if (other.starts_with(name + ".") && other.ends_with(".tmp")) left.push_back(it->path());
  }
  for (const fs::path& folder : left) fs::remove_all(folder, error);
}

/// Makes the dataset of a run, unless it is there.
void make_dataset(const RunConfig& config, const std::vector<LossTerm>& losses, const fs::path& folder,
                  const Observer& observer) {
  if (fs::exists(folder / "config.json")) return;
  const SourceLock lock(folder, observer.stop_requested);
  if (fs::exists(folder / "config.json")) return;
  remove_leftovers(folder);
  write_dataset(config.synthetic, video_render_settings(), folder, observer,
                dataset_sections(config, descriptions_of(losses)), config.body);
}

/// Names the files of a dataset in a run's config. How masks are read is the run's own.
void take_over_data(const fs::path& dataset, const std::vector<LossTerm>& losses, RunConfig& config) {
  RunConfig of_dataset = load_run_config(dataset / "config.json", {}, descriptions_of(losses));
  const DataSettings own = config.data;
  const auto with_own_masks = [&own](DataSettings data) {
    data.mask_threshold = own.mask_threshold;
    data.mask_margin_px = own.mask_margin_px;
    return data;
  };
  config.data = with_own_masks(of_dataset.data);
  config.chain = std::move(of_dataset.chain);
  for (ChainClip& clip : config.chain) clip.data = with_own_masks(clip.data);
}

/// The name that a run has got, also where its sweep would call it otherwise by now: a run is resumed under its name.
void keep_name(const RunPaths& paths, RunConfig& config) {
  if (!fs::exists(paths.config())) return;
  try {
    const std::string name = string_member(parse_json_text(read_text_file(paths.config()), paths.config()), "name");
    if (!name.empty()) config.name = name;
  } catch (const DataError&) {  // whoever reads the folder tells it
  }
}

RunSummary compute(const SweepPaths& paths, const SweepRun& run, const std::vector<LossTerm>& losses, int threads,
                   const Observer& observer) {
  RunConfig config = load_run_config(paths.config(run.id), {}, descriptions_of(losses),
                                     run.dataset.empty() ? ConfigUse::kRun : ConfigUse::kStages);
  RunOptions options{paths.run(run.id), true, threads, observer};
  keep_name({options.folder}, config);
  if (!run.dataset.empty()) {
    const fs::path dataset = paths.dataset(run.dataset);
    with_threads(threads, [&] { make_dataset(config, losses, dataset, observer); });
    take_over_data(dataset, losses, config);
  }
  return config.chain.empty() ? carry_out(config, losses, options) : carry_out_chain(config, losses, options).all;
}

}  // namespace

SweepRunResult run_one(const SweepPaths& paths, const SweepPlan& plan, std::size_t index,
                       const std::vector<LossTerm>& losses, int threads, const Observer& observer) {
  const SweepRun& run = plan.runs.at(index);
  SweepClaim claim(paths, run.id, observer.stop_requested);
  if (sweep_run_state(paths, run.id) == SweepRunState::kDone) {
    complete_report({paths.run(run.id)});
    return {summary_in({paths.run(run.id)}), true};
  }
  const auto begin = std::chrono::steady_clock::now();
  const auto note = [&](const char* event, const std::string& message) {
    const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    claim.note(event, message, seconds, peak_mb());
  };
  claim.note("start");
  try {
    const int asked = threads > 0 ? threads : plan.threads;
    SweepRunResult result{compute(paths, run, losses, asked > 0 ? asked : thread_count(), observer)};
    note("done", "");
    return result;
  } catch (const Interrupted& stop) {
    note("interrupted", stop.what());
    throw;
  } catch (const std::exception& failure) {
    note("failed", failure.what());
    throw;
  }
}

}  // namespace hsi4d
