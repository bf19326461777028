#include "core/compression.h"

#include <catch2/catch.hpp>

#include "core/check.h"

namespace compression_test {

using namespace hsi4d;
using Catch::Matchers::Message;

namespace {

Bytes some_bytes(std::size_t count) {
  Bytes bytes(count);
  std::uint32_t state = 1;
  for (std::uint8_t& byte : bytes) {
    state = state * 1664525 + 1013904223;
    byte = static_cast<std::uint8_t>(state >> 30);
  }
  return bytes;
}

Bytes unpacked(const Bytes& file, std::size_t count) {
  GzipReader reader(file, "a.gz");
  Bytes out(count);
  reader.read(out);
  reader.expect_end();
  return out;
}

}  // namespace

TEST_CASE("gzip streams are packed and unpacked, at once or in pieces") {
  for (const std::size_t count : {0, 1, 1000, 300000}) {
    const Bytes content = some_bytes(count);
    const Bytes file = compress_gzip(content);
    CHECK(file[0] == 0x1f);
    CHECK(file[1] == 0x8b);
    CHECK(unpacked(file, count) == content);
    CHECK(compress_gzip(content) == file);
  }
  const Bytes content = some_bytes(1000), file = compress_gzip(content);
  GzipReader reader(file, "a.gz");
  Bytes all;
  for (const std::size_t piece : {1, 7, 0, 500, 600}) {
    Bytes part(piece);
    part.resize(reader.read_some(part));
    all.insert(all.end(), part.begin(), part.end());
  }
  CHECK(all == content);
}

TEST_CASE("a gzip stream made elsewhere is read") {
  // What Python's gzip.compress(b"hello", mtime=0) gives.
  const Bytes file = {0x1f, 0x8b, 8, 0, 0,    0,    0,    0,    2, 0xff, 0xcb, 0x48, 0xcd,
                      0xc9, 0xc9, 7, 0, 0x86, 0xa6, 0x10, 0x36, 5, 0,    0,    0};
  const Bytes hello = {'h', 'e', 'l', 'l', 'o'};
  CHECK(unpacked(file, 5) == hello);
}

TEST_CASE("a gzip stream that is damaged, cut, too long or too short is refused") {
  const Bytes content = some_bytes(1000);
  const Bytes file = compress_gzip(content);
  for (std::size_t size = 0; size < file.size(); ++size)
    CHECK_THROWS_AS(unpacked(Bytes(file.begin(), file.begin() + static_cast<std::ptrdiff_t>(size)), 1000), DataError);
  CHECK_THROWS_MATCHES(unpacked({}, 1), DataError,
                       Message("a.gz: the gzip stream ends after 0 unpacked bytes: the file was cut short"));
  CHECK_THROWS_MATCHES(unpacked(file, 1001), DataError,
                       Message("a.gz: the gzip stream holds 1000 bytes; 1001 are needed"));
  CHECK_THROWS_MATCHES(unpacked(file, 990), DataError,
                       Message("a.gz: the gzip stream holds more than the 990 bytes that are needed"));
  Bytes longer = file;
  longer.push_back(0);
  CHECK_THROWS_MATCHES(unpacked(longer, 1000), DataError, Message("a.gz: 1 bytes are left over after the gzip stream"));
  Bytes damaged = file;
  damaged[damaged.size() - 6] ^= 1;  // of the checksum
  CHECK_THROWS_MATCHES(unpacked(damaged, 1000), DataError,
                       Message("a.gz: the gzip stream is damaged after 1000 unpacked bytes: incorrect data check"));
}

TEST_CASE("Zstandard frames are packed and unpacked") {
  for (const std::size_t count : {1, 1000, 300000}) {
    const Bytes content = some_bytes(count);
    const Bytes frame = compress_zstd(content);
    Bytes out(count);
    decompress_zstd(frame, out, "a.spz: part");
    CHECK(out == content);
  }
  const Bytes frame = compress_zstd(some_bytes(1000));
  for (const std::size_t count : {999, 1001}) {
    Bytes out(count);
    CHECK_THROWS_MATCHES(decompress_zstd(frame, out, "a.spz: part"), DataError,
                         Message("a.spz: part: the Zstandard frame says that it holds 1000 bytes; " +
                                 std::to_string(count) + " are needed"));
  }
  Bytes out(1000);
  for (std::size_t size = 0; size < frame.size(); ++size)
    CHECK_THROWS_AS(decompress_zstd(std::span(frame).first(size), out, "a"), DataError);
  CHECK_THROWS_AS(decompress_zstd({}, out, "a"), DataError);
}

}  // namespace compression_test
