// The built program while it runs beside a test, to be stopped by signals.
#pragma once

#include <csignal>
#include <fcntl.h>
#include <string>
#include <sys/wait.h>
#include <unistd.h>
#include <vector>

#include "tests/support/temporary_folder.h"

namespace hsi4d::test {

/// The program, running beside the test.
class RunningProgram {
 public:
  explicit RunningProgram(const std::vector<std::string>& arguments) {
    std::vector<std::string> words = {HSI4D_PROGRAM};
    words.insert(words.end(), arguments.begin(), arguments.end());
    std::vector<char*> argv;
    for (std::string& word : words) argv.push_back(word.data());
    argv.push_back(nullptr);
    process_ = ::fork();
    if (process_ != 0) return;
    const int out = ::open("running.txt", O_WRONLY | O_CREAT | O_TRUNC, 0666);
    ::dup2(out, STDOUT_FILENO);
    ::dup2(out, STDERR_FILENO);
    ::signal(SIGINT, SIG_DFL);  // whatever started the tests may have it ignored
    ::execv(argv[0], argv.data());
    ::_exit(126);
  }
  ~RunningProgram() {
    if (!is_running()) return;
    ::kill(process_, SIGKILL);
    ::waitpid(process_, &status_, 0);
  }
  RunningProgram(const RunningProgram&) = delete;
  RunningProgram& operator=(const RunningProgram&) = delete;

  bool is_running() {
    if (!has_ended_) has_ended_ = ::waitpid(process_, &status_, WNOHANG) == process_;
    return !has_ended_;
  }

  /// Sends a signal as soon as `moment` has come, and waits for the end. False when it ended before that.
  template <class F>
  bool signal_at(int signal, F&& moment) {
    while (!moment()) {
      if (!is_running()) return false;
      ::usleep(200);
    }
    ::kill(process_, signal);
    if (!has_ended_) ::waitpid(process_, &status_, 0);
    has_ended_ = true;
    return WIFSIGNALED(status_) || WEXITSTATUS(status_) != 0;
  }

  /// The exit status, or the negative of the signal that ended it.
  int result() const { return WIFSIGNALED(status_) ? -WTERMSIG(status_) : WEXITSTATUS(status_); }
  std::string text() const { return file_text("running.txt"); }

 private:
  pid_t process_ = -1;
  bool has_ended_ = false;
  int status_ = 0;
};

}  // namespace hsi4d::test
