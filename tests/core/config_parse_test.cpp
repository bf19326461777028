#include "core/config_parse.h"

#include <catch2/catch.hpp>

#include "core/check.h"

namespace config_parse_test {

using namespace hsi4d;
using Catch::Matchers::Contains;
using Catch::Matchers::Equals;

namespace {

std::shared_ptr<const ConfigSource> source() {
  auto made = std::make_shared<ConfigSource>();
  made->name = "a.json";
  return made;
}

// The message that a text gives rise to, or "".
std::string whole_fault(const std::string& text) {
  ConfigProblems problems;
  ConfigValue value;
  parse_config_text(text, source(), problems, value);
  try {
    problems.throw_if_any();
  } catch (const UserError& error) {
    return error.what();
  }
  return "";
}

// The message without the line of text and the caret.
std::string fault(const std::string& text) {
  const std::string message = whole_fault(text);
  return message.substr(0, message.find("\n  "));
}

ConfigValue parsed(const std::string& text) {
  ConfigProblems problems;
  ConfigValue value;
  REQUIRE(parse_config_text(text, source(), problems, value));
  problems.throw_if_any();
  return value;
}

}  // namespace

TEST_CASE("values keep their text, order and place") {
  const ConfigValue tree = parsed("{\"b\": [1, -2.50e3,\n true],\n \"a\": {\"s\": \"\\u00e9\\n\"}, \"n\": null}");
  REQUIRE(tree.members.size() == 3);
  CHECK(tree.members[0].key == "b");
  const ConfigValue& list = tree.members[0].value;
  CHECK(list.items[1].text == "-2.50e3");
  CHECK(list.items[1].origin.line == 1);
  CHECK(list.items[1].origin.offset == 10);
  CHECK(list.items[2].boolean);
  CHECK(list.items[2].origin.line == 2);
  const ConfigValue& text = tree.members[1].value.members[0].value;
  CHECK(text.text == "\xC3\xA9\n");
  CHECK(text.origin.line == 3);
  CHECK(tree.members[2].value.kind == ConfigValue::Kind::kNull);
  CHECK(find_member(tree, "a") == &tree.members[1].value);
  CHECK(find_member(tree, "z") == nullptr);
}

TEST_CASE("a byte order mark and Windows line ends are accepted") {
  const ConfigValue tree = parsed("\xEF\xBB\xBF{\r\n\"a\": 1\r\n}\r\n");
  CHECK(tree.members[0].value.origin.line == 2);
}

TEST_CASE("a number at the very end of a text is whole") {
  CHECK(parsed("12.5").text == "12.5");
  CHECK(parsed("-7").text == "-7");
}

TEST_CASE("syntax errors say what to do") {
  CHECK_THAT(fault(""), Equals("a.json:1:1: not valid JSON: the file is empty"));
  CHECK_THAT(fault("  \n "), Equals("a.json:1:1: not valid JSON: the file is empty"));
  CHECK_THAT(fault("{\"a\": 1,}"), Equals("a.json:1:8: not valid JSON: the comma before '}' is one too many"));
  CHECK_THAT(fault("[1,\n 2,\n]"), Equals("a.json:2:3: not valid JSON: the comma before ']' is one too many"));
  CHECK_THAT(fault("{\"a\": 1\n \"b\": 2}"), Equals("a.json:1:7: not valid JSON: a comma is missing after this"));
  CHECK_THAT(fault("[1 2]"), Equals("a.json:1:2: not valid JSON: a comma is missing after this"));
  CHECK_THAT(fault("{\"a\": 1 // one\n}"), Equals("a.json:1:9: not valid JSON: comments are not part of JSON"));
  CHECK_THAT(fault("# one\n{}"), Equals("a.json:1:1: not valid JSON: comments are not part of JSON"));
  CHECK_THAT(fault("{/* a\n b */\"a\": 1}"), Equals("a.json:1:2: not valid JSON: comments are not part of JSON"));
  CHECK_THAT(fault("{'a': 1}"), Equals("a.json:1:2: not valid JSON: strings take double quotes, not single ones"));
  CHECK_THAT(fault("{a: 1}"), Equals("a.json:1:2: not valid JSON: the key a needs double quotes: \"a\""));
  CHECK_THAT(fault("{\"a\": fast}"), Equals("a.json:1:7: /a: not valid JSON: fast is not a value; write true, false, "
                                            "null, a number such as 0.5, or a string in double quotes"));
  CHECK_THAT(fault("{\"a\": None}"), Equals("a.json:1:7: /a: not valid JSON: None is not a value; write true, false, "
                                            "null, a number such as 0.5, or a string in double quotes"));
  CHECK_THAT(fault("[True]"), Equals("a.json:1:2: /0: not valid JSON: True is not a value; write true, false, null, a "
                                     "number such as 0.5, or a string in double quotes"));
  CHECK_THAT(fault("{\"a\": .5}"), Equals("a.json:1:7: /a: not valid JSON: .5 is not a value; write true, false, null, "
                                          "a number such as 0.5, or a string in double quotes"));
  CHECK_THAT(fault("{\"a\": 5.}"), Equals("a.json:1:7: /a: not valid JSON: 5. is not a value; write true, false, null, "
                                          "a number such as 0.5, or a string in double quotes"));
  CHECK_THAT(fault("{\"a\": +5}"), Equals("a.json:1:7: /a: not valid JSON: +5 is not a value; write true, false, null, "
                                          "a number such as 0.5, or a string in double quotes"));
  CHECK_THAT(fault("{\"a\": 01}"), Equals("a.json:1:7: /a: not valid JSON: 01 is not a value; write true, false, null, "
                                          "a number such as 0.5, or a string in double quotes"));
  CHECK_THAT(fault("{\"a\": 0x1F}"), Equals("a.json:1:7: /a: not valid JSON: 0x1F is not a value; write true, false, "
                                            "null, a number such as 0.5, or a string in double quotes"));
  CHECK_THAT(fault("{\"a\": \"x\n}"),
             Equals("a.json:1:7: not valid JSON: this string has no closing quote on its line"));
  CHECK_THAT(fault("{\"a\": \"x"), Equals("a.json:1:7: not valid JSON: this string has no closing quote on its line"));
  CHECK_THAT(
      fault("{\"seed\" 1}"),
      Equals("a.json:1:9: not valid JSON: while parsing object separator - unexpected number literal; expected ':'"));
  CHECK_THAT(fault("\n{\"a\": [1, 2"),
             Equals("a.json:2:12: not valid JSON: the file ends inside the array that line 2 opens"));
  CHECK_THAT(fault("{\"a\": 1"),
             Equals("a.json:1:8: not valid JSON: the file ends inside the object that line 1 opens"));
  CHECK_THAT(fault("{} {}"),
             Equals("a.json:1:4: not valid JSON: while parsing value - unexpected '{'; expected end of input"));
  CHECK_THAT(fault("\xFF\xFE{"), Equals("a.json: the file is UTF-16; save it as UTF-8"));
}

TEST_CASE("numbers that are not finite are refused by name (F12)") {
  CHECK_THAT(fault("{\"a\": {\"lr\": NaN}}"), Equals("a.json:1:14: /a/lr: NaN is not a finite number"));
  CHECK_THAT(fault("{\"a\": [0, -Infinity]}"), Equals("a.json:1:11: /a/1: -Infinity is not a finite number"));
  CHECK_THAT(fault("{\"a\": 1e999}"),
             Equals("a.json:1:7: /a: 1e999 is not a finite number: it is beyond the largest double"));
  CHECK_THAT(fault("{\"a\": -22e2222}"),
             Equals("a.json:1:7: /a: -22e2222 is not a finite number: it is beyond the largest double"));
}

TEST_CASE("the line of a syntax error is shown with a caret") {
  CHECK_THAT(whole_fault("{\"a\": 1,\n\t\"\xC3\xA9\": NaN, \"b\": 1e999,}\n"),
             Equals("a.json:2:7: /\xC3\xA9: NaN is not a finite number\n"
                    "   \"\xC3\xA9\": NaN, \"b\": 1e999,}\n"
                    "        ^"));
  const std::string before(1000, ' '), after(1000, '1');
  CHECK_THAT(
      whole_fault("[" + before + "x" + after),
      Contains("\n  " + std::string(60, ' ') + "x" + std::string(39, '1') + "\n  " + std::string(60, ' ') + "^"));
}

TEST_CASE("duplicate keys are told with both lines, at any depth") {
  CHECK_THAT(fault("{\"a\": 1,\n\"b\": 2,\n\"a\": 3}"),
             Equals("a.json:3: /a: written twice, first in line 1; keep one of them"));
  CHECK_THAT(fault("{\"x\": [{}, {\"k/1\": 1,\n\"k/1\": 1, \"z\": {}}]}"),
             Equals("a.json:2: /x/1/k~11: written twice, first in line 1; keep one of them"));
  CHECK_THAT(fault("{\"a\": 1, \"a\": 2, \"a\": 3}"),
             Equals("2 problems in a.json:\n"
                    "a.json:1: /a: written twice, first in line 1; keep one of them\n"
                    "a.json:1: /a: written twice, first in line 1; keep one of them"));
  CHECK(fault("{\"a\": {\"b\": 1}, \"b\": {\"a\": 1}}").empty());
}

TEST_CASE("text that is not UTF-8 is refused") {
  CHECK_THAT(fault("{\"a\": \"\xC3\x28\"}"), Catch::Matchers::StartsWith("a.json:1:9: not valid JSON: ") &&
                                                 Catch::Matchers::Contains("ill-formed UTF-8 byte"));
}

TEST_CASE("nesting is bounded") {
  const auto nested = [](int depth) {
    return std::string(static_cast<std::size_t>(depth), '[') + std::string(static_cast<std::size_t>(depth), ']');
  };
  CHECK(fault(nested(kDeepestConfig)).empty());
  CHECK_THAT(fault(nested(kDeepestConfig + 1)), Equals("a.json:1:65: nested more than 64 levels deep"));
  CHECK_THAT(fault(std::string(1000000, '[')), Equals("a.json:1:65: nested more than 64 levels deep"));
  std::string objects;
  for (int i = 0; i < 100000; ++i) objects += "{\"a\":";
  CHECK_THAT(fault(objects), Equals("a.json:1:321: nested more than 64 levels deep"));
}

}  // namespace config_parse_test
