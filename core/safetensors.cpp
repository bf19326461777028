#include "core/safetensors.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cstring>
#include <functional>
#include <limits>
#include <memory>
#include <numeric>
#include <optional>

#include "core/check.h"
#include "core/config_parse.h"
#include "core/file_kind.h"
#include "core/text.h"
#include "core/types.h"

namespace hsi4d {
namespace {

using Kind = ConfigValue::Kind;

constexpr std::string_view kMetadata = "__metadata__";
constexpr int64_t kLengthBytes = 8;
constexpr int64_t kDataAlignment = 64;  // bytes
constexpr std::size_t kMostTensorDimensions = 32;

struct TensorType {
  std::string_view name;
  const char* npy;  // its elements in memory
  NpyKind kind;
  int64_t item_size;
};
constexpr TensorType kTypes[] = {
    {"F64", "<f8", NpyKind::floating, 8},         {"F32", "<f4", NpyKind::floating, 4},
    {"F16", "<f2", NpyKind::floating, 2},         {"BF16", "<f4", NpyKind::floating, 2},
    {"I64", "<i8", NpyKind::signed_integer, 8},   {"I32", "<i4", NpyKind::signed_integer, 4},
    {"I16", "<i2", NpyKind::signed_integer, 2},   {"I8", "|i1", NpyKind::signed_integer, 1},
    {"U64", "<u8", NpyKind::unsigned_integer, 8}, {"U32", "<u4", NpyKind::unsigned_integer, 4},
    {"U16", "<u2", NpyKind::unsigned_integer, 2}, {"U8", "|u1", NpyKind::unsigned_integer, 1},
    {"BOOL", "|b1", NpyKind::boolean, 1}};

[[noreturn]] void fail_tensor(const std::string& source, const std::string& reason) {
  throw DataError(source + ": " + reason);
}

std::string named(std::string_view name) { return "'" + with_escapes(name) + "'"; }

// --- reading ---------------------------------------------------------------------------------------------------------

/// An array as the header has it.
struct Entry {
  std::string name, dtype;
  std::vector<int64_t> shape;
  int64_t begin = 0, end = 0;
};

std::optional<int64_t> size_member(const ConfigValue& value) {
  int64_t number = -1;
  const char* end = value.text.data() + value.text.size();
  if (value.kind != Kind::kNumber || std::from_chars(value.text.data(), end, number).ptr != end || number < 0)
    return std::nullopt;
  return number;
}

std::optional<std::vector<int64_t>> whole_numbers(const ConfigValue& value) {
  if (value.kind != Kind::kArray) return std::nullopt;
  std::vector<int64_t> numbers;
  for (const ConfigValue& item : value.items) {
    const std::optional<int64_t> number = size_member(item);
    if (!number) return std::nullopt;
    numbers.push_back(*number);
  }
  return numbers;
}

int64_t header_length(std::span<const uint8_t> file, const std::string& source) {
  if (std::ssize(file) < kLengthBytes)
    fail_tensor(source, "has " + std::to_string(file.size()) + " bytes; a safetensors file begins with 8 for a length");
  uint64_t length = 0;
  for (std::size_t i = kLengthBytes; i-- > 0;) length = length << 8 | file[i];
  const auto rest = static_cast<uint64_t>(file.size()) - kLengthBytes;
  if (length > rest || length > static_cast<uint64_t>(kMaxSafetensorsHeader))
    fail_tensor(source, "claims a header of " + std::to_string(length) + " bytes; " + std::to_string(rest) +
                            " follow, and at most " + std::to_string(kMaxSafetensorsHeader) + " are read");
  return static_cast<int64_t>(length);
}

ConfigValue parse_header(const std::string& text, const std::string& source) {
  if (!text.starts_with('{')) fail_tensor(source, "the header does not begin with '{'; this is no safetensors file");
  const auto origin = std::make_shared<ConfigSource>();
  origin->name = source;
  ConfigProblems problems;
  ConfigValue header;
  const bool is_read = parse_config_text(text, origin, problems, header);
  try {
    problems.throw_if_any();
  } catch (const UserError& error) {
    throw DataError(error.what());
  }
  if (!is_read || header.kind != Kind::kObject) fail_tensor(source, "the header is no JSON object");
  return header;
}

Entry entry_of(const ConfigMember& member, const std::string& label) {
  Entry entry;
  entry.name = member.key;
  if (member.value.kind != Kind::kObject) fail_tensor(label, "is " + kind_name(member.value) + ", not an object");
  const ConfigValue *dtype = find_member(member.value, "dtype"), *shape = find_member(member.value, "shape"),
                    *offsets = find_member(member.value, "data_offsets");
  if (!dtype || !shape || !offsets || member.value.members.size() != 3)
    fail_tensor(label, "needs the keys \"dtype\", \"shape\" and \"data_offsets\" and no other");
  if (dtype->kind != Kind::kString) fail_tensor(label, "the dtype is " + kind_name(*dtype) + ", not a string");
  entry.dtype = dtype->text;
  const auto lengths = whole_numbers(*shape);
  if (!lengths || lengths->size() > kMostTensorDimensions)
    fail_tensor(label, "the shape is " + shown(*shape) + "; allowed: at most 32 lengths from 0 on");
  entry.shape = *lengths;
  const auto range = whole_numbers(*offsets);
  if (!range || range->size() != 2 || (*range)[0] > (*range)[1])
    fail_tensor(label,
                "the data_offsets are " + shown(*offsets) + "; allowed: two numbers, the second not the smaller");
  entry.begin = (*range)[0];
  entry.end = (*range)[1];
  return entry;
}

/// The arrays in the order of their bytes, of which there is neither one twice nor one in none.
void check_layout(std::vector<Entry>& entries, int64_t bytes, const std::string& source) {
  std::stable_sort(entries.begin(), entries.end(), [](const Entry& a, const Entry& b) {
    return std::pair(a.begin, a.end) < std::pair(b.begin, b.end);
  });
  int64_t at = 0;
  for (const Entry& entry : entries) {
    if (entry.begin != at)
      fail_tensor(source + ": array " + named(entry.name), "begins at byte " + std::to_string(entry.begin) +
                                                               " of the data; it has to begin at " +
                                                               std::to_string(at) + ", where the array before it ends");
    at = entry.end;
  }
  if (at != bytes)
    fail_tensor(source, "the arrays end at byte " + std::to_string(at) + " of the data, of which there are " +
                            std::to_string(bytes) + (at > bytes ? "; the file is cut short" : ""));
}

/// The product of the shape, unless the bytes that it needs go beyond int64.
std::optional<int64_t> count_of(std::span<const int64_t> shape, int64_t item_size) {
  if (std::ranges::find(shape, 0) != shape.end()) return 0;
  int64_t count = 1;
  for (const int64_t length : shape) {
    if (length > std::numeric_limits<int64_t>::max() / item_size / count) return std::nullopt;
    count *= length;
  }
  return count;
}

/// The high halves of floats, as floats.
Bytes widened(std::span<const uint8_t> halves) {
  Bytes floats(2 * halves.size(), 0);
  for (std::size_t i = 0; i + 1 < halves.size(); i += 2) {
    floats[2 * i + 2] = halves[i];
    floats[2 * i + 3] = halves[i + 1];
  }
  return floats;
}

NpyArray array_of(const Entry& entry, const TensorType& type, std::span<const uint8_t> content,
                  const std::string& label) {
  const std::optional<int64_t> count = count_of(entry.shape, type.item_size);
  if (!count || *count * type.item_size != std::ssize(content))
    fail_tensor(label, "has " + std::to_string(content.size()) + " bytes; shape " + shape_text(entry.shape) + " of " +
                           entry.dtype +
                           (count ? " needs " + std::to_string(*count * type.item_size) : " needs too many"));
  const bool is_bf16 = type.name == "BF16";
  Bytes bytes = is_bf16 ? widened(content) : Bytes(content.begin(), content.end());
  return {label, type.npy, type.kind, is_bf16 ? 4 : type.item_size, entry.shape, std::move(bytes)};
}

}  // namespace

Safetensors Safetensors::read(const std::string& path) { return decode(read_file(path), path); }

Safetensors Safetensors::decode(std::span<const uint8_t> file, const std::string& source) {
  if (!looks_like_safetensors(file)) {
    const std::string other = other_kind(file, "a .safetensors file");
    if (!other.empty()) fail_tensor(source, other);
  }
  Safetensors result;
  result.source_ = source;
  const int64_t length = header_length(file, source);
  const auto begin = file.begin() + kLengthBytes;
  const ConfigValue header = parse_header(std::string(begin, begin + length), source);
  const std::span<const uint8_t> data = file.subspan(static_cast<std::size_t>(kLengthBytes + length));
  std::vector<Entry> entries;
  for (const ConfigMember& member : header.members) {
    if (member.key != kMetadata) {
      entries.push_back(entry_of(member, source + ": array " + named(member.key)));
      continue;
    }
    if (member.value.kind != Kind::kObject) fail_tensor(source, "the metadata is " + kind_name(member.value));
    for (const ConfigMember& text : member.value.members) {
      if (text.value.kind != Kind::kString)
        fail_tensor(source, "metadata " + named(text.key) + " is " + kind_name(text.value) + ", not a string");
      result.metadata_.emplace(text.key, text.value.text);
    }
  }
  check_layout(entries, std::ssize(data), source);
  for (const Entry& entry : entries) {
    const auto type = std::ranges::find(kTypes, entry.dtype, &TensorType::name);
    if (type == std::end(kTypes)) {
      result.unread_.emplace(entry.name, entry.dtype);
      continue;
    }
    const auto content =
        data.subspan(static_cast<std::size_t>(entry.begin), static_cast<std::size_t>(entry.end - entry.begin));
    result.arrays_.emplace(entry.name, array_of(entry, *type, content, source + ": array " + named(entry.name)));
    result.names_.push_back(entry.name);
  }
  return result;
}

const NpyArray& Safetensors::array(std::string_view name) const {
  const auto found = arrays_.find(name);
  if (found != arrays_.end()) return found->second;
  const auto unread = unread_.find(name);
  if (unread != unread_.end())
    fail_tensor(source_, "array " + named(name) + ": has dtype " + named(unread->second) + ", which is not read");
  fail_tensor(source_, "has no array " + named(name) + "; there are: " + (names_.empty() ? "none" : joined(names_)));
}

const std::string& Safetensors::text(std::string_view key) const {
  const auto found = metadata_.find(key);
  if (found != metadata_.end()) return found->second;
  std::vector<std::string> known;
  for (const auto& entry : metadata_) known.push_back(entry.first);
  fail_tensor(source_, "has no metadata " + named(key) + "; there is: " + (known.empty() ? "none" : joined(known)));
}

std::vector<std::string> Safetensors::texts(std::string_view key) const {
  const std::string& json = text(key);
  ConfigValue list;
  std::vector<std::string> result;
  bool is_list = parse_json_value(json, std::make_shared<ConfigSource>(), list) && list.kind == Kind::kArray;
  for (const ConfigValue& item : list.items) {
    is_list = is_list && item.kind == Kind::kString;
    result.push_back(item.text);
  }
  if (!is_list) fail_tensor(source_, "metadata " + named(key) + " is no list of texts: [\"first\", \"second\"]");
  return result;
}

int Safetensors::require_format(std::string_view format, int newest) const {
  const auto found = metadata_.find("format");
  if (found == metadata_.end() || found->second != format)
    fail_tensor(source_, (found == metadata_.end() ? "the metadata has no \"format\""
                                                   : "the format is " + named(found->second)) +
                             "; allowed: " + named(format));
  const std::string& words = text("version");
  int version = 0;
  const char* end = words.data() + words.size();
  const bool is_number = std::from_chars(words.data(), end, version).ptr == end && !words.empty();
  if (is_number && version >= 1 && version <= newest) return version;
  fail_tensor(source_, "the format's version is " + named(words) + "; allowed: 1 to " + std::to_string(newest) +
                           (is_number && version > newest ? " (the file is from a newer program)" : ""));
}

bool looks_like_safetensors(std::span<const uint8_t> start) {
  if (std::ssize(start) <= kLengthBytes || start[kLengthBytes] != '{') return false;
  uint64_t length = 0;
  for (std::size_t i = kLengthBytes; i-- > 0;) length = length << 8 | start[i];
  return length <= static_cast<uint64_t>(kMaxSafetensorsHeader);
}

// --- writing ---------------------------------------------------------------------------------------------------------

namespace {

void require_utf8(std::string_view text) {
  for (std::size_t at = 0, step = 0; at < text.size(); at += step) {
    step = utf8_length(text.substr(at));
    HSI4D_CHECK(step > 0, "not UTF-8: " + with_escapes(text));
  }
}

template <class T>
constexpr std::string_view dtype_of() {
  if (std::is_same_v<T, double>) return "F64";
  if (std::is_same_v<T, float>) return "F32";
  constexpr std::string_view kSigned[] = {"I8", "I16", "", "I32", "", "", "", "I64"};
  constexpr std::string_view kUnsigned[] = {"U8", "U16", "", "U32", "", "", "", "U64"};
  return std::is_signed_v<T> ? kSigned[sizeof(T) - 1] : kUnsigned[sizeof(T) - 1];
}

ConfigValue numbers_of(std::span<const int64_t> numbers) {
  std::vector<ConfigValue> items;
  for (const int64_t number : numbers) items.push_back(ConfigValue::make_integer(number));
  return ConfigValue::make_array(std::move(items));
}

}  // namespace

SafetensorsWriter::SafetensorsWriter(std::string_view format, int version) {
  set_text("format", format);
  set_text("version", std::to_string(version));
}

void SafetensorsWriter::add_member(Member member, int64_t count) {
  HSI4D_CHECK(!member.name.empty() && member.name != kMetadata, "an array cannot be named " + named(member.name));
  require_utf8(member.name);
  HSI4D_CHECK(std::ranges::find(members_, member.name, &Member::name) == members_.end(),
              "array " + named(member.name) + " is there already");
  const std::optional<int64_t> needed = count_of(member.shape, member.item_size);
  HSI4D_CHECK(needed == count, "array " + named(member.name) + ": " + std::to_string(count) + " values for shape " +
                                   shape_text(member.shape));
  members_.push_back(std::move(member));
}

template <NpyNumber T>
void SafetensorsWriter::add(const std::string& name, std::span<const int64_t> shape, std::span<const T> values) {
  Bytes content(values.size_bytes());
  if (!content.empty()) std::memcpy(content.data(), values.data(), content.size());
  add_member({name, std::string(dtype_of<T>()), sizeof(T), {shape.begin(), shape.end()}, std::move(content)},
             std::ssize(values));
}
#define HSI4D_INSTANTIATE(T) \
  template void SafetensorsWriter::add(const std::string&, std::span<const int64_t>, std::span<const T>)
HSI4D_INSTANTIATE(double);
HSI4D_INSTANTIATE(float);
HSI4D_INSTANTIATE(int8_t);
HSI4D_INSTANTIATE(int16_t);
HSI4D_INSTANTIATE(int32_t);
HSI4D_INSTANTIATE(int64_t);
HSI4D_INSTANTIATE(uint8_t);
HSI4D_INSTANTIATE(uint16_t);
HSI4D_INSTANTIATE(uint32_t);
HSI4D_INSTANTIATE(uint64_t);
#undef HSI4D_INSTANTIATE

void SafetensorsWriter::set_text(const std::string& key, std::string_view text) {
  require_utf8(key);
  require_utf8(text);
  const auto is_key = [&key](const auto& entry) { return entry.first == key; };
  HSI4D_CHECK(std::ranges::none_of(texts_, is_key), "metadata " + named(key) + " is there already");
  texts_.emplace_back(key, text);
}

void SafetensorsWriter::set_texts(const std::string& key, std::span<const std::string> texts) {
  std::vector<ConfigValue> items;
  for (const std::string& text : texts) {
    require_utf8(text);
    items.push_back(ConfigValue::make_string(text));
  }
  set_text(key, to_json_line(ConfigValue::make_array(std::move(items))));
}

Bytes SafetensorsWriter::encode() const {
  std::vector<const Member*> order;
  for (const Member& member : members_) order.push_back(&member);
  std::ranges::stable_sort(order, std::greater<>(), &Member::item_size);
  ConfigValue header = ConfigValue::make_object();
  if (!texts_.empty()) {
    ConfigValue& metadata = header.add(kMetadata, ConfigValue::make_object());
    for (const auto& [key, text] : texts_) metadata.add(key, ConfigValue::make_string(text));
  }
  int64_t at = 0;
  for (const Member* member : order) {
    const std::array<int64_t, 2> range = {at, at + std::ssize(member->content)};
    ConfigValue& entry = header.add(member->name, ConfigValue::make_object());
    entry.add("dtype", ConfigValue::make_string(member->dtype));
    entry.add("shape", numbers_of(member->shape));
    entry.add("data_offsets", numbers_of(range));
    at = range[1];
  }
  std::string text = to_json_line(header);
  const int64_t length = round_up(kLengthBytes + std::ssize(text), kDataAlignment) - kLengthBytes;
  HSI4D_CHECK(length <= kMaxSafetensorsHeader, "a header of " + std::to_string(length) + " bytes is too long");
  text.resize(static_cast<std::size_t>(length), ' ');
  Bytes file;
  file.reserve(static_cast<std::size_t>(kLengthBytes + length + at));
  for (int i = 0; i < kLengthBytes; ++i) file.push_back(static_cast<uint8_t>(length >> (8 * i)));
  file.insert(file.end(), text.begin(), text.end());
  for (const Member* member : order) file.insert(file.end(), member->content.begin(), member->content.end());
  return file;
}

void SafetensorsWriter::write(const std::string& path) const { write_file(path, encode()); }

}  // namespace hsi4d
