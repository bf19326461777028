// The command line: the only file that includes CLI11.
#include "pipelines/cli/program.h"

#include <algorithm>
#include <cstdio>
#include <functional>
#include <new>

#include <CLI/CLI.hpp>

#include "core/check.h"
#include "core/log.h"
#include "core/suggest.h"
#include "core/version.h"
#include "pipelines/cli/commands.h"
#include "pipelines/cli/report_command.h"

namespace hsi4d::cli {
namespace {

constexpr const char* kReport = "this is a bug in hsi4d, please report it: ";

void print(const std::string& text) {
  const bool written = std::fwrite(text.data(), 1, text.size(), stdout) == text.size() && std::fflush(stdout) == 0;
  if (!written) throw UserError("hsi4d: standard output cannot be written to");
}

int complain(const Failure& failure) {
  std::fprintf(stderr, "%s\n", failure.message.c_str());
  return failure.status;
}

/// The subcommands with their arguments; `run` is what the chosen one does.
struct CommandLine {
  CLI::App app{"4D human-scene interaction from video by differentiable Gaussian splatting", "hsi4d"};
  std::string config, topic;
  std::vector<std::string> overrides, runs;
  bool print_config = false;
  std::function<std::string()> run;

  explicit CommandLine(const std::vector<LossDescription>& losses) {
    app.set_version_flag("--version", std::string("hsi4d ") + version());
    app.require_subcommand(1);
    app.failure_message(CLI::FailureMessage::simple);

    CLI::App* check = app.add_subcommand("check", "Check a config and everything that it extends; tells all problems");
    check->add_option("CONFIG", config, "The config file")->required();
    add_overrides(*check);
    check->add_flag("--print-config", print_config, "Print the config with every default filled in");
    check->callback(
        [this, &losses] { run = [this, &losses] { return check_command(config, overrides, print_config, losses); }; });

    CLI::App* schema = app.add_subcommand("schema", "Print the JSON Schema of configs, for editors");
    schema->callback([this, &losses] { run = [&losses] { return schema_command(losses); }; });

    CLI::App* list = app.add_subcommand("list", "List what configs can name: losses, settings");
    list->add_option("TOPIC", topic, "losses or settings")->required();
    list->callback([this, &losses] { run = [this, &losses] { return list_command(topic, losses); }; });

    CLI::App* report = app.add_subcommand("report", "Write report.html of runs, and print their errors");
    report->add_option("RUN", runs, "Folders of runs")->required();
    report->callback([this] { run = [this] { return report_command(runs); }; });
  }

  std::vector<std::string> command_names() {
    std::vector<std::string> names;
    for (const CLI::App* command : app.get_subcommands([](const CLI::App*) { return true; }))
      names.push_back(command->get_name());
    return names;
  }

 private:
  void add_overrides(CLI::App& command) {
    command.add_option("--set", overrides, "Change one setting: render.blur=0.1. The value is JSON, or else text")
        ->type_name("KEY=VALUE")
        ->expected(1)
        ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll)
        ->allow_extra_args(false);
  }
};

std::string join(const std::vector<std::string>& names) {
  std::string text;
  for (const std::string& name : names) text += (text.empty() ? "" : ", ") + name;
  return text;
}

/// Refuses a first word that is no command or option, with the nearest one: CLI11 would only call it unexpected.
void check_command_word(int argc, const char* const* argv, CommandLine& line) {
  const std::vector<std::string> names = line.command_names();
  if (argc < 2) throw UserError("hsi4d: give a command: " + join(names) + "; `hsi4d --help` explains them");
  const std::string word = argv[1];
  const std::vector<std::string> options = {"-h", "--help", "--version"};
  const bool is_option = word.starts_with("-");
  const std::vector<std::string>& known = is_option ? options : names;
  if (std::find(known.begin(), known.end(), word) != known.end()) return;
  throw UserError("hsi4d: there is no " + std::string(is_option ? "option" : "command") + " \"" + word +
                  "\"; known: " + join(known) + did_you_mean(word, known));
}

void run_commands(int argc, const char* const* argv, const std::vector<LossDescription>& losses) {
  CommandLine line(losses);
  check_command_word(argc, argv, line);
  try {
    line.app.parse(argc, argv);
  } catch (const CLI::CallForHelp&) {
    return print(line.app.help());  // of the subcommand, if one was named
  } catch (const CLI::CallForVersion& version_text) {
    return print(std::string(version_text.what()) + "\n");
  } catch (const CLI::ParseError& mistake) {
    const auto chosen = line.app.get_subcommands();
    const std::string command = chosen.empty() ? "hsi4d" : "hsi4d " + chosen.front()->get_name();
    throw UserError(command + ": " + mistake.what() + "; `" + command + " --help` explains its arguments");
  }
  print(line.run());
}

}  // namespace

Failure describe_failure(const std::exception_ptr& error) {
  try {
    std::rethrow_exception(error);
  } catch (const UserError& mistake) {
    return {kUserMistake, mistake.what()};
  } catch (const DataError& mistake) {
    return {kUserMistake, mistake.what()};
  } catch (const std::bad_alloc&) {
    return {kUserMistake, "hsi4d: there is not enough memory for this"};
  } catch (const std::exception& bug) {
    return {kOurBug, kReport + std::string(bug.what())};
  } catch (...) {
    return {kOurBug, kReport + std::string("an exception of unknown type")};
  }
}

int run_program(int argc, const char* const* argv, const std::vector<LossDescription>& losses) {
  try {
    const LogSink to_stderr = log_to(
        [](LogLevel level, std::string_view message) {
          std::fprintf(stderr, "hsi4d: %s%.*s\n",
                       level == LogLevel::kInfo ? "" : (std::string(log_level_name(level)) + ": ").c_str(),
                       static_cast<int>(message.size()), message.data());
        },
        LogLevel::kInfo);
    run_commands(argc, argv, losses);
    return kDone;
  } catch (...) {
    return complain(describe_failure(std::current_exception()));
  }
}

}  // namespace hsi4d::cli
