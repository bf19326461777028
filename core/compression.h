// Compressed bytes: gzip streams [RFC 1952] and Zstandard frames [RFC 8878]. Whoever reads says how much there is, so
// that a small file cannot ask for much memory.
#pragma once

#include <memory>
#include <span>
#include <string>

#include "core/file.h"

namespace hsi4d {

/// The densest that Deflate packs: 1032 bytes into one.
inline constexpr std::uint64_t kDensestDeflate = 1032;

/// Unpacks a gzip stream piece by piece, into memory that the caller has sized.
class GzipReader {
 public:
  /// @param file  a whole gzip stream; must outlive this
  /// @param name  what error messages call it
  GzipReader(std::span<const std::uint8_t> file, std::string name);
  ~GzipReader();
  GzipReader(const GzipReader&) = delete;
  GzipReader& operator=(const GzipReader&) = delete;

  /// Unpacks the next bytes: as many as fit `out`, or fewer where the stream ends. Returns their number.
  /// Throws DataError naming the file and how far it was unpacked: damaged, or cut short.
  std::size_t read_some(std::span<std::uint8_t> out);

  /// As read_some, and a DataError if the stream ends before `out` is full.
  void read(std::span<std::uint8_t> out);

  /// Throws DataError unless the stream ends here, its checksum is right and nothing follows it.
  void expect_end();

 private:
  struct Stream;
  std::string name_;
  std::unique_ptr<Stream> stream_;
};

/// `content` as a gzip stream without name or time. The same bytes for the same content and version of zlib.
Bytes compress_gzip(std::span<const std::uint8_t> content);

/// Unpacks a Zstandard frame that must hold exactly as many bytes as `out`.
/// @param name  what error messages call it: file and part
/// Throws DataError when it is damaged or holds another number of bytes.
void decompress_zstd(std::span<const std::uint8_t> frame, std::span<std::uint8_t> out, const std::string& name);

/// `content` as a Zstandard frame that names its length.
Bytes compress_zstd(std::span<const std::uint8_t> content);

}  // namespace hsi4d
