#include "pipelines/cli/text.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <sstream>

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

std::string wrapped(const std::string& text, std::size_t columns) {
  std::istringstream words(text);
  std::string out;
  std::size_t used = 0;
  for (std::string word; words >> word;) {
    const std::size_t length = count_characters(word);
    const bool fits = used > 0 && used + 1 + length <= columns;
    out += used == 0 ? "" : fits ? " " : "\n";
    out += word;
    used = fits ? used + 1 + length : length;
  }
  return out;
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
