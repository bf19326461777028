// Ctrl-C while a dataset is made, by `synth` and by `demo`.
#include <csignal>

#include <catch2/catch.hpp>

#include "pipelines/synthetic/dataset.h"
#include "tests/support/program.h"
#include "tests/support/running_program.h"
#include "tests/support/tiny_run.h"

namespace dataset_interrupt_test {

using namespace hsi4d;
using namespace hsi4d::test;
using Catch::Matchers::Contains;
namespace fs = std::filesystem;

namespace {

/// Small, but with so many frames that a signal comes in time.
std::vector<std::string> small_dataset(const std::string& frames) {
  std::vector<std::string> words;
  for (const std::string& setting :
       {"synthetic.frames=" + frames, std::string("synthetic.size_px=48"),
        std::string("synthetic.scene_gaussians=1500"), std::string("synthetic.avatar_gaussians=500"),
        std::string("synthetic.object_gaussians=150"), std::string("synthetic.video=png"),
        std::string("stages.camera.iterations=1"), std::string("stages.interaction.iterations=1")}) {
    words.insert(words.end(), {"--set", setting});
  }
  return words;
}

std::vector<std::string> with(std::vector<std::string> first, const std::vector<std::string>& more) {
  first.insert(first.end(), more.begin(), more.end());
  return first;
}

/// True once a frame has been written somewhere in the folder, which is not there at first.
bool has_frame(const fs::path& folder) {
  std::error_code error;
  for (fs::recursive_directory_iterator it(folder, error), end; !error && it != end; it.increment(error)) {
    if (it->path().filename() == "0003.png") return true;
  }
  return false;
}

std::vector<std::string> names_in(const fs::path& folder) {
  std::vector<std::string> names;
  for (const auto& entry : fs::directory_iterator(folder)) names.push_back(entry.path().filename().string());
  return names;
}

const std::string kSaid = "hsi4d: interrupted while a dataset was made; nothing is left of it\n";

}  // namespace

TEST_CASE("SIGINT while synth works leaves nothing, and it can be done again", "[synthetic]") {
  const TemporaryFolder here;
  fs::create_directory("place");
  const fs::path config = fs::path(HSI4D_SOURCE_DIR) / "configs" / "demo_quick.json";
  const auto arguments = [&](const std::string& frames) {
    return with({"synth", config.string(), "--out", "place/data"}, small_dataset(frames));
  };
  for (const int signal : {SIGINT, SIGTERM}) {
    INFO("signal " << signal);
    RunningProgram program(arguments("5000"));
    REQUIRE(program.signal_at(signal, [] { return has_frame("place"); }));
    INFO(program.text());
    CHECK(program.result() == 130);
    CHECK_THAT(program.text(), Catch::Matchers::EndsWith(kSaid));
    CHECK(names_in("place").empty());
  }
  const ProgramResult whole = run_hsi4d(arguments("4"));
  INFO(whole.err);
  CHECK(whole.status == 0);
  CHECK(names_in("place") == std::vector<std::string>{"data"});
  CHECK(fs::exists("place/data/frames/0003.png"));
}

TEST_CASE("a killed synth leaves nothing under the dataset's name, and it can be done again", "[synthetic]") {
  const TemporaryFolder here;
  fs::create_directory("place");
  const fs::path config = fs::path(HSI4D_SOURCE_DIR) / "configs" / "demo_quick.json";
  RunningProgram program(with({"synth", config.string(), "--out", "place/data"}, small_dataset("5000")));
  REQUIRE(program.signal_at(SIGKILL, [] { return has_frame("place"); }));
  CHECK_FALSE(fs::exists("place/data"));
  CHECK(run_hsi4d(with({"synth", config.string(), "--out", "place/data"}, small_dataset("4"))).status == 0);
  CHECK(fs::exists("place/data/config.json"));
}

TEST_CASE("SIGINT while demo makes its dataset leaves no dataset, and --resume makes it", "[synthetic][demo]") {
  const TemporaryFolder here;
  const auto arguments = [](const std::string& frames) {
    return with({"demo", "--quick", "--resume", "--threads", "1", "--out", "demo"}, small_dataset(frames));
  };
  RunningProgram program(arguments("5000"));
  REQUIRE(program.signal_at(SIGINT, [] { return has_frame("demo"); }));
  INFO(program.text());
  CHECK(program.result() == 130);
  CHECK_THAT(program.text(), Catch::Matchers::EndsWith(kSaid));
  CHECK_FALSE(fs::exists("demo"));
  const ProgramResult whole = run_hsi4d(arguments("3"));
  INFO(whole.err);
  CHECK(whole.status == 0);
  CHECK(fs::exists("demo/run/report.html"));
}

TEST_CASE("progress of synth is a few plain lines outside of a terminal, and none with --quiet", "[synthetic]") {
  const TemporaryFolder here;
  const fs::path config = fs::path(HSI4D_SOURCE_DIR) / "configs" / "demo_quick.json";
  const ProgramResult loud = run_hsi4d(with({"synth", config.string(), "--out", "a"}, small_dataset("12")));
  CHECK(loud.status == 0);
  CHECK(loud.err.find('\r') == std::string::npos);
  CHECK_THAT(loud.err, Catch::Matchers::StartsWith("frames 1/12") && Contains("\nframes 12/12"));
  CHECK(std::count(loud.err.begin(), loud.err.end(), '\n') < 6);  // two, and one for every ten seconds
  const ProgramResult quiet = run_hsi4d(with({"synth", config.string(), "--out", "b", "--quiet"}, small_dataset("2")));
  CHECK(quiet.status == 0);
  CHECK(quiet.err.empty());
}

}  // namespace dataset_interrupt_test
