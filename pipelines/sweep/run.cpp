#include "pipelines/sweep/run.h"

#include <algorithm>
#include <chrono>
#include <exception>
#include <filesystem>

#include "core/check.h"
#include "core/config_file.h"
#include "core/disk.h"
#include "core/file.h"
#include "core/json_text.h"
#include "core/memory.h"
#include "core/parallel.h"
#include "pipelines/chain/chain.h"
#include "pipelines/chain/report.h"
#include "pipelines/config/run_config.h"
#include "pipelines/report/report.h"
#include "pipelines/run/run.h"
#include "pipelines/sources/lock.h"
#include "pipelines/synthetic/dataset.h"

namespace hsi4d {
namespace {

namespace fs = std::filesystem;

RunSummary summary_in(const RunPaths& paths) { return parse_summary(read_text_file(paths.summary()), paths.summary()); }

/// A run that was killed between its results and its report, or before its end was noted, gets what is missing now.
void complete_end(const SweepPaths& paths, const std::string& id, SweepClaim& claim) {
  const RunPaths run{paths.run(id)};
  const std::string folder = run.folder.string();
  if (!fs::exists(run.report())) {
    remove_temporary_files(folder);  // of the report: all else was written before
    if (is_chain_folder(folder)) {
      write_chain_report(folder);
    } else {
      write_report(folder);
    }
  }
  const std::vector<SweepAttempt> attempts = read_attempts(paths, id);
  if (!attempts.empty() && attempts.back().event != "done") claim.note("done", "its end was not noted at the time");
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

/// What a dataset's config says of data; what it says beside that is of the run that it was made for.
RunConfig data_of(const fs::path& dataset, const std::vector<LossTerm>& losses) {
  ConfigProblems problems;
  ConfigValue tree = load_config(dataset / "config.json", {}, problems);
  std::erase_if(tree.members,
                [](const ConfigMember& section) { return section.key != "data" && section.key != "chain"; });
  try {
    return read_run_config(tree, descriptions_of(losses), problems);
  } catch (const UserError& problem) {
    throw UserError(std::string(problem.what()) + "\n" + dataset.string() +
                    ": is not whole; remove it, and the sweep makes it again");
  }
}

/// Names the files of a dataset in a run's config. How masks are read is the run's own.
void take_over_data(const fs::path& dataset, const std::vector<LossTerm>& losses, RunConfig& config) {
  RunConfig of_dataset = data_of(dataset, losses);
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

/// The config of a run, which must be its own: by hand, or by a disk, it may have become another one.
RunConfig config_of(const SweepPaths& paths, const SweepRun& run, const std::vector<LossTerm>& losses) {
  const std::string file = paths.config(run.id);
  const bool is_made = !run.dataset.empty();
  if (sweep_run_id(read_text_file(file), file, is_made) != run.id)
    throw UserError(file + ": has other settings than the run; hsi4d sweep SWEEP.json --out " + paths.folder.string() +
                    " --resume writes it anew");
  return load_run_config(file, {}, descriptions_of(losses), is_made ? ConfigUse::kStages : ConfigUse::kRun);
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

/// What tells a run from others of its sweep, by name.
ConfigValue axes_of(const SweepRun& run) {
  ConfigValue axes = ConfigValue::make_object();
  for (const auto& [name, text] :
       {std::pair{"block", &run.block}, {"clip", &run.clip}, {"ablation", &run.ablation}, {"seed", &run.seed}}) {
    if (!text->empty()) axes.add(name, ConfigValue::make_string(*text));
  }
  for (const auto& [key, value] : run.values) axes.add(key, parse_json_text(value, key));
  return axes;
}

RunSummary compute(const SweepPaths& paths, const SweepRun& run, const std::vector<LossTerm>& losses, int threads,
                   const Observer& observer) {
  RunConfig config = config_of(paths, run, losses);
  RunOptions options{paths.run(run.id), true, threads, axes_of(run), observer};
  keep_name({options.folder}, config);
  if (!run.dataset.empty()) {
    const fs::path dataset = paths.dataset(run.dataset);
    with_threads(threads, [&] { make_dataset(config, losses, dataset, observer); });
    take_over_data(dataset, losses, config);
  }
  return config.chain.empty() ? execute_run(config, losses, options) : execute_chain(config, losses, options).all;
}

}  // namespace

SweepRunResult run_one(const SweepPaths& paths, const SweepPlan& plan, std::size_t index, SweepClaim& claim,
                       const std::vector<LossTerm>& losses, int threads, const Observer& observer) {
  const SweepRun& run = plan.runs.at(index);
  if (sweep_run_state(paths, run.id) == SweepRunState::kDone) {
    complete_end(paths, run.id, claim);
    return {summary_in({paths.run(run.id)}), true};
  }
  const auto begin = std::chrono::steady_clock::now();
  const auto note = [&](const char* event, const std::string& message) {
    const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    claim.note(event, message, seconds, static_cast<double>(peak_memory_bytes()) / kBytesPerMb);
  };
  const auto note_end = [&](const char* event, const char* message) {
    try {
      note(event, message);
    } catch (const UserError&) {  // a full disk, perhaps: what has happened is told all the same
    }
  };
  claim.note("start");
  SweepRunResult result;
  try {
    const int asked = threads > 0 ? threads : plan.threads;
    result.summary = compute(paths, run, losses, asked > 0 ? asked : thread_count(), observer);
  } catch (const Interrupted& stop) {
    note_end("interrupted", stop.what());
    throw;
  } catch (const std::exception& failure) {
    note_end("failed", failure.what());
    throw;
  }
  note("done", "");
  return result;
}

}  // namespace hsi4d
