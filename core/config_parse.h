// JSON text to ConfigValue, with a position for everything and messages for people.
#pragma once

#include <memory>
#include <string>

#include "core/config_value.h"

namespace hsi4d {

/// Objects and arrays nested deeper than this are refused: no config needs it and recursion must stay bounded.
inline constexpr int kDeepestConfig = 64;

/// Parses one JSON text (RFC 8259, UTF-8, a byte order mark allowed).
///
/// It stops at the first syntax error, which is reported with its line of text and a caret. Duplicate keys are
/// reported, the first one kept.
/// @param text      the bytes of the file
/// @param source    what messages name, and what the origin of every value refers to
/// @param problems  receives everything that is wrong
/// @param value     receives the tree
/// @return false when the text cannot be read to its end; `value` is then not to be used
bool parse_config_text(const std::string& text, const std::shared_ptr<const ConfigSource>& source,
                       ConfigProblems& problems, ConfigValue& value);

/// As above for a text that should be one JSON value; reports nothing. False when it is not JSON.
bool parse_json_value(const std::string& text, const std::shared_ptr<const ConfigSource>& source, ConfigValue& value);

}  // namespace hsi4d
