// Archives of arrays without their checksums, which stop nearly every mutation: a list of members, of which a whole
// archive is made again before the reader sees it.
//
//   'L', and again and again: length of the name (1 byte), name, length of the content (2 bytes, little-endian),
//   content
#pragma once

#include <algorithm>
#include <string>

#include "tests/fuzz/fuzz.h"
#include "tests/support/zip_archive.h"

namespace hsi4d::fuzz {

inline Bytes list_of(const std::vector<test::ZipMember>& members) {
  Bytes list = {'L'};
  for (const test::ZipMember& member : members) {
    HSI4D_CHECK(member.name.size() < 256 && member.content.size() < 65536, member.name + " is too long for a list");
    test::put(list, member.name.size(), 1);
    test::put(list, member.name);
    test::put(list, member.content.size(), 2);
    list.insert(list.end(), member.content.begin(), member.content.end());
  }
  return list;
}

/// The members of an archive whose members are stored and whose local headers tell their sizes, as NpzWriter's do.
inline std::vector<test::ZipMember> members_of(std::span<const uint8_t> archive) {
  const auto number = [&](std::size_t at, int bytes) {
    std::size_t value = 0;
    for (int i = bytes - 1; i >= 0; --i) value = value << 8 | archive[at + static_cast<std::size_t>(i)];
    return value;
  };
  std::vector<test::ZipMember> members;
  for (std::size_t at = 0; at + 30 <= archive.size() && number(at, 4) == 0x04034b50;) {
    const std::size_t size = number(at + 18, 4), name = at + 30,
                      content = name + number(at + 26, 2) + number(at + 28, 2);
    HSI4D_CHECK(number(at + 8, 2) == 0 && (number(at + 6, 2) & 8U) == 0, "a member that is not stored");
    members.push_back({std::string(archive.begin() + static_cast<std::ptrdiff_t>(name),
                                   archive.begin() + static_cast<std::ptrdiff_t>(name + number(at + 26, 2))),
                       Bytes(archive.begin() + static_cast<std::ptrdiff_t>(content),
                             archive.begin() + static_cast<std::ptrdiff_t>(content + size))});
    at = content + size;
  }
  HSI4D_CHECK(!members.empty(), "an archive without members");
  return members;
}

inline Bytes list_of(std::span<const uint8_t> archive) { return list_of(members_of(archive)); }

inline bool is_list(std::span<const uint8_t> file) { return !file.empty() && file[0] == 'L'; }

/// The archive that a list stands for, or the bytes as they are. What a list tells of lengths is cut to what is there.
inline Bytes archive_of(std::span<const uint8_t> file) {
  if (!is_list(file)) return Bytes(file.begin(), file.end());
  std::span<const uint8_t> rest = file.subspan(1);
  const auto take = [&rest](std::size_t count) {
    const auto taken = rest.first(std::min(count, rest.size()));
    rest = rest.subspan(taken.size());
    return taken;
  };
  std::vector<test::ZipMember> members;
  while (rest.size() >= 3) {
    const auto name = take(take(1)[0]);
    const auto length = take(2);
    if (length.size() < 2) break;
    const auto content = take(length[0] + 256U * length[1]);
    members.push_back({std::string(name.begin(), name.end()), Bytes(content.begin(), content.end())});
  }
  return test::archive_of(members, false);
}

}  // namespace hsi4d::fuzz
