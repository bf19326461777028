#include "core/background_program.h"

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <fcntl.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include "core/memory.h"
#include "core/process.h"
#include "core/spawn.h"
#include "core/system_message.h"

namespace hsi4d {
namespace {

constexpr double kKibPerMb = 1024;

double in_mb(std::int64_t bytes) { return static_cast<double>(bytes) / kBytesPerMb; }

}  // namespace

BackgroundProgram::BackgroundProgram(const std::vector<std::string>& command, const std::string& output)
    : our_peak_mb_(in_mb(peak_memory_bytes())), begin_(std::chrono::steady_clock::now()) {
  HSI4D_CHECK(!command.empty(), "a command needs a program");
  const int file = beyond_standard(::open(output.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0666));
  if (file < 0) throw UserError(output + ": cannot be written: " + system_message(errno));
  const int nothing = beyond_standard(::open("/dev/null", O_RDONLY | O_CLOEXEC));
  const int error = nothing < 0 ? errno : spawn_program(command, {nothing, file, file}, pid_);
  ::close(file);
  if (nothing >= 0) ::close(nothing);
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
  peak_mb();  // for the last time, perhaps
  const int ended = ::wait4(pid_, &status, WNOHANG, &used);
  if (ended != pid_ && !(ended < 0 && errno == ECHILD)) return std::nullopt;
  end_ = ProgramEnd{};
  end_->is_known = ended == pid_;
  end_->peak_mb = peak_mb_;
  if (!end_->is_known) return end_;  // whoever started us has the system throw ends away
  if (WIFEXITED(status)) end_->status = WEXITSTATUS(status);
  if (WIFSIGNALED(status)) end_->signal = WTERMSIG(status);
  const double told = static_cast<double>(used.ru_maxrss) / kKibPerMb;  // never less than ours at its start
  if (told > our_peak_mb_) end_->peak_mb = std::max(told, peak_mb_);
  return end_;
}

void BackgroundProgram::send(int signal) const {
  if (!end_) ::kill(pid_, signal);
}

double BackgroundProgram::peak_mb() {
  if (!end_) peak_mb_ = std::max(peak_mb_, in_mb(peak_memory_bytes(pid_)));
  return end_ ? end_->peak_mb : peak_mb_;
}

double BackgroundProgram::seconds() const {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin_).count();
}

void end_with_parent(int parent) {
  ::prctl(PR_SET_PDEATHSIG, SIGTERM);
  if (::getppid() != parent) ::raise(SIGTERM);  // it has ended before we asked
}

}  // namespace hsi4d
