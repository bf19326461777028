// "Did you mean": the known name nearest to a wrong one.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace hsi4d {

/// Number of single-character edits between two names: insertions, deletions, substitutions and swaps of neighbours
/// (optimal string alignment). Case and '-' against '_' are free.
int edit_distance(std::string_view a, std::string_view b);

/// The name of `known` nearest to `wrong`, the first of equals; empty when none is near enough to be meant.
std::string nearest_name(std::string_view wrong, const std::vector<std::string>& known);

/// `; did you mean "name"?` for the nearest name, or an empty string.
std::string did_you_mean(std::string_view wrong, const std::vector<std::string>& known);

}  // namespace hsi4d
