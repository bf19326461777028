// What a run that goes on finds in its folder: one of config, status and metrics is tried, the others are good.
#include "pipelines/record/folder.h"
#include "tests/fuzz/scratch.h"

namespace hsi4d::fuzz::resume_fuzz {

namespace {

const std::string kConfig =
    R"({"name": "a", "seed": 3, "data": {"scene": "a.ply"}, "stages": {"camera": {"iterations": 3}}})";

Scratch& scratch() {
  static Scratch made(
      {{"config.resolved.json", bytes_of(kConfig)},
       {"metrics.jsonl",
        bytes_of("{\"frame\": 1, \"stage\": \"a\", \"iteration\": 0}\n{\"frame\": 2, \"stage\": \"a\"}\n")},
       {"status.json", bytes_of(R"({"state": "interrupted", "started": "now"})")}});
  return made;
}

}  // namespace

std::vector<Bytes> corpus() { return scratch().corpus(); }

bool accepts(std::span<const uint8_t> file) {
  scratch().try_file(file);
  is_read([&] { look_at_run_folder(scratch().path(), kConfig, false); });
  const bool is_taken = is_read([&] {
    RunFolder folder(scratch().path(), {.config = kConfig}, true);
    folder.keep_metrics([](const std::string&, std::optional<int> frame) { return frame && *frame <= 1; });
  });
  if (!file.empty()) scratch().try_file(Scratch::with_choice(2, {}));  // the run has written its status
  return is_taken;
}

const Target target("resume", corpus, accepts);

}  // namespace hsi4d::fuzz::resume_fuzz
