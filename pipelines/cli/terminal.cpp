#include "pipelines/cli/terminal.h"

#include <cstdio>
#include <cstdlib>
#include <string>
#include <sys/ioctl.h>
#include <unistd.h>

#include "pipelines/cli/interrupt.h"

namespace hsi4d::cli {
namespace {

constexpr double kTerminalInterval = 0.1, kPlainInterval = 10;  // seconds
constexpr int kUsualColumns = 80;

int terminal_columns(int file) {
  winsize size{};
  return ioctl(file, TIOCGWINSZ, &size) == 0 && size.ws_col > 0 ? size.ws_col : kUsualColumns;
}

void show_bar(const ProgressState& state) {
  // One column stays free: writing the last one makes some terminals wrap. "\x1b[K" clears what a longer line left.
  std::string text = "\r";
  text.append(progress_bar(state, terminal_columns(STDERR_FILENO) - 1))
      .append("\x1b[K")
      .append(state.is_finished ? "\n" : "");
  std::fputs(text.c_str(), stderr);
  std::fflush(stderr);
}

void show_line(const ProgressState& state) { std::fprintf(stderr, "%s\n", progress_line(state).c_str()); }

}  // namespace

bool stderr_is_terminal() {
  const char* const term = std::getenv("TERM");
  return isatty(STDERR_FILENO) != 0 && term != nullptr && std::string(term) != "dumb" && *term != '\0';
}

std::optional<int> stdout_columns() {
  if (isatty(STDOUT_FILENO) == 0) return std::nullopt;
  return terminal_columns(STDOUT_FILENO);
}

Observer observer_on_terminal(bool quiet) {
  Observer observer;
  const bool is_terminal = stderr_is_terminal();
  if (!quiet) observer.progress = is_terminal ? show_bar : show_line;
  observer.progress_interval = is_terminal ? kTerminalInterval : kPlainInterval;
  observer.stop_requested = [] { return InterruptWatch::requested(); };
  return observer;
}

}  // namespace hsi4d::cli
