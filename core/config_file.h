// A config file with what it extends and with the command line's overrides, as one tree.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "core/config.h"
#include "core/config_value.h"

namespace hsi4d {

/// The longest config file that is read, in bytes.
inline constexpr int64_t kLargestConfig = int64_t{8} << 20;

/// Reads `file` and lays it over the file that its "extends" names, and so on; then applies the overrides in their
/// order.
///
/// "extends" is relative to the file that holds it. Objects merge key by key; null takes an object of the extended file
/// out; arrays and all other values replace. An override is KEY=VALUE with KEY a dotted path
/// ("stages.camera.iterations") or a JSON pointer
/// ("/stages/camera/iterations"), and VALUE JSON, or else a string. A "$schema" string at the top of a file is for
/// editors and is dropped.
/// @param problems  receives what is wrong: a missing or cyclic base, syntax errors, duplicate keys, unusable overrides
/// @return the tree; every value knows where it was written
/// Throws UserError when `file` itself cannot be read, or when some text could not be parsed to its end (with all
/// problems).
ConfigValue load_config(const std::filesystem::path& file, const std::vector<std::string>& overrides,
                        ConfigProblems& problems);

/// A tree made of overrides alone, over an empty object.
ConfigValue config_from_overrides(const std::vector<std::string>& overrides, ConfigProblems& problems);

/// As load_config for text that is in no file, with `name` in messages; "extends" is relative to `folder`.
/// @param beside  more such texts by name, which "extends" may name instead of files
ConfigValue load_config_text(const std::string& text, const std::string& name, const std::filesystem::path& folder,
                             const std::vector<std::string>& overrides, ConfigProblems& problems,
                             const std::map<std::string, std::string>& beside = {});

/// A struct read from a tree, where describe(ConfigFields&, T&) tells its fields. Throws UserError with all problems,
/// those found before included.
template <class T>
T read_settings(const ConfigValue& tree, ConfigProblems& problems) {
  T settings;
  ConfigFields fields;
  describe(fields, settings);
  read_config(tree, fields, problems);
  problems.throw_if_any();
  return settings;
}

}  // namespace hsi4d
