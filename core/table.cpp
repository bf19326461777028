#include "core/table.h"

#include <algorithm>

#include "core/text.h"

namespace hsi4d {
namespace {

constexpr std::size_t kColumnGap = 2;  // blanks between the columns of a table

using TextRows = std::vector<std::vector<std::string>>;

/// The text with every character that `replace` gives something else for replaced by that.
template <class F>
std::string with_replaced(const std::string& text, F replace) {
  std::string out;
  for (const char c : text) out += replace(c);
  return out;
}

/// Head and rows as they stand in text; a table with marks has room for them in every column that is aligned right.
TextRows text_rows(const Table& table) {
  const auto marked = [](const auto& row) {
    return std::any_of(row.begin(), row.end(), [](const Cell& c) { return c.is_marked(); });
  };
  const bool has_marks = std::any_of(table.rows.begin(), table.rows.end(), marked);
  TextRows rows;
  const auto add = [&](const std::vector<Cell>& row) {
    rows.emplace_back();
    for (std::size_t i = 0; i < row.size(); ++i) {
      const bool is_right = table.align[std::min(i, table.align.size() - 1)] == 'r';
      rows.back().push_back(row[i].text + (row[i].is_marked() ? "*" : has_marks && is_right ? " " : ""));
    }
  };
  if (!table.head.empty()) add(table.head);
  for (const auto& row : table.rows) add(row);
  return rows;
}

std::vector<std::size_t> widths_of(const TextRows& rows) {
  std::vector<std::size_t> widths;
  for (const auto& row : rows) {
    widths.resize(std::max(widths.size(), row.size()));
    for (std::size_t i = 0; i < row.size(); ++i) widths[i] = std::max(widths[i], count_characters(row[i]));
  }
  return widths;
}

/// The first column and those from `begin` to before `end`.
std::string text_of(const TextRows& rows, const std::vector<std::size_t>& widths, const std::string& align,
                    std::size_t begin, std::size_t end) {
  std::string text;
  for (const auto& row : rows) {
    const auto add = [&](std::size_t i) {
      const std::string blanks(widths[i] - count_characters(row[i]), ' ');
      const bool is_right = align[std::min(i, align.size() - 1)] == 'r';
      text += (i == 0 ? "" : std::string(kColumnGap, ' ')) + (is_right ? blanks + row[i] : row[i] + blanks);
    };
    if (!row.empty()) add(0);
    for (std::size_t i = begin; i < std::min(end, row.size()); ++i) add(i);
    text.erase(text.find_last_not_of(' ') + 1);
    text += "\n";
  }
  return text;
}

std::string csv_field(const std::string& text) {
  if (text.find_first_of(",\"\r\n") == std::string::npos) return text;
  return "\"" + with_replaced(text, [](char c) { return c == '"' ? std::string("\"\"") : std::string(1, c); }) + "\"";
}

std::string html_cell(const Cell& cell, const std::string& element, const std::string& scope) {
  return "<" + element + scope + (cell.mark.empty() ? "" : " class=\"" + cell.mark + "\"") +
         (cell.tip.empty() ? "" : " title=\"" + html_escape(cell.tip) + "\"") + ">" +
         (!cell.html.empty()    ? cell.html
          : cell.mark == "none" ? "–"
                                : html_escape(cell.text)) +
         "</" + element + ">";
}

}  // namespace

std::string html_escape(std::string_view text) {
  std::string out;
  for (std::size_t i = 0; i < text.size();) {
    const std::size_t length = utf8_length(text.substr(i));
    const auto first = static_cast<unsigned char>(text[i]);
    const bool is_control = (first < 0x20 && first != '\n' && first != '\t') || first == 0x7F;
    const std::string_view character = text.substr(i, std::max<std::size_t>(length, 1));
    out += length == 0 || is_control ? "\xEF\xBF\xBD"
           : character == "&"        ? "&amp;"
           : character == "<"        ? "&lt;"
           : character == ">"        ? "&gt;"
           : character == "\""       ? "&quot;"
           : character == "'"        ? "&#39;"
                                     : character;
    i += character.size();
  }
  return out;
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

std::string table_text(const Table& table, std::optional<int> columns) {
  constexpr int kLeast = 20;  // characters of a line
  TextRows rows = text_rows(table);
  const std::size_t most = columns ? static_cast<std::size_t>(std::max(*columns, kLeast)) : std::string::npos;
  for (auto& row : rows) {
    if (columns && !row.empty()) row[0] = shortened(row[0], most / 2);
  }
  const std::vector<std::size_t> widths = widths_of(rows);
  if (widths.size() < 2 || !columns) return text_of(rows, widths, table.align, 1, widths.size());
  std::string text;
  for (std::size_t begin = 1, end = 1; begin < widths.size(); begin = end) {
    std::size_t width = widths[0];
    do width += kColumnGap + widths[end++];
    while (end < widths.size() && width + kColumnGap + widths[end] <= most);
    text += (text.empty() ? "" : "\n") + text_of(rows, widths, table.align, begin, end);
  }
  return text;
}

std::size_t table_width(const Table& table) {
  std::size_t width = 0;
  for (const std::size_t column : widths_of(text_rows(table))) width += column + kColumnGap;
  return width - std::min(width, kColumnGap);
}

std::string table_markdown(const Table& table) {
  if (table.rows.empty()) return "";
  TextRows rows;
  const auto add = [&](const std::vector<Cell>& row) {
    rows.emplace_back(table.head.size());
    for (std::size_t i = 0; i < row.size(); ++i) {
      const std::string text =
          with_replaced(row[i].text, [](char c) { return c == '|' ? std::string("\\|") : std::string(1, c); });
      rows.back()[i] = row[i].is_marked() ? "**" + text + "**" : text;
    }
  };
  add(table.head);
  for (const auto& row : table.rows) add(row);
  const std::vector<std::size_t> widths = widths_of(rows);
  std::string text, rule = "|";
  for (const std::size_t width : widths) rule += std::string(std::max<std::size_t>(width, 1) + 2, '-') + "|";
  for (const auto& row : rows) {
    text += "|";
    for (std::size_t i = 0; i < row.size(); ++i)
      text += " " + row[i] + std::string(std::max<std::size_t>(widths[i], 1) - count_characters(row[i]), ' ') + " |";
    text += "\n";
    if (&row == &rows.front()) text += rule + "\n";
  }
  return text;
}

std::string table_csv(const Table& table) {
  std::string text;
  const auto add = [&](const std::vector<Cell>& row) {
    for (std::size_t i = 0; i < table.head.size(); ++i)
      text += (i == 0 ? "" : ",") + (i < row.size() ? csv_field(row[i].text) : "");
    text += "\n";
  };
  add(table.head);
  for (const auto& row : table.rows) add(row);
  return text;
}

std::string table_html(const Table& table, const std::string& css_class) {
  std::string text = "<table" + (css_class.empty() ? "" : " class=\"" + css_class + "\"") + ">\n<thead><tr>";
  for (const Cell& cell : table.head) text += html_cell(cell, "th", "");
  text += "</tr></thead>\n<tbody>\n";
  for (const auto& row : table.rows) {
    text += "<tr>";
    for (std::size_t i = 0; i < row.size(); ++i)
      text += i == 0 ? html_cell(row[i], "th", " scope=\"row\"") : html_cell(row[i], "td", "");
    text += "</tr>\n";
  }
  return text + "</tbody></table>";
}

}  // namespace hsi4d
