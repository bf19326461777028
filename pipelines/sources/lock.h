// Who makes an output of a program outside (pipelines/sources/sources.h): one process at a time.
#pragma once

#include <filesystem>
#include <functional>
#include <string>

#include "core/file_lock.h"

namespace hsi4d {

/// The right to make one output, held by a lock beside it, ".NAME.lock", which the system releases when the process
/// ends, however it ends, and which is removed when it is given back.
class SourceLock {
 public:
  /// Waits until no other process has it; tells it once that it waits.
  /// @param output  the file or folder that will be made; its folder is made where it is not there
  /// @param stop    asked many times a second; empty: never
  /// Throws Interrupted when it was asked to stop, UserError where the lock cannot be written. A file system without
  /// locks is warned of.
  SourceLock(const std::filesystem::path& output, const std::function<bool()>& stop);
  ~SourceLock();
  SourceLock(const SourceLock&) = delete;
  SourceLock& operator=(const SourceLock&) = delete;

 private:
  std::filesystem::path file_;
  FileLock lock_;
};

/// The folder in which this process makes an output, "NAME.PID.tmp" beside it.
std::filesystem::path work_folder_of(const std::filesystem::path& output);

/// Removes the work folders in `folder` that processes have left behind which were killed: those whose output no
/// process is making. To be called without a SourceLock on any of them.
void sweep_work_folders(const std::filesystem::path& folder);

}  // namespace hsi4d
