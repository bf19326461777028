#include "core/compression.h"

#include <algorithm>
#include <limits>
#include <new>
#include <zlib.h>
#include <zstd.h>

#include "core/check.h"

namespace hsi4d {
namespace {

constexpr int kGzip = 16 + MAX_WBITS;  // zlib's way to ask for gzip's header and checksum
constexpr int kZstdLevel = 12;

/// zlib counts bytes in 32 bits.
uInt piece(std::size_t bytes) { return static_cast<uInt>(std::min<std::size_t>(bytes, std::size_t{1} << 30)); }

}  // namespace

// gzip ----------------------------------------------------------------------------------------------------------------

struct GzipReader::Stream {
  z_stream z = {};
  std::span<const std::uint8_t> left;  // of the input, beyond what zlib has been given
  std::uint64_t unpacked = 0;
  bool ended = false;
};

GzipReader::GzipReader(std::span<const std::uint8_t> file, std::string name)
    : name_(std::move(name)), stream_(std::make_unique<Stream>()) {
  stream_->left = file;
  if (inflateInit2(&stream_->z, kGzip) != Z_OK) throw std::bad_alloc();
}

GzipReader::~GzipReader() { inflateEnd(&stream_->z); }

std::size_t GzipReader::read_some(std::span<std::uint8_t> out) {
  Stream& s = *stream_;
  std::size_t done = 0;
  const auto where = [&] { return " after " + std::to_string(s.unpacked + done) + " unpacked bytes"; };
  while (done < out.size() && !s.ended) {
    if (s.z.avail_in == 0) {
      s.z.next_in = const_cast<Bytef*>(s.left.data());
      s.z.avail_in = piece(s.left.size());
      s.left = s.left.subspan(s.z.avail_in);
    }
    s.z.next_out = out.data() + done;
    s.z.avail_out = piece(out.size() - done);
    const uInt room = s.z.avail_out;
    const int status = inflate(&s.z, Z_NO_FLUSH);
    done += room - s.z.avail_out;
    if (status == Z_STREAM_END) {
      s.ended = true;
    } else if (status == Z_MEM_ERROR) {
      throw std::bad_alloc();
    } else if (status == Z_BUF_ERROR) {
      throw DataError(name_ + ": the gzip stream ends" + where() + ": the file was cut short");
    } else if (status != Z_OK) {
      throw DataError(name_ + ": the gzip stream is damaged" + where() +
                      (s.z.msg != nullptr ? std::string(": ") + s.z.msg : ""));
    }
  }
  s.unpacked += done;
  return done;
}

void GzipReader::read(std::span<std::uint8_t> out) {
  const std::size_t done = read_some(out);
  if (done < out.size())
    throw DataError(name_ + ": the gzip stream holds " + std::to_string(stream_->unpacked) + " bytes; " +
                    std::to_string(stream_->unpacked - done + out.size()) + " are needed");
}

void GzipReader::expect_end() {
  std::uint8_t more = 0;
  if (read_some({&more, 1}) != 0)
    throw DataError(name_ + ": the gzip stream holds more than the " + std::to_string(stream_->unpacked - 1) +
                    " bytes that are needed");
  const std::size_t behind = stream_->z.avail_in + stream_->left.size();
  if (behind != 0)
    throw DataError(name_ + ": " + std::to_string(behind) + " bytes are left over after the gzip stream");
}

Bytes compress_gzip(std::span<const std::uint8_t> content) {
  z_stream z = {};
  if (deflateInit2(&z, Z_BEST_COMPRESSION, Z_DEFLATED, kGzip, 8, Z_DEFAULT_STRATEGY) != Z_OK) throw std::bad_alloc();
  const std::unique_ptr<z_stream, decltype([](z_stream* stream) { deflateEnd(stream); })> end(&z);
  Bytes out;
  Bytes buffer(std::size_t{1} << 16);
  int status = Z_OK;
  while (status != Z_STREAM_END) {
    if (z.avail_in == 0) {
      z.next_in = const_cast<Bytef*>(content.data());
      z.avail_in = piece(content.size());
      content = content.subspan(z.avail_in);
    }
    z.next_out = buffer.data();
    z.avail_out = static_cast<uInt>(buffer.size());
    status = deflate(&z, content.empty() ? Z_FINISH : Z_NO_FLUSH);
    HSI4D_CHECK(status == Z_OK || status == Z_STREAM_END, "zlib's deflate fails with " + std::to_string(status));
    out.insert(out.end(), buffer.begin(), buffer.end() - z.avail_out);
  }
  return out;
}

// Zstandard -----------------------------------------------------------------------------------------------------------

void decompress_zstd(std::span<const std::uint8_t> frame, std::span<std::uint8_t> out, const std::string& name) {
  const unsigned long long claimed = ZSTD_getFrameContentSize(frame.data(), frame.size());
  if (claimed != ZSTD_CONTENTSIZE_UNKNOWN && claimed != ZSTD_CONTENTSIZE_ERROR && claimed != out.size())
    throw DataError(name + ": the Zstandard frame says that it holds " + std::to_string(claimed) + " bytes; " +
                    std::to_string(out.size()) + " are needed");
  const std::size_t size = ZSTD_decompress(out.data(), out.size(), frame.data(), frame.size());
  if (ZSTD_isError(size) != 0)
    throw DataError(name + ": the Zstandard frame cannot be unpacked into " + std::to_string(out.size()) +
                    " bytes: " + ZSTD_getErrorName(size));
  if (size != out.size())
    throw DataError(name + ": the Zstandard frame holds " + std::to_string(size) + " bytes; " +
                    std::to_string(out.size()) + " are needed");
}

Bytes compress_zstd(std::span<const std::uint8_t> content) {
  Bytes out(ZSTD_compressBound(content.size()));
  const std::size_t size = ZSTD_compress(out.data(), out.size(), content.data(), content.size(), kZstdLevel);
  HSI4D_CHECK(ZSTD_isError(size) == 0, std::string("Zstandard cannot pack: ") + ZSTD_getErrorName(size));
  out.resize(size);
  return out;
}

}  // namespace hsi4d
