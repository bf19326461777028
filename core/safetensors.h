// Files of named arrays in the safetensors format: networks, and own formats that are exchanged with other programs.
//
//   8 bytes   length L of the header, little-endian
//   L bytes   JSON: {"__metadata__": {TEXT: TEXT}, NAME: {"dtype", "shape", "data_offsets": [begin, end]}, ...}
//   the rest  the arrays, C order, little-endian, one after the other without a gap
//
// [Hugging Face, safetensors, format description]. Nothing in such a file can be executed. Own formats name themselves
// in the metadata, as `format` and `version`.
#pragma once

#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "core/npy.h"

namespace hsi4d {

/// The longest header that is read.
inline constexpr int64_t kMaxSafetensorsHeader = int64_t{16} << 20;

/// The arrays of a .safetensors file, all of them in memory.
///
///   const Safetensors file = Safetensors::read("net.safetensors");
///   file.require_format("hsi4d colour net", 1);
///   const std::vector<float> weights = file.array("layer0.weights").require_shape({-1, 64}).as<float>();
class Safetensors {
 public:
  /// The arrays of a file: dtypes F64 F32 F16 BF16, I8 to I64, U8 to U64, BOOL. Others are kept as names, and refused
  /// when they are asked for.
  ///
  /// @param path  UTF-8
  /// Throws UserError when the file cannot be read; DataError naming the file and the array: a header that is longer
  /// than the file or than kMaxSafetensorsHeader, no JSON, other keys than above, a name twice, lengths that the shape
  /// does not give, arrays that overlap, leave gaps or do not end where the file does.
  static Safetensors read(const std::string& path);

  /// As read, of a file in memory.
  /// @param source  what error messages call it
  static Safetensors decode(std::span<const uint8_t> file, const std::string& source);

  /// The file's path, for messages.
  const std::string& source() const { return source_; }
  /// Names of the arrays that can be read, in the order of their bytes.
  const std::vector<std::string>& names() const { return names_; }
  /// Whether array(name) has something to return.
  bool has(std::string_view name) const { return arrays_.contains(name); }
  /// The array of that name. Throws DataError naming the file: absent (and which are there), or of a dtype that is not
  /// read.
  const NpyArray& array(std::string_view name) const;

  /// The texts beside the arrays.
  const std::map<std::string, std::string, std::less<>>& metadata() const { return metadata_; }
  /// One of them. Throws DataError naming the file when it is absent.
  const std::string& text(std::string_view key) const;
  /// A list of texts, as SafetensorsWriter::set_texts writes it. Throws DataError as text, and when it is no such list.
  std::vector<std::string> texts(std::string_view key) const;

  /// The version, when the metadata's `format` is this and its `version` is 1 to `newest`.
  /// Throws DataError naming the file, what it is and what is read.
  int require_format(std::string_view format, int newest) const;

 private:
  std::string source_;
  std::vector<std::string> names_;
  std::map<std::string, std::string, std::less<>> unread_;  // name to dtype
  std::map<std::string, NpyArray, std::less<>> arrays_;
  std::map<std::string, std::string, std::less<>> metadata_;
};

/// Whether a file begins as safetensors do: a length, and a header that begins with '{'. Of the first 9 bytes.
bool looks_like_safetensors(std::span<const uint8_t> start);

/// Collects arrays and texts and writes them as a .safetensors file; equal content gives equal files.
///
/// add throws InternalError for a name that is empty, "__metadata__" or repeated, or a count of values that is not the
/// product of the shape; set_text for a repeated key; all for text that is not UTF-8.
class SafetensorsWriter {
 public:
  /// Own formats: sets `format` and `version`.
  SafetensorsWriter(std::string_view format, int version);
  /// A file of no particular format.
  SafetensorsWriter() = default;

  /// An array of numbers, C order; shape {} for a scalar.
  template <NpyNumber T>
  void add(const std::string& name, std::span<const int64_t> shape, std::span<const T> values);
  template <NpyNumber T>
  void add(const std::string& name, std::initializer_list<int64_t> shape, const std::vector<T>& values) {
    add(name, std::span(shape.begin(), shape.size()), std::span<const T>(values));
  }

  /// A text beside the arrays.
  void set_text(const std::string& key, std::string_view text);
  /// A list of texts: a JSON array of strings, as one text.
  void set_texts(const std::string& key, std::span<const std::string> texts);

  /// The file's bytes: arrays by the size of their numbers, the largest first, then in the order of the calls of add,
  /// so that every array begins at a multiple of it; the first at a multiple of 64.
  Bytes encode() const;

  /// Writes the file in one step (see AtomicFile). Throws UserError naming the path when that fails.
  void write(const std::string& path) const;

 private:
  struct Member {
    std::string name, dtype;
    int64_t item_size;
    std::vector<int64_t> shape;
    Bytes content;
  };
  void add_member(Member member, int64_t count);

  std::vector<Member> members_;
  std::vector<std::pair<std::string, std::string>> texts_;
};

}  // namespace hsi4d
