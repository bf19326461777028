// Whole files: read, and written so that a reader never sees half of one. Paths are UTF-8.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace hsi4d {

/// A file's content.
using Bytes = std::vector<uint8_t>;

/// The largest file that read_file takes unless told otherwise.
inline constexpr int64_t kMaxFileBytes = int64_t{64} << 30;

/// The content of a file.
///
/// @param path       UTF-8
/// @param max_bytes  a larger file is refused before it is read
/// Throws UserError naming the path: missing, a folder, not permitted, too large.
Bytes read_file(const std::string& path, int64_t max_bytes = kMaxFileBytes);

/// The content of a file as text, byte for byte. Errors as read_file.
std::string read_text_file(const std::string& path, int64_t max_bytes = kMaxFileBytes);

/// The first bytes of a file: `count` of them, or fewer where the file ends. Errors as read_file.
Bytes read_file_start(const std::string& path, int64_t count);

/// Replaces or makes the file at `path`, in one step for anybody who looks (see AtomicFile, whose errors it has).
void write_file(const std::string& path, std::span<const uint8_t> content);

/// As write_file, for text.
void write_text_file(const std::string& path, std::string_view content);

/// `path` as meant by the file that names it: absolute paths stay, others are taken from that file's folder.
///
///   ("runs/a/config.json", "../scene.ply") -> "runs/scene.ply"
std::string path_beside(const std::string& naming_file, const std::string& path);

/// Whether a file's name begins with a dot: systems and editors leave such files beside others ("._0002.png"). They are
/// no frames, masks or poses.
bool is_hidden(std::string_view path);

/// A file that comes into being when it is complete: it is written under a temporary name in the same folder and
/// renamed by commit(), which replaces an older file in one step. Without commit() the temporary is removed and an
/// older file stays as it was. A link is followed, so that its target is replaced and the link stays.
///
/// Safe against a killed program, not against a power cut: nothing is synced to the disk.
class AtomicFile {
 public:
  /// Makes the empty temporary file `<path>.<process>-<number>.tmp`, and folders that are missing on the way to it.
  /// Throws UserError naming the path: its folder cannot be made or written to, or a folder or device has that name.
  explicit AtomicFile(const std::string& path);
  ~AtomicFile();
  AtomicFile(const AtomicFile&) = delete;
  AtomicFile& operator=(const AtomicFile&) = delete;

  /// Where to write until commit().
  const std::string& temporary_path() const { return temporary_; }

  /// Writes `content` at the temporary's end. Throws UserError naming the path (a full disk).
  void append(std::span<const uint8_t> content);

  /// Gives the file its name. At most once. Throws UserError naming the path.
  void commit();

 private:
  std::string path_;
  std::string target_;
  std::string temporary_;
};

}  // namespace hsi4d
