// The demo's configs, which are part of the program so that it runs from anywhere.
#pragma once

#include <map>
#include <string>

namespace hsi4d::cli {

/// Texts by name: demo_quick.json and demo.json, and best.json, which that extends.
std::map<std::string, std::string> demo_config_texts();

}  // namespace hsi4d::cli
