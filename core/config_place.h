// Settings laid into a config by their keys: what `--set` and sweeps do.
#pragma once

#include <string>
#include <vector>

#include "core/config_value.h"

namespace hsi4d {

/// The keys of a dotted path ("stages.camera.iterations"), or of a JSON pointer (RFC 6901,
/// "/stages/camera/iterations"), as messages write settings; none where a key is empty or there are more than configs
/// are deep.
std::vector<std::string> config_keys(const std::string& path);

/// The place that `keys` name in a tree. Objects on the way that are not there are made, marked as ConfigMember tells.
/// @param origin    of whoever names the place: what is made has it, and problems are told there
/// @param problems  receives a key of something that is no object, and an index that an array does not have
/// @return  null after a problem
ConfigValue* config_place(ConfigValue& tree, const std::vector<std::string>& keys, const ConfigOrigin& origin,
                          ConfigProblems& problems);

/// Takes the object out that `keys` name. False where there is none.
bool take_out_object(ConfigValue& tree, const std::vector<std::string>& keys);

/// Lays a value over the place of a key as a file that extends another one does: objects merge, and may add to what is
/// there; everything else replaces. null takes an object out that is there: a stage, a loss.
/// @param key     as config_keys takes it
/// @param origin  where the key was written
void lay_into_config(ConfigValue& tree, const std::string& key, const ConfigValue& value, const ConfigOrigin& origin,
                     ConfigProblems& problems);

}  // namespace hsi4d
