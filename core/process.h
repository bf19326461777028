// Other programs, run as children.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
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

/// A program ended by itself with another status than 0.
class ProgramFailedError : public UserError {
 public:
  ProgramFailedError(const std::string& message, int status) : UserError(message), status_(status) {}
  int status() const { return status_; }

 private:
  int status_;
};

/// Where a program's standard output goes: collected for `finish`, or read as it comes.
enum class ChildOutput { kCollected, kRead };

/// What a program gets that may take long.
struct ProcessLimits {
  double seconds = 0;                         ///< after which it is ended; 0: it takes as long as it takes
  std::function<bool()> stop_requested = {};  ///< asked many times a second; empty: never
};

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

  /// Closes its standard input and waits for its end. What it has started in its process group and left behind is ended
  /// then: asked to (SIGTERM), and killed two seconds later where it does not go.
  /// @return  what it printed on standard error, and on standard output where that is collected
  /// Throws ProgramFailedError with the program's name, its exit status and the end of what it printed, unless that is
  /// 0; UserError with the signal that ended it.
  std::string finish();

  /// As finish, within limits: see run_process.
  std::optional<std::string> finish(const ProcessLimits& limits);

 private:
  /// Waits until `seconds` are over. @return  whether it has ended; it is still to be waited for
  bool has_ended_within(double seconds, const std::function<bool()>& stop_requested);
  /// Ends it with its group, or what is left of that where it has ended: SIGTERM, SIGKILL two seconds later.
  void end();
  /// Its end is known: what it printed, or what is thrown of it.
  std::string result();

  std::vector<std::string> command_;
  int pid_ = -1, input_ = -1, output_ = -1;
  int status_ = 0;   // as waitpid gives it, once it has ended
  int stream_ = -1;  // its standard output, where that is read
};

/// The end of what a program printed, to go on with after a message: ":\n..." or "; it printed nothing".
std::string end_of_output(const std::string& text);

/// The file of a program as a command would start it: a name with a '/' itself, others from the folders of PATH; empty
/// where there is none that can be executed.
std::string find_program(const std::string& name);

/// Runs a program to its end, or to that of its time. It is ended with all that it has started in its process group, as
/// after ChildProcess::finish; what has made a session of its own (setsid) goes on.
/// @return  as `finish`; nothing when it was asked to stop
/// Throws as `finish`; UserError with the program's name and the end of what it printed when its time is over.
std::optional<std::string> run_process(std::vector<std::string> command, const ProcessLimits& limits);

/// Runs a program to its end. As ChildProcess, without input.
std::string run_process(std::vector<std::string> command);

}  // namespace hsi4d
