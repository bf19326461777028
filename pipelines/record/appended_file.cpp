#include "pipelines/record/appended_file.h"

#include <cerrno>
#include <fcntl.h>
#include <unistd.h>
#include <utility>

#include "core/check.h"
#include "core/system_message.h"

namespace hsi4d {

AppendedFile::AppendedFile(std::string path)
    : path_(std::move(path)), descriptor_(::open(path_.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0666)) {
  if (descriptor_ < 0) throw UserError(path_ + ": cannot be written: " + system_message(errno));
}

AppendedFile::~AppendedFile() { ::close(descriptor_); }

void AppendedFile::append(std::string_view content) const {
  while (!content.empty()) {
    const ssize_t done = ::write(descriptor_, content.data(), content.size());
    if (done < 0 && errno == EINTR) continue;
    if (done < 0) throw UserError(path_ + ": cannot be written: " + system_message(errno));
    content.remove_prefix(static_cast<size_t>(done));
  }
}

}  // namespace hsi4d
