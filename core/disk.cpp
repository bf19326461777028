#include "core/disk.h"

#include <fcntl.h>
#include <filesystem>
#include <unistd.h>
#include <vector>

namespace hsi4d {

namespace fs = std::filesystem;

void sync_to_disk(const std::string& path) {
  const auto sync = [](const fs::path& entry) {
    const int descriptor = ::open(entry.c_str(), O_RDONLY | O_CLOEXEC);
    if (descriptor < 0) return;
    ::fsync(descriptor);
    ::close(descriptor);
  };
  std::error_code error;
  for (fs::recursive_directory_iterator it(path, error), end; !error && it != end; it.increment(error)) {
    std::error_code gone;
    if (it->is_regular_file(gone) || it->is_directory(gone)) sync(it->path());
  }
  sync(path);
}

void remove_temporary_files(const std::string& folder) {
  std::vector<fs::path> left;
  std::error_code error;
  for (fs::directory_iterator it(folder, error), end; !error && it != end; it.increment(error)) {
    if (it->path().filename().string().ends_with(".tmp")) left.push_back(it->path());
  }
  for (const fs::path& file : left) fs::remove(file, error);
}

}  // namespace hsi4d
