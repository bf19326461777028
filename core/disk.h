// What programs that were killed, or a power cut, would leave: temporary files removed, whole ones put on the disk.
#pragma once

#include <string>

namespace hsi4d {

/// Puts a file, or all files of a folder and of those in it, on the disk: they are whole after a power cut, which
/// AtomicFile alone does not see to. What cannot be synced (a file system that does not do that) stays as it is.
void sync_to_disk(const std::string& path);

/// Removes what writers (AtomicFile) have left half done in a folder that were killed: files whose names end with
/// ".tmp"; not those of folders in it. Only while nobody writes to it. Does nothing where there is no such folder.
void remove_temporary_files(const std::string& folder);

}  // namespace hsi4d
