// Settings as plain structs, described once.
//
// The member initialisers of a struct are its defaults. One function beside it names every field, its range and
// meaning:
//
//   struct BlurSettings {
//     double radius_px = 1.5;
//   };
//   void describe(ConfigFields& f, BlurSettings& s) {
//     f.number("radius_px", s.radius_px, {.above = 0, .max = 100}, "Standard deviation, pixels");
//   }
//
// The same description reads and checks a config, writes config.resolved.json, makes the JSON Schema and lists
// settings.
#pragma once

#include <array>
#include <concepts>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <initializer_list>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "core/config_value.h"

namespace hsi4d {

/// Which numbers are allowed: `min` and `max` are allowed themselves, `above` and `below` are not. All must be finite.
struct NumberRange {
  double min = -std::numeric_limits<double>::infinity();
  double above = -std::numeric_limits<double>::infinity();
  double max = std::numeric_limits<double>::infinity();
  double below = std::numeric_limits<double>::infinity();
};

/// Which whole numbers are allowed.
struct IntegerRange {
  std::int64_t min = std::numeric_limits<std::int64_t>::min();
  std::int64_t max = std::numeric_limits<std::int64_t>::max();
  std::int64_t multiple_of = 1;
};

/// How many elements a list may have.
struct ListSize {
  std::size_t min = 0;
  std::size_t max = std::numeric_limits<std::size_t>::max();
};

/// What a path must be.
struct PathRule {
  bool must_exist = false;
  bool may_be_empty = true;  ///< an empty string stays an empty path: "none"
};

/// One word of a choice and the value that it stands for.
template <class E>
struct ConfigChoice {
  E value;
  const char* name;
};

/// The word of a value, from its table of choices.
template <class E>
std::string_view choice_name(std::span<const ConfigChoice<E>> choices, E value) {
  for (const ConfigChoice<E>& choice : choices) {
    if (choice.value == value) return choice.name;
  }
  return {};
}

/// Settings under free keys, in the order in which they were written.
template <class T>
using ConfigMap = std::vector<std::pair<std::string, T>>;

/// The entry of a map under `key`, or null.
template <class T>
const T* find_entry(const ConfigMap<T>& map, std::string_view key) {
  for (const auto& [name, value] : map) {
    if (name == key) return &value;
  }
  return nullptr;
}

/// A key that a map may have, and what its value is before anything is read.
template <class T>
struct ConfigKey {
  std::string name;
  std::string summary;
  T initial;
};

class ConfigFields;

/// One described field. Made by the functions of ConfigFields; code outside core/config has no reason to look inside.
struct ConfigField {
  enum class Kind { kValue, kObject, kMap, kList, kStep, kRule };
  using Read = std::function<void(const ConfigValue&, const std::string& pointer, ConfigProblems&)>;

  Kind kind = Kind::kValue;
  std::string name, summary, allowed;
  bool is_required = false;
  bool is_path = false;                                   ///< kValue: `write` gives the path
  ConfigValue schema;                                     ///< kValue: type and range as JSON Schema
  Read read;                                              ///< kValue
  std::function<ConfigValue()> write;                     ///< kValue
  std::shared_ptr<ConfigFields> children;                 ///< kObject: its fields; kMap, kList: those of a new element
  bool has_known_keys = false;                            ///< kMap: children are objects, one a key; no other keys
  std::function<ConfigFields(const std::string&)> entry;  ///< kMap, kList: the fields of an element, made if new
  std::function<std::vector<std::pair<std::string, ConfigFields>>()> entries;  ///< kMap, kList: of those that there are
  std::function<void()> clear;                                                 ///< kList
  std::function<void()> step;                                                  ///< kStep
  std::function<std::string()> rule;                                           ///< kRule: what is wrong, or nothing
  std::vector<std::string> rule_fields;                                        ///< kRule: the fields that it is about

  /// The field must be written; without this an absent field keeps its default.
  ConfigField& required() {
    is_required = true;
    return *this;
  }
};

/// The described fields of one struct, bound to one instance of it, which must outlive them and stay in place.
class ConfigFields {
 public:
  /// Calls the function `describe(ConfigFields&, S&)` of the struct's own namespace.
  struct ByName {
    template <class S>
    void operator()(ConfigFields& fields, S& settings) const {
      describe(fields, settings);
    }
  };

  /// A finite number. NaN, infinities and what overflows or underflows the type are refused.
  ConfigField& number(std::string_view name, double& value, NumberRange range, std::string_view summary);
  ConfigField& number(std::string_view name, float& value, NumberRange range, std::string_view summary);

  /// A whole number; 2.0 is one, 2.7 and true are not.
  template <std::integral T>
  requires(!std::same_as<T, bool>) ConfigField& integer(std::string_view name, T& value, IntegerRange range,
                                                        std::string_view summary) {
    using Limits = std::numeric_limits<T>;
    if (std::cmp_less(range.min, Limits::min())) range.min = static_cast<std::int64_t>(Limits::min());
    if (std::cmp_greater(range.max, Limits::max())) range.max = static_cast<std::int64_t>(Limits::max());
    return add_integer(
        name, range, summary, [&value] { return static_cast<std::int64_t>(value); },
        [&value](std::int64_t read) { value = static_cast<T>(read); });
  }

  ConfigField& boolean(std::string_view name, bool& value, std::string_view summary);
  /// Text without the character 0.
  ConfigField& string(std::string_view name, std::string& value, std::string_view summary);

  /// A file or folder; a relative one is relative to the file that names it, or to the current folder in `--set`. The
  /// path read is absolute, and so is the one written to config.resolved.json.
  ConfigField& path(std::string_view name, std::filesystem::path& value, PathRule rule, std::string_view summary);

  /// One of a table of words.
  template <class E>
  ConfigField& choice(std::string_view name, E& value, std::type_identity_t<std::span<const ConfigChoice<E>>> choices,
                      std::string_view summary) {
    std::vector<std::string> words;
    std::vector<E> values;
    for (const ConfigChoice<E>& choice : choices) {
      words.emplace_back(choice.name);
      values.push_back(choice.value);
    }
    auto get = [&value, values] {
      std::size_t index = 0;
      while (index < values.size() && values[index] != value) ++index;
      return index;
    };
    auto set = [&value, values](std::size_t index) { value = values[index]; };
    return add_choice(name, std::move(words), summary, get, set);
  }

  /// Exactly N numbers.
  template <std::size_t N>
  ConfigField& numbers(std::string_view name, std::array<double, N>& values, NumberRange range,
                       std::string_view summary) {
    auto get = [&values] { return std::vector<double>(values.begin(), values.end()); };
    auto set = [&values](const std::vector<double>& read) { std::copy(read.begin(), read.end(), values.begin()); };
    return add_numbers(name, range, {N, N}, summary, get, set);
  }
  /// A list of numbers.
  ConfigField& numbers(std::string_view name, std::vector<double>& values, NumberRange range, std::string_view summary,
                       ListSize size = {});
  /// A list of strings without the character 0.
  ConfigField& strings(std::string_view name, std::vector<std::string>& values, std::string_view summary,
                       ListSize size = {});

  /// A value that may also be null. `describe_value` describes the value with the same name: it is called as
  /// describe_value(fields, value), for example [](ConfigFields& f, double& v) { f.number("until", v, {}, "..."); }.
  template <class T, class Describe>
  ConfigField& optional(std::optional<T>& value, Describe describe_value) {
    auto held = std::make_shared<T>();
    ConfigFields inner;
    describe_value(inner, *held);
    auto has = [&value] { return value.has_value(); };
    auto load = [&value, held] { *held = *value; };
    auto store = [&value, held](bool present) {
      if (present) {
        value = *held;
      } else {
        value.reset();
      }
    };
    return add_optional(std::move(inner), has, load, store);
  }

  /// One word that may stand for the value of a number above: `is_word` says whether it does.
  void or_word(std::string_view name, std::string word, bool& is_word);

  /// A nested struct.
  template <class S, class Describe = ByName>
  ConfigField& object(std::string_view name, S& value, std::string_view summary, Describe describe_value = {}) {
    auto children = std::make_shared<ConfigFields>();
    describe_value(*children, value);
    return add_object(name, std::move(children), summary);
  }

  /// Structs under keys that the user chooses: letters, digits, '_' and '-'.
  template <class S, class Describe = ByName>
  ConfigField& map(std::string_view name, ConfigMap<S>& value, std::string_view summary, Describe describe_value = {}) {
    ConfigField& field = add_entries(ConfigField::Kind::kMap, name, summary, describe_value, std::make_shared<S>());
    bind_map(field, value, describe_value, [](const std::string&) { return S{}; });
    return field;
  }

  /// Structs under keys of a known set, each with its own initial value.
  template <class S, class Describe = ByName>
  ConfigField& map(std::string_view name, ConfigMap<S>& value, std::vector<ConfigKey<S>> keys, std::string_view summary,
                   Describe describe_value = {}) {
    auto known = std::make_shared<std::vector<ConfigKey<S>>>(std::move(keys));
    auto children = std::make_shared<ConfigFields>();
    for (ConfigKey<S>& key : *known) children->object(key.name, key.initial, key.summary, describe_value);
    children->keep_alive_ = known;
    ConfigField& field = add_field(ConfigField::Kind::kMap, name, summary);
    field.has_known_keys = true;
    field.children = std::move(children);
    bind_map(field, value, describe_value, [known](const std::string& wanted) {
      for (const ConfigKey<S>& key : *known) {
        if (key.name == wanted) return key.initial;
      }
      return S{};  // never: the reader refuses other keys before it asks for an entry
    });
    return field;
  }

  /// A list of structs.
  template <class S, class Describe = ByName>
  ConfigField& list(std::string_view name, std::vector<S>& value, std::string_view summary,
                    Describe describe_value = {}) {
    ConfigField& field = add_entries(ConfigField::Kind::kList, name, summary, describe_value, std::make_shared<S>());
    field.clear = [&value] { value.clear(); };
    field.entry = [&value, describe_value](const std::string&) {
      return described(value.emplace_back(), describe_value);
    };
    field.entries = [&value, describe_value] {
      std::vector<std::pair<std::string, ConfigFields>> all;
      for (S& element : value) all.emplace_back("", described(element, describe_value));
      return all;
    };
    return field;
  }

  /// Runs while reading, after the fields above have been read and before those below are: a preset sets its values
  /// here and keys written explicitly win.
  void then(std::function<void()> step);

  /// A condition between fields, checked when all of them were read without problems. `rule` returns what is wrong, or
  /// an empty string; the message is placed at the first of `names`.
  void rule(std::vector<std::string> names, std::function<std::string()> rule);

  const std::vector<ConfigField>& fields() const { return fields_; }
  /// The names of the fields.
  std::vector<std::string> names() const;
  /// The field named `name`, or null.
  const ConfigField* find(std::string_view name) const;

 private:
  template <class S, class Describe>
  static ConfigFields described(S& value, Describe describe_value) {
    ConfigFields fields;
    describe_value(fields, value);
    return fields;
  }

  template <class S, class Describe>
  ConfigField& add_entries(ConfigField::Kind kind, std::string_view name, std::string_view summary,
                           Describe describe_value, std::shared_ptr<S> prototype) {
    auto children = std::make_shared<ConfigFields>();
    describe_value(*children, *prototype);
    children->keep_alive_ = std::move(prototype);
    ConfigField& field = add_field(kind, name, summary);
    field.children = std::move(children);
    return field;
  }

  template <class S, class Describe, class Make>
  static void bind_map(ConfigField& field, ConfigMap<S>& value, Describe describe_value, Make make) {
    field.entry = [&value, describe_value, make](const std::string& key) {
      for (auto& [name, element] : value) {
        if (name == key) return described(element, describe_value);
      }
      value.emplace_back(key, make(key));
      return described(value.back().second, describe_value);
    };
    field.entries = [&value, describe_value] {
      std::vector<std::pair<std::string, ConfigFields>> all;
      for (auto& [name, element] : value) all.emplace_back(name, described(element, describe_value));
      return all;
    };
  }

  ConfigField& add_field(ConfigField::Kind kind, std::string_view name, std::string_view summary);
  ConfigField& add_integer(std::string_view name, IntegerRange range, std::string_view summary,
                           std::function<std::int64_t()> get, std::function<void(std::int64_t)> set);
  ConfigField& add_choice(std::string_view name, std::vector<std::string> words, std::string_view summary,
                          std::function<std::size_t()> get, std::function<void(std::size_t)> set);
  ConfigField& add_numbers(std::string_view name, NumberRange range, ListSize size, std::string_view summary,
                           std::function<std::vector<double>()> get,
                           std::function<void(const std::vector<double>&)> set);
  ConfigField& add_optional(ConfigFields inner, std::function<bool()> has, std::function<void()> load,
                            std::function<void(bool)> store);
  ConfigField& add_object(std::string_view name, std::shared_ptr<ConfigFields> children, std::string_view summary);

  std::vector<ConfigField> fields_;
  std::shared_ptr<void> keep_alive_;  // a prototype that the fields are bound to
};

/// Reads an object into the struct that the fields are bound to. Every problem is added: unknown keys (with the nearest
/// known one), wrong types, values out of range, missing required keys, broken rules. Absent keys keep their value.
/// @param pointer  JSON pointer of `value`, "" for a whole config
void read_config(const ConfigValue& value, const ConfigFields& fields, ConfigProblems& problems,
                 const std::string& pointer = "");

/// Every setting with its present value, in the order of the description.
ConfigValue write_config(const ConfigFields& fields);

/// A path that is set.
struct ConfigPath {
  std::string pointer;
  std::filesystem::path path;
};

/// The paths that are not empty, in the order of the description.
std::vector<ConfigPath> list_paths(const ConfigFields& fields, const std::string& pointer = "");

/// A JSON Schema (draft 2020-12) of configs with these fields. Required keys are named in the descriptions but not
/// enforced, because a file may leave them to the file that it extends.
ConfigValue config_schema(const ConfigFields& fields, std::string_view title);

/// One setting, for listings.
struct ConfigSetting {
  std::string pointer;  ///< JSON pointer; NAME stands for a key that the user chooses, 0 for the elements of a list
  std::string allowed;  ///< "0 to 1"
  std::string initial;  ///< its default as JSON; "required" where there is none
  std::string summary;
};

/// Every setting, depth first.
std::vector<ConfigSetting> list_settings(const ConfigFields& fields, const std::string& pointer = "");

}  // namespace hsi4d
