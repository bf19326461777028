#include "pipelines/cli/other_programs.h"

#include <filesystem>
#include <string>
#include <string_view>
#include <system_error>
#include <unistd.h>

#include <CLI/CLI.hpp>

#include "core/check.h"
#include "core/system_message.h"
#include "pipelines/cli/list.h"

namespace hsi4d::cli {

void add_other_programs(CLI::App& app, Program&) {
  for (const OtherProgram& other : kOtherPrograms) app.add_subcommand(other.command, other.summary);
}

bool is_other_program(int argc, const char* const* argv) {
  if (argc < 2) return false;
  for (const OtherProgram& other : kOtherPrograms) {
    if (std::string_view(argv[1]) == other.command) return true;
  }
  return false;
}

void become_other_program(const char* const* argv) {
  const std::string command = argv[1];
  std::error_code error;
  const std::filesystem::path own = std::filesystem::read_symlink("/proc/self/exe", error);
  const std::filesystem::path program = own.parent_path() / ("hsi4d-" + command);
  if (!std::filesystem::exists(program, error))
    throw UserError("hsi4d " + command + ": there is no program " + program.string() +
                    "; `cmake --build --preset release --target hsi4d-" + command + "` builds it");
  execv(program.c_str(), const_cast<char* const*>(argv + 1));
  throw UserError("hsi4d " + command + ": " + program.string() + " cannot be started: " + system_message(errno));
}

}  // namespace hsi4d::cli
