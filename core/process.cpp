#include "core/process.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <fcntl.h>
#include <filesystem>
#include <fstream>
#include <limits>
#include <sstream>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <thread>
#include <unistd.h>

#include "core/check.h"
#include "core/spawn.h"
#include "core/system_message.h"
#include "core/text.h"

namespace hsi4d {

namespace {

constexpr std::chrono::milliseconds kLook{20};  // between looks at whether a program has ended
constexpr double kSecondsToGo = 2;              // of one that is asked to end, before it is killed
constexpr std::size_t kMostTold = 2000;         // bytes of what a program printed, in a message

void close_if_open(int& descriptor) {
  if (descriptor >= 0) close(descriptor);
  descriptor = -1;
}

/// What a file holds, from its beginning.
std::string content_of(int descriptor) {
  std::string text;
  std::array<char, 4096> part{};
  off_t at = 0;
  for (ssize_t count = 0; (count = pread(descriptor, part.data(), part.size(), at)) > 0; at += count)
    text.append(part.data(), static_cast<std::size_t>(count));
  return text;
}

std::string fate_of(int status) {
  if (WIFSIGNALED(status)) return "was ended by signal " + std::to_string(WTERMSIG(status));
  return "ended with status " + std::to_string(WEXITSTATUS(status));
}

void wait_for(pid_t pid, int* status) {
  while (waitpid(pid, status, 0) < 0 && errno == EINTR) {
  }
}

/// Whether a process group has a member that runs: one that is dead and that nobody has waited for yet does not count.
bool is_alive(pid_t group) {
  if (kill(-group, 0) != 0) return false;
  std::error_code error;
  std::filesystem::directory_iterator it("/proc", error);
  if (error) return true;
  for (const std::filesystem::directory_iterator end; !error && it != end; it.increment(error)) {
    std::ifstream file(it->path() / "stat");
    std::string text;
    if (!std::getline(file, text)) continue;
    std::istringstream fields(text.substr(std::min(text.rfind(')'), text.size() - 1) + 1));  // after "PID (NAME)"
    char state = 0;
    pid_t parent = 0, own_group = 0;
    if (fields >> state >> parent >> own_group && own_group == group && state != 'Z') return true;
  }
  return false;
}

}  // namespace

ChildProcess::ChildProcess(std::vector<std::string> command, ChildOutput output) : command_(std::move(command)) {
  HSI4D_CHECK(!command_.empty(), "a command needs a program");
  // A socket and not a pipe: a program that stops reading is then an error and not a signal.
  std::array<int, 2> ends{-1, -1}, pipe_ends{-1, -1};
  output_ = memfd_create("output", MFD_CLOEXEC);
  const bool is_read = output == ChildOutput::kRead;
  const bool is_ready = output_ >= 0 && socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends.data()) == 0 &&
                        (!is_read || pipe2(pipe_ends.data(), O_CLOEXEC) == 0);
  int error = is_ready ? 0 : errno;
  output_ = beyond_standard(output_);
  for (int* const end : {&ends[0], &ends[1], &pipe_ends[0], &pipe_ends[1]}) *end = beyond_standard(*end);
  input_ = ends[0];
  stream_ = pipe_ends[0];
  if (error == 0) error = spawn_program(command_, {ends[1], is_read ? pipe_ends[1] : output_, output_}, pid_);
  close_if_open(ends[1]);
  close_if_open(pipe_ends[1]);
  if (error == 0) return;
  close_if_open(input_);
  close_if_open(output_);
  close_if_open(stream_);
  pid_ = -1;
  throw ProgramNotStartedError(command_.front() + ": cannot be run: " + system_message(error) +
                               (error == ENOENT ? "; is it installed, and in PATH?" : ""));
}

ChildProcess::~ChildProcess() {
  close_if_open(input_);
  close_if_open(stream_);
  if (pid_ > 0) {
    kill(-pid_, SIGKILL);
    wait_for(pid_, nullptr);
  }
  close_if_open(output_);
}

std::size_t ChildProcess::read(std::span<uint8_t> bytes) {
  std::size_t done = 0;
  while (done < bytes.size()) {
    const ssize_t count = ::read(stream_, bytes.data() + done, bytes.size() - done);
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) break;
    done += static_cast<std::size_t>(count);
  }
  return done;
}

bool ChildProcess::write(std::span<const uint8_t> bytes) {
  while (!bytes.empty()) {
    const ssize_t count = send(input_, bytes.data(), bytes.size(), MSG_NOSIGNAL);
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) return false;
    bytes = bytes.subspan(static_cast<std::size_t>(count));
  }
  return true;
}

std::string ChildProcess::finish() {
  HSI4D_CHECK(pid_ > 0, "the program's end was waited for before");
  close_if_open(input_);
  close_if_open(stream_);
  siginfo_t ended{};
  while (waitid(P_PID, static_cast<id_t>(pid_), &ended, WEXITED | WNOWAIT) < 0 && errno == EINTR) {
  }
  end();
  return result();
}

std::optional<std::string> ChildProcess::finish(const ProcessLimits& limits) {
  HSI4D_CHECK(pid_ > 0, "the program's end was waited for before");
  close_if_open(input_);
  close_if_open(stream_);
  const double seconds = limits.seconds > 0 ? limits.seconds : std::numeric_limits<double>::infinity();
  const bool has_ended = has_ended_within(seconds, limits.stop_requested);
  const bool is_stopped = !has_ended && limits.stop_requested && limits.stop_requested();
  end();
  if (has_ended) return result();
  if (is_stopped) return std::nullopt;
  throw UserError(command_.front() + ": was ended after " + number_text(limits.seconds) +
                  " seconds, which is all the time it has" + end_of_output(content_of(output_)));
}

bool ChildProcess::has_ended_within(double seconds, const std::function<bool()>& stop_requested) {
  using Clock = std::chrono::steady_clock;
  for (const Clock::time_point begin = Clock::now();;) {
    siginfo_t ended{};
    if (waitid(P_PID, static_cast<id_t>(pid_), &ended, WEXITED | WNOHANG | WNOWAIT) == 0 && ended.si_pid == pid_)
      return true;
    if (stop_requested && stop_requested()) return false;
    if (std::chrono::duration<double>(Clock::now() - begin).count() > seconds) return false;
    std::this_thread::sleep_for(kLook);
  }
}

void ChildProcess::end() {
  using Clock = std::chrono::steady_clock;
  const pid_t group = pid_;
  bool is_waited_for = false;
  // The group has its number for as long as it has a member, and the program is one until it is waited for.
  kill(-group, SIGTERM);
  for (const Clock::time_point begin = Clock::now();;) {
    is_waited_for = is_waited_for || waitpid(group, &status_, WNOHANG) == group;
    if (is_waited_for && !is_alive(group)) break;
    if (std::chrono::duration<double>(Clock::now() - begin).count() > kSecondsToGo) {
      kill(-group, SIGKILL);
      if (!is_waited_for) wait_for(group, &status_);
      break;
    }
    std::this_thread::sleep_for(kLook);
  }
  pid_ = -1;
}

std::string ChildProcess::result() {
  std::string text = content_of(output_);
  if (WIFEXITED(status_) && WEXITSTATUS(status_) == 0) return text;
  const std::string message = command_.front() + ": " + fate_of(status_) + end_of_output(text);
  if (WIFEXITED(status_)) throw ProgramFailedError(message, WEXITSTATUS(status_));
  throw UserError(message);
}

std::string end_of_output(const std::string& text) {
  const std::size_t last = text.find_last_not_of(" \n\r\t");
  if (last == std::string::npos) return "; it printed nothing";
  const std::string trimmed = text.substr(0, last + 1);
  return trimmed.size() <= kMostTold ? ":\n" + trimmed : ":\n..." + trimmed.substr(trimmed.size() - kMostTold);
}

std::string find_program(const std::string& name) {
  namespace fs = std::filesystem;
  const auto can_run = [](const fs::path& file) {
    std::error_code error;
    return fs::is_regular_file(file, error) && access(file.c_str(), X_OK) == 0;
  };
  if (name.find('/') != std::string::npos) return can_run(name) ? name : "";
  const char* const path = std::getenv("PATH");
  std::istringstream folders(path == nullptr ? "/bin:/usr/bin" : path);
  for (std::string folder; !name.empty() && std::getline(folders, folder, ':');) {
    const fs::path file = fs::path(folder.empty() ? "." : folder) / name;
    if (can_run(file)) return file.string();
  }
  return "";
}

std::optional<std::string> run_process(std::vector<std::string> command, const ProcessLimits& limits) {
  return ChildProcess(std::move(command)).finish(limits);
}

std::string run_process(std::vector<std::string> command) { return ChildProcess(std::move(command)).finish(); }

}  // namespace hsi4d
