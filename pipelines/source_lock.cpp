#include "pipelines/source_lock.h"

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <thread>
#include <unistd.h>
#include <vector>

#include "core/check.h"
#include "core/log.h"
#include "core/system_message.h"
#include "pipelines/observer.h"

namespace hsi4d {

namespace {

namespace fs = std::filesystem;

constexpr std::chrono::milliseconds kBetweenTries{50};

fs::path lock_file(const fs::path& output) {
  return output.parent_path() / ("." + output.filename().string() + ".lock");
}

enum class Lock { kHeld, kBusy, kGone, kNone };

/// Takes an open file, at once or not. kGone: whoever had it has removed it; kNone: this file system has no locks.
Lock try_lock(const fs::path& file, int descriptor) {
  if (::flock(descriptor, LOCK_EX | LOCK_NB) != 0) return errno == EWOULDBLOCK ? Lock::kBusy : Lock::kNone;
  struct stat held {
  }, there{};
  const bool is_same = ::fstat(descriptor, &held) == 0 && ::stat(file.c_str(), &there) == 0 &&
                       held.st_ino == there.st_ino && held.st_dev == there.st_dev;
  return is_same ? Lock::kHeld : Lock::kGone;
}

/// The output that a work folder is of, "a/video-KEY.mp4" of "a/video-KEY.mp4.123.tmp"; empty: it is none.
fs::path output_of_work(const fs::path& work) {
  const fs::path numbered = work.stem();
  const std::string number = numbered.extension().string();
  const bool is_number =
      number.size() > 1 && std::all_of(number.begin() + 1, number.end(), [](char c) { return c >= '0' && c <= '9'; });
  const std::string name = numbered.stem().string();
  if (work.extension() != ".tmp" || !is_number ||
      !(name.starts_with("video-") || name.starts_with("masks-") || name.starts_with("motion-")))
    return {};
  return work.parent_path() / name;
}

/// Removes a work folder if no process makes its output.
void sweep(const fs::path& work, const fs::path& output) {
  const fs::path file = lock_file(output);
  const int descriptor = ::open(file.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0666);
  if (descriptor < 0) return;
  std::error_code ignored;
  if (try_lock(file, descriptor) == Lock::kHeld) {
    fs::remove_all(work, ignored);
    fs::remove(file, ignored);
  }
  ::close(descriptor);
}

}  // namespace

SourceLock::SourceLock(const fs::path& output, const std::function<bool()>& stop) : file_(lock_file(output)) {
  std::error_code error;
  fs::create_directories(output.parent_path(), error);
  if (error) throw UserError(output.parent_path().string() + ": the folder cannot be made: " + error.message());
  for (bool has_told = false;;) {
    descriptor_ = ::open(file_.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0666);
    if (descriptor_ < 0) throw UserError(file_.string() + ": cannot be written: " + system_message(errno));
    const Lock lock = try_lock(file_, descriptor_);
    if (lock == Lock::kHeld) return;
    if (lock == Lock::kNone) {
      log_warning(file_.string() + ": this file system has no locks: two runs that make this output would both do so");
      return;
    }
    ::close(descriptor_);
    if (lock == Lock::kGone) continue;
    if (!has_told) log_info(output.string() + ": another process makes it; waits for that");
    has_told = true;
    if (stop && stop()) throw Interrupted("interrupted while another process made " + output.string());
    std::this_thread::sleep_for(kBetweenTries);
  }
}

SourceLock::~SourceLock() {
  std::error_code ignored;
  fs::remove(file_, ignored);  // while it is held: whoever opened it finds that it is gone
  ::close(descriptor_);
}

fs::path work_folder_of(const fs::path& output) { return output.string() + "." + std::to_string(::getpid()) + ".tmp"; }

void sweep_work_folders(const fs::path& folder) {
  std::vector<fs::path> found;
  std::error_code error;
  for (fs::directory_iterator it(folder, error), end; !error && it != end; it.increment(error)) {
    if (!output_of_work(it->path()).empty()) found.push_back(it->path());
  }
  for (const fs::path& work : found) sweep(work, output_of_work(work));
}

}  // namespace hsi4d
