#include "core/npy.h"

#include <algorithm>
#include <array>
#include <bit>
#include <charconv>
#include <cmath>
#include <cstring>
#include <functional>
#include <limits>
#include <numeric>
#include <string_view>
#include <utility>

#include <half.h>

#include "core/check.h"
#include "core/npy_header.h"

namespace hsi4d {
namespace {

static_assert(std::endian::native == std::endian::little, "elements are copied as they stand in the file");

[[noreturn]] void fail_npy(const std::string& source, const std::string& reason) {
  throw DataError(source + ": " + reason);
}

// Types ---------------------------------------------------------------------------------------------------------------

struct NpyType {
  NpyKind kind;
  int64_t item_size;  // bytes
  int64_t swap_size;  // bytes that a byte order applies to
  bool big_endian;
};

std::optional<NpyKind> kind_of(char letter) {
  switch (letter) {
    case 'f':
      return NpyKind::floating;
    case 'i':
      return NpyKind::signed_integer;
    case 'u':
      return NpyKind::unsigned_integer;
    case 'b':
      return NpyKind::boolean;
    case 'S':
      return NpyKind::bytes;
    case 'U':
      return NpyKind::unicode;
    default:
      return std::nullopt;
  }
}

bool is_size_of(NpyKind kind, int64_t number) {
  switch (kind) {
    case NpyKind::floating:
      return number == 2 || number == 4 || number == 8;
    case NpyKind::boolean:
      return number == 1;
    case NpyKind::bytes:
    case NpyKind::unicode:
      return number >= 0 && number <= (int64_t{1} << 28);
    default:
      return number == 1 || number == 2 || number == 4 || number == 8;
  }
}

/// A byte order, a letter and a number of bytes (of characters for U). Nothing for a type that is not read.
std::optional<NpyType> parse_type(std::string_view dtype) {
  if (dtype.size() < 3) return std::nullopt;
  const char order = dtype[0];
  const std::optional<NpyKind> kind = kind_of(dtype[1]);
  int64_t number = -1;
  const auto [end, error] = std::from_chars(dtype.data() + 2, dtype.data() + dtype.size(), number);
  if (!kind || error != std::errc{} || end != dtype.data() + dtype.size() || !is_size_of(*kind, number)) {
    return std::nullopt;
  }
  const bool unicode = *kind == NpyKind::unicode;
  const int64_t swap_size = unicode ? 4 : *kind == NpyKind::bytes ? 1 : number;
  if (order != '<' && order != '>' && order != '=' && !(order == '|' && swap_size == 1)) return std::nullopt;
  return NpyType{*kind, unicode ? 4 * number : number, swap_size, order == '>'};
}

std::string unread_reason(const std::string& dtype) {
  const bool objects = dtype.find('O') <= 1;
  return objects ? "holds Python objects (dtype '" + dtype + "'), which are not unpickled"
                 : "has dtype '" + dtype + "', which is not read";
}

// Layout --------------------------------------------------------------------------------------------------------------

/// The product of the shape and the item size, or nothing beyond int64.
std::optional<int64_t> bytes_needed(std::span<const int64_t> shape, int64_t item_size) {
  if (std::ranges::find(shape, 0) != shape.end()) return 0;
  int64_t bytes = 1;
  for (const int64_t length : shape) {
    if (length > std::numeric_limits<int64_t>::max() / bytes) return std::nullopt;
    bytes *= length;
  }
  // Elements are counted too, which matters for strings of no characters.
  if (bytes > std::numeric_limits<int64_t>::max() / std::max<int64_t>(1, item_size)) return std::nullopt;
  return bytes * item_size;
}

int64_t product(std::span<const int64_t> shape) {
  // Before multiplying: beside a zero, the other lengths may be anything.
  if (std::ranges::find(shape, 0) != shape.end()) return 0;
  return std::accumulate(shape.begin(), shape.end(), int64_t{1}, std::multiplies<>());
}

void swap_bytes(Bytes& content, int64_t swap_size) {
  for (auto at = content.begin(); at != content.end(); at += swap_size) std::reverse(at, at + swap_size);
}

/// From first index fastest to last index fastest.
Bytes c_order(const Bytes& fortran, std::span<const int64_t> shape, int64_t item_size) {
  Bytes result(fortran.size());
  const size_t n = shape.size();
  std::vector<int64_t> strides(n), index(n, 0);
  int64_t stride = item_size;
  for (size_t d = 0; d < n; ++d) stride *= shape[d], strides[d] = stride / shape[d];
  int64_t from = 0;
  for (int64_t to = 0; to < std::ssize(result); to += item_size) {
    std::memcpy(result.data() + to, fortran.data() + from, static_cast<size_t>(item_size));
    for (size_t d = n; d-- > 0;) {
      from += strides[d];
      if (++index[d] < shape[d]) break;
      from -= strides[d] * shape[d];
      index[d] = 0;
    }
  }
  return result;
}

// Numbers -------------------------------------------------------------------------------------------------------------

template <class T>
std::string entry_text(T value) {
  std::array<char, 64> text;
  const auto end = std::to_chars(text.data(), text.data() + text.size(), value).ptr;
  return std::string(text.data(), end);
}

template <class To>
std::string type_text() {
  if constexpr (std::is_same_v<To, float>) return "float32";
  if constexpr (std::is_same_v<To, double>) return "float64";
  return (std::is_signed_v<To> ? "int" : "uint") + std::to_string(8 * sizeof(To));
}

/// The value as To, or nothing where To cannot hold it. Comparisons are written so that NaN fails.
template <class To, class From>
std::optional<To> convert(From value) {
  if constexpr (std::is_same_v<To, float> && std::is_same_v<From, double>) {
    const bool fits = !std::isfinite(value) || std::abs(value) <= From{std::numeric_limits<To>::max()};
    return fits ? std::optional(static_cast<To>(value)) : std::nullopt;
  } else if constexpr (std::is_floating_point_v<To>) {
    return static_cast<To>(value);
  } else if constexpr (std::is_floating_point_v<From>) {
    const From low = static_cast<From>(std::numeric_limits<To>::min());
    const From end = std::ldexp(From{1}, std::numeric_limits<To>::digits);
    if (!(value >= low && value < end && value == std::trunc(value))) return std::nullopt;
    return static_cast<To>(value);
  } else {
    return std::in_range<To>(value) ? std::optional(static_cast<To>(value)) : std::nullopt;
  }
}

template <class To, class From>
std::vector<To> convert_all(const Bytes& content, const std::string& source) {
  std::vector<To> result(content.size() / sizeof(From));
  for (size_t i = 0; i < result.size(); ++i) {
    From value;
    std::memcpy(&value, content.data() + i * sizeof(From), sizeof(From));
    const std::optional<To> converted = convert<To, From>(value);
    if (!converted) {
      const char* needed = std::is_integral_v<To> ? "whole numbers in the range of " : "numbers in the range of ";
      fail_npy(source, "element " + std::to_string(i) + " is " + entry_text(value) + "; " + needed + type_text<To>() +
                           " are needed");
    }
    result[i] = *converted;
  }
  return result;
}

template <class To>
std::vector<To> convert_halves(const Bytes& content, const std::string& source) {
  Bytes floats(2 * content.size());
  for (size_t i = 0; i < content.size() / 2; ++i) {
    half value;
    value.setBits(static_cast<uint16_t>(content[2 * i] | content[2 * i + 1] << 8));
    const float wide = value;
    std::memcpy(floats.data() + 4 * i, &wide, 4);
  }
  return convert_all<To, float>(floats, source);
}

template <class To>
std::vector<To> convert_booleans(const Bytes& content) {
  std::vector<To> result(content.size());
  std::ranges::transform(content, result.begin(), [](uint8_t value) { return static_cast<To>(value != 0); });
  return result;
}

// Text ----------------------------------------------------------------------------------------------------------------

void append_utf8(std::string& text, uint32_t code) {
  const auto tail = [&](int shift) { text += static_cast<char>(0x80 | ((code >> shift) & 0x3f)); };
  if (code < 0x80) {
    text += static_cast<char>(code);
  } else if (code < 0x800) {
    text += static_cast<char>(0xc0 | code >> 6), tail(0);
  } else if (code < 0x10000) {
    text += static_cast<char>(0xe0 | code >> 12), tail(6), tail(0);
  } else {
    text += static_cast<char>(0xf0 | code >> 18), tail(12), tail(6), tail(0);
  }
}

bool is_character(uint32_t code) { return code < 0x110000 && !(code >= 0xd800 && code < 0xe000); }

/// Code points of UTF-8 text; refuses overlong and cut sequences.
std::vector<uint32_t> characters(const std::string& text) {
  std::vector<uint32_t> result;
  for (size_t i = 0; i < text.size();) {
    const uint8_t lead = static_cast<uint8_t>(text[i]);
    const size_t length = lead < 0x80 ? 1 : lead >> 5 == 6 ? 2 : lead >> 4 == 14 ? 3 : lead >> 3 == 30 ? 4 : 0;
    HSI4D_CHECK(length > 0 && length <= text.size() - i, "text is not UTF-8");
    uint32_t code = length == 1 ? lead : lead & (0x7fu >> length);
    for (size_t k = 1; k < length; ++k) code = code << 6 | (static_cast<uint8_t>(text[i + k]) & 0x3f);
    std::string again;
    if (is_character(code)) append_utf8(again, code);
    HSI4D_CHECK(again == text.substr(i, length), "text is not UTF-8");
    result.push_back(code);
    i += length;
  }
  return result;
}

/// Magic, version 1.0, the dict padded with spaces so that the data begins at a multiple of 64.
Bytes header_bytes(std::span<const int64_t> shape, const std::string& dtype) {
  std::string dict = "{'descr': '" + dtype + "', 'fortran_order': False, 'shape': (";
  for (size_t d = 0; d < shape.size(); ++d) dict += (d > 0 ? ", " : "") + std::to_string(shape[d]);
  dict += shape.size() == 1 ? ",), }" : "), }";
  constexpr size_t kPrefix = 10;
  dict.append(63 - (kPrefix + dict.size()) % 64, ' ');
  dict += '\n';
  HSI4D_CHECK(dict.size() <= 0xffff, "a shape of " + std::to_string(shape.size()) + " dimensions");
  std::string header("\x93NUMPY\x01\x00", 8);
  header += static_cast<char>(dict.size() & 0xff);
  header += static_cast<char>(dict.size() >> 8);
  header += dict;
  return Bytes(header.begin(), header.end());
}

void check_count(std::span<const int64_t> shape, size_t count) {
  HSI4D_CHECK(std::ranges::none_of(shape, [](int64_t length) { return length < 0; }), shape_text(shape));
  const std::optional<int64_t> needed = bytes_needed(shape, 1);
  HSI4D_CHECK(needed && *needed == static_cast<int64_t>(count),
              "shape " + shape_text(shape) + " for " + std::to_string(count) + " values");
}

}  // namespace

// Reading -------------------------------------------------------------------------------------------------------------

std::string shape_text(std::span<const int64_t> shape) {
  std::string text = "[";
  for (size_t d = 0; d < shape.size(); ++d) {
    if (d > 0) text += ',';
    text += shape[d] < 0 ? "*" : std::to_string(shape[d]);
  }
  return text + "]";
}

NpyArray::NpyArray(std::string source, std::string dtype, NpyKind kind, int64_t item_size, std::vector<int64_t> shape,
                   Bytes content)
    : source_(std::move(source)),
      dtype_(std::move(dtype)),
      kind_(kind),
      item_size_(item_size),
      shape_(std::move(shape)),
      size_(product(shape_)),
      content_(std::move(content)) {
  HSI4D_CHECK_EQ(size_ * item_size_, std::ssize(content_));
}

const NpyArray& NpyArray::require_shape(std::initializer_list<int64_t> wanted) const {
  const auto fits = [](int64_t is, int64_t needed) { return needed < 0 || is == needed; };
  if (!std::equal(shape_.begin(), shape_.end(), wanted.begin(), wanted.end(), fits)) {
    fail_npy(source_,
             "has shape " + shape_text(shape_) + "; " + shape_text({wanted.begin(), wanted.size()}) + " is needed");
  }
  return *this;
}

template <NpyNumber T>
std::vector<T> NpyArray::as() const {
  const bool is_signed = kind_ == NpyKind::signed_integer;
  switch (kind_) {
    case NpyKind::boolean:
      return convert_booleans<T>(content_);
    case NpyKind::floating:
      if (item_size_ == 2) return convert_halves<T>(content_, source_);
      return item_size_ == 4 ? convert_all<T, float>(content_, source_) : convert_all<T, double>(content_, source_);
    case NpyKind::bytes:
    case NpyKind::unicode:
      fail_npy(source_, "holds text (dtype '" + dtype_ + "'); numbers are needed");
    default:
      break;
  }
  switch (item_size_) {
    case 1:
      return is_signed ? convert_all<T, int8_t>(content_, source_) : convert_all<T, uint8_t>(content_, source_);
    case 2:
      return is_signed ? convert_all<T, int16_t>(content_, source_) : convert_all<T, uint16_t>(content_, source_);
    case 4:
      return is_signed ? convert_all<T, int32_t>(content_, source_) : convert_all<T, uint32_t>(content_, source_);
    default:
      return is_signed ? convert_all<T, int64_t>(content_, source_) : convert_all<T, uint64_t>(content_, source_);
  }
}

void NpyArray::require_one() const {
  if (size_ != 1) fail_npy(source_, "has shape " + shape_text(shape_) + "; a single value is needed");
}

template <NpyNumber T>
T NpyArray::scalar() const {
  require_one();
  return as<T>().front();
}

std::vector<std::string> NpyArray::strings() const {
  if (kind_ != NpyKind::bytes && kind_ != NpyKind::unicode) {
    fail_npy(source_, "holds numbers (dtype '" + dtype_ + "'); text is needed");
  }
  std::vector<std::string> result(static_cast<size_t>(size_));
  for (size_t i = 0; i < result.size(); ++i) {
    const uint8_t* item = content_.data() + i * static_cast<size_t>(item_size_);
    std::string& text = result[i];
    if (kind_ == NpyKind::bytes) {
      text.assign(item, item + item_size_);
    } else {
      for (int64_t at = 0; at < item_size_; at += 4) {
        uint32_t code;
        std::memcpy(&code, item + at, 4);
        if (!is_character(code)) {
          fail_npy(source_, "element " + std::to_string(i) + " holds " + std::to_string(code) +
                                ", which is no Unicode character");
        }
        append_utf8(text, code);
      }
    }
    text.erase(text.find_last_not_of('\0') + 1);
  }
  return result;
}

std::string NpyArray::text() const {
  require_one();
  return strings().front();
}

NpyResult decode_npy(Bytes file, const std::string& source) {
  const NpyHeader header = parse_npy_header(file, source);
  const std::optional<NpyType> type = parse_type(header.dtype);
  if (!type) return {std::nullopt, unread_reason(header.dtype)};
  const std::optional<int64_t> needed = bytes_needed(header.shape, type->item_size);
  const std::string shape = "shape " + shape_text(header.shape) + " of '" + header.dtype + "'";
  if (!needed) fail_npy(source, shape + " is too large");
  const int64_t present = std::ssize(file) - header.data_begin;
  if (*needed != present) {
    fail_npy(source, shape + " needs " + std::to_string(*needed) + " bytes, but " + std::to_string(present) +
                         (present < *needed ? " are there (truncated)" : " are there"));
  }
  // Strings of no characters take no bytes, so that the file's size does not bound their number.
  if (type->item_size == 0 && product(header.shape) > (1 << 20)) fail_npy(source, shape + " is too large");
  Bytes content = std::move(file);
  content.erase(content.begin(), content.begin() + header.data_begin);
  if (type->big_endian && type->swap_size > 1) swap_bytes(content, type->swap_size);
  if (header.fortran_order && header.shape.size() > 1 && *needed > 0) {
    content = c_order(content, header.shape, type->item_size);
  }
  return {NpyArray(source, header.dtype, type->kind, type->item_size, header.shape, std::move(content)), ""};
}

NpyArray read_npy(const std::string& path) {
  NpyResult result = decode_npy(read_file(path), path);
  if (!result.array) fail_npy(path, result.unread_reason);
  return std::move(*result.array);
}

// Writing -------------------------------------------------------------------------------------------------------------

template <NpyNumber T>
Bytes encode_npy(std::span<const int64_t> shape, std::span<const T> values) {
  check_count(shape, values.size());
  const char letter = std::is_floating_point_v<T> ? 'f' : std::is_signed_v<T> ? 'i' : 'u';
  Bytes result = header_bytes(shape, std::string(sizeof(T) == 1 ? "|" : "<") + letter + std::to_string(sizeof(T)));
  const uint8_t* begin = reinterpret_cast<const uint8_t*>(values.data());
  result.insert(result.end(), begin, begin + values.size_bytes());
  return result;
}

Bytes encode_npy(std::span<const int64_t> shape, std::span<const std::string> values) {
  check_count(shape, values.size());
  std::vector<std::vector<uint32_t>> texts;
  size_t longest = 1;
  for (const std::string& value : values) {
    HSI4D_CHECK(!value.ends_with('\0'), "text ends in a zero, which numpy would drop");
    texts.push_back(characters(value));
    longest = std::max(longest, texts.back().size());
  }
  Bytes result = header_bytes(shape, "<U" + std::to_string(longest));
  for (std::vector<uint32_t>& text : texts) {
    text.resize(longest);
    const uint8_t* begin = reinterpret_cast<const uint8_t*>(text.data());
    result.insert(result.end(), begin, begin + 4 * longest);
  }
  return result;
}

#define HSI4D_NPY_NUMBER(T)                     \
  template std::vector<T> NpyArray::as() const; \
  template T NpyArray::scalar() const;          \
  template Bytes encode_npy(std::span<const int64_t>, std::span<const T>);
HSI4D_NPY_NUMBER(float)
HSI4D_NPY_NUMBER(double)
HSI4D_NPY_NUMBER(int8_t)
HSI4D_NPY_NUMBER(int16_t)
HSI4D_NPY_NUMBER(int32_t)
HSI4D_NPY_NUMBER(int64_t)
HSI4D_NPY_NUMBER(uint8_t)
HSI4D_NPY_NUMBER(uint16_t)
HSI4D_NPY_NUMBER(uint32_t)
HSI4D_NPY_NUMBER(uint64_t)
#undef HSI4D_NPY_NUMBER

}  // namespace hsi4d
