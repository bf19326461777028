// Archives of named arrays as numpy stores them (.npz): reading, and writing with the same bytes every time.
#pragma once

#include <cstdint>
#include <map>
#include <set>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "core/npy.h"

namespace hsi4d {

/// The arrays of a .npz file, all of them in memory.
///
///   const Npz body = Npz::read("body.npz");
///   const std::vector<float> weights = body.array("weights").require_shape({-1, 55}).as<float>();
class Npz {
 public:
  /// A member that is not read, and why: "holds Python objects (dtype '|O'), which are not unpickled".
  struct Skipped {
    std::string name;
    std::string reason;
  };

  /// The arrays of an archive: stored or deflated members, zip64 too. Each member's length and checksum are tested.
  ///
  /// @param path       UTF-8
  /// @param max_bytes  all arrays together, unpacked
  /// Throws UserError when the file cannot be read; DataError naming the file and the array: no zip archive, encrypted,
  /// another packing, damaged, an array twice, more than max_bytes, or what decode_npy refuses.
  static Npz read(const std::string& path, int64_t max_bytes = kMaxFileBytes);

  /// As read, of an archive in memory.
  /// @param source  what error messages call it
  static Npz decode(std::span<const uint8_t> file, const std::string& source, int64_t max_bytes = kMaxFileBytes);

  /// The file's path, for messages.
  const std::string& source() const { return source_; }
  /// Names of the arrays, in the file's order.
  const std::vector<std::string>& names() const { return names_; }
  /// Members that are not read, in the file's order.
  const std::vector<Skipped>& skipped() const { return skipped_; }

  /// Whether array(name) has something to return.
  bool has(std::string_view name) const { return arrays_.contains(name); }

  /// The array of that name. Throws DataError naming the file: skipped (and why), or absent (and which are there).
  const NpyArray& array(std::string_view name) const;

 private:
  std::string source_;
  std::vector<std::string> names_;
  std::vector<Skipped> skipped_;
  std::map<std::string, NpyArray, std::less<>> arrays_;
};

/// How members of an archive are packed.
enum class NpzPacking { stored, deflated };

/// Collects arrays and writes them as a .npz file: little-endian, C order, one fixed date, so that equal arrays give
/// equal files; zip64 where sizes or counts need it.
///
/// add throws InternalError for an empty or repeated name, or a count of values that is not the product of the shape.
class NpzWriter {
 public:
  /// An array of numbers, C order; shape {} for a scalar.
  template <NpyNumber T>
  void add(const std::string& name, std::span<const int64_t> shape, std::span<const T> values) {
    add_member(name, encode_npy(shape, values));
  }
  template <NpyNumber T>
  void add(const std::string& name, std::initializer_list<int64_t> shape, const std::vector<T>& values) {
    add(name, std::span(shape.begin(), shape.size()), std::span<const T>(values));
  }

  /// A single number, shape [].
  template <NpyNumber T>
  void add_scalar(const std::string& name, T value) {
    add(name, std::span<const int64_t>(), std::span<const T>(&value, 1));
  }

  /// A single string, shape [], UTF-8.
  void add_text(const std::string& name, const std::string& text);

  /// Strings, shape [number of strings], UTF-8.
  void add_texts(const std::string& name, std::span<const std::string> texts);

  /// The archive's bytes; members in the order of the calls of add.
  Bytes encode(NpzPacking packing = NpzPacking::stored) const;

  /// Writes the archive in one step (see AtomicFile). Throws UserError naming the path when that fails.
  void write(const std::string& path, NpzPacking packing = NpzPacking::stored) const;

 private:
  void add_member(const std::string& name, Bytes content);

  std::vector<std::pair<std::string, Bytes>> members_;
  std::set<std::string> names_;
};

}  // namespace hsi4d
