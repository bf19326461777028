// Another program that runs beside this one, watched without waiting.
#pragma once

#include <chrono>
#include <optional>
#include <string>
#include <vector>

namespace hsi4d {

/// How a program ended.
struct ProgramEnd {
  int status = 0;        ///< exit status, where no signal ended it
  int signal = 0;        ///< that ended it; 0: none
  bool is_known = true;  ///< false: it is gone, and the system has been asked not to tell how (SIGCHLD ignored)
  double peak_mb = 0;    ///< the most memory that it had; where that is less than we had, as far as we have looked
};

/// A program with a process group of its own, so that what the terminal sends to us (Ctrl-C) is for us to pass on. It
/// reads nothing, and what it prints is appended to a file.
class BackgroundProgram {
 public:
  /// Starts a program.
  /// @param command  the program, looked up in PATH, and its arguments; no shell is involved
  /// @param output   the file for what it prints, UTF-8; its folder must be there
  /// Throws UserError naming the file, ProgramNotStartedError naming the program.
  BackgroundProgram(const std::vector<std::string>& command, const std::string& output);
  /// Kills it with its group if it still runs.
  ~BackgroundProgram();
  BackgroundProgram(const BackgroundProgram&) = delete;
  BackgroundProgram& operator=(const BackgroundProgram&) = delete;

  /// How it ended; nothing while it runs.
  std::optional<ProgramEnd> ended();
  /// Sends a signal to it, if it still runs.
  void send(int signal) const;
  /// The most memory that it has had so far, MB; 0 where the system does not tell.
  double peak_mb();
  /// Since it was started.
  double seconds() const;

 private:
  int pid_ = -1;
  double peak_mb_ = 0;      // as far as we have looked
  double our_peak_mb_ = 0;  // of this process, when it started the program
  std::optional<ProgramEnd> end_;
  std::chrono::steady_clock::time_point begin_;
};

/// Asks the system to end this process as politely as SIGTERM does when the process `parent`, which has started it,
/// ends, however it ends. Ends at once if that is gone already.
void end_with_parent(int parent);

}  // namespace hsi4d
