// Arrays as numpy stores them (.npy): reading of numbers, booleans and strings, never of pickled objects.
#pragma once

#include <cstdint>
#include <initializer_list>
#include <optional>
#include <span>
#include <string>
#include <type_traits>
#include <vector>

#include "core/file.h"

namespace hsi4d {

/// What an array's elements are.
enum class NpyKind { floating, signed_integer, unsigned_integer, boolean, bytes, unicode };

/// A number that arrays are asked for and written in: float, double, or an integer of 8 to 64 bits.
template <class T>
concept NpyNumber = std::is_same_v<T, float> || std::is_same_v<T, double> ||
    (std::is_integral_v<T> && !std::is_same_v<T, bool> && sizeof(T) <= 8);

/// An array read from a file; its elements are held little-endian, in C order.
class NpyArray {
 public:
  /// @param source   what messages call it: "body.npz: array 'weights'"
  /// @param dtype    as in the file: "<f4"
  /// @param content  little-endian elements of item_size bytes each, C order
  NpyArray(std::string source, std::string dtype, NpyKind kind, int64_t item_size, std::vector<int64_t> shape,
           Bytes content);

  const std::string& source() const { return source_; }
  const std::string& dtype() const { return dtype_; }
  NpyKind kind() const { return kind_; }
  const std::vector<int64_t>& shape() const { return shape_; }
  /// Number of elements: the product of the shape, 1 for a scalar.
  int64_t size() const { return size_; }

  /// Returns the array when it has this shape; -1 stands for any length.
  /// Throws DataError with both: "body.npz: array 'weights' has shape [3,4]; [*,55] is needed".
  const NpyArray& require_shape(std::initializer_list<int64_t> wanted) const;

  /// All elements, C order, as T. Floats to a narrower float and integers to float are rounded to nearest.
  ///
  /// Throws DataError naming array, element and value: a string array; a number beyond T's range; one that is not whole
  /// (NaN too) where T is an integer.
  template <NpyNumber T>
  std::vector<T> as() const;

  /// The only element. Throws DataError when there are more or none; else as as().
  template <NpyNumber T>
  T scalar() const;

  /// All elements of a string array, C order, in UTF-8 without trailing zeros ('S' arrays byte for byte).
  /// Throws DataError for another kind of array, or a number that is no Unicode character.
  std::vector<std::string> strings() const;

  /// The only string. Throws DataError when there are more or none; else as strings().
  std::string text() const;

 private:
  void require_one() const;

  std::string source_;
  std::string dtype_;
  NpyKind kind_;
  int64_t item_size_;
  std::vector<int64_t> shape_;
  int64_t size_;
  Bytes content_;
};

/// "[3,4]"; "[]" for a scalar. -1 is shown as "*".
std::string shape_text(std::span<const int64_t> shape);

/// An array, or why it is not read: Python objects (nothing is unpickled), structures, complex numbers, dates.
struct NpyResult {
  std::optional<NpyArray> array;
  std::string unread_reason;
};

/// The array of a .npy file in memory.
///
/// Versions 1 to 3; dtypes f2 f4 f8, i1 to i8, u1 to u8, b1, S, U; both byte orders; C and Fortran order.
///
/// @param file    given away, so that a large array is in memory once
/// @param source  what error messages call it
/// Throws DataError naming the source and byte or sizes: not such a file, a header that is not exactly numpy's, fewer
/// or more bytes than the shape needs.
NpyResult decode_npy(Bytes file, const std::string& source);

/// The array in a .npy file. Throws UserError when the file cannot be read, DataError as decode_npy and for unread
/// dtypes.
NpyArray read_npy(const std::string& path);

/// A .npy file: version 1, little-endian, C order, data at a multiple of 64, as numpy writes it.
/// Throws InternalError when the count of values is not the product of the shape.
template <NpyNumber T>
Bytes encode_npy(std::span<const int64_t> shape, std::span<const T> values);

/// As encode_npy, of strings ('<U' of the longest). Throws InternalError for text that is not UTF-8 or ends in a zero.
Bytes encode_npy(std::span<const int64_t> shape, std::span<const std::string> values);

}  // namespace hsi4d
