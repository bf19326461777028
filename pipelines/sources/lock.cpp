#include "pipelines/sources/lock.h"

#include <algorithm>
#include <unistd.h>
#include <vector>

#include "core/check.h"
#include "core/log.h"
#include "core/observer.h"

namespace hsi4d {

namespace {

namespace fs = std::filesystem;

fs::path lock_file(const fs::path& output) {
  return output.parent_path() / ("." + output.filename().string() + ".lock");
}

/// The output that a work folder is of, "a/video-KEY.mp4" of "a/video-KEY.mp4.123.tmp"; empty: it is none.
fs::path output_of_work(const fs::path& work) {
  const fs::path numbered = work.stem();
  const std::string number = numbered.extension().string();
  const bool is_number =
      number.size() > 1 && std::all_of(number.begin() + 1, number.end(), [](char c) { return c >= '0' && c <= '9'; });
  const std::string name = numbered.stem().string();
  if (work.extension() != ".tmp" || !is_number ||
      !(name.starts_with("video-") || name.starts_with("person-") || name.starts_with("masks-") ||
        name.starts_with("motion-")))
    return {};
  return work.parent_path() / name;
}

/// Removes a work folder if no process makes its output.
void sweep(const fs::path& work, const fs::path& output) {
  const fs::path file = lock_file(output);
  std::error_code ignored;
  try {
    FileLock lock(file.string());
    if (lock.take() != FileLock::State::kHeld || !lock.is_in_place()) return;
    fs::remove_all(work, ignored);
    fs::remove(file, ignored);
  } catch (const UserError&) {  // a folder that we cannot write to: it stays
  }
}

/// The lock that is held, or that there are none; waits.
FileLock lock_of(const fs::path& output, const std::function<bool()>& stop) {
  const std::string file = lock_file(output).string();
  while (true) {
    FileLock lock(file);
    const auto tell = [&] { log_info(output.string() + ": another process makes it; waits for that"); };
    const FileLock::State state = lock.wait(stop, tell);
    if (state == FileLock::State::kBusy) throw Interrupted("interrupted while another process made " + output.string());
    if (state == FileLock::State::kNoLocks) {
      log_warning(file + ": this file system has no locks: two runs that make this output would both do so");
      return lock;
    }
    if (lock.is_in_place()) return lock;  // else whoever had it has removed it
  }
}

/// The folder that an output is in, made.
const fs::path& with_folder(const fs::path& output) {
  std::error_code error;
  fs::create_directories(output.parent_path(), error);
  if (error) throw UserError(output.parent_path().string() + ": the folder cannot be made: " + error.message());
  return output;
}

}  // namespace

SourceLock::SourceLock(const fs::path& output, const std::function<bool()>& stop)
    : file_(lock_file(output)), lock_(lock_of(with_folder(output), stop)) {}

SourceLock::~SourceLock() {
  std::error_code ignored;
  fs::remove(file_, ignored);  // while it is held: whoever opened it finds that it is gone
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
