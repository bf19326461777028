#include "splat/files/ply_table.h"

#include <algorithm>
#include <array>
#include <bit>
#include <charconv>
#include <cmath>
#include <cstring>
#include <set>

#include "core/check.h"
#include "core/config_value.h"

namespace hsi4d {
namespace {

static_assert(std::endian::native == std::endian::little, "the library runs on little-endian machines");

constexpr std::size_t kMostShown = 60;  // bytes of a header line or word in a message

struct TypeName {
  const char* name;
  PlyType type;
};
constexpr std::array<TypeName, 16> kTypes = {{{"char", PlyType::kInt8},
                                              {"uchar", PlyType::kUint8},
                                              {"short", PlyType::kInt16},
                                              {"ushort", PlyType::kUint16},
                                              {"int", PlyType::kInt32},
                                              {"uint", PlyType::kUint32},
                                              {"float", PlyType::kFloat32},
                                              {"double", PlyType::kFloat64},
                                              {"int8", PlyType::kInt8},
                                              {"uint8", PlyType::kUint8},
                                              {"int16", PlyType::kInt16},
                                              {"uint16", PlyType::kUint16},
                                              {"int32", PlyType::kInt32},
                                              {"uint32", PlyType::kUint32},
                                              {"float32", PlyType::kFloat32},
                                              {"float64", PlyType::kFloat64}}};

std::size_t size_of(PlyType type) {
  switch (type) {
    case PlyType::kInt8:
    case PlyType::kUint8:
      return 1;
    case PlyType::kInt16:
    case PlyType::kUint16:
      return 2;
    case PlyType::kInt32:
    case PlyType::kUint32:
    case PlyType::kFloat32:
      return 4;
    case PlyType::kFloat64:
      return 8;
  }
  return 0;
}

bool is_space(char c) { return c == ' ' || c == '\t' || c == '\r' || c == '\n' || c == '\v' || c == '\f'; }

std::string in_quotes(std::string_view text) {
  return json_string(text.substr(0, kMostShown)) + (text.size() > kMostShown ? "..." : "");
}

std::string count_text(double count) {
  return std::isfinite(count) ? ConfigValue::make_number(count).text : std::isnan(count) ? "nan" : "infinitely many";
}

std::vector<std::string_view> words_of(std::string_view line) {
  std::vector<std::string_view> words;
  std::size_t at = 0;
  while (true) {
    while (at < line.size() && is_space(line[at])) ++at;
    if (at == line.size()) return words;
    const std::size_t begin = at;
    while (at < line.size() && !is_space(line[at])) ++at;
    words.push_back(line.substr(begin, at - begin));
  }
}

/// Reads the header line by line.
class HeaderParser {
 public:
  HeaderParser(std::string_view text, const std::string& name) : text_(text), name_(name) {}

  PlyHeader parse() {
    if (!text_.starts_with("ply\n") && !text_.starts_with("ply\r\n"))
      throw DataError(name_ + ": this is no PLY file: it does not begin with a line \"ply\"");
    next_line();
    while (true) {
      const std::vector<std::string_view> words = words_of(next_line());
      if (words.empty() || words[0] == "obj_info") continue;
      if (words[0] == "comment") {
        header_.comments.emplace_back(current_.substr(std::min(current_.size(), current_.find("comment") + 8)));
        continue;
      }
      if (words[0] == "end_header" && words.size() == 1) break;
      parse_line(words);
    }
    if (!has_format_) fail("the header has no line \"format\"");
    header_.data_begin = at_;
    return std::move(header_);
  }

 private:
  std::string_view next_line() {
    const std::size_t end = text_.find('\n', at_);
    ++line_;
    if (end == std::string_view::npos) throw DataError(name_ + ": the header does not end: there is no \"end_header\"");
    current_ = text_.substr(at_, end - at_);
    if (current_.ends_with('\r')) current_.remove_suffix(1);
    at_ = end + 1;
    return current_;
  }

  void parse_line(const std::vector<std::string_view>& words) {
    const std::string_view word = words[0];
    if (word == "format" && words.size() == 3) return parse_format(words);
    if (word == "element" && words.size() == 3) return parse_element(words);
    if (word == "property" && words.size() == 3) return add_property({std::string(words[2]), type(words[1]), {}});
    if (word == "property" && words.size() == 5 && words[1] == "list") {
      const PlyType count_type = type(words[2]);
      if (count_type == PlyType::kFloat32 || count_type == PlyType::kFloat64)
        fail("the length of a list is " + in_quotes(words[2]) + "; allowed: a type of whole numbers");
      return add_property({std::string(words[4]), type(words[3]), count_type});
    }
    fail(in_quotes(current_) + " is no line of a PLY header");
  }

  void parse_format(const std::vector<std::string_view>& words) {
    if (has_format_) fail("a second line \"format\"");
    has_format_ = true;
    if (words[2] != "1.0") fail("version " + in_quotes(words[2]) + " of PLY is not known; allowed: 1.0");
    if (words[1] == "ascii") {
      header_.format = PlyFormat::kAscii;
    } else if (words[1] == "binary_little_endian") {
      header_.format = PlyFormat::kLittleEndian;
    } else if (words[1] == "binary_big_endian") {
      header_.format = PlyFormat::kBigEndian;
    } else {
      fail("format " + in_quotes(words[1]) + " is not known; allowed: binary_little_endian, binary_big_endian, ascii");
    }
  }

  void parse_element(const std::vector<std::string_view>& words) {
    PlyElement element{std::string(words[1]), 0, {}};
    const char* end = words[2].data() + words[2].size();
    const auto done = std::from_chars(words[2].data(), end, element.rows);
    if (done.ec != std::errc() || done.ptr != end || element.rows < 0)
      fail(in_quotes(words[2]) + " is no number of rows; allowed: 0 to 9223372036854775807");
    if (!element_names_.insert(element.name).second) fail("a second element " + in_quotes(words[1]));
    property_names_.clear();
    header_.elements.push_back(std::move(element));
  }

  void add_property(PlyProperty property) {
    if (header_.elements.empty()) fail("a property before the first element");
    if (!property_names_.insert(property.name).second) fail("a second property " + in_quotes(property.name));
    header_.elements.back().properties.push_back(std::move(property));
  }

  PlyType type(std::string_view word) const {
    for (const TypeName& known : kTypes) {
      if (word == known.name) return known.type;
    }
    fail("type " + in_quotes(word) + " is not known; allowed: char, uchar, short, ushort, int, uint, float, double");
  }

  [[noreturn]] void fail(const std::string& problem) const {
    throw DataError(name_ + ":" + std::to_string(line_) + ": " + problem);
  }

  std::string_view text_, current_;
  const std::string& name_;
  std::size_t at_ = 0;
  int line_ = 0;
  bool has_format_ = false;
  PlyHeader header_;
  std::set<std::string> element_names_, property_names_;
};

/// The fewest bytes that a row can have.
std::size_t least_row_bytes(const PlyElement& element, PlyFormat format) {
  std::size_t bytes = 0;
  for (const PlyProperty& property : element.properties) {
    const std::size_t binary = size_of(property.count_type.value_or(property.type));
    bytes += format == PlyFormat::kAscii ? 2 : binary;  // a digit and what parts it from the next
  }
  return bytes;
}

bool has_list(const PlyElement& element) {
  return std::any_of(element.properties.begin(), element.properties.end(),
                     [](const PlyProperty& property) { return property.count_type.has_value(); });
}

/// Before memory is taken for them: the rows that the header names are within what the file can hold.
void check_counts(const PlyHeader& header, std::size_t file_size, const std::string& name) {
  std::size_t left = file_size - header.data_begin;
  if (header.format == PlyFormat::kAscii) ++left;  // the last line may end without a line break
  for (const PlyElement& element : header.elements) {
    const std::size_t row = least_row_bytes(element, header.format);
    if (row == 0) continue;
    if (static_cast<std::uint64_t>(element.rows) > left / row) {
      const bool exact = header.format != PlyFormat::kAscii && !has_list(element);
      throw DataError(name + ": element " + in_quotes(element.name) + " has " + std::to_string(element.rows) +
                      " rows of " + (exact ? "" : "at least ") + std::to_string(row) +
                      " bytes, but the file has only " + std::to_string(left) +
                      " bytes for them: it was cut short, or its header is wrong");
    }
    left -= static_cast<std::size_t>(element.rows) * row;
  }
}

template <class T>
double load(const std::uint8_t* bytes, bool swap) {
  std::array<std::uint8_t, sizeof(T)> raw;
  std::memcpy(raw.data(), bytes, sizeof(T));
  if (swap) std::reverse(raw.begin(), raw.end());
  return static_cast<double>(std::bit_cast<T>(raw));
}

double load_number(const std::uint8_t* bytes, PlyType type, bool swap) {
  switch (type) {
    case PlyType::kInt8:
      return load<std::int8_t>(bytes, swap);
    case PlyType::kUint8:
      return load<std::uint8_t>(bytes, swap);
    case PlyType::kInt16:
      return load<std::int16_t>(bytes, swap);
    case PlyType::kUint16:
      return load<std::uint16_t>(bytes, swap);
    case PlyType::kInt32:
      return load<std::int32_t>(bytes, swap);
    case PlyType::kUint32:
      return load<std::uint32_t>(bytes, swap);
    case PlyType::kFloat32:
      return load<float>(bytes, swap);
    case PlyType::kFloat64:
      return load<double>(bytes, swap);
  }
  return 0;
}

/// Walks over the data, element by element.
class RowReader {
 public:
  RowReader(std::span<const std::uint8_t> file, const PlyHeader& header, const std::string& name)
      : file_(file), format_(header.format), name_(name), at_(header.data_begin) {}

  void skip(const PlyElement& element) {
    begin(element);
    if (element.properties.empty()) return;
    if (format_ != PlyFormat::kAscii && !has_list(element)) {  // check_counts knows that they are there, in this case
      advance(static_cast<std::size_t>(element.rows) * least_row_bytes(element, format_));
      return;
    }
    for (row_ = 0; row_ < element.rows; ++row_) {
      for (const PlyProperty& property : element.properties) skip(property);
    }
  }

  void read(const PlyElement& element, std::span<const int> columns,
            FunctionRef<void(Index, std::span<const double>)> take) {
    begin(element);
    std::vector<int> place(element.properties.size(), -1);  // in `values`
    for (std::size_t i = 0; i < columns.size(); ++i) place[static_cast<std::size_t>(columns[i])] = static_cast<int>(i);
    std::vector<double> values(columns.size());
    for (row_ = 0; row_ < element.rows; ++row_) {
      for (std::size_t p = 0; p < place.size(); ++p) {
        const PlyProperty& property = element.properties[p];
        if (place[p] < 0) {
          skip(property);
        } else {
          values[static_cast<std::size_t>(place[p])] = number(property.type);
        }
      }
      take(row_, values);
    }
  }

  void read_lists(const PlyElement& element, int column, FunctionRef<void(Index, std::span<const double>)> take) {
    begin(element);
    std::vector<double> values;
    for (row_ = 0; row_ < element.rows; ++row_) {
      for (std::size_t p = 0; p < element.properties.size(); ++p) {
        const PlyProperty& property = element.properties[p];
        if (p != static_cast<std::size_t>(column)) {
          skip(property);
          continue;
        }
        values.resize(property.count_type ? list_length(property) : 1);
        for (double& value : values) value = number(property.type);
      }
      take(row_, values);
    }
  }

  void expect_end() {
    if (format_ == PlyFormat::kAscii) skip_spaces();
    if (at_ == file_.size()) return;
    throw DataError(name_ + ": " + std::to_string(file_.size() - at_) +
                    " bytes are left over after the last row: the header's counts are wrong, or the file is damaged");
  }

 private:
  void begin(const PlyElement& element) {
    element_ = &element;
    row_ = 0;
  }

  void skip(const PlyProperty& property) {
    if (!property.count_type) {
      number(property.type);
      return;
    }
    const std::size_t length = list_length(property);
    if (format_ != PlyFormat::kAscii) return advance(length * size_of(property.type));
    for (std::size_t i = 0; i < length; ++i) number(property.type);
  }

  /// Reads how many numbers of a list follow: no more than the file has bytes for.
  std::size_t list_length(const PlyProperty& property) {
    const double count = number(*property.count_type);
    const std::size_t least = format_ == PlyFormat::kAscii ? 1 : size_of(property.type);
    if (!(count >= 0) || count != std::floor(count) || count > static_cast<double>((file_.size() - at_) / least))
      fail("property " + in_quotes(property.name) + " has a list of " + count_text(count) + " numbers; the file has " +
           std::to_string(file_.size() - at_) + " bytes left");
    return static_cast<std::size_t>(count);
  }

  double number(PlyType type) {
    if (format_ == PlyFormat::kAscii) return ascii_number();
    const std::size_t begin = at_;
    advance(size_of(type));
    return load_number(file_.data() + begin, type, format_ == PlyFormat::kBigEndian);
  }

  void advance(std::size_t bytes) {
    if (bytes > file_.size() - at_) fail("the file ends here");
    at_ += bytes;
  }

  void skip_spaces() {
    while (at_ < file_.size() && is_space(static_cast<char>(file_[at_]))) ++at_;
  }

  double ascii_number() {
    skip_spaces();
    const std::size_t begin = at_;
    while (at_ < file_.size() && !is_space(static_cast<char>(file_[at_]))) ++at_;
    const std::string_view word(reinterpret_cast<const char*>(file_.data()) + begin, at_ - begin);
    if (word.empty()) fail("the file ends here");
    const std::string_view digits = word.starts_with('+') ? word.substr(1) : word;
    double value = 0;
    const char* end = digits.data() + digits.size();
    const auto done = std::from_chars(digits.data(), end, value);
    if (done.ec != std::errc() || done.ptr != end) fail(in_quotes(word) + " is no number that a double can hold");
    return value;
  }

  [[noreturn]] void fail(const std::string& problem) const {
    throw DataError(name_ + ": element " + in_quotes(element_->name) + ", row " + std::to_string(row_) + " (byte " +
                    std::to_string(at_) + "): " + problem);
  }

  std::span<const std::uint8_t> file_;
  PlyFormat format_;
  const std::string& name_;
  std::size_t at_;
  const PlyElement* element_ = nullptr;
  Index row_ = 0;
};

}  // namespace

int PlyElement::find(std::string_view property) const {
  for (std::size_t i = 0; i < properties.size(); ++i) {
    if (properties[i].name == property) return static_cast<int>(i);
  }
  return -1;
}

int PlyHeader::find(std::string_view element) const {
  for (std::size_t i = 0; i < elements.size(); ++i) {
    if (elements[i].name == element) return static_cast<int>(i);
  }
  return -1;
}

PlyHeader read_ply_header(std::span<const std::uint8_t> file, const std::string& name) {
  PlyHeader header = HeaderParser({reinterpret_cast<const char*>(file.data()), file.size()}, name).parse();
  check_counts(header, file.size(), name);
  return header;
}

std::vector<std::string> names_beside(const PlyHeader& header, std::span<const PlyNames> known) {
  std::vector<std::string> others;
  for (const PlyElement& element : header.elements) {
    const auto names = std::find_if(known.begin(), known.end(),
                                    [&element](const PlyNames& one) { return one.element == element.name; });
    if (names == known.end()) {
      others.push_back("element " + element.name);
      continue;
    }
    for (const PlyProperty& property : element.properties) {
      if (std::find(names->properties.begin(), names->properties.end(), property.name) == names->properties.end())
        others.push_back(element.name + "." + property.name);
    }
  }
  return others;
}

void read_ply_rows(std::span<const std::uint8_t> file, const PlyHeader& header, const std::string& name, int element,
                   std::span<const int> columns, FunctionRef<void(Index, std::span<const double>)> take) {
  RowReader reader(file, header, name);
  for (int e = 0; e < static_cast<int>(header.elements.size()); ++e) {
    if (e == element) {
      reader.read(header.elements[static_cast<std::size_t>(e)], columns, take);
    } else {
      reader.skip(header.elements[static_cast<std::size_t>(e)]);
    }
  }
  reader.expect_end();
}

void read_ply_lists(std::span<const std::uint8_t> file, const PlyHeader& header, const std::string& name, int element,
                    int column, FunctionRef<void(Index, std::span<const double>)> take) {
  RowReader reader(file, header, name);
  for (int e = 0; e < static_cast<int>(header.elements.size()); ++e) {
    if (e == element) {
      reader.read_lists(header.elements[static_cast<std::size_t>(e)], column, take);
    } else {
      reader.skip(header.elements[static_cast<std::size_t>(e)]);
    }
  }
  reader.expect_end();
}

}  // namespace hsi4d
