#include "core/npy_header.h"

#include <algorithm>
#include <charconv>
#include <string_view>

#include "core/check.h"

namespace hsi4d {
namespace {

constexpr std::string_view kMagic = "\x93NUMPY";
constexpr int64_t kMostHeaderBytes = 1 << 20;
constexpr size_t kMostDimensions = 32;  // numpy's own limit
constexpr int kMostNesting = 16;

/// {'descr': '<f4', 'fortran_order': False, 'shape': (3, 4), } and nothing else.
class HeaderParser {
 public:
  /// @param text_begin  where `text` stands in the file, for messages
  HeaderParser(std::string_view text, int64_t text_begin, const std::string& source)
      : text_(text), text_begin_(text_begin), source_(source) {}

  NpyHeader parse() {
    expect('{');
    while (!take('}')) {
      parse_entry();
      if (!take(',')) {
        expect('}');
        break;
      }
    }
    skip_spaces();
    if (at_ < text_.size()) fail("the header's end");
    if (!has_dtype_ || !has_order_ || !has_shape_) fail("the keys 'descr', 'fortran_order' and 'shape'");
    return header_;
  }

 private:
  void parse_entry() {
    const size_t begin = at_;
    const std::string key = parse_string();
    expect(':');
    if (key == "descr" && !has_dtype_) {
      has_dtype_ = true;
      parse_dtype();
    } else if (key == "fortran_order" && !has_order_) {
      has_order_ = true;
      header_.fortran_order = parse_bool();
    } else if (key == "shape" && !has_shape_) {
      has_shape_ = true;
      parse_shape();
    } else {
      at_ = begin;
      fail("each of the keys 'descr', 'fortran_order' and 'shape' once");
    }
  }

  void parse_dtype() {
    if (peek() != '[') {
      header_.dtype = parse_string();
      return;
    }
    header_.dtype = "structured";
    skip_value(0);
  }

  /// Over a list of fields: strings, numbers, tuples and lists of such.
  void skip_value(int depth) {
    if (depth > kMostNesting) fail("fewer brackets");
    const char open = peek();
    if (open == '\'' || open == '"') {
      parse_string();
    } else if (open == '(' || open == '[') {
      const char close = open == '(' ? ')' : ']';
      expect(open);
      while (!take(close)) {
        skip_value(depth + 1);
        if (!take(',')) {
          expect(close);
          break;
        }
      }
    } else {
      parse_length();
    }
  }

  bool parse_bool() {
    skip_spaces();
    for (const std::string_view word : {"True", "False"}) {
      if (text_.substr(at_).starts_with(word)) {
        at_ += word.size();
        return word == "True";
      }
    }
    fail("True or False");
  }

  void parse_shape() {
    expect('(');
    while (!take(')')) {
      header_.shape.push_back(parse_length());
      if (header_.shape.size() > kMostDimensions) fail("at most 32 dimensions");
      // (3) is a number in Python, not a shape.
      if (header_.shape.size() == 1) {
        expect(',');
      } else if (!take(',')) {
        expect(')');
        break;
      }
    }
  }

  int64_t parse_length() {
    skip_spaces();
    int64_t value = 0;
    const char* begin = text_.data() + at_;
    const char* end = text_.data() + text_.size();
    const auto [next, error] = std::from_chars(begin, end, value);
    if (error != std::errc{} || value < 0) fail("a length from 0 to 2^63-1");
    at_ += static_cast<size_t>(next - begin);
    if (at_ < text_.size() && text_[at_] == 'L') ++at_;  // a long of Python 2
    return value;
  }

  std::string parse_string() {
    const char quote = peek();
    if (quote != '\'' && quote != '"') fail("a string");
    const size_t begin = ++at_;
    while (at_ < text_.size() && text_[at_] != quote && text_[at_] != '\\') ++at_;
    if (at_ == text_.size() || text_[at_] != quote) fail("a string's end");
    return std::string(text_.substr(begin, at_++ - begin));
  }

  void skip_spaces() {
    while (at_ < text_.size() && (text_[at_] == ' ' || text_[at_] == '\n')) ++at_;
  }
  char peek() {
    skip_spaces();
    return at_ < text_.size() ? text_[at_] : '\0';
  }
  bool take(char c) {
    if (peek() != c || at_ == text_.size()) return false;
    ++at_;
    return true;
  }
  void expect(char c) {
    if (!take(c)) fail(std::string("'") + c + "'");
  }
  [[noreturn]] void fail(const std::string& expected) const {
    throw DataError(source_ + ": npy header, byte " + std::to_string(text_begin_ + static_cast<int64_t>(at_)) + ": " +
                    expected + " expected");
  }

  std::string_view text_;
  int64_t text_begin_;
  const std::string& source_;
  size_t at_ = 0;
  bool has_dtype_ = false, has_order_ = false, has_shape_ = false;
  NpyHeader header_;
};

}  // namespace

NpyHeader parse_npy_header(std::span<const uint8_t> file, const std::string& source) {
  const std::string_view text(reinterpret_cast<const char*>(file.data()), file.size());
  if (!text.starts_with(kMagic) || text.size() < 10) throw DataError(source + ": is not an npy file");
  const int major = file[6], minor = file[7];
  if (major < 1 || major > 3 || minor != 0) {
    throw DataError(source + ": has npy version " + std::to_string(major) + "." + std::to_string(minor) +
                    "; 1.0, 2.0 and 3.0 are read");
  }
  const int64_t begin = major == 1 ? 10 : 12;
  if (std::ssize(file) < begin) throw DataError(source + ": ends within its npy header");
  int64_t length = 0;
  for (int64_t i = begin - 1; i >= 8; --i) length = length << 8 | file[i];
  if (length > kMostHeaderBytes) {
    throw DataError(source + ": its npy header claims " + std::to_string(length) + " bytes; at most " +
                    std::to_string(kMostHeaderBytes) + " are read");
  }
  if (length > std::ssize(file) - begin) throw DataError(source + ": ends within its npy header");
  NpyHeader header = HeaderParser(text.substr(begin, length), begin, source).parse();
  header.data_begin = begin + length;
  return header;
}

}  // namespace hsi4d
