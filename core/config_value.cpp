#include "core/config_value.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <unordered_map>

#include "core/check.h"

namespace hsi4d {
namespace {

constexpr std::size_t kMostShown = 64;      // characters of a value in a message
constexpr std::size_t kMostProblems = 100;  // told of one config; the rest is counted

using Kind = ConfigValue::Kind;

/// A key of a pointer without its escapes, ~1 for "/" and ~0 for "~".
std::string unescaped(std::string_view key) {
  std::string out;
  for (std::size_t i = 0; i < key.size(); ++i) {
    const bool is_escape = key[i] == '~' && i + 1 < key.size();
    out += !is_escape ? key[i] : key[i + 1] == '1' ? '/' : '~';
    if (is_escape) ++i;
  }
  return out;
}

const ConfigValue* find_item(const ConfigValue& array, const std::string& key) {
  std::size_t index = 0;
  const auto end = std::from_chars(key.data(), key.data() + key.size(), index);
  return end.ec == std::errc() && index < array.items.size() ? &array.items[index] : nullptr;
}

template <class T>
std::string json_number_text(T value) {
  HSI4D_CHECK(std::isfinite(value), "a config cannot hold a number that is not finite");
  std::array<char, 32> buffer;
  const auto end = std::to_chars(buffer.data(), buffer.data() + buffer.size(), value);
  return {buffer.data(), end.ptr};
}

bool is_plain(const ConfigValue& value) { return value.kind != Kind::kArray && value.kind != Kind::kObject; }

// Appends `value`; indent < 0 writes one line.
void append_json(std::string& out, const ConfigValue& value, int indent);

void append_break(std::string& out, int indent) {
  if (indent < 0) return;
  out += '\n';
  out.append(2 * static_cast<std::size_t>(indent), ' ');
}

void append_array(std::string& out, const ConfigValue& value, int indent) {
  const bool one_line = indent < 0 || std::all_of(value.items.begin(), value.items.end(), is_plain);
  const int inner = one_line ? -1 : indent + 1;
  out += '[';
  for (std::size_t i = 0; i < value.items.size(); ++i) {
    if (i > 0) out += one_line ? ", " : ",";
    append_break(out, inner);
    append_json(out, value.items[i], inner);
  }
  if (!one_line) append_break(out, indent);
  out += ']';
}

void append_object(std::string& out, const ConfigValue& value, int indent) {
  const int inner = indent < 0 ? -1 : indent + 1;
  out += '{';
  for (std::size_t i = 0; i < value.members.size(); ++i) {
    if (i > 0) out += indent < 0 ? ", " : ",";
    append_break(out, inner);
    out += json_string(value.members[i].key) + ": ";
    append_json(out, value.members[i].value, inner);
  }
  if (!value.members.empty()) append_break(out, indent);
  out += '}';
}

void append_json(std::string& out, const ConfigValue& value, int indent) {
  switch (value.kind) {
    case Kind::kNull:
      out += "null";
      break;
    case Kind::kBoolean:
      out += value.boolean ? "true" : "false";
      break;
    case Kind::kNumber:
      out += value.text;
      break;
    case Kind::kString:
      out += json_string(value.text);
      break;
    case Kind::kArray:
      append_array(out, value, indent);
      break;
    case Kind::kObject:
      append_object(out, value, indent);
      break;
  }
}

}  // namespace

ConfigValue ConfigValue::make_null() { return {}; }

ConfigValue ConfigValue::make_boolean(bool value) {
  ConfigValue made;
  made.kind = Kind::kBoolean;
  made.boolean = value;
  return made;
}

ConfigValue ConfigValue::make_number(double value) {
  ConfigValue made;
  made.kind = Kind::kNumber;
  made.text = json_number_text(value);
  return made;
}

ConfigValue ConfigValue::make_number(float value) {
  ConfigValue made;
  made.kind = Kind::kNumber;
  made.text = json_number_text(value);
  return made;
}

ConfigValue ConfigValue::make_integer(std::int64_t value) {
  ConfigValue made;
  made.kind = Kind::kNumber;
  made.text = std::to_string(value);
  return made;
}

ConfigValue ConfigValue::make_string(std::string_view value) {
  ConfigValue made;
  made.kind = Kind::kString;
  made.text = value;
  return made;
}

ConfigValue ConfigValue::make_array() { return make_array(std::vector<ConfigValue>()); }

ConfigValue ConfigValue::make_array(std::vector<ConfigValue> values) {
  ConfigValue made;
  made.kind = Kind::kArray;
  made.items = std::move(values);
  return made;
}

ConfigValue ConfigValue::make_object() {
  ConfigValue made;
  made.kind = Kind::kObject;
  return made;
}

ConfigValue& ConfigValue::add(std::string_view key, ConfigValue value) {
  members.push_back({std::string(key), std::move(value), {}, false});
  return members.back().value;
}

const ConfigValue* find_member(const ConfigValue& object, std::string_view key) {
  for (const ConfigMember& member : object.members) {
    if (member.key == key) return &member.value;
  }
  return nullptr;
}

const ConfigOrigin& origin_at(const ConfigValue& tree, std::string_view pointer) {
  const ConfigValue* node = &tree;
  const ConfigOrigin* origin = &tree.origin;
  for (std::size_t begin = 1; begin < pointer.size();) {
    const std::size_t end = std::min(pointer.find('/', begin), pointer.size());
    const std::string key = unescaped(pointer.substr(begin, end - begin));
    begin = end + 1;
    node = node->kind == Kind::kArray ? find_item(*node, key) : find_member(*node, key);
    if (node == nullptr) return *origin;
    origin = &node->origin;
  }
  return *origin;
}

ConfigValue merged(ConfigValue base, ConfigValue overlay) {
  if (base.kind != Kind::kObject || overlay.kind != Kind::kObject) return overlay;
  base.origin = overlay.origin;
  base.members.reserve(base.members.size() + overlay.members.size());  // keeps the keys in place for the views below
  std::unordered_map<std::string_view, std::size_t> place;
  for (std::size_t i = 0; i < base.members.size(); ++i) place.emplace(base.members[i].key, i);
  std::vector<std::size_t> taken_out;
  for (ConfigMember& member : overlay.members) {
    const auto found = place.find(member.key);
    if (found == place.end()) {
      base.members.push_back(std::move(member));
      continue;
    }
    ConfigMember& target = base.members[found->second];
    if (member.value.kind == Kind::kNull && target.value.kind == Kind::kObject) taken_out.push_back(found->second);
    target.value = merged(std::move(target.value), std::move(member.value));
    target.key_origin = member.key_origin;
  }
  std::sort(taken_out.begin(), taken_out.end(), std::greater<>());
  for (const std::size_t i : taken_out) base.members.erase(base.members.begin() + static_cast<std::ptrdiff_t>(i));
  return base;
}

std::string to_json(const ConfigValue& value) {
  std::string out;
  append_json(out, value, 0);
  return out + '\n';
}

std::string to_json_line(const ConfigValue& value) {
  std::string out;
  append_json(out, value, -1);
  return out;
}

std::string shown(const ConfigValue& value) {
  const std::string out = to_json_line(value);
  if (out.size() <= kMostShown) return out;
  std::size_t end = kMostShown - 3;
  while (end > 0 && (static_cast<unsigned char>(out[end]) & 0xC0U) == 0x80U) --end;  // not inside a UTF-8 character
  return out.substr(0, end) + "...";
}

std::string kind_name(const ConfigValue& value) {
  switch (value.kind) {
    case Kind::kNull:
      return "null";
    case Kind::kBoolean:
      return "a boolean";
    case Kind::kNumber:
      return "a number";
    case Kind::kString:
      return "a string";
    case Kind::kArray:
      return "an array";
    case Kind::kObject:
      return "an object";
  }
  throw InternalError("no such kind of value");
}

std::string json_string(std::string_view text) {
  constexpr std::string_view kHex = "0123456789abcdef";
  std::string out = "\"";
  for (const char c : text) {
    switch (c) {
      case '"':
        out += "\\\"";
        break;
      case '\\':
        out += "\\\\";
        break;
      case '\n':
        out += "\\n";
        break;
      case '\r':
        out += "\\r";
        break;
      case '\t':
        out += "\\t";
        break;
      default:
        if (static_cast<unsigned char>(c) < 0x20U || c == 0x7F) {
          const unsigned code = static_cast<unsigned char>(c);
          out += "\\u00";
          out += kHex[code >> 4U];
          out += kHex[code & 15U];
        } else {
          out += c;
        }
    }
  }
  return out + '"';
}

std::string child_pointer(std::string_view pointer, std::string_view key) {
  std::string out(pointer);
  out += '/';
  for (const char c : key) {
    if (c == '~') {
      out += "~0";
    } else if (c == '/') {
      out += "~1";
    } else {
      out += c;
    }
  }
  return out;
}

void ConfigProblems::add(const ConfigOrigin& origin, std::string_view pointer, std::string_view message) {
  ++count_;
  if (problems_.size() >= kMostProblems) return;
  std::string text;
  if (origin.source) {
    text += origin.source->name;
    if (origin.line > 0) text += ":" + std::to_string(origin.line);
    if (origin.column > 0) text += ":" + std::to_string(origin.column);
    text += ": ";
  }
  if (!pointer.empty()) {
    const std::string escaped = json_string(pointer);  // a key may hold a line break
    text += escaped.substr(1, escaped.size() - 2) + ": ";
  }
  text += message;
  problems_.push_back({origin, std::string(pointer), std::move(text)});
}

std::vector<std::string> ConfigProblems::pointers() const {
  std::vector<std::string> all;
  for (const Problem& problem : problems_) all.push_back(problem.pointer);
  return all;
}

void ConfigProblems::throw_if_any() const {
  if (problems_.empty()) return;
  if (count_ == 1) throw UserError(problems_.front().text);
  std::vector<Problem> sorted = problems_;
  const auto order = [](const Problem& p) { return p.origin.source ? p.origin.source->order : 0; };
  std::stable_sort(sorted.begin(), sorted.end(), [&](const Problem& a, const Problem& b) {
    return order(a) != order(b) ? order(a) < order(b) : a.origin.offset < b.origin.offset;
  });
  const auto source = [](const Problem& p) { return p.origin.source.get(); };
  const bool one_source = std::all_of(
      sorted.begin(), sorted.end(), [&](const Problem& p) { return source(p) && source(p) == source(sorted.front()); });
  std::string text = std::to_string(count_) + " problems";
  if (one_source) text += " in " + source(sorted.front())->name;
  text += ":";
  for (const Problem& problem : sorted) text += "\n" + problem.text;
  if (count_ > sorted.size()) text += "\nand " + std::to_string(count_ - sorted.size()) + " more";
  throw UserError(text);
}

}  // namespace hsi4d
