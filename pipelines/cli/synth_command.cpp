#include "pipelines/cli/synth_command.h"

#include "core/parallel.h"
#include "pipelines/cli/interrupt.h"
#include "pipelines/cli/terminal.h"
#include "pipelines/config/run_config.h"
#include "pipelines/synthetic/dataset.h"
#include "pipelines/synthetic/views.h"

namespace hsi4d::cli {

std::string synth_command(const std::filesystem::path& config, const std::vector<std::string>& overrides,
                          const std::filesystem::path& out, bool quiet, const std::vector<LossDescription>& losses) {
  const RunConfig run = load_run_config(config, overrides, losses);
  const InterruptWatch watch;
  const bool of_views = run.synthetic.kind == SyntheticKind::kViews;
  with_threads(run.threads > 0 ? run.threads : thread_count(), [&] {
    if (of_views)
      return write_views(run.synthetic, video_render_settings(), out, observer_on_terminal(quiet), run.body);
    write_dataset(run.synthetic, video_render_settings(), out, observer_on_terminal(quiet),
                  dataset_sections(run, losses), run.body);
  });
  const std::string size =
      std::to_string(run.synthetic.size_px) + " x " + std::to_string(run.synthetic.size_px) + " pixels";
  if (of_views) {
    return out.generic_string() + ": " + std::to_string(run.synthetic.views_cameras * run.synthetic.views_poses) +
           " views of " + size + " for hsi4d avatar fit\n";
  }
  const std::string clips = run.synthetic.clips == 1 ? "" : std::to_string(run.synthetic.clips) + " clips of ";
  return out.generic_string() + ": " + clips + std::to_string(run.synthetic.frames) + " frames of " + size +
         " with masks and truth\n";
}

}  // namespace hsi4d::cli
