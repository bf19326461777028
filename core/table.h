// A table as text for terminals, as Markdown, CSV or HTML; and the pieces of text that these need.
#pragma once

#include <concepts>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "core/formatted.h"

namespace hsi4d {

/// `text` as HTML text or attribute: & < > " ' escaped, control characters and bytes that are no UTF-8 replaced.
std::string html_escape(std::string_view text);

/// The text in at most so many characters, begin and end with … between them where it is longer.
std::string shortened(const std::string& text, std::size_t most);

/// A cell of a table.
struct Cell {
  std::string text;
  std::string mark;  ///< class in HTML; "best", "better" and "worse" are bold in Markdown and have a * in text
  std::string tip;   ///< tooltip in HTML
  std::string html;  ///< stands in HTML in place of the text, of this program's making; empty: the text

  Cell() = default;
  Cell(std::string words, std::string its_mark = "", std::string its_tip = "")
      : text(std::move(words)), mark(std::move(its_mark)), tip(std::move(its_tip)) {}
  Cell(std::string_view words) : text(words) {}
  Cell(const char* words) : text(words) {}
  Cell(std::integral auto number) : text(std::to_string(number)) {}
  Cell(double number, int decimals) : text(fixed_number(number, decimals)) {}

  bool is_marked() const { return !text.empty() && (mark == "best" || mark == "better" || mark == "worse"); }
};

/// What was not measured: "-", in HTML "–".
inline const Cell kNoCell{std::string("-"), "none"};

/// Rows of cells below a head. A row may have fewer cells than the head, and as text more.
struct Table {
  std::string title = {}, caption = {};
  std::vector<Cell> head = {};
  std::vector<std::vector<Cell>> rows = {};
  std::string align = "l";  ///< of text: l or r for each column, the last letter for all that follow
};

/// A line a row, columns of equal width two blanks apart.
///
/// @param columns  of the terminal, at least 20: columns of the table that find no place beside the others follow below
///                 with the first column before them again. That one is shortened to half a line; others keep their
///                 width, and one that is wider than a line stays so. Nothing: all in one line.
std::string table_text(const Table& table, std::optional<int> columns = {});

/// The longest line of table_text(table), characters.
std::size_t table_width(const Table& table);

/// In columns of one width; empty for a table without rows.
std::string table_markdown(const Table& table);

/// A head line and a line a row, each with a field for each column of the head.  [RFC 4180]
std::string table_csv(const Table& table);

/// One <table>; the first cell of a row heads it.
std::string table_html(const Table& table, const std::string& css_class = "");

}  // namespace hsi4d
