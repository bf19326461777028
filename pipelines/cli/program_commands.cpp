#include "pipelines/cli/program_commands.h"

#include <csignal>
#include <cstdio>
#include <string_view>
#include <utility>
#include <vector>

#include <CLI/CLI.hpp>

#include "core/check.h"
#include "core/log.h"
#include "core/simd.h"
#include "pipelines/cli/command_words.h"

namespace hsi4d::cli {
namespace {

void print(const std::string& text) {
  const bool written = std::fwrite(text.data(), 1, text.size(), stdout) == text.size() && std::fflush(stdout) == 0;
  if (!written) throw UserError("hsi4d: standard output cannot be written to");
}

int complain(const Failure& failure) {
  std::fprintf(stderr, "%s\n", failure.message.c_str());
  return failure.status;
}

/// What a command knows, and its commands.
CommandWords words_of(const CLI::App& command) {
  CommandWords words{command.get_name(), {}, {}, command.get_require_subcommand_min() > 0};
  for (const CLI::App* part : command.get_subcommands([](const CLI::App*) { return true; }))
    words.commands.push_back(words_of(*part));
  for (const CLI::Option* option : command.get_options()) {
    for (const std::string& name : option->get_lnames()) words.options.push_back("--" + name);
  }
  return words;
}

int parse_and_run(int argc, const char* const* argv, CLI::App& app, Program& program) {
  check_words(argc, argv, words_of(app));
  try {
    app.parse(argc, argv);
  } catch (const CLI::CallForHelp&) {
    print(app.help());  // of the subcommand, if one was named
    return kDone;
  } catch (const CLI::CallForVersion& version_text) {
    print(std::string(version_text.what()) + "\n");
    return kDone;
  } catch (const CLI::ParseError& mistake) {
    std::string command = "hsi4d";
    for (auto chosen = app.get_subcommands(); !chosen.empty(); chosen = chosen.front()->get_subcommands())
      command += " " + chosen.front()->get_name();
    throw UserError(command + ": " + mistake.what() + "; `" + command + " --help` explains its arguments");
  }
  print(program.run());
  return program.status;
}

}  // namespace

void run_when_chosen(CLI::App& command, Program& program, std::function<std::string()> run) {
  command.callback([&program, run = std::move(run)] { program.run = run; });
}

int run_commands(int argc, const char* const* argv, const AddCommands& add, const std::vector<LossTerm>& terms) {
  try {
    const LogSink to_stderr = log_to(
        [](LogLevel level, std::string_view message) {
          std::fprintf(stderr, "hsi4d: %s%.*s\n",
                       level == LogLevel::kInfo ? "" : (std::string(log_level_name(level)) + ": ").c_str(),
                       static_cast<int>(message.size()), message.data());
        },
        LogLevel::kInfo);
    std::signal(SIGCHLD, SIG_DFL);  // whoever has started us may have it ignored: no program's end would be told us
    best_isa();                     // before any kernel runs
    CLI::App app("4D human-scene interaction from video by differentiable Gaussian splatting", "hsi4d");
    app.require_subcommand(1);
    app.failure_message(CLI::FailureMessage::simple);
    Program program{.terms = terms};
    add(app, program);
    return parse_and_run(argc, argv, app, program);
  } catch (...) {
    return complain(describe_failure(std::current_exception()));
  }
}

int run_command_program(const char* command, int argc, const char* const* argv, const AddCommands& add,
                        const std::vector<LossTerm>& terms) {
  std::vector<const char*> words = {"hsi4d", command};
  if (argc > 1) words.insert(words.end(), argv + 1, argv + argc);
  const int count = static_cast<int>(words.size());
  words.push_back(nullptr);
  return run_commands(count, words.data(), add, terms);
}

}  // namespace hsi4d::cli
