// Keys that configs have no more.
#pragma once

#include "core/config_value.h"

namespace hsi4d {

/// Takes out of a config the keys that were settings once (the table is in removed_keys.cpp), each with a problem that
/// tells what stands in its place. A key with the value that the program has now passes: config.resolved.json of
/// earlier runs names every setting.
ConfigValue without_removed_keys(ConfigValue tree, ConfigProblems& problems);

}  // namespace hsi4d
