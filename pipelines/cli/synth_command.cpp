#include "pipelines/cli/synth_command.h"

#include "core/parallel.h"
#include "pipelines/cli/interrupt.h"
#include "pipelines/cli/terminal.h"
#include "pipelines/run_config.h"
#include "pipelines/synthetic.h"

namespace hsi4d::cli {

std::string synth_command(const std::filesystem::path& config, const std::vector<std::string>& overrides,
                          const std::filesystem::path& out, bool quiet, const std::vector<LossDescription>& losses) {
  const RunConfig run = load_run_config(config, overrides, losses);
  const InterruptWatch watch;
  with_threads(run.threads > 0 ? run.threads : thread_count(), [&] {
    write_dataset(run.synthetic, video_render_settings(), out, observer_on_terminal(quiet),
                  sections_beside_data(run, losses), run.body);
  });
  const std::string frames = std::to_string(run.synthetic.frames) + (run.synthetic.frames == 1 ? " frame" : " frames");
  const std::string size = std::to_string(run.synthetic.size_px);
  return out.generic_string() + ": " + frames + " of " + size + " x " + size + " pixels with masks and truth\n";
}

}  // namespace hsi4d::cli
