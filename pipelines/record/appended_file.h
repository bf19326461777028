// A file that grows line by line, or record by record, while others read it. Paths are UTF-8.
#pragma once

#include <string>
#include <string_view>

namespace hsi4d {

/// A file that is open for appending as long as this lives.
class AppendedFile {
 public:
  /// Opens the file, made where there is none. Throws UserError naming the path.
  explicit AppendedFile(std::string path);
  ~AppendedFile();
  AppendedFile(const AppendedFile&) = delete;
  AppendedFile& operator=(const AppendedFile&) = delete;

  /// Writes all of `content` at the file's end; it is with the system when this returns. Throws UserError naming the
  /// path (a full disk).
  void append(std::string_view content) const;

 private:
  std::string path_;
  int descriptor_;
};

}  // namespace hsi4d
