// What a researcher reads when a config is wrong: every message to the letter.
#include <catch2/catch.hpp>

#include "core/check.h"
#include "pipelines/config/run_config.h"
#include "tests/support/program.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/test_losses.h"

namespace errors_test {

using namespace hsi4d;
using namespace hsi4d::test;
using Catch::Matchers::Contains;
using Catch::Matchers::Equals;
using Catch::Matchers::StartsWith;

namespace {

std::string fault_of(const std::string& file, const std::vector<std::string>& overrides = {}) {
  try {
    load_run_config(file, overrides, test_losses());
  } catch (const UserError& error) {
    return error.what();
  }
  return "no fault";
}

std::string fault(const std::string& text, const std::vector<std::string>& overrides = {}) {
  const TemporaryFolder folder;
  return fault_of(folder.write("a.json", text), overrides);
}

const std::string kSections =
    "name, seed, threads, precision, rotations, background, remove_depth_bias, uncertainty, camera, camera_selection, "
    "start, "
    "instance, data, sources, "
    "chain, "
    "body, "
    "color_net, "
    "synthetic, render, "
    "skip, "
    "approx, log, passes, stages";

// A config with one stage, `inside` its braces.
std::string stage(const std::string& inside) { return "{\"stages\": {\"camera\": {\n" + inside + "}}}"; }

}  // namespace

TEST_CASE("names of runs that are no names of folders") {
  CHECK_THAT(fault(R"({"name": "x\u0000y"})"),
             Equals(R"(a.json:1: /name: "x\u0000y" holds the character 0 (\u0000), which no text here can have)"));
  CHECK_THAT(
      fault(R"({"name": "../../evil"})"),
      Equals("a.json:1: /name: \"../../evil\" cannot be the name of a folder; allowed: a name of at most 200 bytes "
             "without /, \\ and control characters, not . or .."));
  for (const char* name : {"/tmp/x", "..", ".", "a/b", "a\\\\b", "a\\nb"})
    CHECK_THAT(fault("{\"name\": \"" + std::string(name) + "\"}"), StartsWith("a.json:1: /name: "));
  CHECK(fault(R"({"name": "Walk 2, with \u00e4"})") == "no fault");
}

TEST_CASE("unknown keys") {
  CHECK_THAT(fault(R"({"sede": 1})"), Equals("a.json:1: /sede: unknown key; did you mean \"seed\"?"));
  CHECK_THAT(fault(R"({"render": {"alpha_mim": 0.1}})"),
             Equals("a.json:1: /render/alpha_mim: unknown key; did you mean \"alpha_min\"?"));
  CHECK_THAT(fault(R"({"blur": 0.1})"), Equals("a.json:1: /blur: unknown key; it belongs in /render"));
  CHECK_THAT(fault(R"({"zzzzz": 0.1})"), Equals("a.json:1: /zzzzz: unknown key; known here: " + kSections));
  CHECK_THAT(fault(stage(R"("iterations": 30, "optimise": {})")),
             Equals("a.json:2: /stages/camera/optimise: unknown key; did you mean \"optimize\"?"));
  CHECK_THAT(fault(stage("\"iterations\": 30,\n\"losses\": {\"phto\": {}}")),
             Equals("a.json:3: /stages/camera/losses/phto: unknown key; did you mean \"photo\"?"));
  CHECK_THAT(fault(stage(R"("iterations": 30, "losses": {"depth": {}})")),
             Equals("a.json:2: /stages/camera/losses/depth: unknown key; known here: photo, centre"));
  CHECK_THAT(fault(stage(R"("iterations": 30, "losses": {"photo": {"wieght": 1}})")),
             Equals("a.json:2: /stages/camera/losses/photo/wieght: unknown key; did you mean \"weight\"?"));
  CHECK_THAT(
      fault(stage(R"("iterations": 30, "losses": {"centre": {"masked": true}})")),
      Equals("a.json:2: /stages/camera/losses/centre/masked: unknown key; it belongs in /stages/NAME/losses/photo"));
}

TEST_CASE("body models") {
  CHECK_THAT(fault(R"({"body": {"kind": "smpl"}})"),
             Equals("a.json:1: /body/kind: \"smpl\" is not one of the choices; allowed: \"procedural\", \"smplx\"; did "
                    "you mean \"smplx\"?"));
  CHECK_THAT(fault(R"({"body": {"kind": "smplx"}})"),
             Equals("a.json:1: /body/path: kind smplx needs the file of a body model"));
  CHECK_THAT(fault(R"({"body": {"kind": "smplx", "path": "nowhere.npz"}})"),
             StartsWith("a.json:1: /body/path: ") && Contains("nowhere.npz"));
  CHECK_THAT(fault(R"({"body": {"path": "a.json"}})"),
             Equals("a.json:1: /body/path: kind procedural reads no file; kind smplx does"));
  CHECK_THAT(fault(R"({"body": {"beta": 3}})"), Equals("a.json:1: /body/beta: unknown key; did you mean \"betas\"?"));
  CHECK_THAT(fault(R"({"body": {"betas": 301}})"),
             Equals("a.json:1: /body/betas: 301 is out of range; allowed: 0 to 300"));
}

TEST_CASE("wrong types") {
  CHECK_THAT(fault(stage(R"("iterations": 2.7)")),
             Equals("a.json:2: /stages/camera/iterations: 2.7 is not a whole number; allowed: 1 to 1000000"));
  CHECK_THAT(
      fault(stage(R"("iterations": true)")),
      Equals("a.json:2: /stages/camera/iterations: true is a boolean, not a whole number; allowed: 1 to 1000000"));
  CHECK_THAT(fault(R"({"render": {"blur": true}})"),
             Equals("a.json:1: /render/blur: true is a boolean, not a number; allowed: 0 to 100, or \"estimate\""));
  CHECK_THAT(fault(R"({"render": {"blur": "0.3"}})"),
             Equals("a.json:1: /render/blur: \"0.3\" is a string, not a number; allowed: 0 to 100, or \"estimate\""));
  CHECK_THAT(fault(R"({"render": {"antialias": 0}})"),
             Equals("a.json:1: /render/antialias: 0 is a number, not a boolean; allowed: true or false"));
  CHECK_THAT(fault(R"({"render": []})"), Equals("a.json:1: /render: [] is an array, not an object"));
  CHECK_THAT(
      fault(R"({"stages": null})"),
      Equals("a.json:1: /stages: null is not an object, and takes none out: the file that is extended has none here; "
             "write {...}, or leave the key out"));
  CHECK_THAT(fault(R"({"seed": null})"),
             Equals("a.json:1: /seed: null is not a whole number; allowed: 0 to 9007199254740991"));
  CHECK_THAT(fault(R"({"render": {"quality": "fats"}})"),
             Equals("a.json:1: /render/quality: \"fats\" is not one of the choices; allowed: \"fast\", \"default\", "
                    "\"accurate\", \"reference\"; did you mean \"fast\"?"));
  CHECK_THAT(fault(R"({"render": {"depth_key": "half"}})"),
             Equals("a.json:1: /render/depth_key: \"half\" is not one of the choices; allowed: \"float\", \"double\""));
}

TEST_CASE("values out of range") {
  CHECK_THAT(fault(R"({"seed": -1})"), Equals("a.json:1: /seed: -1 is out of range; allowed: 0 to 9007199254740991"));
  CHECK_THAT(fault(R"({"render": {"alpha_cap": 0}})"),
             Equals("a.json:1: /render/alpha_cap: 0 is out of range; allowed: above 0 and at most 1"));
  CHECK_THAT(fault(R"({"render": {"transmittance_stop": 1}})"),
             Equals("a.json:1: /render/transmittance_stop: 1 is out of range; allowed: at least 0 and below 1"));
  CHECK_THAT(fault(R"({"render": {"tile": 12}})"),
             Equals("a.json:1: /render/tile: 12 is out of range; allowed: 8 to 16, a multiple of 8"));
  CHECK_THAT(fault(stage(R"("iterations": 0)")),
             Equals("a.json:2: /stages/camera/iterations: 0 is out of range; allowed: 1 to 1000000"));
  CHECK_THAT(fault(stage(R"("iterations": 1, "losses": {"photo": {"weight": -1}})")),
             Equals("a.json:2: /stages/camera/losses/photo/weight: -1 is out of range; allowed: at least 0"));
  CHECK_THAT(
      fault(stage(R"("iterations": 1, "optimize": {"root": {"lr": 0.1, "lr_final_share": 0}})")),
      Equals(
          "a.json:2: /stages/camera/optimize/root/lr_final_share: 0 is out of range; allowed: above 0 and at most 1"));
  CHECK_THAT(fault(stage(R"("iterations": 1, "optimizer": {"beta1": 1})")),
             Equals("a.json:2: /stages/camera/optimizer/beta1: 1 is out of range; allowed: at least 0 and below 1"));
}

TEST_CASE("missing keys and contradictions") {
  CHECK_THAT(fault(stage(R"("losses": {})")),
             Equals("a.json:1: /stages/camera: the key \"iterations\" is missing; allowed: 1 to 1000000"));
  CHECK_THAT(fault(stage(R"("iterations": 30, "optimize": {"root": {}})")),
             Equals("a.json:2: /stages/camera/optimize/root: the key \"lr\" is missing; allowed: 0 to 1000"));
  CHECK_THAT(fault(stage(R"("iterations": 30, "optimize": {"root": {"lr": 0.1, "from": 20, "until": 20}})")),
             Equals("a.json:2: /stages/camera/optimize/root/until: 20 is not after from, which is 20; the group would "
                    "never move"));
  CHECK_THAT(fault(R"({"render": {"quality": "fast", "compatibility": "inria"}})"),
             Equals("a.json:1: /render/quality: quality and compatibility set the same keys; write one of the two"));
  CHECK_THAT(fault(stage(R"("iterations": 9, "optimizer": {"kind": "bfgs"},
                            "optimize": {"root": {"lr": 0.1, "lr_final_share": 0.5}})")),
             Contains("/stages/camera") && Contains("bfgs moves all numbers in every step: from, until, every and "
                                                    "lr_final_share of \"root\" have no meaning"));
}

TEST_CASE("a curvature is kept from frame to frame alone") {
  CHECK_THAT(
      fault(stage(R"("iterations": 9, "over": "sequence", "optimizer": {"kind": "bfgs", "keep_curvature": true})")),
      Contains("/stages/camera") && Contains("only a stage over frames has a frame before"));
}

TEST_CASE("a removed key is refused with what stands in its place, unless it says what is so now") {
  const std::string plateau = "/stages/camera/plateau: no setting since 0.1.0: a stage ends after its iterations";
  CHECK_THAT(fault(stage(R"("iterations": 3, "plateau": {"iterations": 5, "gain": 0.01})")), Contains(plateau));
  CHECK_THAT(fault(stage(R"("iterations": 3)"), {"stages.camera.plateau.gain=0.5"}),
             Contains("--set stages.camera.plateau.gain=0.5: " + plateau));
  CHECK_THAT(
      fault(stage(R"("iterations": 3, "losses": {"penetration": {"memory_mib": 9}})")),
      Contains("/stages/camera/losses/penetration/memory_mib: no setting since 0.1.0: at most 256 MiB are taken"));
  CHECK_THAT(fault(R"({"camera_selection": {"elevations_deg": [5]}})"),
             Equals("a.json:1: /camera_selection/elevations_deg: no setting since 0.1.0: 0, 15 and 30 degrees above "
                    "the horizon are tried"));
  CHECK(fault(R"({"camera_selection": {"elevations_deg": [0, 15, 30], "at_objects": true}})") == "no fault");
}

TEST_CASE("duplicate keys, numbers that are not finite, broken JSON") {
  CHECK_THAT(fault("{\"seed\": 1,\n\"seed\": 2}"),
             Equals("a.json:2: /seed: written twice, first in line 1; keep one of them"));
  CHECK_THAT(fault(R"({"render": {"blur": 1e999}})"),
             Equals("a.json:1:21: /render/blur: 1e999 is not a finite number: it is beyond the largest double\n"
                    "  {\"render\": {\"blur\": 1e999}}\n"
                    "                      ^"));
  CHECK_THAT(fault(R"({"render": {"near": NaN}})"),
             StartsWith("a.json:1:21: /render/near: NaN is not a finite number\n"));
  CHECK_THAT(fault("{\"seed\": 1,\n}"),
             StartsWith("a.json:1:11: not valid JSON: the comma before '}' is one too many\n"));
  CHECK_THAT(fault("{\"seed\": 1 // mine\n}"),
             StartsWith("a.json:1:12: not valid JSON: comments are not part of JSON\n"));
  CHECK_THAT(fault(""), Equals("a.json:1:1: not valid JSON: the file is empty"));
  CHECK_THAT(fault("42"), Equals("a.json:1: 42 is a number; a config is an object: {...}"));
}

TEST_CASE("overrides name the command line") {
  const std::string good = stage(R"("iterations": 30, "losses": {"photo": {}})");
  CHECK_THAT(
      fault(good, {"stages.camera.iteration=10"}),
      Equals("--set stages.camera.iteration=10: /stages/camera/iteration: unknown key; did you mean \"iterations\"?"));
  CHECK_THAT(
      fault(good, {"stages.camara.iterations=10"}),
      Equals("--set stages.camara.iterations=10: /stages/camara: no such entry in the config, and --set adds none; a "
             "config that extends it can; did you mean \"camera\"?"));
  CHECK_THAT(
      fault(good, {"stages.camera.losses.centre.weight=0"}),
      Equals(
          "--set stages.camera.losses.centre.weight=0: /stages/camera/losses/centre: no such entry in the config, and "
          "--set adds none; a config that extends it can; known here: photo"));
  CHECK_THAT(
      fault(good, {"stages.camera.iterations=2.7"}),
      Equals("--set stages.camera.iterations=2.7: /stages/camera/iterations: 2.7 is not a whole number; allowed: 1 to "
             "1000000"));
  CHECK_THAT(fault(good, {"render.blur=wide"}),
             Equals("--set render.blur=wide: /render/blur: wide is not a number; allowed: 0 to 100, or \"estimate\""));
  CHECK_THAT(fault(good, {"render.blur=NaN"}),
             Equals("--set render.blur=NaN: /render/blur: NaN is not a number; allowed: 0 to 100, or \"estimate\""));
  CHECK_THAT(fault(good, {"rendr.blur=1"}),
             Equals("--set rendr.blur=1: /rendr: unknown key; did you mean \"render\"?"));
  CHECK_THAT(fault(good, {"extends=b.json"}),
             Equals("--set extends=b.json: /extends: unknown key; known here: " + kSections));
  CHECK(fault(good, {"render.blur=1", "stages.camera.losses={\"centre\": {}}"}) == "no fault");
}

TEST_CASE("overrides may be JSON pointers") {
  const std::string good = stage(R"("iterations": 30, "losses": {"photo": {}})");
  CHECK(fault(good, {"/render/blur=0.1", "/stages/camera/losses/photo/weight=2"}) == "no fault");
  CHECK_THAT(fault(good, {"/render/blur=wide"}),
             Equals("--set /render/blur=wide: /render/blur: wide is not a number; allowed: 0 to 100, or \"estimate\""));
  CHECK_THAT(fault(good, {"/a~1b~0=1"}), Equals("--set /a~1b~0=1: /a~1b~0: unknown key; known here: " + kSections));
  for (const char* bad : {"/=1", "=1", "/render//blur=1", "render..blur=1", "render.blur"}) {
    CHECK_THAT(fault(good, {bad}),
               Equals(std::string("--set ") + bad +
                      ": write --set KEY=VALUE with dots between nested keys, for example --set render.blur=0.1 or "
                      "--set /render/blur=0.1"));
  }
}

TEST_CASE("every problem of a file, of what it extends and of the overrides is told at once") {
  const TemporaryFolder folder;
  folder.write("base.json", R"({"render": {"near": -1}, "stages": {"camera": {"iterations": 30}}})");
  folder.write("a.json", R"({
  "extends": "base.json",
  "seed": "one",
  "render": {"alpha_mim": 0.1, "blur": -1},
  "stages": {
    "camera": {"losses": {"photo": {"ssim_share": 2}}},
    "body": {"optimize": {"root": {"lr": 0.01, "every": 0}}}
  }
})");
  CHECK_THAT(fault_of("a.json", {"threads=many"}),
             Equals("8 problems:\n"
                    "a.json:3: /seed: \"one\" is a string, not a whole number; allowed: 0 to 9007199254740991\n"
                    "a.json:4: /render/alpha_mim: unknown key; did you mean \"alpha_min\"?\n"
                    "a.json:4: /render/blur: -1 is out of range; allowed: 0 to 100\n"
                    "a.json:6: /stages/camera/losses/photo/ssim_share: 2 is out of range; allowed: 0 to 1\n"
                    "a.json:7: /stages/body: the key \"iterations\" is missing; allowed: 1 to 1000000\n"
                    "a.json:7: /stages/body/optimize/root/every: 0 is out of range; allowed: 1 to 1000000\n"
                    "base.json:1: /render/near: -1 is out of range; allowed: above 0 and at most 1000\n"
                    "--set threads=many: /threads: many is not a whole number; allowed: 0 to 1024"));
}

TEST_CASE("rules and stages are told with everything else, and not where they only follow from it") {
  const TemporaryFolder folder;
  folder.write("a.json", R"({
  "render": {"quality": "fast", "compatibility": "inria", "blurr": 1},
  "stages": {
    "camera": {"iterations": 3, "draw": "scene", "optimise": {"camera": {"lr": 1}}, "losses": {"masked_l2": {"weight": 0}}},
    "body": {"optimize": {"transl": {"lr": 1, "from": 9}, "bodypose": {}}}
  }
})");
  const ProgramResult result = run_hsi4d({"run", "a.json"});
  CHECK(result.status == 2);
  CHECK_THAT(
      result.err,
      Catch::Matchers::StartsWith(
          "9 problems in a.json:\n"
          "a.json:1: /data: no inputs are given; a run needs scene, avatar, frames, masks, camera, initial. `hsi4d "
          "synth` "
          "makes a dataset with a config beside it to run; `hsi4d demo` makes one and runs it\n"
          "a.json:2: /render/quality: quality and compatibility set the same keys; write one of the two\n"
          "a.json:2: /render/blurr: unknown key; did you mean \"blur\"?\n"
          "a.json:4: /stages/camera/optimise: unknown key; did you mean \"optimize\"?\n"
          "a.json:4: /stages/camera/losses: masked_l2 has weight 0, which switches a loss off; a stage needs one that "
          "is "
          "on\n"
          "a.json:5: /stages/body: the key \"iterations\" is missing; allowed: 1 to 1000000\n"
          "a.json:5: /stages/body/losses: a stage needs a loss\n"
          "a.json:5: /stages/body/optimize/bodypose: the key \"lr\" is missing; allowed: 0 to 1000\n"
          "a.json:5: /stages/body/optimize/bodypose: there is no such parameter group; did you mean \"body_pose\"?"));
  const std::string in_stages = run_hsi4d({"check", "a.json"}).err;  // which asks for no inputs
  CHECK_THAT(in_stages, Catch::Matchers::StartsWith("8 problems in a.json:\na.json:2: "));
}

TEST_CASE("the program prints the same text and exits with 2") {
  const TemporaryFolder folder;
  folder.write("a.json", "{\"sede\": 1,\n\"threads\": -1}");
  const ProgramResult wrong = run_hsi4d({"check", "a.json", "--set", "render.blur=x"});
  CHECK(wrong.status == 2);
  CHECK(wrong.out.empty());
  CHECK_THAT(wrong.err,
             Equals("3 problems:\na.json:1: /sede: unknown key; did you mean \"seed\"?\n"
                    "a.json:2: /threads: -1 is out of range; allowed: 0 to 1024\n"
                    "--set render.blur=x: /render/blur: x is not a number; allowed: 0 to 100, or \"estimate\"\n"));
  folder.write("configs/default.json", "{}");
  const ProgramResult missing = run_hsi4d({"check", "configs/defualt.json"});
  CHECK(missing.status == 2);
  CHECK_THAT(missing.err,
             Equals("configs/defualt.json: there is no such file; did you mean \"configs/default.json\"?\n"));
}

}  // namespace errors_test
