// What a run tells of itself beside its result: warnings, steps that were not taken, the log.
#include <numbers>
#include <regex>

#include <catch2/catch.hpp>

#include "autodiff/elementwise.h"
#include "autodiff/reduce.h"
#include "core/check.h"
#include "core/log.h"
#include "core/rotation.h"
#include "optim/stage.h"
#include "splat/files/io_ply.h"
#include "splat/files/splat_file.h"
#include "splat/files/transform.h"
#include "tests/support/program.h"
#include "tests/support/tiny_run.h"

namespace warnings_test {

using namespace hsi4d;
using namespace hsi4d::test;
using Catch::Matchers::Contains;
namespace fs = std::filesystem;

namespace {

/// Everything that is logged at warning or above while it lives.
class Warnings {
 public:
  const std::vector<std::string>& all() const { return all_; }
  Index holding(const std::string& part) const {
    return std::count_if(all_.begin(), all_.end(), [&](const std::string& text) { return Contains(part).match(text); });
  }

 private:
  std::vector<std::string> all_;
  LogSink sink_ =
      log_to([this](LogLevel, std::string_view message) { all_.emplace_back(message); }, LogLevel::kWarning);
};

/// The lines of a log without their times.
std::vector<std::string> log_lines(const fs::path& run) {
  std::vector<std::string> lines;
  std::istringstream text(file_text(run / "log.txt"));
  for (std::string line; std::getline(text, line);) {
    REQUIRE(
        std::regex_search(line, std::regex("^\\d{4}-\\d\\d-\\d\\dT\\d\\d:\\d\\d:\\d\\d\\.\\d{3}[+-]\\d\\d:\\d\\d ")));
    lines.push_back(line.substr(line.find(' ') + 1));
  }
  return lines;
}

/// y = x, but NaN in those evaluations that are told.
struct Trap {
  static inline int evaluations = 0;
  static inline int from = 0, count = 0;
};

template <class S>
struct TrapOp {
  static constexpr const char* kName = "trap";
  void forward(NodeIo<S>& io) {
    const int now = Trap::evaluations++;
    const bool is_bad = now >= Trap::from && now < Trap::from + Trap::count;
    io.out().scalar() = is_bad ? std::numeric_limits<S>::quiet_NaN() : io.in(0).scalar();
  }
  void backward(NodeIo<S>& io) { io.d_in(0).scalar() += io.d_out().scalar(); }
};

template <class S>
Var<S> trapped(Var<S> x) {
  return x.owner().record(TrapOp<S>{}, {x}, kScalarShape, Source::current());
}

std::vector<LossTerm> with_trap() {
  std::vector<LossTerm> terms = loss_terms();
  terms.push_back(make_loss_term("trap", "Is not finite now and then",
                                 [](const auto& in) { return trapped(mean(square(in.rendered - in.target))); }));
  return terms;
}

/// A run whose second stage has the trap for its only loss; from the first evaluation in `from` on, `count` of them
/// are NaN. The optimiser looks twice at a bad evaluation, to name the operator.
RunSummary run_into_trap(const std::string& folder, int from, int count, const std::string& max_rollbacks,
                         bool resume = false) {
  Trap::evaluations = 0;
  Trap::from = from;
  Trap::count = count;
  const std::vector<LossTerm> terms = with_trap();
  const fs::path file = TinyDataset::folder() / "trap.json";
  write_changed(tiny_config_file(), file, [](nlohmann::ordered_json& config) {
    config["stages"]["interaction"]["losses"] = {{"trap", nlohmann::ordered_json::object()}};
  });
  RunOptions options;
  options.folder = folder;
  options.threads = 1;
  options.resume = resume;
  const RunConfig read =
      load_run_config(file, {"stages.interaction.optimizer.max_rollbacks=" + max_rollbacks}, descriptions_of(terms));
  return execute_run(read, terms, options);
}

}  // namespace

TEST_CASE("a loss that is off is told once, with the reason", "[run]") {
  const TemporaryFolder here;
  const std::string no_weight = "stage interaction: the loss \"center\" is off: its weight is 0";
  SECTION("its weight is 0") {
    const Warnings warnings;
    execute_tiny(tiny_config({"stages.interaction.losses.center.weight=0"}), "run");
    CHECK(warnings.all() == std::vector<std::string>{no_weight});
  }
  SECTION("there is no object") {
    RunConfig config = tiny_config();
    config.data.objects.clear();
    const Warnings warnings;
    execute_tiny(config, "run");
    CHECK(warnings.all().empty());
    CHECK_THAT(file_text("run/log.txt"), Contains("there are no objects: losses of objects are off (center, depth)\n"));
  }
  SECTION("on the terminal") {
    const ProgramResult result =
        run_hsi4d({"run", tiny_config_file(), "--out", "run", "--set", "stages.interaction.losses.center.weight=0"});
    CHECK(result.status == 0);
    CHECK_THAT(result.err, Contains("hsi4d: warning: " + no_weight + "\n"));
  }
}

TEST_CASE("a ground that the estimate says is not level is told once", "[run]") {
  const TemporaryFolder here;
  here.write("a.json", R"({"extends": ")" + tiny_config_file() +
                           R"(", "stages": {"interaction": {"losses": {"ground": {"level_within": 1e-6}}}}})");
  const Warnings warnings;
  execute_tiny(load_run_config("a.json", {}, descriptions_of(loss_terms())), "run");
  CHECK(warnings.all().size() == 1);
  CHECK(warnings.holding("stage interaction: the loss \"ground\" moves nothing: the lower foot goes up and down by ") ==
        1);
}

TEST_CASE("an object that center leaves out is told once, with its frames, also by a run that was resumed", "[run]") {
  const TemporaryFolder here;
  const RunConfig config = tiny_config({"stages.interaction.losses.center.min_opacity=100000"});
  const std::string told =
      "stage interaction: the loss \"center\" was off for the object \"watering_can\" (the opacity rendered of it sums "
      "to less than min_opacity), in some iterations at least, in frames 1-3";
  {
    const Warnings warnings;
    execute_tiny(config, "run");
    CHECK(warnings.all() == std::vector<std::string>{told});
  }
  const std::string log = file_text("run/log.txt");
  CHECK_THAT(log, Contains(" warning " + told + "\n"));
  CHECK_THAT(log, Contains("frame 2, stage interaction: 10 iterations in ") &&
                      Contains(", center without watering_can in 11 of 11 evaluations\n"));
  for (const nlohmann::json& line : metrics_of("run")) {
    if (line["stage"] == "interaction") CHECK(line["losses"]["center"] == 0);
  }
  const Warnings warnings;
  int count = 0;
  CHECK_THROWS_AS(execute_tiny(config, "halves", 1, false, [&] { return ++count == 20; }), Interrupted);
  CHECK(warnings.all().empty());  // its frames are not known yet
  execute_tiny(config, "halves", 1, true);
  CHECK(warnings.all() == std::vector<std::string>{told});
  CHECK(differences("run", "halves").empty());
}

TEST_CASE("a run in which every loss is on warns of nothing", "[run]") {
  const TemporaryFolder here;
  const Warnings warnings;
  execute_tiny(tiny_config(), "run");
  CHECK(warnings.all().empty());
}

TEST_CASE("a scene that is turned against the camera is told before the first step", "[run]") {
  const TemporaryFolder here;
  const RunConfig config = tiny_config();
  Similarity half_turn;
  half_turn.rotation = so3_exp(Vector3<double>(0, 0, std::numbers::pi));
  write_ply("turned.ply", transformed(read_splats(config.data.scene.string()).gaussians, half_turn));
  const Warnings warnings;
  const RunConfig turned = tiny_config({"data.scene=" + fs::absolute("turned.ply").string()});
  CHECK_THROWS(execute_tiny(turned, "run", 1, false, [] { return true; }));
  CHECK(warnings.holding("scene, camera and the state of frame 0 may not be in one world") == 1);
}

TEST_CASE("steps that were not taken are told, counted and lived with", "[run]") {
  const TemporaryFolder here;
  const Warnings warnings;
  const RunSummary summary = run_into_trap("run", 4, 1, "10");  // the fifth evaluation; looked at again it is finite
  REQUIRE(warnings.all() ==
          std::vector<std::string>{"frame 1, stage interaction, iteration 4: no step, the loss is nan"});
  const std::vector<nlohmann::json> lines = metrics_of("run");
  Index rolled_back = 0;
  for (const nlohmann::json& line : lines) {
    if (!line.contains("rolled_back")) continue;
    ++rolled_back;
    CHECK(line["rolled_back"] == true);
    CHECK(line["frame"] == 1);
    CHECK(line["iteration"] == 4);
    CHECK(line["loss"].is_null());
    CHECK(line["losses"]["trap"].is_null());
  }
  CHECK(rolled_back == 1);
  CHECK(lines.size() == 3 * kPerFrame);  // the others are done as ever
  CHECK(number_in(summary.metrics[0].values, "rollbacks") == 0);
  CHECK(number_in(summary.metrics[1].values, "rollbacks") == 1);
  CHECK(json_of("run/summary.json")["metrics"][1]["rollbacks"] == 1);
  CHECK(json_of("run/status.json")["state"] == "done");
  CHECK(number_in(summary.metrics.back().values, "psnr_db") > 15);
  CHECK_THAT(file_text("run/log.txt"),
             Contains(" warning " + warnings.all()[0] + "\n") && Contains(", 1 steps not taken\n"));
}

TEST_CASE("more steps that were not taken than allowed end a run, and it goes on once the cause is gone", "[run]") {
  const TemporaryFolder here;
  const Warnings warnings;
  std::string message;
  try {
    run_into_trap("run", 0, 1000000, "2");
  } catch (const StageDivergedError& error) {
    message = error.what();
  }
  CHECK_THAT(message,
             Contains("stage 'interaction, frame 1': given up in iteration 2 after 3 steps that had to be taken "
                      "back (max_rollbacks is 2): the loss is nan; first: ") &&
                 Contains("'trap'"));
  CHECK(warnings.holding("frame 1, stage interaction, iteration ") == 2);
  check_has_failed("run", message);
  CHECK_THAT(file_text("run/log.txt"), Contains(" error failed: " + message + "\n"));
  CHECK_FALSE(fs::exists("run/summary.json"));
  run_into_trap("run", 0, 0, "2", true);
  CHECK(json_of("run/status.json")["state"] == "done");
  CHECK(warnings.all().size() == 2);
  run_into_trap("whole", 0, 0, "2");
  CHECK(differences("whole", "run").empty());
}

TEST_CASE("the log of a run tells every stage of every frame, and the terminal does not", "[run]") {
  const TemporaryFolder here;
  const ProgramResult result = run_hsi4d({"run", tiny_config_file(), "--out", "run", "--threads", "1"});
  REQUIRE(result.status == 0);
  CHECK(result.err.find("iterations in") == std::string::npos);
  const std::vector<std::string> lines = log_lines("run");
  REQUIRE(lines.size() == 1 + 2 * (kTinyFrames - 1) + 1);
  CHECK_THAT(lines.front(), Contains("info hsi4d ") && Contains("run 'tiny': 4 frames of 48x48 pixels, 2 stages, "
                                                                "1 thread, float"));
  const std::string number = "[0-9.e+-]+";
  std::size_t at = 1;
  for (int frame = 1; frame < kTinyFrames; ++frame) {
    const std::string start = "info frame " + std::to_string(frame) + ", stage ";
    CHECK_THAT(lines[at++], Catch::Matchers::Matches(start + "camera: 8 iterations in " + number + " s, loss " +
                                                     number + " \\(masked_l2 " + number + "\\) -> " + number +
                                                     " \\(masked_l2 " + number + "\\)"));
    const std::string terms = number + " \\(photometric " + number + ", center " + number + ", depth " + number + "\\)";
    CHECK_THAT(lines[at++], Catch::Matchers::Matches(start + "interaction: 10 iterations in " + number + " s, loss " +
                                                     terms + " -> " + terms));
  }
  CHECK_THAT(lines.back(), Catch::Matchers::Matches("info done: 4 frames in .*, psnr_db " + number + ", ssim " +
                                                    number + ", mpjpe_mm " + number + ", object_translation_cm " +
                                                    number + ", camera_translation_cm " + number));
}

TEST_CASE("warnings from before there was a folder, and a resumed run, are in the log", "[run]") {
  const TemporaryFolder here;
  fs::copy(TinyDataset::folder(), "data", fs::copy_options::recursive);
  fs::remove("data/masks/human/0002.png");
  const RunConfig config = load_run_config("data/config.json", {}, descriptions_of(loss_terms()));
  int count = 0;
  CHECK_THROWS_AS(execute_tiny(config, "run", 1, false, [&] { return ++count == 20; }), Interrupted);
  const std::string warning = "/human: has no mask for 1 of 4 frames; these count as empty";
  CHECK_THAT(file_text("run/log.txt"), Contains(warning) && Contains(" info interrupted: interrupted in frame 2"));
  execute_tiny(config, "run", 1, true);
  CHECK_THAT(file_text("run/log.txt"), Contains("info resumed with frame 2 of 3\n"));
}

}  // namespace warnings_test
