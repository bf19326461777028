// Other programs, run as children.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "core/check.h"

namespace hsi4d {

/// A program could not be started: most likely it is not installed.
class ProgramNotStartedError : public UserError {
 public:
  using UserError::UserError;
};

/// Where a program's standard output goes: collected for `finish`, or read as it comes.
enum class ChildOutput { kCollected, kRead };

/// A program that runs until `finish`. It does not see our standard input.
class ChildProcess {
 public:
  /// Starts a program.
  /// @param command  the program, looked up in PATH, and its arguments; no shell is involved
  /// Throws ProgramNotStartedError naming the program.
  explicit ChildProcess(std::vector<std::string> command, ChildOutput output = ChildOutput::kCollected);
  /// Ends a child that nobody waited for.
  ~ChildProcess();
  ChildProcess(const ChildProcess&) = delete;
  ChildProcess& operator=(const ChildProcess&) = delete;

  /// Gives the program something to read on its standard input.
  /// @return  false where it no longer reads: `finish` tells why
  bool write(std::span<const uint8_t> bytes);

  /// Reads its standard output, where that is read: as many bytes as are asked for, or fewer at its end.
  std::size_t read(std::span<uint8_t> bytes);

  /// Closes its standard input and waits for its end.
  /// @return  what it printed on standard error, and on standard output where that is collected
  /// Throws UserError with the program's name, its exit status or signal, and the end of what it printed, unless it
  /// ended with status 0.
  std::string finish();

 private:
  std::vector<std::string> command_;
  int pid_ = -1, input_ = -1, output_ = -1;
  int stream_ = -1;  // its standard output, where that is read
};

/// Runs a program to its end. As ChildProcess, without input.
std::string run_process(std::vector<std::string> command);

}  // namespace hsi4d
