#include "optim/stage_settings.h"

#include <catch2/catch.hpp>

#include "autodiff/elementwise.h"
#include "autodiff/reduce.h"
#include "core/check.h"
#include "core/config_file.h"
#include "optim/stage.h"
#include "tests/support/loss_terms.h"
#include "tests/support/temporary_folder.h"

namespace stage_settings_test {

using namespace hsi4d;
using namespace hsi4d::test;

namespace tint {

struct Settings {
  std::filesystem::path file;
};
void describe(ConfigFields& f, Settings& s) { f.path("file", s.file, {}, "A number"); }

int reads = 0;  // of files

double read(const Settings& settings) {
  ++reads;
  const std::string text = file_text(settings.file), name = settings.file.filename().string();
  if (text.empty()) throw UserError(name + ": holds nothing");
  if (text == "nan") throw DataError(name + ": is not finite");
  return std::stod(text);
}

/// Square of the image's mean less a file's number.
LossTerm loss() {
  LossTerm term = make_loss_term<Settings>(
      "tint", "Distance from a file's number", [](const Settings& settings) { return read(settings); },
      [](const auto& in, double value) { return square(mean(in.rendered) - value); });
  term.description.weight = 0.25;
  return term;
}

StageSettings stage_of(const std::string& losses) {
  StageSettings stage;
  ConfigFields fields;
  describe(fields, stage, {loss().description});
  ConfigProblems problems;
  const std::string text = R"({"iterations": 3, "optimize": {"image": {"lr": 0.1}}, "losses": )" + losses + "}";
  read_config(load_config_text(text, "a.json", std::filesystem::current_path(), {}, problems), fields, problems);
  problems.throw_if_any();
  return stage;
}

}  // namespace tint

TEST_CASE("what a loss reads is read once, and every stage is recorded from it") {
  const TemporaryFolder folder;
  folder.write("half", "0.5");
  tint::reads = 0;
  StageSettings stage = tint::stage_of(R"({"tint": {"file": "half"}})");
  CHECK(tint::reads == 0);  // a config alone is not enough
  CHECK(stage.losses[0].second.weight == 0.25);
  CHECK(prepare_losses(stage).empty());
  CHECK(prepare_losses(stage).empty());
  CHECK(tint::reads == 1);
  const std::vector<LossTerm> terms = {tint::loss()};
  Tape<float> tape;
  LossInputs<float> inputs;
  inputs.rendered = tape.parameter("image", image_shape<float>(3, 2, 2));
  const std::vector<ParameterGroup<float>> groups = {{"image", {inputs.rendered}}};
  const auto loss_of = [&] { return run_stage<float>(tape, stage, terms, inputs, groups).terms[0].value; };
  const double first = loss_of();
  CHECK(loss_of() < first);
  CHECK(first < 0.25);
  CHECK(tint::reads == 1);
  for (auto& [name, loss] : stage.losses) loss.prepared.reset();
  loss_of();
  CHECK(tint::reads == 2);  // code that prepares nothing has it prepared
}

TEST_CASE("a loss that cannot be prepared is told with its place, unless it is off") {
  const TemporaryFolder folder;
  folder.write("bad", "nan");
  const auto faults_of = [](const std::string& losses) {
    StageSettings stage = tint::stage_of(losses);
    std::string text;
    for (const LossFault& fault : prepare_losses(stage)) text += fault.pointer + ": " + fault.text + "\n";
    return text;
  };
  CHECK(faults_of(R"({"tint": {"file": "bad"}})") == "/losses/tint/file: bad: is not finite\n");
  CHECK(faults_of(R"({"tint": {"file": "none"}})") == "/losses/tint/file: none: holds nothing\n");
  CHECK(faults_of(R"({"tint": {}})") == "/losses/tint: : holds nothing\n");  // names no file
  CHECK(faults_of(R"({"tint": {"file": "bad", "weight": 0}})").empty());
}

TEST_CASE("losses that need what a stage does not have are named, unless they are off") {
  StageSettings stage;
  for (const char* name :
       {"photometric", "masked_l2", "center", "depth", "mask", "fit", "contact", "annotated_contact", "grip", "smooth",
        "object_smooth", "ground", "foot_sliding", "penetration", "joint_limits", "pose_prior"})
    stage.losses.emplace_back(name, default_settings(term_named(name).description));
  std::string text;
  for (const LossFault& fault : losses_without_inputs(stage, kImageInputs, "a picture"))
    text += fault.pointer + ": " + fault.text + "\n";
  CHECK(text ==
        "/losses/center: this loss needs objects, which a picture does not have\n"
        "/losses/depth: this loss needs objects, which a picture does not have\n"
        "/losses/mask: this loss needs the body in an image, which a picture does not have\n"
        "/losses/fit: this loss needs the body, which a picture does not have\n"
        "/losses/contact: this loss needs the body, which a picture does not have\n"
        "/losses/annotated_contact: this loss needs the body, which a picture does not have\n"
        "/losses/grip: this loss needs the body, which a picture does not have\n"
        "/losses/smooth: this loss needs the body, which a picture does not have\n"
        "/losses/object_smooth: this loss needs the body, which a picture does not have\n"
        "/losses/ground: this loss needs the body, which a picture does not have\n"
        "/losses/foot_sliding: this loss needs the body, which a picture does not have\n"
        "/losses/penetration: this loss needs the body, which a picture does not have\n"
        "/losses/joint_limits: this loss needs the body, which a picture does not have\n"
        "/losses/pose_prior: this loss needs the body, which a picture does not have\n");
  CHECK(losses_without_inputs(stage, kMotionInputs, "a motion").size() == 5);  // the others
  for (auto& [name, loss] : stage.losses) loss.weight = 0;
  CHECK(losses_without_inputs(stage, kImageInputs, "a picture").empty());
}

}  // namespace stage_settings_test
