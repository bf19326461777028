#include "core/file.h"

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cstdio>
#include <fcntl.h>
#include <filesystem>
#include <limits>
#include <sys/stat.h>
#include <unistd.h>
#include <utility>

#include "core/check.h"
#include "core/system_message.h"

namespace hsi4d {
namespace {

[[noreturn]] void fail_file(const std::string& path, const std::string& what, int error) {
  throw UserError(path + ": " + what + ": " + system_message(error));
}

class Descriptor {
 public:
  explicit Descriptor(int value) : value_(value) {}
  ~Descriptor() {
    if (value_ >= 0) ::close(value_);
  }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  int get() const { return value_; }
  int release() { return std::exchange(value_, -1); }

 private:
  int value_;
};

/// At most `limit` bytes from the file's start. A pipe has no size beforehand, so the end decides, not the size.
template <class Content>
Content read_up_to(const std::string& path, int64_t limit, int64_t max_bytes) {
  const Descriptor file(::open(path.c_str(), O_RDONLY | O_CLOEXEC));
  if (file.get() < 0) fail_file(path, "cannot be read", errno);
  struct stat status {};
  if (::fstat(file.get(), &status) != 0) fail_file(path, "cannot be read", errno);
  if (S_ISDIR(status.st_mode)) throw UserError(path + ": cannot be read: it is a folder");
  const int64_t claimed = S_ISREG(status.st_mode) ? int64_t{status.st_size} : 0;
  if (claimed > max_bytes && limit > max_bytes) {
    throw UserError(path + ": has " + std::to_string(claimed) + " bytes; at most " + std::to_string(max_bytes) +
                    " are read");
  }
  Content content;
  // One byte more than claimed, so that the end is seen without growing.
  content.resize(static_cast<size_t>(std::min(limit, claimed + 1)));
  int64_t size = 0;
  while (size < limit) {
    if (size == std::ssize(content)) {
      content.resize(static_cast<size_t>(std::min(limit, std::max<int64_t>(2 * size, int64_t{1} << 16))));
    }
    const ssize_t got = ::read(file.get(), content.data() + size, content.size() - static_cast<size_t>(size));
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) fail_file(path, "cannot be read", errno);
    if (got == 0) break;
    size += got;
    if (size > max_bytes) {
      throw UserError(path + ": has more than the " + std::to_string(max_bytes) + " bytes that are read");
    }
  }
  content.resize(static_cast<size_t>(size));
  return content;
}

constexpr int64_t kNoLimit = std::numeric_limits<int64_t>::max();

/// The file that a write to `path` replaces: a link's target, else the path itself.
std::string follow_link(const std::string& path) {
  std::error_code error;
  if (!std::filesystem::is_symlink(path, error)) return path;
  const std::filesystem::path target = std::filesystem::canonical(path, error);
  return error ? path : target.string();
}

/// A folder that is missing on the way to `path`, and those that it is in.
void make_folders(const std::string& path, const std::filesystem::path& folder) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error)
    throw UserError(path + ": cannot be written: the folder " + folder.string() +
                    " cannot be made: " + error.message());
}

}  // namespace

Bytes read_file(const std::string& path, int64_t max_bytes) { return read_up_to<Bytes>(path, kNoLimit, max_bytes); }

std::string read_text_file(const std::string& path, int64_t max_bytes) {
  return read_up_to<std::string>(path, kNoLimit, max_bytes);
}

Bytes read_file_start(const std::string& path, int64_t count) { return read_up_to<Bytes>(path, count, count); }

void write_file(const std::string& path, std::span<const uint8_t> content) {
  AtomicFile file(path);
  file.append(content);
  file.commit();
}

void write_text_file(const std::string& path, std::string_view content) {
  write_file(path, std::span(reinterpret_cast<const uint8_t*>(content.data()), content.size()));
}

std::string path_beside(const std::string& naming_file, const std::string& path) {
  return (std::filesystem::path(naming_file).parent_path() / path).lexically_normal().string();
}

bool is_hidden(std::string_view path) {
  const std::size_t slash = path.find_last_of('/');  // npos + 1 is 0
  return path.substr(slash + 1).starts_with('.');
}

AtomicFile::AtomicFile(const std::string& path) : path_(path), target_(follow_link(path)) {
  struct stat status {};
  if (::stat(target_.c_str(), &status) == 0 && !S_ISREG(status.st_mode)) {
    throw UserError(path_ + ": cannot be written: " + (S_ISDIR(status.st_mode) ? "it is a folder" : "it is no file"));
  }
  static std::atomic<int64_t> counter{0};
  const std::string stem = target_ + "." + std::to_string(::getpid()) + "-";
  int error = EEXIST;
  bool has_made_folders = false;
  while (error == EEXIST) {
    temporary_ = stem + std::to_string(counter.fetch_add(1)) + ".tmp";
    const Descriptor file(::open(temporary_.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666));
    error = file.get() >= 0 ? 0 : errno;
    if (error != ENOENT || has_made_folders) continue;
    make_folders(path_, std::filesystem::path(target_).parent_path());
    has_made_folders = true;
    error = EEXIST;
  }
  if (error != 0) fail_file(path_, "cannot be written", error);
}

AtomicFile::~AtomicFile() {
  if (!temporary_.empty()) ::unlink(temporary_.c_str());
}

void AtomicFile::append(std::span<const uint8_t> content) {
  Descriptor file(::open(temporary_.c_str(), O_WRONLY | O_APPEND | O_CLOEXEC));
  if (file.get() < 0) fail_file(path_, "cannot be written", errno);
  while (!content.empty()) {
    const ssize_t done = ::write(file.get(), content.data(), content.size());
    if (done < 0 && errno == EINTR) continue;
    if (done < 0) fail_file(path_, "cannot be written", errno);
    content = content.subspan(static_cast<size_t>(done));
  }
  // Network file systems report a full disk here.
  if (::close(file.release()) != 0) fail_file(path_, "cannot be written", errno);
}

void AtomicFile::commit() {
  HSI4D_CHECK(!temporary_.empty(), path_ + " was committed before");
  if (std::rename(temporary_.c_str(), target_.c_str()) != 0) fail_file(path_, "cannot be written", errno);
  temporary_.clear();
}

}  // namespace hsi4d
