#include "pipelines/cli/program.h"

#include <algorithm>
#include <sstream>

#include <catch2/catch.hpp>
#include <nlohmann/json.hpp>

#include "core/check.h"
#include "core/text.h"
#include "core/version.h"
#include "optim/loss_term.h"
#include "pipelines/cli/check_command.h"
#include "pipelines/cli/instances.h"
#include "pipelines/cli/list_command.h"
#include "pipelines/config/run_config.h"
#include "tests/support/program.h"
#include "tests/support/test_losses.h"

namespace program_test {

using namespace hsi4d;
using namespace hsi4d::test;
using Catch::Matchers::Contains;
using Catch::Matchers::Equals;
using Catch::Matchers::StartsWith;

namespace {

std::vector<std::filesystem::path> shipped_configs() {
  std::vector<std::filesystem::path> files;
  for (const auto& entry : std::filesystem::directory_iterator(std::filesystem::path(HSI4D_SOURCE_DIR) / "configs")) {
    if (entry.path().extension() == ".json") files.push_back(entry.path());
  }
  std::sort(files.begin(), files.end());
  return files;
}

/// The program's commands, in its order: what it tells of where none is given.
std::vector<std::string> commands() {
  const TemporaryFolder folder;
  std::string told = run_hsi4d({}).err;
  const std::string before = "hsi4d: give a command: ", behind = "; `hsi4d --help` explains them\n";
  REQUIRE(told.starts_with(before));
  REQUIRE(told.ends_with(behind));
  std::istringstream words(told.substr(before.size(), told.size() - before.size() - behind.size()));
  std::vector<std::string> names;
  for (std::string word; words >> word;) names.push_back(word.ends_with(",") ? word.substr(0, word.size() - 1) : word);
  return names;
}

/// Those of the README's table: in backticks before a row's colon.
std::vector<std::string> commands_of_readme() {
  std::istringstream readme(file_text(std::filesystem::path(HSI4D_SOURCE_DIR) / "README.md"));
  std::vector<std::string> names;
  bool is_in_section = false;
  for (std::string line; std::getline(readme, line);) {
    if (line.starts_with("## ")) is_in_section = line == "## Commands";
    if (!is_in_section || !line.starts_with("| `")) continue;
    std::istringstream parts(line.substr(0, line.find(':')));
    for (std::string around, name; std::getline(parts, around, '`') && std::getline(parts, name, '`');)
      names.push_back(name);
  }
  return names;
}

}  // namespace

TEST_CASE("the README's table has every command") {
  CHECK_THAT(commands_of_readme(), Catch::Matchers::UnorderedEquals(commands()));
}

TEST_CASE("every shipped config passes check, and reads back from its resolved form") {
  const TemporaryFolder folder;
  REQUIRE(shipped_configs().size() >= 2);
  for (const std::filesystem::path& file : shipped_configs()) {
    INFO(file);
    const ProgramResult check = run_hsi4d({"check", file.string()});
    CHECK(check.status == 0);
    CHECK(check.err.empty());
    CHECK_THAT(check.out, Contains(": OK\n"));
    const ProgramResult printed = run_hsi4d({"check", file.string(), "--print-config"});
    CHECK(printed.status == 0);
    folder.write("resolved.json", printed.out);
    const ProgramResult again = run_hsi4d({"check", "resolved.json", "--print-config"});
    CHECK(again.status == 0);
    CHECK(again.out == printed.out);
  }
}

TEST_CASE("check takes overrides before and after the config") {
  const TemporaryFolder folder;
  folder.write("a.json", "{}");
  const ProgramResult result =
      run_hsi4d({"check", "--set", "render.blur=0.5", "a.json", "--set", "seed=4", "--print-config"});
  CHECK(result.err.empty());
  CHECK_THAT(result.out, Contains("\"blur\": 0.5") && Contains("\"seed\": 4"));
  CHECK_THAT(run_hsi4d({"check", "a.json", "--set", "threads=1"}).out,
             StartsWith("a.json: OK\n  seed 0, 1 thread\n  render: quality default\n  no stages\n"
                        "  the config alone is checked; `hsi4d run a.json --dry-run` reads its inputs\n"
                        "  note: no run yet: /stages: a run needs at least one stage\n"
                        "  note: no run yet: /data: no inputs are given; a run needs scene, avatar, "));
}

TEST_CASE("the summary of check tells what will run") {
  const TemporaryFolder folder;
  folder.write("a.json", R"({"render": {"compatibility": "gsplat"}, "stages": {"camera": {"iterations": 1,
    "optimize": {"camera": {"lr": 1}}, "losses": {"photo": {}, "centre": {}}}}})");
  CHECK_THAT(cli::check_command("a.json", {}, false, test_losses()),
             StartsWith("a.json: OK\n  seed 0, one thread a core\n  render: quality default, as gsplat\n"
                        "  stage camera: 1 iteration, 1 parameter group (camera), 2 losses (photo, centre)\n"
                        "  the config alone is checked; `hsi4d run a.json --dry-run` reads its inputs\n"
                        "  note: no run yet: /data: no inputs are given"));
}

TEST_CASE("check refuses stages whose groups are not known, do not exist in what is drawn, or never move") {
  const TemporaryFolder folder;
  folder.write("a.json", R"({"stages": {
    "camera": {"iterations": 5, "draw": "scene", "optimize": {"camera": {"lr": 1}, "transl": {"lr": 1}},
               "losses": {"masked_l2": {}}},
    "body": {"iterations": 5, "optimize": {"bodypose": {"lr": 1}, "transl": {"lr": 1, "from": 5},
                                           "scene_sh": {"lr": 1}},
             "losses": {"photometric": {}}},
    "none": {"iterations": 5, "optimize": {}}}})");
  const std::string groups =
      "camera, object_orient, object_transl, object_joint, object_light, transl, global_orient, body_pose, jaw_pose, "
      "leye_pose, "
      "reye_pose, "
      "left_hand_pose, right_hand_pose, color_net, avatar_features";
  const ProgramResult result = run_hsi4d({"check", "a.json"});
  CHECK(result.status == 2);
  CHECK(result.out.empty());
  CHECK(result.err ==
        "6 problems in a.json:\n"
        "a.json:2: /stages/camera/optimize/transl: there is no such parameter group; known here: camera\n"
        "a.json:4: /stages/body/optimize/bodypose: there is no such parameter group; did you mean \"body_pose\"?\n"
        "a.json:4: /stages/body/optimize/transl/from: 5 is beyond the stage's 5 iterations; the group would never "
        "move\n"
        "a.json:5: /stages/body/optimize/scene_sh: there is no such parameter group; known here: " +
            groups +
            "\na.json:7: /stages/none/losses: a stage needs a loss\n"
            "a.json:7: /stages/none/optimize: no parameter group is named; known here: " +
            groups + "\n");
  folder.write("b.json", R"({"stages": {"body": {"iterations": 5,
    "optimize": {"transl": {"lr": 1, "from": 3, "until": 3}}, "losses": {"photometric": {}}}}})");
  CHECK_THAT(run_hsi4d({"check", "b.json"}).err,
             Contains("3 is not after from, which is 3; the group would never move"));
  folder.write("off.json", R"({"stages": {
    "a": {"iterations": 5, "optimize": {"transl": {"lr": 1}}, "losses": {"photometric": {"weight": 0}}},
    "b": {"iterations": 5, "optimize": {"transl": {"lr": 1}},
          "losses": {"photometric": {}, "depth": {"weight": 0}}}}})");
  CHECK(run_hsi4d({"check", "off.json"}).err ==
        "off.json:2: /stages/a/losses: photometric has weight 0, which switches a loss off; a stage needs one that is "
        "on\n");
  CHECK_THAT(run_hsi4d({"check", "off.json", "--set", "stages.a.losses.photometric.weight=1"}).out,
             Contains("2 losses (photometric, depth off by weight 0)\n"));
  // Those of them that would be right.
  folder.write("c.json", R"({"stages": {
    "camera": {"iterations": 5, "draw": "scene", "optimize": {"camera": {"lr": 1}}, "losses": {"masked_l2": {}}},
    "body": {"iterations": 5, "optimize": {"body_pose": {"lr": 1}, "transl": {"lr": 1, "from": 4}},
             "losses": {"photometric": {}}}}})");
  CHECK(run_hsi4d({"check", "c.json"}).status == 0);
}

TEST_CASE("schema prints JSON that refuses unknown keys") {
  const TemporaryFolder folder;
  const ProgramResult result = run_hsi4d({"schema"});
  CHECK(result.status == 0);
  const nlohmann::json schema = nlohmann::json::parse(result.out);
  CHECK(schema["additionalProperties"] == false);
  CHECK(schema["properties"]["render"]["properties"]["blur"]["default"] == 0.3);
  CHECK(result.out == run_config_schema(descriptions_of(loss_terms())));
}

TEST_CASE("list tells losses and settings") {
  CHECK_THAT(cli::list_command("losses", test_losses()),
             Equals("photo   Difference of images\ncentre  Distance of centres\n"));
  CHECK_THAT(cli::list_command("settings", test_losses()),
             Contains("/render/blur") && Contains("/stages/NAME/losses/photo/ssim_share"));
  CHECK_THROWS_MATCHES(
      cli::list_command("loses", test_losses()), UserError,
      Catch::Matchers::Message("hsi4d list: there is nothing called \"loses\" to list; known: losses, stages, scenes, "
                               "settings, avatar_fit, reconstruct; did you mean \"losses\"?"));
  const std::string stages = cli::list_command("stages", test_losses());
  CHECK_THAT(stages, Contains("\nframe        scene  camera           Six numbers of the camera") &&
                         Contains("\nframe        all    body_pose        21 joints of the body\n"));
  CHECK(std::count(stages.begin(), stages.end(), '\n') == 1 + 2 * (1 + 15) + 1 + 5 + 3);
  CHECK_THAT(cli::list_command("scenes", test_losses()),
             Contains("\nscene      garden         a lawn with a path") &&
                 Contains("\nmotion     push           walks in a circle, pushing it") &&
                 Contains("  office_chair\n") && Contains("\nobject     vase ") &&
                 Contains("  bed, windowsill, ladder\n"));
  CHECK(cli::instance_rows("nowhere", test_losses()).empty());
  const auto rows =
      cli::instance_rows(std::string(HSI4D_SOURCE_DIR) + "/configs/anyinteraction", descriptions_of(loss_terms()));
  REQUIRE(rows.size() == 22);
  CHECK(rows[0] == std::vector<std::string>{"bar_bar", "The person is leaning on the bar.", "static", "stand-in"});
  const TemporaryFolder folder;
  const ProgramResult result = run_hsi4d({"list", "losses"});
  CHECK(result.status == 0);
  CHECK(result.out == cli::list_command("losses", descriptions_of(loss_terms())));
}

TEST_CASE("the program and every subcommand answer --version and --help") {
  const TemporaryFolder folder;
  const ProgramResult version_text = run_hsi4d({"--version"});
  CHECK(version_text.status == 0);
  CHECK(version_text.out == std::string("hsi4d ") + version() + " (" + git_commit() + ")\n");
  const ProgramResult help = run_hsi4d({"--help"});
  CHECK(help.status == 0);
  for (const std::string& command : commands()) {
    CHECK_THAT(help.out, Contains(command));
    if (command == "bench" || command == "stress") continue;  // programs of their own
    const ProgramResult own = run_hsi4d({command, "--help"});
    CHECK(own.status == 0);
    CHECK(own.err.empty());
    CHECK_THAT(own.out, Contains("hsi4d " + command));
  }
}

TEST_CASE("the help of gradients tells which of them are zero") {
  const TemporaryFolder folder;
  CHECK_THAT(run_hsi4d({"gradients", "--help"}).out,
             Contains("log-scales and opacity logits\nthat it holds at -20 or 20") &&
                 Contains("unless\nrender.cap_gradient is pass (render.compatibility=inria makes it so)."));
}

TEST_CASE("mistakes on the command line end with 2 and one message") {
  const TemporaryFolder folder;
  const auto mistake = [](const std::vector<std::string>& arguments) {
    const ProgramResult result = run_hsi4d(arguments);
    CHECK(result.status == 2);
    CHECK(result.out.empty());
    return result.err;
  };
  const std::string known = joined(commands());
  CHECK(mistake({"chek"}) == "hsi4d: there is no command \"chek\"; known: " + known + "; did you mean \"check\"?\n");
  CHECK(mistake({"frobnicate"}) == "hsi4d: there is no command \"frobnicate\"; known: " + known + "\n");
  CHECK(mistake({}) == "hsi4d: give a command: " + known + "; `hsi4d --help` explains them\n");
  CHECK(mistake({"check"}) == "hsi4d check: CONFIG is required; `hsi4d check --help` explains its arguments\n");
  CHECK(mistake({"check", "a.json", "--sett", "x=1"}) ==
        "hsi4d check: there is no option \"--sett\"; known: --help, --set, --print-config; did you mean \"--set\"?\n");
  CHECK(
      mistake({"demo", "--quik"}) ==
      "hsi4d demo: there is no option \"--quik\"; known: --help, --quick, --out, --set, --quiet, --resume, --threads; "
      "did you mean \"--quick\"?\n");
  CHECK(mistake({"render", "--sceen=a.ply"}).find("did you mean \"--scene\"?") != std::string::npos);
  CHECK(mistake({"run", "a.json", "--seed", "x"}) ==
        "hsi4d run: --seed: \"x\" is out of range, or not a whole number; allowed: 0 or more; `hsi4d run --help` "
        "explains its arguments\n");
  CHECK(mistake({"check", "a.json", "--set"}) ==
        "hsi4d check: --set: 1 required KEY=VALUE missing; `hsi4d check --help` explains its arguments\n");
  CHECK(mistake({"--vresion"}) ==
        "hsi4d: there is no option \"--vresion\"; known: -h, --help, --version; did you mean \"--version\"?\n");
}

TEST_CASE("output that cannot be written is an error, not silence") {
  const TemporaryFolder folder;
  if (!std::filesystem::exists("/dev/full")) return;
  const std::string command = std::string("'") + HSI4D_PROGRAM + "' schema > /dev/full 2> stderr.txt";
  const int status = std::system(command.c_str());
  CHECK(WEXITSTATUS(status) == 2);
  CHECK(file_text("stderr.txt") == "hsi4d: standard output cannot be written to\n");
}

}  // namespace program_test
