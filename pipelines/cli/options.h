// Options that several commands have. The files that include it include CLI11.
#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <vector>

namespace CLI {
class App;
class Option;
class Validator;
}  // namespace CLI

namespace hsi4d::cli {

/// Refuses what is no whole number from 0 to `most`, in words.
CLI::Validator whole_number(std::int64_t most = std::numeric_limits<std::int64_t>::max());

/// --threads.
void add_threads(CLI::App& command, std::optional<int>& threads);

/// --set, several times.
void add_overrides(CLI::App& command, std::vector<std::string>& overrides);

/// An option that may be given several times, with one value each time.
CLI::Option* add_several(CLI::App& command, const std::string& name, std::vector<std::string>& values,
                         const std::string& description);

}  // namespace hsi4d::cli
