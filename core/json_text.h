// Reading JSON that the program wrote: positions in every message, unknown members passed over.
#pragma once

#include <string>
#include <string_view>

#include "core/config_value.h"

namespace hsi4d {

/// One JSON value. Throws DataError with every problem, "FILE:LINE: message" each.
///
/// @param name  what messages call the text: the file
/// @param line  the line of the file that the text begins in, from 1
ConfigValue parse_json_text(const std::string& text, const std::string& name, int line = 1);

/// Throws DataError "FILE:LINE: POINTER: message" for a value.
[[noreturn]] void fail_at(const ConfigValue& value, std::string_view pointer, std::string_view message);

/// Throws DataError unless the value is of this kind.
void check_kind(const ConfigValue& value, ConfigValue::Kind kind, std::string_view pointer);

/// A number as double, finite. Throws DataError for another kind or one that double cannot hold.
double number_of(const ConfigValue& value, std::string_view pointer);

/// A whole number from 0 to 2^53. Throws DataError for anything else.
std::int64_t whole_number_of(const ConfigValue& value, std::string_view pointer);

/// The text of a member that is a string; "" where there is none or it is of another kind.
std::string string_member(const ConfigValue& object, std::string_view key);

}  // namespace hsi4d
