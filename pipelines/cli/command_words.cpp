#include "pipelines/cli/command_words.h"

#include <algorithm>

#include "core/check.h"
#include "core/suggest.h"
#include "core/text.h"

namespace hsi4d::cli {

namespace {

std::vector<std::string> names_of(const std::vector<CommandWords>& commands) {
  std::vector<std::string> names;
  for (const CommandWords& command : commands) names.push_back(command.name);
  return names;
}

/// The command of that name, or null.
const CommandWords* find_command(const std::vector<CommandWords>& commands, const std::string& name) {
  const auto found = std::find_if(commands.begin(), commands.end(),
                                  [&name](const CommandWords& command) { return command.name == name; });
  return found == commands.end() ? nullptr : &*found;
}

void check_first_word(int argc, const char* const* argv, const CommandWords& program) {
  const std::vector<std::string> names = names_of(program.commands);
  if (argc < 2) throw UserError("hsi4d: give a command: " + joined(names) + "; `hsi4d --help` explains them");
  const std::string word = argv[1];
  const std::vector<std::string> options = {"-h", "--help", "--version"};
  const bool is_option = word.starts_with("-");
  const std::vector<std::string>& known = is_option ? options : names;
  if (std::find(known.begin(), known.end(), word) != known.end()) return;
  throw UserError("hsi4d: there is no " + std::string(is_option ? "option" : "command") + " \"" + word +
                  "\"; known: " + joined(known) + did_you_mean(word, known));
}

/// Of a command with commands of its own: the one that was named, or null where an option stands in its place or none
/// is needed.
const CommandWords* chosen_part(int argc, const char* const* argv, const CommandWords& command) {
  const std::string word = argc > 2 ? argv[2] : "";
  if (const CommandWords* const part = find_command(command.commands, word)) return part;
  if (word.starts_with("-") || (word.empty() && !command.needs_command)) return nullptr;
  const std::vector<std::string> names = names_of(command.commands);
  throw UserError("hsi4d " + command.name + ": " +
                  (argc > 2 ? "there is no command \"" + word + "\"" : "give a command") + "; known: " + joined(names) +
                  (argc > 2 ? did_you_mean(word, names) : ""));
}

void check_options(int argc, const char* const* argv, const CommandWords& command) {
  const CommandWords* const part = command.commands.empty() ? nullptr : chosen_part(argc, argv, command);
  const std::vector<std::string>& known = (part != nullptr ? *part : command).options;
  const std::string words = command.name + (part != nullptr ? " " + part->name : "");
  for (int i = 2; i < argc; ++i) {
    const std::string word = std::string(argv[i]).substr(0, std::string(argv[i]).find('='));
    if (word == "--") return;
    if (!word.starts_with("--") || std::find(known.begin(), known.end(), word) != known.end()) continue;
    throw UserError("hsi4d " + words + ": there is no option \"" + word + "\"; known: " + joined(known) +
                    did_you_mean(word, known));
  }
}

}  // namespace

void check_words(int argc, const char* const* argv, const CommandWords& program) {
  check_first_word(argc, argv, program);
  if (const CommandWords* const command = find_command(program.commands, argv[1])) check_options(argc, argv, *command);
}

}  // namespace hsi4d::cli
