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

RunSummary reconstruct_into(RunFolder& folder, const RunConfig& config, const std::vector<LossTerm>& losses,
                            const RunOptions& options) {
  try {
    RunSummary summary;
    on_threads(options.threads > 0 ? options.threads : config.threads,
               [&] { summary = reconstruct(config, losses, folder, options.observer); });
    folder.set_state(RunState::kDone);
    return summary;
  } catch (const Interrupted& stop) {
    log_info(stop.what());
    folder.set_state(RunState::kInterrupted, stop.what());
    throw;
  } catch (const std::exception& failure) {
    log_error(failure.what());
    folder.set_state(RunState::kFailed, failure.what());
    throw;
  }
}

}  // namespace

RunSummary carry_out(const RunConfig& config, const std::vector<LossTerm>& losses, const RunOptions& options) {
  check_run(config);
  RunIdentity identity;
  identity.config = resolved_config(config, descriptions_of(losses));
  identity.seed = config.seed;
  identity.threads = options.threads > 0 ? options.threads : config.threads;
  identity.precision = choice_name<RunPrecision>(kRunPrecisions, config.precision);
  RunFolder folder(options.folder, identity, options.resume);
  const RunSummary summary = reconstruct_into(folder, config, losses, options);
  write_report(options.folder);
  return summary;
}

}  // namespace hsi4d
