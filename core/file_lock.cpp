#include "core/file_lock.h"

#include <cerrno>
#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <thread>
#include <unistd.h>
#include <utility>

#include "core/check.h"
#include "core/system_message.h"

namespace hsi4d {

FileLock::FileLock(const std::string& file)
    : file_(file), descriptor_(::open(file.c_str(), O_RDWR | O_APPEND | O_CREAT | O_CLOEXEC, 0666)) {
  if (descriptor_ < 0) throw UserError(file + ": cannot be written: " + system_message(errno));
}

FileLock::~FileLock() {
  if (descriptor_ >= 0) ::close(descriptor_);
}

FileLock::FileLock(FileLock&& other) noexcept
    : file_(std::move(other.file_)), descriptor_(std::exchange(other.descriptor_, -1)) {}

FileLock::State FileLock::take() {
  if (::flock(descriptor_, LOCK_EX | LOCK_NB) == 0) return State::kHeld;
  return errno == EWOULDBLOCK ? State::kBusy : State::kNoLocks;
}

FileLock::State FileLock::wait(const std::function<bool()>& stop_requested, const std::function<void()>& tell,
                               std::chrono::milliseconds look) {
  for (bool has_told = false;; has_told = true) {
    const State state = take();
    if (state != State::kBusy) return state;
    if (!has_told && tell) tell();
    if (stop_requested && stop_requested()) return State::kBusy;
    std::this_thread::sleep_for(look);
  }
}

bool FileLock::is_in_place() const {
  struct stat held {
  }, there{};
  return ::fstat(descriptor_, &held) == 0 && ::stat(file_.c_str(), &there) == 0 && held.st_ino == there.st_ino &&
         held.st_dev == there.st_dev;
}

bool is_file_locked(const std::string& file) {
  const int descriptor = ::open(file.c_str(), O_RDONLY | O_CLOEXEC);
  if (descriptor < 0) return false;
  const bool is_taken = ::flock(descriptor, LOCK_SH | LOCK_NB) != 0 && errno == EWOULDBLOCK;
  ::close(descriptor);
  return is_taken;
}

}  // namespace hsi4d
