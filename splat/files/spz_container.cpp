#include "splat/files/spz_container.h"

#include <algorithm>
#include <vector>

#include "core/check.h"
#include "core/compression.h"
#include "splat/files/quantised.h"

namespace hsi4d {
namespace {

constexpr std::array<std::uint8_t, 4> kMagic = {'N', 'G', 'S', 'P'};
constexpr std::size_t kHeaderBytes = 16, kHeaderBytes4 = 32, kTableRowBytes = 16;
constexpr int kHighestDegreeOfFile = 4;
constexpr int kMostFractionalBits = 24;
constexpr std::uint64_t kMostExtensionBytes = std::uint64_t{1} << 20;
constexpr std::uint64_t kLeastCredible = std::uint64_t{64} << 20;  // bytes that any file may unpack to
constexpr std::uint64_t kDensestCredible = 2048;                   // bytes that a byte of a larger file may
constexpr std::array<const char*, kSpzAttributes> kNames = {"positions",  "opacities", "colours",
                                                            "log-scales", "rotations", "harmonics"};

// Reading -------------------------------------------------------------------------------------------------------------

/// The fields that all versions have at the same places.
SpzHeader read_header(std::span<const std::uint8_t> bytes, const std::string& name) {
  if (!std::equal(kMagic.begin(), kMagic.end(), bytes.begin()))
    throw DataError(name + ": this is no .spz file: its content does not begin with \"NGSP\"");
  const std::uint64_t version = load_uint(&bytes[4], 4);
  if (version < 1 || version > kSpzVersionInFrames)
    throw DataError(name + ": version " + std::to_string(version) + " of .spz is not known; allowed: 1 to 4");
  SpzHeader header;
  header.version = static_cast<int>(version);
  header.count = load_uint(&bytes[8], 4);
  header.degree = bytes[12];
  header.fractional_bits = bytes[13];
  header.flags = bytes[14];
  if (header.degree > kHighestDegreeOfFile)
    throw DataError(name + ": spherical harmonics of degree " + std::to_string(header.degree) + "; allowed: 0 to 4");
  if (header.fractional_bits > kMostFractionalBits)
    throw DataError(name + ": " + std::to_string(header.fractional_bits) +
                    " fractional bits of positions; allowed: 0 to 24");
  return header;
}

/// Before memory is taken: what the header asks for is credible for a file of this size.
void check_size(const SpzHeader& header, std::size_t file_size, std::uint64_t most, const std::string& name) {
  if (header.all_bytes() <= most) return;
  throw DataError(name + ": the header names " + std::to_string(header.count) + " Gaussians, which are " +
                  std::to_string(header.all_bytes()) + " bytes; a file of " + std::to_string(file_size) +
                  " bytes cannot hold them");
}

/// The attributes lie in `memory` one after the other.
void split(SpzContent& content) {
  std::size_t at = 0;
  for (std::size_t a = 0; a < kSpzAttributes; ++a) {
    const auto size = static_cast<std::size_t>(content.header.bytes(a));
    content.attributes[a] = std::span(content.memory).subspan(at, size);
    at += size;
  }
}

void refuse_version_4_inside(const SpzHeader& header, const std::string& name) {
  if (header.version == kSpzVersionInFrames)
    throw DataError(name + ": the gzip stream holds a .spz of version 4, which is not packed that way");
}

/// Versions 1 to 3 in a gzip stream.
SpzContent unpack_gzip(std::span<const std::uint8_t> file, const std::string& name) {
  GzipReader reader(file, name);
  SpzContent content;
  std::array<std::uint8_t, kHeaderBytes> head;
  reader.read(head);
  content.header = read_header(head, name);
  refuse_version_4_inside(content.header, name);
  check_size(content.header, file.size(), file.size() * kDensestDeflate, name);
  content.memory.resize(static_cast<std::size_t>(content.header.all_bytes()));
  reader.read(content.memory);
  if ((content.header.flags & kSpzHasExtensions) != 0) {
    content.extensions.resize(kMostExtensionBytes);
    content.extensions.resize(reader.read_some(content.extensions));
  }
  reader.expect_end();
  split(content);
  return content;
}

/// Versions 1 to 3 as they are before gzip.
SpzContent unpack_plain(std::span<const std::uint8_t> file, const SpzHeader& header, const std::string& name) {
  SpzContent content;
  content.header = header;
  const std::size_t there = file.size() - kHeaderBytes;
  const std::uint64_t needed = header.all_bytes();
  const bool longer = (header.flags & kSpzHasExtensions) != 0;
  if (there < needed || (there > needed && !longer))
    throw DataError(name + ": the header names " + std::to_string(header.count) + " Gaussians, which are " +
                    std::to_string(needed) + " bytes; the file has " + std::to_string(there) +
                    " for them: it was cut short, or its header is wrong");
  const auto begin = file.begin() + kHeaderBytes;
  content.memory.assign(begin, begin + static_cast<std::ptrdiff_t>(needed));
  content.extensions.assign(begin + static_cast<std::ptrdiff_t>(needed), file.end());
  split(content);
  return content;
}

/// A frame of version 4.
struct Frame {
  std::size_t attribute;
  std::span<const std::uint8_t> packed;
};

/// The table of lengths, checked against the header and the file.
std::vector<Frame> read_table(std::span<const std::uint8_t> file, const SpzHeader& header, std::size_t table,
                              const std::string& name) {
  std::vector<Frame> frames;
  for (std::size_t a = 0; a < kSpzAttributes; ++a) {
    if (header.bytes(a) > 0) frames.push_back({a, {}});
  }
  if (file[15] != frames.size())
    throw DataError(name + ": the header names " + std::to_string(file[15]) + " frames; " +
                    std::to_string(header.count) + " Gaussians of degree " + std::to_string(header.degree) + " have " +
                    std::to_string(frames.size()));
  if (table < kHeaderBytes4 || table + kTableRowBytes * frames.size() > file.size())
    throw DataError(name + ": the table of lengths is said to be at byte " + std::to_string(table) + " of a file of " +
                    std::to_string(file.size()));
  std::size_t row = table, at = table + kTableRowBytes * frames.size();
  for (Frame& frame : frames) {
    const std::uint64_t packed = load_uint(&file[row], 8), unpacked = load_uint(&file[row + 8], 8);
    const std::string what = name + ": " + kNames[frame.attribute];
    if (unpacked != header.bytes(frame.attribute))
      throw DataError(what + ": the table names " + std::to_string(unpacked) + " bytes; " +
                      std::to_string(header.count) + " Gaussians have " +
                      std::to_string(header.bytes(frame.attribute)));
    if (packed > file.size() - at)
      throw DataError(what + ": the frame at byte " + std::to_string(at) + " is said to have " +
                      std::to_string(packed) + " bytes; the file ends after " + std::to_string(file.size() - at));
    frame.packed = file.subspan(at, static_cast<std::size_t>(packed));
    row += kTableRowBytes;
    at += static_cast<std::size_t>(packed);
  }
  if (at != file.size())
    throw DataError(name + ": " + std::to_string(file.size() - at) + " bytes are left over after the last frame");
  return frames;
}

/// Version 4.
SpzContent unpack_frames(std::span<const std::uint8_t> file, const SpzHeader& header, const std::string& name) {
  if (file.size() < kHeaderBytes4)
    throw DataError(name + ": the header of version 4 has 32 bytes; the file has " + std::to_string(file.size()));
  check_size(header, file.size(), std::max(kLeastCredible, file.size() * kDensestCredible), name);
  const auto table = static_cast<std::size_t>(load_uint(&file[16], 4));
  const std::vector<Frame> frames = read_table(file, header, table, name);
  SpzContent content;
  content.header = header;
  content.extensions.assign(file.begin() + kHeaderBytes4, file.begin() + static_cast<std::ptrdiff_t>(table));
  content.memory.resize(static_cast<std::size_t>(header.all_bytes()));
  split(content);
  std::size_t at = 0;
  for (const Frame& frame : frames) {
    const auto out = std::span(content.memory).subspan(at, static_cast<std::size_t>(header.bytes(frame.attribute)));
    decompress_zstd(frame.packed, out, name + ": " + kNames[frame.attribute]);
    at += out.size();
  }
  return content;
}

// Writing -------------------------------------------------------------------------------------------------------------

Bytes header_bytes(const SpzHeader& header) {
  Bytes out(kMagic.begin(), kMagic.end());
  append_uint(out, static_cast<std::uint64_t>(header.version), 4);
  append_uint(out, header.count, 4);
  append_uint(out, static_cast<std::uint64_t>(header.degree), 1);
  append_uint(out, static_cast<std::uint64_t>(header.fractional_bits), 1);
  append_uint(out, header.flags, 1);
  return out;
}

Bytes packed_gzip(Bytes head, const std::array<Bytes, kSpzAttributes>& attributes) {
  head.resize(kHeaderBytes);
  for (const Bytes& attribute : attributes) head.insert(head.end(), attribute.begin(), attribute.end());
  return compress_gzip(head);
}

Bytes packed_frames(Bytes head, const std::array<Bytes, kSpzAttributes>& attributes) {
  std::uint8_t count = 0;
  Bytes table, frames;
  for (const Bytes& attribute : attributes) {
    if (attribute.empty()) continue;
    const Bytes frame = compress_zstd(attribute);
    append_uint(table, frame.size(), 8);
    append_uint(table, attribute.size(), 8);
    frames.insert(frames.end(), frame.begin(), frame.end());
    ++count;
  }
  append_uint(head, count, 1);
  append_uint(head, kHeaderBytes4, 4);
  head.resize(kHeaderBytes4);
  head.insert(head.end(), table.begin(), table.end());
  head.insert(head.end(), frames.begin(), frames.end());
  return head;
}

}  // namespace

SpzContent unpack_spz(std::span<const std::uint8_t> file, const std::string& name) {
  if (file.size() >= 2 && file[0] == 0x1f && file[1] == 0x8b) return unpack_gzip(file, name);
  if (file.size() < kHeaderBytes)
    throw DataError(name + ": this is no .spz file: it has " + std::to_string(file.size()) +
                    " bytes, its header alone has 16");
  const SpzHeader header = read_header(file, name);
  return header.version == kSpzVersionInFrames ? unpack_frames(file, header, name) : unpack_plain(file, header, name);
}

Bytes pack_spz(const SpzHeader& header, const std::array<Bytes, kSpzAttributes>& attributes) {
  return header.version == kSpzVersionInFrames ? packed_frames(header_bytes(header), attributes)
                                               : packed_gzip(header_bytes(header), attributes);
}

}  // namespace hsi4d
