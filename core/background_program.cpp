#include "core/background_program.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <fcntl.h>
#include <fstream>
#include <spawn.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include "core/process.h"
#include "core/system_message.h"

extern char** environ;  // POSIX asks programs to declare it

namespace hsi4d {
namespace {

constexpr double kKibPerMb = 1024;

/// Number behind a word at the beginning of a line of a file of /proc, in KiB as it has them; negative: there is none.
double proc_number(const std::string& file, const std::string& word) {
  std::ifstream text(file);
  for (std::string line; std::getline(text, line);) {
    if (line.starts_with(word)) return std::strtod(line.c_str() + word.size(), nullptr);
  }
  return -1;
}

/// Starts the program; 0, or an error number.
int spawn(const std::vector<std::string>& command, const std::string& output, int& pid) {
  std::vector<char*> arguments;
  for (const std::string& argument : command) arguments.push_back(const_cast<char*>(argument.c_str()));
  arguments.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, 0, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_addopen(&actions, 1, output.c_str(), O_WRONLY | O_CREAT | O_APPEND, 0666);
  posix_spawn_file_actions_adddup2(&actions, 1, 2);
  posix_spawnattr_t attributes;
  posix_spawnattr_init(&attributes);
  sigset_t usual;  // a shell that starts us with & may have us ignore some, which the program would take over
  sigemptyset(&usual);
  for (const int signal : {SIGINT, SIGTERM, SIGUSR1, SIGCHLD}) sigaddset(&usual, signal);
  posix_spawnattr_setsigdefault(&attributes, &usual);
  posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETPGROUP | POSIX_SPAWN_SETSIGDEF);
  const int error = posix_spawnp(&pid, command.front().c_str(), &actions, &attributes, arguments.data(), environ);
  posix_spawnattr_destroy(&attributes);
  posix_spawn_file_actions_destroy(&actions);
  return error;
}

}  // namespace

BackgroundProgram::BackgroundProgram(const std::vector<std::string>& command, const std::string& output)
    : begin_(std::chrono::steady_clock::now()) {
  HSI4D_CHECK(!command.empty(), "a command needs a program");
  const int file = ::open(output.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0666);
  if (file < 0) throw UserError(output + ": cannot be written: " + system_message(errno));
  ::close(file);
  const int error = spawn(command, output, pid_);
  if (error == 0) return;
  pid_ = -1;
  throw ProgramNotStartedError(command.front() + ": cannot be run: " + system_message(error));
}

BackgroundProgram::~BackgroundProgram() {
  if (pid_ < 0 || ended()) return;
  ::kill(-pid_, SIGKILL);
  while (::waitpid(pid_, nullptr, 0) < 0 && errno == EINTR) {
  }
}

std::optional<ProgramEnd> BackgroundProgram::ended() {
  if (end_) return end_;
  int status = 0;
  rusage used{};
  if (::wait4(pid_, &status, WNOHANG, &used) != pid_) return std::nullopt;
  end_ = ProgramEnd{WIFEXITED(status) ? WEXITSTATUS(status) : 0, WIFSIGNALED(status) ? WTERMSIG(status) : 0,
                    static_cast<double>(used.ru_maxrss) / kKibPerMb};
  return end_;
}

void BackgroundProgram::send(int signal) const {
  if (!end_) ::kill(pid_, signal);
}

double BackgroundProgram::peak_mb() const {
  if (end_) return end_->peak_mb;
  return std::max(0.0, proc_number("/proc/" + std::to_string(pid_) + "/status", "VmHWM:")) / kKibPerMb;
}

double BackgroundProgram::seconds() const {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin_).count();
}

void end_with_parent(int parent) {
  ::prctl(PR_SET_PDEATHSIG, SIGTERM);
  if (::getppid() != parent) ::raise(SIGTERM);  // it has ended before we asked
}

double available_memory_mb() {
  double most = std::max(0.0, proc_number("/proc/meminfo", "MemAvailable:")) / kKibPerMb;
  std::ifstream limit_file("/sys/fs/cgroup/memory.max"), used_file("/sys/fs/cgroup/memory.current");
  double limit = 0, used = 0;
  if (limit_file >> limit) {  // "max" is none
    used_file >> used;
    most = std::min(most, std::max(0.0, limit - used) / (kKibPerMb * kKibPerMb));
  }
  return most;
}

}  // namespace hsi4d
