// What the JSON files of a study have in common.
#pragma once

#include <string>
#include <string_view>

#include "core/config_value.h"

namespace hsi4d {

/// An object that begins with format, version and the study's id.
ConfigValue study_file(std::string_view format, const std::string& study);

/// Reads such a file. Throws UserError naming a file that cannot be read, DataError for what is no JSON, no object, of
/// another format or of a newer version.
ConfigValue read_study_file(const std::string& file, std::string_view format);

/// A member. Throws DataError with the object's position where there is none.
/// @param pointer  of the object
const ConfigValue& needed(const ConfigValue& object, std::string_view name, const std::string& pointer);

/// A member that is a string, or an array. Throws as needed and check_kind.
std::string needed_text(const ConfigValue& object, std::string_view name, const std::string& pointer);
const ConfigValue& needed_array(const ConfigValue& object, std::string_view name, const std::string& pointer);

}  // namespace hsi4d
