// A folder that is there as a whole or not at all.
#pragma once

#include <filesystem>
#include <string>

namespace hsi4d {

/// A folder under a temporary name beside its own, which it gets when it is complete; else it is removed.
class FolderInMaking {
 public:
  /// @param folder  new or empty; its parents are made
  /// Throws UserError when there is something in it, or it cannot be made.
  explicit FolderInMaking(const std::filesystem::path& folder);
  ~FolderInMaking();
  FolderInMaking(const FolderInMaking&) = delete;
  FolderInMaking& operator=(const FolderInMaking&) = delete;

  /// Path of a file in it, whose folder is made. Throws UserError.
  std::string file(const std::filesystem::path& name) const;

  /// Gives the folder its name. Throws UserError.
  void commit();

 private:
  void refuse_unless_free() const;

  std::filesystem::path folder_, temporary_;
};

}  // namespace hsi4d
