#include "pipelines/cli/text.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <sstream>

#include "body/motion_io.h"
#include "core/check.h"

namespace hsi4d::cli {

namespace {

constexpr std::size_t kColumnGap = 2;  // blanks between the columns of a table

}  // namespace

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

std::vector<std::size_t> column_widths(const std::vector<std::vector<std::string>>& rows) {
  std::vector<std::size_t> widths;
  for (const auto& row : rows) {
    widths.resize(std::max(widths.size(), row.size()));
    for (std::size_t i = 0; i < row.size(); ++i) widths[i] = std::max(widths[i], count_characters(row[i]));
  }
  return widths;
}

std::size_t table_width(const std::vector<std::size_t>& widths) {
  std::size_t width = 0;
  for (const std::size_t column : widths) width += column + kColumnGap;
  return width - std::min(width, kColumnGap);
}

std::string table(const std::vector<std::vector<std::string>>& rows) {
  const std::vector<std::size_t> widths = column_widths(rows);
  std::string text;
  for (const auto& row : rows) {
    for (std::size_t i = 0; i < row.size(); ++i) {
      text += row[i];
      if (i + 1 < row.size()) text.append(widths[i] - count_characters(row[i]) + kColumnGap, ' ');
    }
    text.erase(text.find_last_not_of(' ') + 1);
    text += "\n";
  }
  return text;
}

std::string shortened(const std::string& text, std::size_t most) {
  const std::size_t count = count_characters(text);
  if (count <= most) return text;
  const std::size_t kept = std::max<std::size_t>(most, 3) - 1, begin = (kept + 1) / 2, end = kept - begin;
  std::string out;
  std::size_t at = 0;
  for (std::size_t i = 0; i < count && at < text.size(); ++i) {
    const std::size_t bytes = std::max<std::size_t>(utf8_length(std::string_view(text).substr(at)), 1);
    if (i == begin) out += "…";
    if (i < begin || i >= count - end) out += text.substr(at, bytes);
    at += bytes;
  }
  return out;
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

std::string folded_table(std::vector<std::vector<std::string>> rows, std::optional<int> columns) {
  constexpr int kLeast = 20;  // characters of a line
  if (!columns || rows.empty()) return table(rows);
  const auto most = static_cast<std::size_t>(std::max(*columns, kLeast));
  for (auto& row : rows) row.at(0) = shortened(row[0], most / 2);
  const std::vector<std::size_t> widths = column_widths(rows);
  std::string text;
  for (std::size_t begin = 1; begin < widths.size();) {
    std::vector<std::size_t> shown = {widths[0], widths[begin]};
    std::size_t end = begin + 1;
    for (; end < widths.size(); ++end) {
      shown.push_back(widths[end]);
      if (table_width(shown) > most) break;
    }
    std::vector<std::vector<std::string>> part;
    for (const auto& row : rows) {
      part.push_back({row[0]});
      for (std::size_t i = begin; i < std::min(end, row.size()); ++i) part.back().push_back(row[i]);
    }
    text += (text.empty() ? "" : "\n") + table(part);
    begin = end;
  }
  return widths.size() > 1 ? text : table(rows);
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
