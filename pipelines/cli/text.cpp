#include "pipelines/cli/text.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <filesystem>

#include "body/motion_io.h"
#include "core/check.h"

namespace hsi4d::cli {

std::string short_number(double value) { return rounded(value, 4); }

std::string count_text(std::int64_t count, const std::string& one) {
  return std::to_string(count) + " " + one + (count == 1 ? "" : one.ends_with("s") ? "es" : "s");
}

std::string file_ending(const std::string& path) {
  std::string ending = std::filesystem::path(path).extension().string();
  for (char& c : ending) {
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  }
  return ending;
}

std::string table(const std::vector<std::vector<std::string>>& rows) {
  std::vector<std::size_t> widths;
  for (const auto& row : rows) {
    widths.resize(std::max(widths.size(), row.size()));
    for (std::size_t i = 0; i < row.size(); ++i) widths[i] = std::max(widths[i], count_characters(row[i]));
  }
  std::string text;
  for (const auto& row : rows) {
    for (std::size_t i = 0; i < row.size(); ++i) {
      text += row[i];
      if (i + 1 < row.size()) text.append(widths[i] - count_characters(row[i]) + 2, ' ');
    }
    text.erase(text.find_last_not_of(' ') + 1);
    text += "\n";
  }
  return text;
}

std::vector<double> parse_numbers(const std::string& text, std::size_t count, const std::string& where,
                                  const std::string& names) {
  std::vector<double> numbers;
  const char* at = text.data();
  const char* end = text.data() + text.size();
  while (true) {
    double number = 0;
    const auto done = std::from_chars(at, end, number);
    if (done.ec != std::errc() || !std::isfinite(number)) break;
    numbers.push_back(number);
    at = done.ptr;
    if (at == end || *at != ',') break;
    ++at;
  }
  if (at == end && (count == 0 ? !numbers.empty() : numbers.size() == count)) return numbers;
  throw UserError(where + ": \"" + text + "\" is not understood; allowed: " +
                  (count == 0 ? "" : std::to_string(count) + " ") + "finite numbers " + names);
}

void check_rate(const std::optional<double>& rate, const std::string& where) {
  if (!rate || (*rate >= kSlowestMotion && *rate <= kFastestMotion)) return;
  throw UserError(where + ": " + number_text(*rate) + " is out of range; allowed: " + number_text(kSlowestMotion) +
                  " to " + rounded(kFastestMotion, 6));
}

}  // namespace hsi4d::cli
