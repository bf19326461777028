// Zip archives made by hand, byte for byte, for readers to refuse.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/file.h"
#include "tests/support/crc32.h"

namespace hsi4d::test {

inline void put(Bytes& out, uint64_t value, int bytes) {
  for (int i = 0; i < bytes; ++i) out.push_back(static_cast<uint8_t>(value >> (8 * i)));
}

inline void put(Bytes& out, const std::string& text) {
  for (const char c : text) out.push_back(static_cast<uint8_t>(c));
}

/// A member of an archive made by hand. Fields that are set differ from the truth.
struct ZipMember {
  std::string name;
  Bytes content;
  int method = 0;
  int flags = 0;
  int64_t claimed_size = -1;
  int64_t claimed_packed = -1;
  bool zip64 = false;
};

/// The fields from "flags" to "extra length" that both headers share.
inline void put_fields(Bytes& out, const ZipMember& member, uint64_t extra_bytes) {
  const uint64_t size = member.claimed_size >= 0 ? member.claimed_size : member.content.size();
  const uint64_t packed = member.claimed_packed >= 0 ? member.claimed_packed : member.content.size();
  put(out, member.flags, 2);
  put(out, member.method, 2);
  put(out, 0x00210000, 4);
  put(out, crc32_of(member.content), 4);
  put(out, member.zip64 ? 0xffffffffu : packed, 4);
  put(out, member.zip64 ? 0xffffffffu : size, 4);
  put(out, member.name.size(), 2);
  put(out, extra_bytes, 2);
}

inline void put_extra(Bytes& out, const ZipMember& member) {
  put(out, 1, 2);
  put(out, 16, 2);
  put(out, member.content.size(), 8);
  put(out, member.content.size(), 8);
}

/// APPNOTE.TXT sections 4.3.7 (local header), 4.3.12 (central), 4.3.14 and 4.3.15 (zip64 end), 4.3.16 (end).
inline Bytes archive_of(const std::vector<ZipMember>& members, bool zip64_end) {
  Bytes file, central;
  for (const ZipMember& member : members) {
    const uint64_t offset = file.size(), extra_bytes = member.zip64 ? 20 : 0;
    put(file, "PK\3\4");
    put(file, 45, 2);
    put_fields(file, member, extra_bytes);
    put(file, member.name);
    if (member.zip64) put_extra(file, member);
    file.insert(file.end(), member.content.begin(), member.content.end());
    put(central, "PK\1\2");
    put(central, 45, 2);
    put(central, 45, 2);
    put_fields(central, member, extra_bytes);
    put(central, 0, 6);  // comment length, disk, internal attributes
    put(central, 0, 4);  // external attributes
    put(central, offset, 4);
    put(central, member.name);
    if (member.zip64) put_extra(central, member);
  }
  const uint64_t central_offset = file.size();
  file.insert(file.end(), central.begin(), central.end());
  if (zip64_end) {
    const uint64_t end64_offset = file.size();
    put(file, "PK\6\6");
    put(file, 44, 8);
    put(file, 45, 2);
    put(file, 45, 2);
    put(file, 0, 8);
    put(file, members.size(), 8);
    put(file, members.size(), 8);
    put(file, central.size(), 8);
    put(file, central_offset, 8);
    put(file, "PK\6\7");
    put(file, 0, 4);
    put(file, end64_offset, 8);
    put(file, 1, 4);
  }
  put(file, "PK\5\6");
  put(file, 0, 4);
  put(file, zip64_end ? 0xffff : members.size(), 2);
  put(file, zip64_end ? 0xffff : members.size(), 2);
  put(file, zip64_end ? 0xffffffffu : central.size(), 4);
  put(file, zip64_end ? 0xffffffffu : central_offset, 4);
  put(file, 0, 2);
  return file;
}

/// A .npy file of a pickled Python object.
inline Bytes pickled_npy() {
  const std::string dict = "{'descr': '|O', 'fortran_order': False, 'shape': (), }";
  Bytes file;
  put(file, std::string("\x93NUMPY\1\0", 8));
  put(file, dict.size(), 2);
  put(file, dict + "\x80\x04.");
  return file;
}

}  // namespace hsi4d::test
