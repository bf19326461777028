// The parser is nlohmann's, driven through its SAX interface by an iterator that knows how far it has read: positions
// come from there.
#include "core/config_parse.h"

#include <algorithm>
#include <cstddef>
#include <iterator>
#include <numeric>
#include <optional>

#include "core/check.h"

#ifndef JSON_DIAGNOSTICS
#define JSON_DIAGNOSTICS 1
#endif
#include <nlohmann/json.hpp>

namespace hsi4d {
namespace {

using Kind = ConfigValue::Kind;
constexpr std::size_t kMostBefore = 60, kMostAfter = 40;  // bytes of a line that a message shows around a fault

bool is_space(char c) { return c == ' ' || c == '\t' || c == '\n' || c == '\r'; }
bool is_digit(char c) { return c >= '0' && c <= '9'; }
bool is_letter(char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '_'; }
bool is_number_part(char c) { return is_digit(c) || c == '+' || c == '-' || c == '.' || c == 'e' || c == 'E'; }
bool is_word_part(char c) { return is_number_part(c) || is_letter(c); }

/// Line and column of an offset, from the offsets at which lines begin.
class Lines {
 public:
  explicit Lines(const std::string& text) : text_(text) {
    for (std::size_t i = 0; i < text.size(); ++i) {
      if (text[i] == '\n') begins_.push_back(i + 1);
    }
  }
  int line(std::size_t offset) const {
    return static_cast<int>(std::upper_bound(begins_.begin(), begins_.end(), offset) - begins_.begin());
  }
  int column(std::size_t offset) const {
    int characters = 1;
    for (std::size_t i = begins_[static_cast<std::size_t>(line(offset)) - 1]; i < std::min(offset, text_.size()); ++i) {
      if ((static_cast<unsigned char>(text_[i]) & 0xC0U) != 0x80U) ++characters;
    }
    return characters;
  }

 private:
  const std::string& text_;
  std::vector<std::size_t> begins_ = {0};
};

/// Hands characters to the parser and tells how many it has taken.
class CountingIterator {
 public:
  using iterator_category = std::input_iterator_tag;
  using value_type = char;
  using difference_type = std::ptrdiff_t;
  using pointer = const char*;
  using reference = const char&;

  CountingIterator(const char* at, const char** furthest) : at_(at), furthest_(furthest) {}
  const char& operator*() const { return *at_; }
  CountingIterator& operator++() {
    ++at_;
    *furthest_ = at_;
    return *this;
  }
  CountingIterator operator++(int) {
    CountingIterator old = *this;
    ++*this;
    return old;
  }
  bool operator==(const CountingIterator& other) const { return at_ == other.at_; }
  bool operator!=(const CountingIterator& other) const { return at_ != other.at_; }

 private:
  const char* at_;
  const char** furthest_;
};

/// What stopped a parse.
struct Stop {
  std::size_t start = 0;  ///< where the token that cannot be read begins
  std::size_t end = 0;    ///< past the last character that was read
  std::string pointer;    ///< of the value being read
  std::string reason;     ///< the parser's own words
  bool number_too_large = false;
  std::optional<ConfigOrigin> open;  ///< the innermost object or array that was open
  bool open_is_array = false;
  bool too_deep = false;
};

/// Builds the tree from the parser's events.
class Builder : public nlohmann::json_sax<nlohmann::json> {
 public:
  Builder(const std::string& text, const char* const* furthest, const Lines& lines,
          const std::shared_ptr<const ConfigSource>& source, ConfigProblems& problems, ConfigValue& root)
      : text_(text), furthest_(furthest), lines_(lines), source_(source), problems_(problems), root_(root) {}

  bool null() override {
    scalar(Kind::kNull, 4);
    return true;
  }
  bool boolean(bool value) override {
    scalar(Kind::kBoolean, value ? 4 : 5).boolean = value;
    return true;
  }
  bool number_integer(number_integer_t) override { return number(); }
  bool number_unsigned(number_unsigned_t) override { return number(); }
  bool number_float(number_float_t, const string_t&) override { return number(); }
  bool string(string_t& value) override {
    scalar(Kind::kString, 1).text = value;
    return true;
  }
  bool binary(binary_t&) override { return false; }  // not in JSON text
  bool start_object(std::size_t) override { return open(Kind::kObject); }
  bool start_array(std::size_t) override { return open(Kind::kArray); }
  bool end_array() override { return close(); }
  bool end_object() override {
    drop_duplicates(*stack_.back());
    return close();
  }
  bool key(string_t& value) override {
    event_end_ = furthest();
    stack_.back()->members.push_back({value, {}, origin(event_end_ - 1), false});
    return true;
  }
  bool parse_error(std::size_t position, const std::string&, const nlohmann::detail::exception& fault) override {
    stop.end = std::min(position, text_.size());
    stop.start = event_end_;
    const auto between = [](char c) { return is_space(c) || c == ',' || c == ':'; };
    while (stop.start < stop.end && between(text_[stop.start])) ++stop.start;
    const bool text_ended = position > text_.size();
    if (stop.start == stop.end && stop.end > 0 && !text_ended)
      stop.start = stop.end - 1;  // it is the ',' or ':' itself
    stop.number_too_large = fault.id == 406;
    const std::string words = fault.what();
    const std::size_t cut = words.find("syntax error while parsing ");
    stop.reason = cut == std::string::npos ? words : words.substr(cut + std::string("syntax error ").size());
    stop.pointer = pointer();
    if (!stack_.empty()) {
      stop.open = stack_.back()->origin;
      stop.open_is_array = stack_.back()->kind == Kind::kArray;
    }
    return false;
  }

  Stop stop;

 private:
  std::size_t furthest() const { return static_cast<std::size_t>(*furthest_ - text_.data()); }

  ConfigOrigin origin(std::size_t offset) const { return {source_, offset, lines_.line(offset), 0}; }

  ConfigValue& place() {
    if (stack_.empty()) return root_;
    ConfigValue& parent = *stack_.back();
    if (parent.kind == Kind::kObject) return parent.members.back().value;
    return parent.items.emplace_back();
  }

  ConfigValue& add(Kind kind, std::size_t offset) {
    ConfigValue& value = place();
    value.kind = kind;
    value.origin = origin(offset);
    return value;
  }

  // A literal or string: nothing was read past it. A string's offset is its closing quote, on the same line.
  ConfigValue& scalar(Kind kind, std::size_t length) {
    event_end_ = furthest();
    return add(kind, event_end_ - length);
  }

  // A number ends where the character after it, which has been read unless the text ended, is not part of it.
  bool number() {
    std::size_t end = furthest();
    if (end > 0 && !is_number_part(text_[end - 1])) --end;
    std::size_t start = end;
    while (start > 0 && is_number_part(text_[start - 1])) --start;
    event_end_ = end;
    add(Kind::kNumber, start).text = text_.substr(start, end - start);
    return true;
  }

  bool open(Kind kind) {
    event_end_ = furthest();
    if (static_cast<int>(stack_.size()) >= kDeepestConfig) {
      stop.start = event_end_ - 1;
      stop.pointer = "";
      stop.too_deep = true;
      return false;
    }
    stack_.push_back(&add(kind, event_end_ - 1));
    return true;
  }

  bool close() {
    event_end_ = furthest();
    stack_.pop_back();
    return true;
  }

  std::string pointer() const {
    std::string out;
    for (std::size_t i = 0; i < stack_.size(); ++i) {
      const ConfigValue& level = *stack_[i];
      if (level.kind == Kind::kArray) {
        const bool innermost = i + 1 == stack_.size();
        out = child_pointer(out, std::to_string(innermost ? level.items.size() : level.items.size() - 1));
      } else if (!level.members.empty()) {
        out = child_pointer(out, level.members.back().key);
      }
    }
    return out;
  }

  void drop_duplicates(ConfigValue& object) {
    std::vector<ConfigMember>& members = object.members;
    std::vector<std::size_t> order(members.size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    std::stable_sort(order.begin(), order.end(),
                     [&](std::size_t a, std::size_t b) { return members[a].key < members[b].key; });
    std::vector<bool> drop(members.size(), false);
    std::size_t first = 0;
    for (std::size_t i = 1; i < order.size(); ++i) {
      const ConfigMember& kept = members[order[first]];
      const ConfigMember& again = members[order[i]];
      if (kept.key != again.key) {
        first = i;
        continue;
      }
      drop[order[i]] = true;
      problems_.add(again.key_origin, object_pointer(again.key),
                    "written twice, first in line " + std::to_string(kept.key_origin.line) + "; keep one of them");
    }
    if (std::find(drop.begin(), drop.end(), true) == drop.end()) return;
    std::vector<ConfigMember> kept;
    for (std::size_t i = 0; i < members.size(); ++i) {
      if (!drop[i]) kept.push_back(std::move(members[i]));
    }
    members = std::move(kept);
  }

  // The pointer of `key` in the object that is being closed, whose last member is not `key`.
  std::string object_pointer(const std::string& key) const {
    const std::string last = pointer();
    return child_pointer(last.substr(0, last.rfind('/')), key);
  }

  const std::string& text_;
  const char* const* furthest_;
  const Lines& lines_;
  const std::shared_ptr<const ConfigSource>& source_;
  ConfigProblems& problems_;
  ConfigValue& root_;
  std::vector<ConfigValue*> stack_;
  std::size_t event_end_ = 0;  // past the last thing that was understood
};

/// What is wrong at a stop.
struct Diagnosis {
  std::size_t at = 0;
  std::string message;
  bool of_value = false;  ///< the value that is being read is at fault, not the text around it
};

bool has(const Stop& stop, const char* words) { return stop.reason.find(words) != std::string::npos; }

std::size_t past_spaces(const std::string& text, std::size_t at) {
  while (at < text.size() && is_space(text[at])) ++at;
  return at;
}

/// A word that is no JSON: nan, a literal or number in another language's spelling, an unquoted key.
Diagnosis diagnose_word(const std::string& text, const Stop& stop) {
  std::size_t begin = stop.start, end = stop.start;
  while (begin > 0 && is_word_part(text[begin - 1])) --begin;
  while (end < text.size() && is_word_part(text[end])) ++end;
  const std::string word = text.substr(begin, end - begin);
  std::string bare = word.substr(word[0] == '+' || word[0] == '-' ? 1 : 0);
  for (char& c : bare) c = c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  if (stop.number_too_large) return {begin, word + " is not a finite number: it is beyond the largest double", true};
  if (bare == "nan" || bare == "inf" || bare == "infinity") return {begin, word + " is not a finite number", true};
  const std::size_t after = past_spaces(text, end);
  if (is_letter(word[0]) && after < text.size() && text[after] == ':')
    return {begin, "not valid JSON: the key " + word + " needs double quotes: \"" + word + "\""};
  return {begin,
          "not valid JSON: " + word +
              " is not a value; write true, false, null, a number such as 0.5, or a string in double quotes",
          true};
}

/// A comma too many or too few before the stop.
std::optional<Diagnosis> diagnose_comma(const std::string& text, const Stop& stop) {
  std::size_t last = stop.start;
  while (last > 0 && is_space(text[last - 1])) --last;
  if (last == 0) return std::nullopt;
  const char before = text[last - 1], here = text[stop.start];
  if ((here == '}' || here == ']') && before == ',')
    return Diagnosis{last - 1, std::string("not valid JSON: the comma before '") + here + "' is one too many"};
  const bool begins_value = here == '"' || here == '{' || here == '[' || is_word_part(here);
  if ((!has(stop, "expected '}'") && !has(stop, "expected ']'")) || !begins_value || before == ',' || before == '{' ||
      before == '[' || (last == stop.start && is_word_part(before)))
    return std::nullopt;
  return Diagnosis{last - 1, "not valid JSON: a comma is missing after this"};
}

Diagnosis diagnose(const std::string& text, const Stop& stop) {
  if (stop.too_deep) return {stop.start, "nested more than " + std::to_string(kDeepestConfig) + " levels deep"};
  if (stop.start >= text.size()) {
    if (!stop.open) return {0, "not valid JSON: the file is empty"};
    return {text.size(), std::string("not valid JSON: the file ends inside the ") +
                             (stop.open_is_array ? "array" : "object") + " that line " +
                             std::to_string(stop.open->line) + " opens"};
  }
  const char here = text[stop.start];
  if (here == '#' || text.compare(stop.start, 2, "//") == 0 || text.compare(stop.start, 2, "/*") == 0)
    return {stop.start, "not valid JSON: comments are not part of JSON"};
  if (here == '\'') return {stop.start, "not valid JSON: strings take double quotes, not single ones"};
  if (has(stop, "invalid string") && stop.end > stop.start && (stop.end == text.size() || text[stop.end - 1] == '\n'))
    return {stop.start, "not valid JSON: this string has no closing quote on its line"};
  if (const auto comma = diagnose_comma(text, stop)) return *comma;
  if (is_word_part(here) && !has(stop, "expected ':'") && !has(stop, "expected end of input"))
    return diagnose_word(text, stop);
  return {here == '"' && stop.end > 0 ? stop.end - 1 : stop.start, "not valid JSON: " + stop.reason};
}

/// The line of text around an offset, and below it a caret; of no text, nothing.
std::string line_with_caret(const std::string& text, std::size_t at) {
  if (text.empty()) return "";
  const auto continues = [&](std::size_t i) { return (static_cast<unsigned char>(text[i]) & 0xC0U) == 0x80U; };
  std::size_t begin = at, end = at;
  while (begin > 0 && text[begin - 1] != '\n' && (at - begin < kMostBefore || continues(begin))) --begin;
  while (end < text.size() && text[end] != '\n' && (end - at < kMostAfter || continues(end))) ++end;
  std::string line, indent;
  for (std::size_t i = begin; i < end; ++i) {
    line += static_cast<unsigned char>(text[i]) < 0x20U ? ' ' : text[i];
    if (i < at && !continues(i)) indent += ' ';
  }
  return "\n  " + line + "\n  " + indent + "^";
}

}  // namespace

bool parse_config_text(const std::string& text, const std::shared_ptr<const ConfigSource>& source,
                       ConfigProblems& problems, ConfigValue& value) {
  if (text.starts_with("\xFF\xFE") || text.starts_with("\xFE\xFF")) {
    problems.add({source, 0, 0, 0}, "", "the file is UTF-16; save it as UTF-8");
    return false;
  }
  const Lines lines(text);
  value = {};
  const char* furthest = text.data();
  Builder builder(text, &furthest, lines, source, problems, value);
  const CountingIterator begin(text.data(), &furthest), end(text.data() + text.size(), &furthest);
  if (nlohmann::json::sax_parse(begin, end, &builder)) return true;
  const Diagnosis fault = diagnose(text, builder.stop);
  problems.add({source, fault.at, lines.line(fault.at), lines.column(fault.at)},
               fault.of_value ? builder.stop.pointer : "", fault.message + line_with_caret(text, fault.at));
  return false;
}

bool parse_json_value(const std::string& text, const std::shared_ptr<const ConfigSource>& source, ConfigValue& value) {
  ConfigProblems problems;
  return parse_config_text(text, source, problems, value) && problems.empty();
}

}  // namespace hsi4d
