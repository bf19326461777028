// The demo's configs, which are part of the program so that it runs from anywhere.
#pragma once

#include <string_view>

namespace hsi4d::cli {

/// The text of configs/demo_quick.json, or of configs/demo.json.
std::string_view demo_config_text(bool quick);

}  // namespace hsi4d::cli
