// PLY files as tables: the header, and the rows of one element as numbers.       [Turk, "The PLY Polygon File Format"]
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/types.h"

namespace hsi4d {

enum class PlyFormat { kAscii, kLittleEndian, kBigEndian };

enum class PlyType { kInt8, kUint8, kInt16, kUint16, kInt32, kUint32, kFloat32, kFloat64 };

struct PlyProperty {
  std::string name;
  PlyType type = PlyType::kFloat32;
  std::optional<PlyType> count_type;  ///< of a list: a count, then as many of `type`
};

struct PlyElement {
  std::string name;
  Index rows = 0;
  std::vector<PlyProperty> properties;

  /// The place of a property, or -1.
  int find(std::string_view property) const;
};

struct PlyHeader {
  PlyFormat format = PlyFormat::kAscii;
  std::vector<PlyElement> elements;
  std::vector<std::string> comments;  ///< what stands behind "comment ", in order
  std::size_t data_begin = 0;         ///< first byte after the header

  /// The place of an element, or -1.
  int find(std::string_view element) const;
};

/// The header of a PLY file. Lines end in LF or CR LF.
/// @param name  what error messages call the file
/// Throws DataError "NAME:LINE: ..." for anything that is no header of PLY 1.0, and "NAME: ..." when the file is too
/// short for the rows that it names.
PlyHeader read_ply_header(std::span<const std::uint8_t> file, const std::string& name);

/// An element and properties of it.
struct PlyNames {
  std::string element;
  std::vector<std::string> properties;
};

/// What a header has beside names that are known: "element face", and of known elements properties, "vertex.label".
std::vector<std::string> names_beside(const PlyHeader& header, std::span<const PlyNames> known);

/// Reads the rows of one element in order, and walks over all others, so that the whole file is checked.
///
/// @param element  its place in the header
/// @param columns  places of the element's properties that are wanted; none of them a list
/// @param take     receives the row's number and the columns' values
/// Throws DataError naming element and row: bytes missing or left over, a word that is no number, a list whose length
/// is none.
void read_ply_rows(std::span<const std::uint8_t> file, const PlyHeader& header, const std::string& name, int element,
                   std::span<const int> columns, FunctionRef<void(Index row, std::span<const double> values)> take);

/// Reads one property of an element, in order, and walks over all else: a list gives its numbers, another property one.
///
/// @param column  place of the element's property
/// Throws as read_ply_rows.
void read_ply_lists(std::span<const std::uint8_t> file, const PlyHeader& header, const std::string& name, int element,
                    int column, FunctionRef<void(Index row, std::span<const double> values)> take);

}  // namespace hsi4d
