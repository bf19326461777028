// What a run does when its inputs are elsewhere, or others, than when it began; and objects that are not seen.
#include <fstream>

#include <catch2/catch.hpp>

#include "body/motion_io.h"
#include "core/check.h"
#include "core/image_io.h"
#include "core/log.h"
#include "pipelines/input/input_hashes.h"
#include "tests/support/program.h"
#include "tests/support/tiny_run.h"

namespace inputs_test {

using namespace hsi4d;
using namespace hsi4d::test;
using Catch::Matchers::Contains;
namespace fs = std::filesystem;

namespace {

RunConfig config_of(const fs::path& data, const std::vector<std::string>& overrides = {}) {
  return load_run_config(data / "config.json", overrides, descriptions_of(loss_terms()));
}

void copy_dataset(const fs::path& to) { fs::copy(TinyDataset::folder(), to, fs::copy_options::recursive); }

/// A run that was stopped in frame 2: frames 0 and 1 are in its checkpoint.
void begin_run(const RunConfig& config, const std::string& folder) {
  int count = 0;
  CHECK_THROWS_AS(execute_tiny(config, folder, 1, false, [&] { return ++count == kPerFrame + 3; }), Interrupted);
}

/// Changes one byte of a file and nothing of its size.
void change_byte(const fs::path& file, std::size_t from_end) {
  std::string bytes = file_text(file);
  char& byte = bytes.at(bytes.size() - from_end);
  byte = static_cast<char>(byte ^ 1);
  std::ofstream(file, std::ios::binary) << bytes;
}

void brighten(const fs::path& file) {
  Image image = read_image(file.string());
  image(0, 3, 3) = image(0, 3, 3) > 0.5F ? 0.0F : 1.0F;
  write_image(file.string(), image);
}

std::string resume_message(const RunConfig& config, const std::string& folder) {
  try {
    execute_tiny(config, folder, 1, true);
  } catch (const DataError& error) {
    return error.what();
  }
  return "resumed";
}

std::vector<std::string> warnings_of(const RunConfig& config) {
  std::vector<std::string> warnings;
  const LogSink sink =
      log_to([&](LogLevel, std::string_view text) { warnings.emplace_back(text); }, LogLevel::kWarning);
  check_frames(config.data, read_clip(config.data), losses_over_masks(config));
  return warnings;
}

}  // namespace

TEST_CASE("a run goes on where its data has been moved, with another number of threads in its config", "[run]") {
  const TemporaryFolder here;
  copy_dataset("data");
  execute_tiny(config_of("data"), "whole");
  begin_run(config_of("data"), "run");
  fs::rename("data", "moved");
  const RunConfig moved = config_of("moved", {"threads=2", "synthetic.seed=9"});
  execute_tiny(moved, "run", 0, true);
  CHECK(file_text("run/config.resolved.json") == resolved_config(moved, descriptions_of(loss_terms())));
  CHECK(differences("whole", "run") == std::vector<std::string>{"config.resolved.json"});
  CHECK(json_of("run/status.json")["threads"] == 2);
}

TEST_CASE("a run is not resumed with an input whose content has changed, and says which", "[run]") {
  const TemporaryFolder here;
  copy_dataset("data");
  const RunConfig config = config_of("data");
  execute_tiny(config, "whole");
  begin_run(config, "run");
  const std::string scene = config.data.scene.string(), masks = config.data.masks.string();
  const std::string end =
      "run/checkpoint/progress.npz: goes on with the inputs as they were; without it the run "
      "begins anew";
  SECTION("the scene, of the same size") {
    const std::string before = file_text(scene);
    change_byte(scene, 2);
    CHECK(resume_message(config, "run") == scene + ": is not what the run began with (/data/scene)\n" + end);
    CHECK(json_of("run/status.json")["state"] == "failed");
    std::ofstream(scene, std::ios::binary) << before;
  }
  SECTION("a frame that was done, and a mask of frame 0 that is gone") {
    const std::string frame = (config.data.frames / "0001.png").string(), before = file_text(frame);
    const fs::path mask = config.data.masks / "human" / "0000.png";
    brighten(frame);
    fs::rename(mask, "kept.png");
    CHECK(resume_message(config, "run") == mask.string() + ": is not what the run began with (masks/human/0000.png)\n" +
                                               frame + ": is not what the run began with (frames/0001.png)\n" + end);
    fs::rename("kept.png", mask);
    std::ofstream(frame, std::ios::binary) << before;
  }
  SECTION("the motion that initial.json names") {
    const fs::path motion = fs::path(scene).parent_path() / "initial_motion.npz";
    const std::string before = file_text(motion);
    Motion changed = read_motion(motion.string());
    changed.poses[3].transl[0] += 0.001;
    write_motion(motion.string(), changed);
    CHECK(resume_message(config, "run") ==
          motion.string() + ": is not what the run began with (/data/initial: /motion)\n" + end);
    std::ofstream(motion, std::ios::binary) << before;
  }
  SECTION("without the checkpoint it begins anew") {
    change_byte(scene, 2);
    fs::remove("run/checkpoint/progress.npz");
    CHECK(resume_message(config, "run") == "resumed");
    return;
  }
  CHECK(resume_message(config, "run") == "resumed");
  CHECK(differences("whole", "run").empty());
}

TEST_CASE("a frame that was not reached yet may be mended before a run goes on", "[run]") {
  const TemporaryFolder here;
  copy_dataset("data");
  const RunConfig config = config_of("data");
  begin_run(config, "run");
  brighten(config.data.frames / "0003.png");
  execute_tiny(config, "whole");
  CHECK(resume_message(config, "run") == "resumed");
  CHECK(differences("whole", "run").empty());
}

TEST_CASE("hashes of inputs tell contents apart, not places") {
  const TemporaryFolder here;
  here.write("a/x", "foobar");
  here.write("b/x", "foobar");
  CHECK(input_hashes({{"x", "a/x"}, {"y", "a/y"}}) == "85944171f73967e8 x\n- y\n");
  CHECK(input_hashes({{"x", "a/x"}}) == input_hashes({{"x", "b/x"}}));
  CHECK_NOTHROW(check_unchanged("85944171f73967e8 x\n", {{"x", "b/x"}}, "c"));
  here.write("b/x", "foobaz");
  CHECK_THROWS_AS(check_unchanged("85944171f73967e8 x\n", {{"x", "b/x"}}, "c"), DataError);
  CHECK_THROWS_AS(check_unchanged("", {{"x", "a/x"}}, "c"), DataError);
  std::vector<ClipFile> many(11, {"x", "a/x"});
  CHECK_THROWS_WITH(check_unchanged("", many, "c"), Contains("\nand 3 more files\nc: goes on with"));
}

TEST_CASE("frames in which an object is not seen are told once, as ranges", "[run]") {
  const TemporaryFolder here;
  CHECK(frame_ranges({}).empty());
  CHECK(frame_ranges({4}) == "4");
  CHECK(frame_ranges({0, 1, 3, 5, 6, 7}) == "0-1, 3, 5-7");
  copy_dataset("data");
  const RunConfig config = config_of("data");
  CHECK(warnings_of(config).empty());
  const fs::path masks = config.data.masks / kTinyObject;
  const std::string rest = ": no pixel reaches data.mask_threshold; the loss \"center\" is off for it there";
  write_image((masks / "0000.png").string(), Image(1, kTinyPixels, kTinyPixels));
  CHECK(warnings_of(config).empty());  // frame 0 is given, not optimised
  write_image((masks / "0002.png").string(), Image(1, kTinyPixels, kTinyPixels));
  CHECK(warnings_of(config) == std::vector<std::string>{masks.string() + ": the object is hidden in frame 2" + rest});
  RunConfig without = config;
  std::erase_if(without.stages.back().second.losses, [](const auto& loss) { return loss.first == "center"; });
  CHECK(warnings_of(without) ==
        std::vector<std::string>{masks.string() + ": the object is hidden in frame 2: no pixel reaches "
                                                  "data.mask_threshold"});
  write_image((masks / "0003.png").string(), Image(1, kTinyPixels, kTinyPixels));
  execute_tiny(config, "run");
  CHECK_THAT(file_text("run/log.txt"),
             Contains(" warning " + masks.string() + ": the object is hidden in frames 2-3" + rest));
}

}  // namespace inputs_test
