#include "core/suggest.h"

#include <algorithm>

namespace hsi4d {
namespace {

constexpr size_t kLongestName = 64;  // beyond this nobody mistyped a key, and the table would only cost time

char folded(char c) {
  if (c == '-') return '_';
  return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
}

}  // namespace

int edit_distance(std::string_view a, std::string_view b) {
  const size_t columns = b.size() + 1;
  std::vector<int> before(columns), above(columns), row(columns);
  for (size_t j = 0; j < columns; ++j) above[j] = static_cast<int>(j);
  for (size_t i = 1; i <= a.size(); ++i) {
    row[0] = static_cast<int>(i);
    for (size_t j = 1; j < columns; ++j) {
      const char p = folded(a[i - 1]), q = folded(b[j - 1]);
      row[j] = std::min({above[j] + 1, row[j - 1] + 1, above[j - 1] + (p == q ? 0 : 1)});
      const bool swapped = i > 1 && j > 1 && p == folded(b[j - 2]) && folded(a[i - 2]) == q;
      if (swapped) row[j] = std::min(row[j], before[j - 2] + 1);
    }
    before.swap(above);
    above.swap(row);
  }
  return above.back();
}

std::string nearest_name(std::string_view wrong, const std::vector<std::string>& known) {
  if (wrong.empty() || wrong.size() > kLongestName) return {};
  std::string best;
  int least = 1 + static_cast<int>((wrong.size() + 1) / 3);  // one edit in three letters still looks like a slip
  for (const std::string& name : known) {
    if (name.empty() || name.size() > kLongestName) continue;
    const int distance = edit_distance(wrong, name);
    if (distance < least && distance < static_cast<int>(name.size())) {
      least = distance;
      best = name;
    }
  }
  if (!best.empty()) return best;
  for (const std::string& name : known) {  // an abbreviation: "iter" for "iterations"
    if (wrong.size() >= 3 && name.starts_with(wrong)) return name;
  }
  return {};
}

std::string did_you_mean(std::string_view wrong, const std::vector<std::string>& known) {
  const std::string name = nearest_name(wrong, known);
  return name.empty() ? std::string() : "; did you mean \"" + name + "\"?";
}

}  // namespace hsi4d
