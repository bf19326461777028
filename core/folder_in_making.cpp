#include "core/folder_in_making.h"

#include <system_error>
#include <unistd.h>

#include "core/check.h"

namespace hsi4d {

namespace fs = std::filesystem;

FolderInMaking::FolderInMaking(const fs::path& folder) : folder_(fs::absolute(folder).lexically_normal()) {
  if (!folder_.has_filename()) folder_ = folder_.parent_path();  // "out/"
  refuse_unless_free();
  std::error_code error;
  fs::create_directories(folder_.parent_path(), error);
  temporary_ = folder_;
  temporary_ += "." + std::to_string(::getpid()) + ".tmp";
  if (error || !fs::create_directory(temporary_, error) || error)
    throw UserError(folder_.string() + ": the folder cannot be made" + (error ? ": " + error.message() : ""));
}

FolderInMaking::~FolderInMaking() {
  std::error_code ignored;
  if (!temporary_.empty()) fs::remove_all(temporary_, ignored);
}

std::string FolderInMaking::file(const fs::path& name) const {
  const fs::path path = temporary_ / name;
  std::error_code error;
  fs::create_directories(path.parent_path(), error);
  if (error) throw UserError(path.parent_path().string() + ": the folder cannot be made: " + error.message());
  return path.string();
}

void FolderInMaking::commit() {
  refuse_unless_free();
  std::error_code error;
  fs::rename(temporary_, folder_, error);  // replaces an empty folder
  if (error) throw UserError(folder_.string() + ": the folder cannot be made: " + error.message());
  temporary_.clear();
}

void FolderInMaking::refuse_unless_free() const {
  std::error_code error;
  if (!fs::exists(folder_, error) && !error) return;
  if (!error && !fs::is_directory(folder_, error))
    throw UserError(folder_.string() + ": there is something that is not a folder; name a new or empty folder");
  if (!error && !fs::is_empty(folder_, error))
    throw UserError(folder_.string() + ": the folder is not empty; name a new or empty one");
  if (error) throw UserError(folder_.string() + ": " + error.message());
}

}  // namespace hsi4d
