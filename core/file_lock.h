// Locks on files, which processes on one machine, or on several that share a file system with locks, respect.
#pragma once

#include <chrono>
#include <functional>
#include <string>

namespace hsi4d {

/// The right of one process alone to do something, held by a lock on a file that the system releases when the process
/// ends, however it ends.
class FileLock {
 public:
  enum class State {
    kHeld,
    kBusy,     ///< another process has it
    kNoLocks,  ///< this file system has none: whoever asks must warn, and do without
  };

  /// How long `wait` waits between looks.
  static constexpr std::chrono::milliseconds kLook{50};

  /// Opens the file, which is made where it is not there; its folder must be. Throws UserError naming it.
  explicit FileLock(const std::string& file);
  ~FileLock();
  FileLock(FileLock&& other) noexcept;
  FileLock& operator=(FileLock&&) = delete;

  /// Takes the lock if nobody has it.
  State take();

  /// Waits until nobody else has it.
  /// @param stop_requested  asked at every look; empty: never. When it says so kBusy is returned
  /// @param tell            called once, if it has to wait
  State wait(const std::function<bool()>& stop_requested, const std::function<void()>& tell,
             std::chrono::milliseconds look = kLook);

  /// False once the file was removed or replaced: whoever comes now locks another one.
  bool is_in_place() const;

  /// To read and to append.
  int descriptor() const { return descriptor_; }

 private:
  std::string file_;
  int descriptor_ = -1;
};

/// True while some process holds the lock on a file; false where there is no such file. Whoever asks takes no lock that
/// another one who asks would see.
bool is_file_locked(const std::string& file);

}  // namespace hsi4d
