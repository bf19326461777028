#include "pipelines/cli/command_line.h"

#include <CLI/CLI.hpp>

#include "core/text.h"
#include "core/version.h"
#include "pipelines/cli/options.h"
#include "pipelines/cli/other_programs.h"

namespace hsi4d::cli {

CommandLine::CommandLine(const std::vector<LossTerm>& terms) : losses(descriptions_of(terms)) {
  app->set_version_flag("--version", std::string("hsi4d ") + version() + " (" + git_commit() + ")");

  add_run(terms);
  add_demo(terms);
  add_synth();
  add_select_camera();
  add_evaluate();
  add_report();
  add_study();
  add_sweep(terms);
  add_run_one(terms);
  add_render();
  add_gradients();
  add_avatar(terms);
  add_pose();
  add_motion();
  add_convert();
  add_info();
  for (const OtherProgram& other : kOtherPrograms) app->add_subcommand(other.command, other.summary);
  add_gradcheck(terms);
  add_check();
  add_schema();
  add_list();
}

void CommandLine::add_gradcheck(const std::vector<LossTerm>& terms) {
  GradcheckArguments& a = gradcheck;
  CLI::App* command = app->add_subcommand(
      "gradcheck",
      "Check the gradient of a stage, its whole loss by each parameter group, against differences in double");
  command->add_option("CONFIG", a.config, "The config file, with its data")->required();
  command->add_option("--stage", a.check.stage, "Which of its stages")->type_name("S")->required();
  add_overrides(*command, a.overrides);
  command->add_option("--frame", a.check.frame, "The frame, of a stage over frames; default: 3, or the last of fewer")
      ->check(whole_number())
      ->type_name("I");
  command
      ->add_option("--entries", a.check.entries,
                   "Numbers that are tried of each array, at random; each takes six renders or more")
      ->capture_default_str()
      ->check(CLI::Range(1, 1000000))
      ->type_name("N");
  command->add_option("--seed", a.check.seed, "Which numbers these are, and the disturbance")
      ->capture_default_str()
      ->check(whole_number())
      ->type_name("N");
  add_threads(*command, a.threads);
  command->add_option("--json", a.json, "File for the figures, one JSON object a group")->type_name("F");
  command->footer(
      "The state is that in which the frame would begin, every number of the groups disturbed by up to 0.01.\n"
      "Numbers at a kink (Gaussians change places, a pixel is just reached) are told and judge nothing.\n"
      "It is quick in small images: --set approx.longest_side_px=64.\n"
      "Exit status: 1 when a gradient is wrong, or too many kinks leave it open.");
  command->callback([this, &terms] { run = [this, &terms] { return gradcheck_command(gradcheck, terms, status); }; });
}

void CommandLine::add_check() {
  CLI::App* check = app->add_subcommand("check", "Check a config and everything that it extends; tells all problems");
  check->add_option("CONFIG", config, "The config file")->required();
  add_overrides(*check, overrides);
  check->add_flag("--print-config", print_config, "Print the config with every default filled in");
  check->callback([this] { run = [this] { return check_command(config, overrides, print_config, losses); }; });
}

void CommandLine::add_schema() {
  CLI::App* schema = app->add_subcommand("schema", "Print the JSON Schema of configs, for editors");
  schema->add_option("KIND", kind, "Of which configs: " + joined(schema_kinds()) + "; default: run");
  schema->callback([this] { run = [this] { return schema_command(kind, losses); }; });
}

void CommandLine::add_list() {
  CLI::App* list = app->add_subcommand("list", "List what configs can name");
  list->add_option("TOPIC", topic, joined(list_topics()))->required();
  list->callback([this] { run = [this] { return list_command(topic, losses); }; });
}

}  // namespace hsi4d::cli
