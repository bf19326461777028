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

/// Throws UserError for a number of an option that is outside.
/// @param option  with the command, "hsi4d init: --focal-px"
void check_range(double value, const std::string& option, double least, double most);

/// The same where it is given.
template <class T>
void check_range(const std::optional<T>& value, const std::string& option, double least, double most) {
  if (value) check_range(static_cast<double>(*value), option, least, most);
}

/// An option that may be given several times, with one value each time.
CLI::Option* add_several(CLI::App& command, const std::string& name, std::vector<std::string>& values,
                         const std::string& description);

}  // namespace hsi4d::cli
