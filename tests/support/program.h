// Runs the built program as a user would.
#pragma once

#include <cstdlib>
#include <string>
#include <sys/wait.h>
#include <vector>

#include "tests/support/temporary_folder.h"

namespace hsi4d::test {

/// What a run of the program left.
struct ProgramResult {
  int status = -1;  ///< exit status; -1 when a signal ended it
  std::string out, err;
};

/// Runs HSI4D_PROGRAM with these arguments in the current folder, which receives two small files.
inline ProgramResult run_hsi4d(const std::vector<std::string>& arguments) {
  const auto in_quotes = [](const std::string& text) {
    std::string out = "'";
    for (const char c : text) out += c == '\'' ? std::string("'\\''") : std::string(1, c);
    return out + "'";
  };
  std::string command = in_quotes(HSI4D_PROGRAM);
  for (const std::string& argument : arguments) command += " " + in_quotes(argument);
  const int status = std::system((command + " > stdout.txt 2> stderr.txt < /dev/null").c_str());
  return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, file_text("stdout.txt"), file_text("stderr.txt")};
}

}  // namespace hsi4d::test
