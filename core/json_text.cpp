#include "core/json_text.h"

#include <charconv>
#include <cmath>
#include <cstdint>
#include <memory>

#include "core/check.h"
#include "core/config_parse.h"

namespace hsi4d {
namespace {

using Kind = ConfigValue::Kind;

/// ConfigProblems tells the user's mistakes; in a file that the program wrote they are damage.
[[noreturn]] void throw_as_data_error(const ConfigProblems& problems) {
  try {
    problems.throw_if_any();
  } catch (const UserError& error) {
    throw DataError(error.what());
  }
  throw InternalError("a JSON text could not be read, and no problem was told");
}

std::shared_ptr<const ConfigSource> source_named(const std::string& name) {
  auto source = std::make_shared<ConfigSource>();
  source->name = name;
  return source;
}

}  // namespace

ConfigValue parse_json_text(const std::string& text, const std::string& name, int line) {
  const std::shared_ptr<const ConfigSource> source = source_named(name);
  ConfigProblems problems;
  ConfigValue value;
  // Blank lines in front give every position its line.
  const bool read = parse_config_text(std::string(static_cast<size_t>(line - 1), '\n') + text, source, problems, value);
  if (!read || !problems.empty()) throw_as_data_error(problems);
  return value;
}

void fail_at(const ConfigValue& value, std::string_view pointer, std::string_view message) {
  ConfigProblems problems;
  problems.add(value.origin, pointer, message);
  throw_as_data_error(problems);
}

void check_kind(const ConfigValue& value, Kind kind, std::string_view pointer) {
  if (value.kind == kind) return;
  ConfigValue wanted;
  wanted.kind = kind;
  const std::string name = kind == Kind::kArray ? "an array" : kind_name(wanted);
  fail_at(value, pointer, shown(value) + " is " + kind_name(value) + ", not " + name);
}

double number_of(const ConfigValue& value, std::string_view pointer) {
  check_kind(value, Kind::kNumber, pointer);
  double number = 0;
  const char* const end = value.text.data() + value.text.size();
  const auto [stop, error] = std::from_chars(value.text.data(), end, number);
  if (error != std::errc() || stop != end || !std::isfinite(number))
    fail_at(value, pointer, value.text + " is beyond the range of numbers");
  return number;
}

std::int64_t whole_number_of(const ConfigValue& value, std::string_view pointer) {
  constexpr double kLargest = 9007199254740992.0;
  const double number = number_of(value, pointer);
  if (!(number >= 0 && number <= kLargest) || number != std::floor(number))
    fail_at(value, pointer, value.text + " is not a whole number from 0 to 2^53");
  return static_cast<std::int64_t>(number);
}

std::string string_member(const ConfigValue& object, std::string_view key) {
  const ConfigValue* const member = find_member(object, key);
  return member != nullptr && member->kind == Kind::kString ? member->text : "";
}

}  // namespace hsi4d
