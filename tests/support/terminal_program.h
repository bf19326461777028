// The built program on a terminal of a given width.
#pragma once

#include <cstdlib>
#include <pty.h>
#include <string>
#include <sys/ioctl.h>
#include <sys/wait.h>
#include <unistd.h>
#include <vector>

namespace hsi4d::test {

/// What the program writes onto a terminal, stdout and stderr together, with line feeds alone.
/// @param status  receives its exit status; -1 when a signal ended it
inline std::string on_terminal(std::vector<std::string> arguments, int columns, int& status) {
  arguments.insert(arguments.begin(), HSI4D_PROGRAM);
  std::vector<char*> argv;
  for (std::string& word : arguments) argv.push_back(word.data());
  argv.push_back(nullptr);
  winsize size{};
  size.ws_row = 24;
  size.ws_col = static_cast<unsigned short>(columns);
  int terminal = -1;
  const pid_t process = ::forkpty(&terminal, nullptr, nullptr, &size);
  if (process == 0) {
    ::setenv("TERM", "xterm", 1);
    ::execv(argv[0], argv.data());
    ::_exit(126);
  }
  std::string text;
  char buffer[4096];
  for (ssize_t count; (count = ::read(terminal, buffer, sizeof buffer)) > 0;)
    text.append(buffer, static_cast<std::size_t>(count));
  int how = 0;
  ::waitpid(process, &how, 0);
  ::close(terminal);
  status = WIFEXITED(how) ? WEXITSTATUS(how) : -1;
  std::erase(text, '\r');
  return text;
}

}  // namespace hsi4d::test
