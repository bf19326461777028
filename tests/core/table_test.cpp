#include "core/table.h"

#include <cmath>

#include <catch2/catch.hpp>

namespace table_test {

using namespace hsi4d;

TEST_CASE("a table that is wider than a terminal is folded, its first column again before each part") {
  const Table table{.head = {"", "one", "second", "third"},
                    .rows = {{"first row", "1.00 ± 0.10", "22", "333"}, {"b", "2", "", "4"}}};
  const std::string whole =
      "           one          second  third\n"
      "first row  1.00 ± 0.10  22      333\n"
      "b          2                    4\n";
  CHECK(table_text(table) == whole);
  CHECK(table_text(table, 37) == whole);
  CHECK(table_text(table, 36) ==
        "           one          second\n"
        "first row  1.00 ± 0.10  22\n"
        "b          2\n"
        "\n"
        "           third\n"
        "first row  333\n"
        "b          4\n");
  CHECK(table_text(table, 22) ==
        "           one\n"
        "first row  1.00 ± 0.10\n"
        "b          2\n"
        "\n"
        "           second\n"
        "first row  22\n"
        "b\n"
        "\n"
        "           third\n"
        "first row  333\n"
        "b          4\n");
}

TEST_CASE("names are shortened in the middle, by characters and not by bytes") {
  CHECK(shortened("garden_walk", 11) == "garden_walk");
  CHECK(shortened("garden_walk", 10) == "garde…walk");
  CHECK(shortened("αβγδεζ", 5) == "αβ…εζ");
  const Table table{.head = {"", "x"}, .rows = {{std::string(40, 'n'), "1"}}};
  CHECK(table_text(table, 30) == "                 x\nnnnnnnn…nnnnnnn  1\n");
}

TEST_CASE("columns are aligned as asked, with room for the marks of those at the right") {
  const Table table{.head = {"metric", "start", "end"},
                    .rows = {{"error", {60, 1}, Cell("20.0", "best")}, {"time", kNoCell, 7}},
                    .align = "lr"};
  CHECK(table_text(table) ==
        "metric  start    end\n"
        "error    60.0   20.0*\n"
        "time        -      7\n");
  CHECK(table_width(table) == 21);
  CHECK(table_html(table, "errors") ==
        "<table class=\"errors\">\n<thead><tr><th>metric</th><th>start</th><th>end</th></tr></thead>\n<tbody>\n"
        "<tr><th scope=\"row\">error</th><td>60.0</td><td class=\"best\">20.0</td></tr>\n"
        "<tr><th scope=\"row\">time</th><td class=\"none\">–</td><td>7</td></tr>\n</tbody></table>");
}

TEST_CASE("Markdown, CSV and HTML escape what they need to") {
  const Table table{.head = {"", "a|b"}, .rows = {{"x, \"y\"", Cell("<1>", "better")}, {"z"}}};
  CHECK(table_markdown(table) ==
        "|        | a\\|b    |\n"
        "|--------|---------|\n"
        "| x, \"y\" | **<1>** |\n"
        "| z      |         |\n");
  CHECK(table_csv(table) == ",a|b\n\"x, \"\"y\"\"\",<1>\nz,\n");
  CHECK(html_escape("a<b>&\"'\x01\xFF") == "a&lt;b&gt;&amp;&quot;&#39;\xEF\xBF\xBD\xEF\xBF\xBD");
}

}  // namespace table_test
