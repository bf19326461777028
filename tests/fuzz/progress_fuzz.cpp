// Checkpoints of a run, of a clip of three frames and two objects.
#include "body/body_model.h"
#include "optim/checkpoint.h"
#include "pipelines/run/checkpoint.h"
#include "tests/fuzz/archive_list.h"
#include "tests/fuzz/scratch.h"

namespace hsi4d::fuzz::progress_fuzz {

namespace {

constexpr std::size_t kStages = 2;
const std::string kConfig = "{}";

/// As far as progress is concerned: no Gaussians.
const Clip& clip() {
  static const Clip made = [] {
    Clip clip;
    clip.camera.width = 3;
    clip.camera.height = 2;
    clip.objects.resize(2);
    clip.first.objects.resize(2);
    clip.first.body = rest_pose(kSmplxJoints);
    clip.frame_files = {"0.png", "1.png", "2.png"};
    return clip;
  }();
  return made;
}

/// Two of three frames done.
RunProgress small_progress() {
  RunProgress progress = first_progress(clip(), kStages);
  for (auto& stage : progress.after_stage) stage.push_back(clip().first);
  progress.image_errors.push_back({{"psnr_db", 30}});
  progress.start_errors.push_back({{"psnr_db", 20}});
  progress.left_out = {{1, 1, 0, "contact", "far"}};
  progress.still = {{0, 1, "transl"}};
  progress.inputs = "cbf29ce484222325 /data/scene\n";
  return progress;
}

Scratch& scratch() {
  static Scratch made({ScratchFile{"progress.npz", {}}});
  return made;
}

}  // namespace

std::vector<Bytes> corpus() {
  const std::string file = scratch() / "progress.npz";
  save_progress(file, kConfig, small_progress());
  const Bytes archive = read_file(file);
  return {list_of(archive), archive};
}

bool accepts(std::span<const uint8_t> file) {
  const std::string path = scratch() / "progress.npz";
  write_file(path, archive_of(file));
  return is_read([&] {
    const RunProgress progress = load_progress(path, kConfig, clip(), kStages);
    HSI4D_CHECK(progress.frames_done() >= 1 && progress.frames_done() <= 3, "frames that the clip has not");
  });
}

const Target target("progress", corpus, accepts);

}  // namespace hsi4d::fuzz::progress_fuzz
