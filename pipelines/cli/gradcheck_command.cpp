#include "pipelines/cli/gradcheck_command.h"

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "core/file.h"
#include "core/formatted.h"
#include "core/text.h"
#include "pipelines/cli/failure.h"
#include "pipelines/cli/list.h"
#include "pipelines/cli/options.h"
#include "pipelines/cli/run_command.h"
#include "pipelines/cli/text.h"

namespace hsi4d::cli {

namespace {

const char* verdict(const GroupGradcheck& group) {
  if (group.numbers == 0) return "nothing to move";
  if (!group.report.failures.empty()) return "WRONG";
  return group.report.ok() ? "right" : "TOO MANY KINKS";
}

std::string error_text(const GroupGradcheck& group) {
  return group.report.kinks == group.report.entries ? "-" : formatted("%.1e", group.report.worst_error);
}

std::string heading(const StageCheck& check) {
  std::string text = "stage " + check.stage;
  text += check.frame ? ", frame " + std::to_string(*check.frame) : ", all frames";
  text += ": loss " + rounded(check.found.loss, 6) + " =";
  for (const LossValue& term : check.found.terms)
    text += (&term == &check.found.terms.front() ? " " : " + ") + rounded(term.weight, 4) + " * " + term.name + " " +
            rounded(term.value, 6);
  if (!check.found.off.empty()) text += "; off: " + joined(check.found.off);
  return text + "\n";
}

std::string group_table(const StageCheck& check) {
  Table table{.head = {"GROUP", "NUMBERS", "TRIED", "AT KINKS", "WORST ERROR", ""}};
  for (const GroupGradcheck& group : check.found.groups)
    table.rows.push_back(
        {group.group, group.numbers, group.report.entries, group.report.kinks, error_text(group), verdict(group)});
  return table_text(table);
}

std::string json_line(const StageCheck& check, const GroupGradcheck& group) {
  nlohmann::ordered_json line = {{"stage", check.stage}};
  if (check.frame) line["frame"] = *check.frame;
  line.update({{"group", group.group},
               {"numbers", group.numbers},
               {"tried", group.report.entries},
               {"at_kinks", group.report.kinks},
               {"worst_error", group.report.worst_error},
               {"tolerance", check.tolerance},
               {"verdict", verdict(group)}});
  return line.dump() + "\n";
}

}  // namespace

std::string gradcheck_command(const GradcheckArguments& arguments, const std::vector<LossTerm>& losses, int& status) {
  const RunConfig config =
      load_run_config(arguments.config, arguments.overrides, descriptions_of(losses), ConfigUse::kRun);
  StageCheckOptions options = arguments.check;
  options.threads = run_threads(arguments.threads);
  const StageCheck check = check_stage(config, losses, options);
  std::string text = heading(check) + group_table(check), json;
  for (const GroupGradcheck& group : check.found.groups) {
    json += json_line(check, group);
    if (group.numbers > 0 && !group.report.ok()) text += group.group + ": " + group.report.text() + "\n";
  }
  if (!arguments.json.empty()) write_text_file(arguments.json, json);
  text += formatted("allowed: %.0e, relative to the larger of the number's gradient and the array's root mean square\n",
                    check.tolerance);
  if (!check.found.ok()) status = kRowsFailed;
  return text;
}

void add_gradcheck(CLI::App& app, Program& program) {
  GradcheckArguments& a = program.options<GradcheckArguments>();
  CLI::App* command = app.add_subcommand(
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
  run_when_chosen(*command, program, [&] { return gradcheck_command(a, program.terms, program.status); });
}

}  // namespace hsi4d::cli
