#include "pipelines/run.h"

#include <exception>

#include "core/log.h"
#include "core/parallel.h"
#include "pipelines/report.h"

namespace hsi4d {

namespace {

/// Runs `body` on the threads that were asked for; 0: one a core.
template <class F>
void on_threads(int threads, F&& body) {
  if (threads > 0) return with_threads(threads, body);
  body();
}

/// Notes how the run ended. Where that cannot be written either (a full disk), what ended it is still what is thrown.
void note_end(RunFolder& folder, RunState state, const std::string& message) noexcept {
  try {
    folder.set_state(state, message);
    // In the run's log alone: whoever called gets the exception, and would read the message twice.
    const LogSink to_log = log_to_file(folder.paths().log(), LogLevel::kDebug);
    log_debug(std::string(run_state_name(state)) + ": " + message);
  } catch (const std::exception&) {
  }
}

RunSummary reconstruct_into(RunFolder& folder, const RunConfig& config, const Clip& clip,
                            const std::vector<LossTerm>& losses, const RunOptions& options) {
  try {
    RunSummary summary;
    on_threads(options.threads > 0 ? options.threads : config.threads,
               [&] { summary = reconstruct(config, clip, losses, folder, options.observer); });
    folder.set_state(RunState::kDone);  // the report tells it
    write_report(options.folder);
    return summary;
  } catch (const Interrupted& stop) {
    note_end(folder, RunState::kInterrupted, stop.what());
    throw;
  } catch (const std::exception& failure) {
    note_end(folder, RunState::kFailed, failure.what());
    throw;
  }
}

}  // namespace

RunSummary carry_out(const RunConfig& config, const std::vector<LossTerm>& losses, const RunOptions& options) {
  check_run(config);
  const Clip clip = read_clip(config.data);  // before anything is written
  check_frames(config.data, clip);
  RunIdentity identity;
  identity.config = resolved_config(config, descriptions_of(losses));
  identity.seed = config.seed;
  const int threads = options.threads > 0 ? options.threads : config.threads;
  identity.threads = threads > 0 ? threads : thread_count();
  identity.precision = choice_name<RunPrecision>(kRunPrecisions, config.precision);
  RunFolder folder(options.folder, identity, options.resume);
  return reconstruct_into(folder, config, clip, losses, options);
}

}  // namespace hsi4d
