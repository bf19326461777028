// A JSON value that remembers where it was written, and the list of problems found in a config.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

namespace hsi4d {

/// A file, or one `--set` of the command line, that values were written in.
struct ConfigSource {
  std::string name;              ///< as messages show it: the path as it was given, or "--set KEY=VALUE"
  std::filesystem::path folder;  ///< what relative paths written in this source are relative to
  int order = 0;                 ///< problems are sorted by it, then by offset
  bool is_command_line = false;
};

/// Where a value or key was written. An empty origin is a value that the program made.
struct ConfigOrigin {
  std::shared_ptr<const ConfigSource> source;
  std::size_t offset = 0;  ///< bytes from the start of the source
  int line = 0;            ///< from 1; 0 where lines make no sense
  int column = 0;          ///< from 1, in characters; 0 where only the line is told
};

struct ConfigMember;

/// One JSON value: plain data, for reading and for writing. Objects keep the order in which keys were written.
struct ConfigValue {
  enum class Kind { kNull, kBoolean, kNumber, kString, kArray, kObject };
  Kind kind = Kind::kNull;
  bool boolean = false;
  std::string text;  ///< of a number: as written, so that every type rounds it once; of a string: its UTF-8 characters
  std::vector<ConfigValue> items;
  std::vector<ConfigMember> members;
  ConfigOrigin origin;

  static ConfigValue make_null();  // not here: clang would want ConfigMember's size
  static ConfigValue make_boolean(bool value);
  /// Shortest text that reads back as the same number. Throws InternalError when it is not finite: JSON cannot hold it.
  static ConfigValue make_number(double value);
  static ConfigValue make_number(float value);
  static ConfigValue make_integer(std::int64_t value);
  static ConfigValue make_string(std::string_view value);
  static ConfigValue make_array();
  static ConfigValue make_array(std::vector<ConfigValue> values);
  static ConfigValue make_object();
  /// Appends a member to an object; the key must be new.
  ConfigValue& add(std::string_view key, ConfigValue value);
};

struct ConfigMember {
  std::string key;
  ConfigValue value;
  ConfigOrigin key_origin;
  bool made_by_set = false;  ///< `--set` named this key and no file had written it
};

/// The member of an object named `key`, or null.
const ConfigValue* find_member(const ConfigValue& object, std::string_view key);

/// Where the value at a JSON pointer was written; where it was not, the object or array that it would be in.
const ConfigOrigin& origin_at(const ConfigValue& tree, std::string_view pointer);

/// `base` with `overlay` laid over it: objects merge key by key, null takes out an object that the base has under its
/// key, everything else replaces.
ConfigValue merged(ConfigValue base, ConfigValue overlay);

/// JSON text in lines of two-space indentation, arrays of plain values on one line, ending with a newline.
std::string to_json(const ConfigValue& value);

/// JSON text on one line, without a line break at its end.
std::string to_json_line(const ConfigValue& value);

/// JSON text on one line, shortened to what a message can show.
std::string shown(const ConfigValue& value);

/// "a string", "an array of 3", ...: what a value is, for messages.
std::string kind_name(const ConfigValue& value);

/// A string in JSON's double quotes.
std::string json_string(std::string_view text);

/// `pointer` + "/" + key, escaped as RFC 6901 wants (~0, ~1).
std::string child_pointer(std::string_view pointer, std::string_view key);

/// The problems of a config, collected so that all can be told at once.
class ConfigProblems {
 public:
  /// "FILE:LINE: POINTER: message", or "--set KEY=VALUE: POINTER: message"; an empty pointer is left out.
  void add(const ConfigOrigin& origin, std::string_view pointer, std::string_view message);
  std::size_t size() const { return count_; }
  bool empty() const { return count_ == 0; }
  /// Where the problems are; of very many problems not all.
  std::vector<std::string> pointers() const;
  /// Throws one UserError with every problem, a line each, in the order of the sources; nothing without problems.
  void throw_if_any() const;

 private:
  struct Problem {
    ConfigOrigin origin;
    std::string pointer, text;
  };
  std::vector<Problem> problems_;
  std::size_t count_ = 0;
};

}  // namespace hsi4d
