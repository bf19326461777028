#include "pipelines/cli/command_line.h"

#include <charconv>
#include <limits>

#include <CLI/CLI.hpp>

#include "core/config_value.h"
#include "core/text.h"
#include "core/version.h"

namespace hsi4d::cli {

CLI::Validator whole_number(std::int64_t most) {
  return CLI::Validator(
      [most](const std::string& text) {
        std::int64_t number = -1;
        const auto end = std::from_chars(text.data(), text.data() + text.size(), number);
        if (end.ec == std::errc() && end.ptr == text.data() + text.size() && number >= 0 && number <= most)
          return std::string();
        const bool is_open = most == std::numeric_limits<std::int64_t>::max();
        return json_string(text) + " is out of range, or not a whole number; allowed: 0 " +
               (is_open ? "or more" : "to " + std::to_string(most));
      },
      "");
}

CommandLine::~CommandLine() = default;

CommandLine::CommandLine(const std::vector<LossTerm>& terms)
    : app(std::make_unique<CLI::App>("4D human-scene interaction from video by differentiable Gaussian splatting",
                                     "hsi4d")),
      losses(descriptions_of(terms)) {
  app->set_version_flag("--version", std::string("hsi4d ") + version() + " (" + git_commit() + ")");
  app->require_subcommand(1);
  app->failure_message(CLI::FailureMessage::simple);

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
  add_bench(terms);
  add_stress();
  add_gradcheck(terms);
  add_check();
  add_schema();
  add_list();
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

void CommandLine::add_threads(CLI::App& command, std::optional<int>& threads) {
  command.add_option("--threads", threads, "Threads, 0: one a core; results do not depend on it")
      ->check(whole_number(1024))
      ->type_name("N");
}

void CommandLine::add_overrides(CLI::App& command, std::vector<std::string>& overrides) {
  add_several(command, "--set", overrides, "Change one setting: render.blur=0.1. The value is JSON, or else text")
      ->type_name("KEY=VALUE");
}

CLI::Option* CommandLine::add_several(CLI::App& command, const std::string& name, std::vector<std::string>& values,
                                      const std::string& description) {
  return command.add_option(name, values, description)
      ->expected(1)
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll)
      ->allow_extra_args(false);
}

}  // namespace hsi4d::cli
