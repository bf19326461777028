#include "core/config_value.h"

#include <bit>
#include <cmath>
#include <limits>
#include <random>

#include <catch2/catch.hpp>

#include "core/check.h"
#include "core/config.h"
#include "core/config_parse.h"

namespace config_value_test {

using namespace hsi4d;

namespace {

ConfigValue object(std::initializer_list<std::pair<const char*, ConfigValue>> members) {
  ConfigValue made = ConfigValue::make_object();
  for (const auto& [key, value] : members) made.add(key, value);
  return made;
}

std::string message(const ConfigProblems& problems) {
  try {
    problems.throw_if_any();
  } catch (const UserError& error) {
    return error.what();
  }
  return "";
}

}  // namespace

TEST_CASE("JSON text is indented, with plain arrays on one line") {
  const ConfigValue tree =
      object({{"a", ConfigValue::make_array({ConfigValue::make_integer(1), ConfigValue::make_null()})},
              {"b", ConfigValue::make_array({object({{"c", ConfigValue::make_string("x\"\\\n\x01")}})})},
              {"d", ConfigValue::make_object()},
              {"e", ConfigValue::make_boolean(true)}});
  CHECK(to_json(tree) ==
        "{\n  \"a\": [1, null],\n  \"b\": [\n    {\n      \"c\": \"x\\\"\\\\\\n\\u0001\"\n    }\n  ],\n  \"d\": {},\n  "
        "\"e\": true\n}\n");
  CHECK(to_json_line(tree) == "{\"a\": [1, null], \"b\": [{\"c\": \"x\\\"\\\\\\n\\u0001\"}], \"d\": {}, \"e\": true}");
  CHECK(shown(tree) == "{\"a\": [1, null], \"b\": [{\"c\": \"x\\\"\\\\\\n\\u0001\"}], \"d\": {}, \"e\":...");
}

TEST_CASE("a long value is shortened between characters") {
  const std::string text = shown(ConfigValue::make_string("a" + std::string(20, 'b') + [] {
    std::string umlauts;
    for (int i = 0; i < 40; ++i) umlauts += "\xC3\xA4";
    return umlauts;
  }()));
  CHECK(text.size() <= 64);
  CHECK(text.ends_with("\xA4..."));
}

TEST_CASE("numbers that are not finite are never written (F12)") {
  CHECK_THROWS_AS(ConfigValue::make_number(std::nan("")), InternalError);
  CHECK_THROWS_AS(ConfigValue::make_number(std::numeric_limits<double>::infinity()), InternalError);
  CHECK_THROWS_AS(ConfigValue::make_number(-std::numeric_limits<float>::infinity()), InternalError);
}

TEST_CASE("a million random floats and doubles survive writing and reading, bit for bit (F12)") {
  std::mt19937_64 random(20240501);
  float single = 0;
  double wide = 0;
  ConfigFields fields;
  fields.number("f", single, {}, "");
  fields.number("d", wide, {}, "");
  const ConfigField& read_single = *fields.find("f");
  const ConfigField& read_wide = *fields.find("d");
  int failures = 0;
  for (int i = 0; i < 1000000; ++i) {
    const std::uint64_t bits = random();
    float f = std::bit_cast<float>(static_cast<std::uint32_t>(bits));
    double d = std::bit_cast<double>(bits);
    if (i % 4 == 0) f = std::bit_cast<float>(static_cast<std::uint32_t>(bits) & 0x807FFFFFU);  // denormal
    if (i % 4 == 0) d = std::bit_cast<double>(bits & 0x800FFFFFFFFFFFFFU);
    if (!std::isfinite(f) || !std::isfinite(d)) continue;
    ConfigProblems problems;
    read_single.read(ConfigValue::make_number(f), "", problems);
    read_wide.read(ConfigValue::make_number(d), "", problems);
    const bool same = std::bit_cast<std::uint32_t>(single) == std::bit_cast<std::uint32_t>(f) &&
                      std::bit_cast<std::uint64_t>(wide) == std::bit_cast<std::uint64_t>(d);
    if (!same || !problems.empty()) ++failures;
  }
  CHECK(failures == 0);
}

TEST_CASE("merging goes key by key, arrays replace, null takes objects out") {
  const auto parse = [](const std::string& text) {
    ConfigProblems problems;
    ConfigValue value;
    REQUIRE(parse_config_text(text, nullptr, problems, value));
    return value;
  };
  const ConfigValue base =
      parse(R"({"a": {"x": 1, "y": [1, 2, 3]}, "b": 2, "c": {"z": 1}, "e": {"f": {}, "g": {"h": 3}}})");
  const ConfigValue overlay =
      parse(R"({"c": null, "a": {"y": [4], "n": 5, "m": null}, "b": null, "e": {"f": null}, "d": {}})");
  const std::string text = to_json(merged(base, overlay));
  CHECK(text ==
        to_json(parse(R"({"a": {"x": 1, "y": [4], "n": 5, "m": null}, "b": null, "e": {"g": {"h": 3}}, "d": {}})")));
}

TEST_CASE("problems come in the order of sources and lines, in one message") {
  auto first = std::make_shared<ConfigSource>(), second = std::make_shared<ConfigSource>();
  first->name = "a.json";
  second->name = "--set b=1";
  second->order = 1;
  ConfigProblems problems;
  CHECK(message(problems).empty());
  problems.add({second, 0, 0, 0}, "/b", "three");
  CHECK(message(problems) == "--set b=1: /b: three");
  problems.add({first, 50, 4, 2}, "", "two");
  problems.add({first, 10, 1, 0}, "/x\ny", "one");
  CHECK(message(problems) == "3 problems:\na.json:1: /x\\ny: one\na.json:4:2: two\n--set b=1: /b: three");
  ConfigProblems many;
  for (int i = 0; i < 120; ++i) many.add({first, static_cast<std::size_t>(i), i + 1, 0}, "", "bad");
  CHECK(message(many).starts_with("120 problems in a.json:\na.json:1: bad\n"));
  CHECK(message(many).ends_with("a.json:100: bad\nand 20 more"));
}

TEST_CASE("pointers escape what RFC 6901 escapes") { CHECK(child_pointer("/a", "b/c~d") == "/a/b~1c~0d"); }

}  // namespace config_value_test
