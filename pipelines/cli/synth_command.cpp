// `hsi4d synth`: a dataset with exact ground truth.
#include <filesystem>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "core/parallel.h"
#include "pipelines/cli/interrupt.h"
#include "pipelines/cli/list.h"
#include "pipelines/cli/options.h"
#include "pipelines/cli/terminal.h"
#include "pipelines/config/run_config.h"
#include "pipelines/synthetic/dataset.h"
#include "pipelines/synthetic/photos.h"
#include "pipelines/synthetic/views.h"

namespace hsi4d::cli {

namespace {

struct SynthArguments {
  std::string config;
  std::vector<std::string> overrides;
  std::string out;  ///< a new or empty folder; it appears when everything in it is complete
  std::optional<int> threads;
  bool quiet = false;
};

/// Makes the dataset that the config's section `synthetic` describes, and tells progress on stderr unless `quiet`.
/// The other sections go along in its config.json. Returns what the command prints.
///
/// Throws UserError with all problems of the config, or when the folder is not empty or cannot be written;
/// Interrupted after Ctrl-C.
std::string synth_command(const SynthArguments& a, const std::vector<LossDescription>& losses) {
  const std::filesystem::path out = a.out;
  RunConfig run = load_run_config(a.config, a.overrides, losses);
  run.threads = a.threads.value_or(run.threads);
  const InterruptWatch watch;
  const bool of_views = run.synthetic.kind == SyntheticKind::kViews;
  const bool of_photos = run.synthetic.kind == SyntheticKind::kPhotos;
  with_threads(run.threads > 0 ? run.threads : thread_count(), [&] {
    if (of_views)
      return write_views(run.synthetic, video_render_settings(), out, observer_on_terminal(a.quiet), run.body);
    if (of_photos) return write_photos(run.synthetic, video_render_settings(), out, observer_on_terminal(a.quiet));
    write_dataset(run.synthetic, video_render_settings(), out, observer_on_terminal(a.quiet),
                  dataset_sections(run, losses), run.body);
  });
  const std::string size =
      std::to_string(run.synthetic.size_px) + " x " + std::to_string(run.synthetic.size_px) + " pixels";
  if (of_photos)
    return out.generic_string() + ": pictures of " + size + " with cameras and depths for hsi4d reconstruct\n";
  if (of_views) {
    return out.generic_string() + ": " + std::to_string(run.synthetic.views_cameras * run.synthetic.views_poses) +
           " views of " + size + " for hsi4d avatar fit\n";
  }
  const std::string clips = run.synthetic.clips == 1 ? "" : std::to_string(run.synthetic.clips) + " clips of ";
  return out.generic_string() + ": " + clips + std::to_string(run.synthetic.frames) + " frames of " + size +
         " with masks and truth\n";
}

}  // namespace

void add_synth(CLI::App& app, Program& program) {
  SynthArguments& a = program.options<SynthArguments>();
  CLI::App* synth = app.add_subcommand("synth", "Make a dataset with exact ground truth");
  synth->add_option("CONFIG", a.config, "A config; section synthetic says what is made, the rest goes along")
      ->required();
  synth->add_option("--out", a.out, "Where to: a new or empty folder")->type_name("DIR")->required();
  add_overrides(*synth, a.overrides);
  add_threads(*synth, a.threads);
  synth->add_flag("--quiet", a.quiet, "No progress on stderr");
  run_when_chosen(*synth, program, [&] { return synth_command(a, descriptions_of(program.terms)); });
}

}  // namespace hsi4d::cli
