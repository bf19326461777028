// The words of a command line that the program does not know, told with the nearest one that it does.
#pragma once

#include <string>
#include <vector>

namespace hsi4d::cli {

/// A command, or the program itself: what may follow its name.
struct CommandWords {
  std::string name;
  std::vector<CommandWords> commands;  ///< of which one may follow
  std::vector<std::string> options;    ///< long ones: "--out"
  bool needs_command = false;          ///< one of the commands has to follow
};

/// Refuses a command line without a command, and one with a command or a long option that is not known: the parser
/// would call the first unexpected, and ask for what is missing before it told the second. Throws UserError, which
/// lists what is known.
/// @param argc, argv  as main has them
void check_words(int argc, const char* const* argv, const CommandWords& program);

}  // namespace hsi4d::cli
