#include "pipelines/run/stage_check.h"

#include "core/parallel.h"
#include "pipelines/run/stage_inputs.h"

namespace hsi4d {

StageCheck check_stage(const RunConfig& asked, const std::vector<LossTerm>& losses, const StageCheckOptions& options) {
  RunConfig config = asked;
  config.color_net.camera_gradient = true;
  StageGradcheckOptions check;
  check.differences.entries = options.entries;
  check.differences.seed = options.seed;
  StageCheck result{options.stage, {}, check.differences.tolerance, {}};
  const int threads = options.threads > 0 ? options.threads : config.threads;
  with_threads(threads > 0 ? threads : thread_count(), [&] {
    const StageInputs inputs(config, losses,
                             {options.stage, options.frame, "hsi4d gradcheck: --stage", "hsi4d gradcheck: --frame"});
    result.frame = inputs.frame;
    result.found = inputs.frame
                       ? check_frame_stage(inputs.task(), inputs.frame_task(), inputs.start, inputs.colors(), check)
                       : check_sequence_stage(inputs.task(), inputs.before, check);
  });
  return result;
}

}  // namespace hsi4d
