// The kinds of values: how each is read and checked, written, and told to an editor. The walk over a whole description
// is in config_walk.cpp.
#include "core/config.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>

#include "core/check.h"
#include "core/suggest.h"
#include "core/text.h"

namespace hsi4d {
namespace {

using Kind = ConfigValue::Kind;

std::string allowed_text(const NumberRange& range) {
  const bool has_min = std::isfinite(range.min), has_max = std::isfinite(range.max);
  const bool has_above = std::isfinite(range.above), has_below = std::isfinite(range.below);
  if (has_min && has_max) return number_text(range.min) + " to " + number_text(range.max);
  std::string text;
  if (has_min) text = "at least " + number_text(range.min);
  if (has_above) text = "above " + number_text(range.above);
  if (has_max || has_below) text += text.empty() ? "" : " and ";
  if (has_max) text += "at most " + number_text(range.max);
  if (has_below) text += "below " + number_text(range.below);
  return text.empty() ? "any finite number" : text;
}

std::string allowed_text(const IntegerRange& range) {
  using Limits = std::numeric_limits<std::int64_t>;
  std::string text = range.max < Limits::max()   ? std::to_string(range.min) + " to " + std::to_string(range.max)
                     : range.min > Limits::min() ? std::to_string(range.min) + " or more"
                                                 : "any whole number";
  if (range.multiple_of > 1) text += ", a multiple of " + std::to_string(range.multiple_of);
  return text;
}

std::string allowed_size(const ListSize& size) {
  if (size.min == size.max) return std::to_string(size.min);
  if (size.max == std::numeric_limits<std::size_t>::max()) return std::to_string(size.min) + " or more";
  return std::to_string(size.min) + " to " + std::to_string(size.max);
}

bool is_inside(double value, const NumberRange& range) {
  return value >= range.min && value <= range.max && value > range.above && value < range.below;
}

bool is_inside(std::int64_t value, const IntegerRange& range) {
  return value >= range.min && value <= range.max && value % range.multiple_of == 0;
}

void report(const ConfigValue& value, const std::string& pointer, ConfigProblems& problems, const std::string& what,
            const std::string& allowed) {
  problems.add(value.origin, pointer, what + (allowed.empty() ? "" : "; allowed: " + allowed));
}

/// True when the value is of this kind; otherwise says what it is and what it should be. On the command line whatever
/// is not JSON is a string, so "is a string" would puzzle there.
bool expect_kind(const ConfigValue& value, Kind kind, const char* wanted, const std::string& allowed,
                 const std::string& pointer, ConfigProblems& problems) {
  if (value.kind == kind) return true;
  const bool plain_word = value.kind == Kind::kString && value.origin.source && value.origin.source->is_command_line;
  report(value, pointer, problems,
         plain_word                  ? value.text + " is not " + wanted
         : value.kind == Kind::kNull ? std::string("null is not ") + wanted
                                     : shown(value) + " is " + kind_name(value) + ", not " + wanted,
         allowed);
  return false;
}

/// True for a string without the character 0, at which names of files and arguments of programs end.
bool expect_text(const ConfigValue& value, const std::string& pointer, ConfigProblems& problems) {
  if (!expect_kind(value, Kind::kString, "a string", "", pointer, problems)) return false;
  if (value.text.find('\0') == std::string::npos) return true;
  report(value, pointer, problems, shown(value) + " holds the character 0 (\\u0000), which no text here can have", "");
  return false;
}

template <class T>
bool read_number(const ConfigValue& value, const NumberRange& range, const std::string& pointer,
                 ConfigProblems& problems, T& number) {
  if (!expect_kind(value, Kind::kNumber, "a number", allowed_text(range), pointer, problems)) return false;
  T parsed{};
  const char* end = value.text.data() + value.text.size();
  const auto done = std::from_chars(value.text.data(), end, parsed);
  if (done.ec == std::errc::result_out_of_range || !std::isfinite(parsed)) {
    report(value, pointer, problems,
           shown(value) + " is too large or too near to zero for a " + std::to_string(8 * sizeof(T)) + "-bit number",
           allowed_text(range));
    return false;
  }
  HSI4D_CHECK(done.ec == std::errc() && done.ptr == end, "the parser let a number through that is none: " + value.text);
  if (!is_inside(static_cast<double>(parsed), range)) {
    report(value, pointer, problems, shown(value) + " is out of range", allowed_text(range));
    return false;
  }
  number = parsed;
  return true;
}

/// The whole number that a JSON number is, if it is one that 64 bits hold: 12, but also 12.0 and 1.2e1.
bool whole_number(const std::string& text, std::int64_t& number, bool& is_whole) {
  const char* end = text.data() + text.size();
  const auto done = std::from_chars(text.data(), end, number);
  is_whole = true;
  if (done.ec == std::errc() && done.ptr == end) return true;
  double wide = 0;
  const auto as_double = std::from_chars(text.data(), end, wide);
  if (as_double.ec != std::errc()) {
    is_whole = text.find_first_of(".eE") == std::string::npos;
    return false;
  }
  is_whole = wide == std::floor(wide);
  if (!is_whole || std::abs(wide) > 9.0e18) return false;
  number = static_cast<std::int64_t>(wide);
  return true;
}

ConfigValue typed_schema(const char* type) {
  ConfigValue schema = ConfigValue::make_object();
  schema.add("type", ConfigValue::make_string(type));
  return schema;
}

ConfigValue number_schema(const NumberRange& range) {
  ConfigValue schema = typed_schema("number");
  const auto bound = [&](const char* key, double value) {
    if (std::isfinite(value)) schema.add(key, ConfigValue::make_number(value));
  };
  bound("minimum", range.min);
  bound("maximum", range.max);
  bound("exclusiveMinimum", range.above);
  bound("exclusiveMaximum", range.below);
  return schema;
}

ConfigValue list_schema(ConfigValue items, const ListSize& size) {
  ConfigValue schema = typed_schema("array");
  schema.add("items", std::move(items));
  if (size.min > 0) schema.add("minItems", ConfigValue::make_integer(static_cast<std::int64_t>(size.min)));
  if (size.max != std::numeric_limits<std::size_t>::max())
    schema.add("maxItems", ConfigValue::make_integer(static_cast<std::int64_t>(size.max)));
  return schema;
}

/// True when the value is an array of an allowed size.
bool expect_list(const ConfigValue& value, const ListSize& size, const std::string& allowed, const std::string& pointer,
                 ConfigProblems& problems) {
  if (!expect_kind(value, Kind::kArray, "an array", allowed, pointer, problems)) return false;
  const std::size_t count = value.items.size();
  if (count >= size.min && count <= size.max) return true;
  report(value, pointer, problems,
         shown(value) + " has " + std::to_string(count) + (count == 1 ? " element" : " elements"), allowed_size(size));
  return false;
}

template <class T>
ConfigField::Read number_reader(T& value, const NumberRange& range) {
  return [&value, range](const ConfigValue& written, const std::string& pointer, ConfigProblems& problems) {
    read_number(written, range, pointer, problems, value);
  };
}

}  // namespace

ConfigField& ConfigFields::add_field(ConfigField::Kind kind, std::string_view name, std::string_view summary) {
  const bool is_data = kind != ConfigField::Kind::kStep && kind != ConfigField::Kind::kRule;
  HSI4D_CHECK(!is_data || find(name) == nullptr, "a setting is described twice: " + std::string(name));
  ConfigField& field = fields_.emplace_back();
  field.kind = kind;
  field.name = name;
  field.summary = summary;
  return field;
}

ConfigField& ConfigFields::number(std::string_view name, double& value, NumberRange range, std::string_view summary) {
  ConfigField& field = add_field(ConfigField::Kind::kValue, name, summary);
  field.allowed = allowed_text(range);
  field.schema = number_schema(range);
  field.read = number_reader(value, range);
  field.write = [&value] { return ConfigValue::make_number(value); };
  return field;
}

ConfigField& ConfigFields::number(std::string_view name, float& value, NumberRange range, std::string_view summary) {
  ConfigField& field = add_field(ConfigField::Kind::kValue, name, summary);
  field.allowed = allowed_text(range);
  field.schema = number_schema(range);
  field.read = number_reader(value, range);
  field.write = [&value] { return ConfigValue::make_number(value); };
  return field;
}

ConfigField& ConfigFields::add_integer(std::string_view name, IntegerRange range, std::string_view summary,
                                       std::function<std::int64_t()> get, std::function<void(std::int64_t)> set) {
  ConfigField& field = add_field(ConfigField::Kind::kValue, name, summary);
  field.allowed = allowed_text(range);
  field.schema = typed_schema("integer");
  field.schema.add("minimum", ConfigValue::make_integer(range.min));
  field.schema.add("maximum", ConfigValue::make_integer(range.max));
  if (range.multiple_of > 1) field.schema.add("multipleOf", ConfigValue::make_integer(range.multiple_of));
  field.read = [range, set = std::move(set)](const ConfigValue& value, const std::string& pointer,
                                             ConfigProblems& problems) {
    if (!expect_kind(value, Kind::kNumber, "a whole number", allowed_text(range), pointer, problems)) return;
    std::int64_t number = 0;
    bool is_whole = true;
    const bool fits = whole_number(value.text, number, is_whole);
    if (fits && is_inside(number, range)) return set(number);
    report(value, pointer, problems, shown(value) + (is_whole ? " is out of range" : " is not a whole number"),
           allowed_text(range));
  };
  field.write = [get = std::move(get)] { return ConfigValue::make_integer(get()); };
  return field;
}

ConfigField& ConfigFields::boolean(std::string_view name, bool& value, std::string_view summary) {
  ConfigField& field = add_field(ConfigField::Kind::kValue, name, summary);
  field.allowed = "true or false";
  field.schema = typed_schema("boolean");
  field.read = [&value](const ConfigValue& written, const std::string& pointer, ConfigProblems& problems) {
    if (expect_kind(written, Kind::kBoolean, "a boolean", "true or false", pointer, problems)) value = written.boolean;
  };
  field.write = [&value] { return ConfigValue::make_boolean(value); };
  return field;
}

ConfigField& ConfigFields::string(std::string_view name, std::string& value, std::string_view summary) {
  ConfigField& field = add_field(ConfigField::Kind::kValue, name, summary);
  field.allowed = "text";
  field.schema = typed_schema("string");
  field.read = [&value](const ConfigValue& written, const std::string& pointer, ConfigProblems& problems) {
    if (expect_text(written, pointer, problems)) value = written.text;
  };
  field.write = [&value] { return ConfigValue::make_string(value); };
  return field;
}

ConfigField& ConfigFields::path(std::string_view name, std::filesystem::path& value, PathRule rule,
                                std::string_view summary) {
  ConfigField& field = add_field(ConfigField::Kind::kValue, name, summary);
  field.allowed = rule.must_exist ? "a path of something that exists" : "a path";
  field.is_path = true;
  field.schema = typed_schema("string");
  field.read = [&value, rule](const ConfigValue& written, const std::string& pointer, ConfigProblems& problems) {
    if (!expect_kind(written, Kind::kString, "a path in a string", "", pointer, problems)) return;
    if (written.text.empty() && rule.may_be_empty) {
      value.clear();
      return;
    }
    if (written.text.empty() || written.text.find('\0') != std::string::npos)
      return report(written, pointer, problems, shown(written) + " is not a path", "");
    const std::filesystem::path folder =
        written.origin.source ? written.origin.source->folder : std::filesystem::path();
    const std::filesystem::path file = (folder / written.text).lexically_normal();
    std::error_code error;
    if (rule.must_exist && !std::filesystem::exists(file, error))
      return report(written, pointer, problems,
                    shown(written) + " does not exist (looked for " + file.generic_string() + ")", "");
    const std::filesystem::path whole = std::filesystem::absolute(file, error);
    value = error ? file : whole.lexically_normal();
  };
  field.write = [&value] { return ConfigValue::make_string(value.generic_string()); };
  return field;
}

ConfigField& ConfigFields::add_choice(std::string_view name, std::vector<std::string> words, std::string_view summary,
                                      std::function<std::size_t()> get, std::function<void(std::size_t)> set) {
  ConfigField& field = add_field(ConfigField::Kind::kValue, name, summary);
  std::vector<ConfigValue> listed;
  for (const std::string& word : words) {
    field.allowed += (field.allowed.empty() ? "" : ", ") + json_string(word);
    listed.push_back(ConfigValue::make_string(word));
  }
  field.schema = typed_schema("string");
  field.schema.add("enum", ConfigValue::make_array(std::move(listed)));
  field.read = [words, allowed = field.allowed, set = std::move(set)](
                   const ConfigValue& value, const std::string& pointer, ConfigProblems& problems) {
    if (value.kind != Kind::kString)
      return report(value, pointer, problems, shown(value) + " is " + kind_name(value) + ", not one of the choices",
                    allowed);
    for (std::size_t i = 0; i < words.size(); ++i) {
      if (words[i] == value.text) return set(i);
    }
    report(value, pointer, problems, shown(value) + " is not one of the choices",
           allowed + did_you_mean(value.text, words));
  };
  field.write = [words, get = std::move(get)] {
    const std::size_t index = get();
    HSI4D_CHECK(index < words.size(), "a setting holds a value that has no word");
    return ConfigValue::make_string(words[index]);
  };
  return field;
}

ConfigField& ConfigFields::add_numbers(std::string_view name, NumberRange range, ListSize size,
                                       std::string_view summary, std::function<std::vector<double>()> get,
                                       std::function<void(const std::vector<double>&)> set) {
  ConfigField& field = add_field(ConfigField::Kind::kValue, name, summary);
  field.allowed = allowed_size(size) + " numbers, each " + allowed_text(range);
  field.schema = list_schema(number_schema(range), size);
  field.read = [range, size, allowed = field.allowed, set = std::move(set)](
                   const ConfigValue& value, const std::string& pointer, ConfigProblems& problems) {
    if (!expect_list(value, size, allowed, pointer, problems)) return;
    std::vector<double> read(value.items.size());
    bool good = true;
    for (std::size_t i = 0; i < read.size(); ++i) {
      good = read_number(value.items[i], range, child_pointer(pointer, std::to_string(i)), problems, read[i]) && good;
    }
    if (good) set(read);
  };
  field.write = [get = std::move(get)] {
    ConfigValue array = ConfigValue::make_array();
    for (const double number : get()) array.items.push_back(ConfigValue::make_number(number));
    return array;
  };
  return field;
}

ConfigField& ConfigFields::numbers(std::string_view name, std::vector<double>& values, NumberRange range,
                                   std::string_view summary, ListSize size) {
  return add_numbers(
      name, range, size, summary, [&values] { return values; },
      [&values](const std::vector<double>& read) { values = read; });
}

ConfigField& ConfigFields::strings(std::string_view name, std::vector<std::string>& values, std::string_view summary,
                                   ListSize size) {
  ConfigField& field = add_field(ConfigField::Kind::kValue, name, summary);
  field.allowed = allowed_size(size) + " strings";
  field.schema = list_schema(typed_schema("string"), size);
  field.read = [&values, size, allowed = field.allowed](const ConfigValue& value, const std::string& pointer,
                                                        ConfigProblems& problems) {
    if (!expect_list(value, size, allowed, pointer, problems)) return;
    std::vector<std::string> read;
    for (std::size_t i = 0; i < value.items.size(); ++i) {
      const ConfigValue& item = value.items[i];
      if (expect_text(item, child_pointer(pointer, std::to_string(i)), problems)) read.push_back(item.text);
    }
    values = std::move(read);
  };
  field.write = [&values] {
    ConfigValue array = ConfigValue::make_array();
    for (const std::string& text : values) array.items.push_back(ConfigValue::make_string(text));
    return array;
  };
  return field;
}

ConfigField& ConfigFields::add_optional(ConfigFields inner, std::function<bool()> has, std::function<void()> load,
                                        std::function<void(bool)> store) {
  HSI4D_CHECK(inner.fields_.size() == 1 && inner.fields_[0].kind == ConfigField::Kind::kValue,
              "an optional setting describes exactly one value");
  const ConfigField value = inner.fields_[0];
  ConfigField& field = add_field(ConfigField::Kind::kValue, value.name, value.summary);
  field.allowed = value.allowed + ", or null";
  field.schema = ConfigValue::make_object();
  for (const ConfigMember& member : value.schema.members) {
    ConfigValue content = member.value;
    if (member.key == "type") content = ConfigValue::make_array({content, ConfigValue::make_string("null")});
    if (member.key == "enum") content.items.push_back(ConfigValue::make_null());
    field.schema.add(member.key, std::move(content));
  }
  field.read = [read = value.read, store](const ConfigValue& written, const std::string& pointer,
                                          ConfigProblems& problems) {
    if (written.kind == Kind::kNull) return store(false);
    const std::size_t before = problems.size();
    read(written, pointer, problems);
    if (problems.size() == before) store(true);
  };
  field.write = [write = value.write, has = std::move(has), load = std::move(load)] {
    if (!has()) return ConfigValue::make_null();
    load();
    return write();
  };
  return field;
}

void ConfigFields::or_word(std::string_view name, std::string word, bool& is_word) {
  const auto field = std::find_if(fields_.begin(), fields_.end(), [&](const ConfigField& f) { return f.name == name; });
  HSI4D_CHECK(field != fields_.end() && field->kind == ConfigField::Kind::kValue,
              "no number '" + std::string(name) + "'");
  const ConfigValue text = ConfigValue::make_string(word);
  field->allowed += ", or " + json_string(word);
  ConfigValue words = ConfigValue::make_object(), schema = ConfigValue::make_object();
  words.add("enum", ConfigValue::make_array({text}));
  schema.add("anyOf", ConfigValue::make_array({std::move(field->schema), std::move(words)}));
  field->schema = std::move(schema);
  field->read = [read = field->read, allowed = field->allowed, word, &is_word](
                    const ConfigValue& written, const std::string& pointer, ConfigProblems& problems) {
    is_word = written.kind == Kind::kString && written.text == word;
    if (is_word) return;
    if (written.kind == Kind::kNumber) return read(written, pointer, problems);
    expect_kind(written, Kind::kNumber, "a number", allowed, pointer, problems);
  };
  field->write = [write = field->write, text, &is_word] { return is_word ? text : write(); };
}

ConfigField& ConfigFields::add_object(std::string_view name, std::shared_ptr<ConfigFields> children,
                                      std::string_view summary) {
  ConfigField& field = add_field(ConfigField::Kind::kObject, name, summary);
  field.children = std::move(children);
  return field;
}

void ConfigFields::then(std::function<void()> step) {
  add_field(ConfigField::Kind::kStep, "", "").step = std::move(step);
}

void ConfigFields::rule(std::vector<std::string> names, std::function<std::string()> rule) {
  for (const std::string& name : names)
    HSI4D_CHECK(std::any_of(fields_.begin(), fields_.end(), [&name](const ConfigField& f) { return f.name == name; }),
                "a rule is about a setting that is not described before it: " + name);
  ConfigField& field = add_field(ConfigField::Kind::kRule, names.at(0), "");
  field.rule = std::move(rule);
  field.rule_fields = std::move(names);
}

std::vector<std::string> ConfigFields::names() const {
  std::vector<std::string> all;
  for (const ConfigField& field : fields_) {
    if (field.kind != ConfigField::Kind::kStep && field.kind != ConfigField::Kind::kRule) all.push_back(field.name);
  }
  return all;
}

const ConfigField* ConfigFields::find(std::string_view name) const {
  for (const ConfigField& field : fields_) {
    const bool is_data = field.kind != ConfigField::Kind::kStep && field.kind != ConfigField::Kind::kRule;
    if (is_data && field.name == name) return &field;
  }
  return nullptr;
}

}  // namespace hsi4d
