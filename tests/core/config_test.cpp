#include "core/config.h"

#include <catch2/catch.hpp>

#include "core/check.h"
#include "core/config_file.h"

namespace config_test {

using namespace hsi4d;
using Catch::Matchers::Equals;

namespace kinds {

enum class Colour { kRed, kBlue };
constexpr std::array<ConfigChoice<Colour>, 2> kColours = {{{Colour::kRed, "red"}, {Colour::kBlue, "blue"}}};

struct Inner {
  double x = 1;
  int count = 2;
};

struct Settings {
  double share = 0.5;
  float scale = 2;
  int steps = 10;
  std::uint8_t small = 3;
  bool on = false;
  std::string text = "hello";
  std::filesystem::path file;
  Colour colour = Colour::kRed;
  std::array<double, 3> point = {1, 2, 3};
  std::vector<double> radii = {0.5};
  std::vector<std::string> names;
  std::optional<double> limit;
  std::optional<Colour> second;
  Inner inner;
  ConfigMap<Inner> free;
  ConfigMap<Inner> known;
  std::vector<Inner> list;
};

void describe(ConfigFields& f, Inner& s) {
  f.number("x", s.x, {.above = 0}, "A number");
  f.integer("count", s.count, {.min = 1, .max = 9}, "A count").required();
}

void describe(ConfigFields& f, Settings& s) {
  f.number("share", s.share, {.min = 0, .max = 1}, "A share");
  f.number("scale", s.scale, {.above = 0, .below = 10}, "A scale");
  f.integer("steps", s.steps, {.min = 0, .max = 100, .multiple_of = 5}, "Steps");
  f.integer("small", s.small, {}, "A byte");
  f.boolean("on", s.on, "A switch");
  f.string("text", s.text, "A text");
  f.path("file", s.file, {.must_exist = true}, "A file");
  f.choice("colour", s.colour, kColours, "A colour");
  f.numbers("point", s.point, {}, "A point");
  f.numbers("radii", s.radii, {.above = 0}, "Radii", {.min = 1});
  f.strings("names", s.names, "Names", {.max = 2});
  f.optional(s.limit, [](ConfigFields& g, double& v) { g.number("limit", v, {.min = 0}, "A limit"); });
  f.optional(s.second, [](ConfigFields& g, Colour& v) { g.choice("second", v, kColours, "Another"); });
  f.object("inner", s.inner, "A struct");
  f.map("free", s.free, "Structs by name");
  f.map("known", s.known, {{"one", "The first", {1, 1}}, {"two", "The second", {2, 2}}}, "Structs by known names");
  f.list("list", s.list, "Structs in a row");
}

}  // namespace kinds

namespace paths {

struct Leaf {
  std::filesystem::path file;
};

struct Tree {
  std::filesystem::path own, none;
  double number = 1;
  Leaf one;
  ConfigMap<Leaf> named;
  std::vector<Leaf> row;
};

void describe(ConfigFields& f, Leaf& s) { f.path("file", s.file, {}, "A file"); }

void describe(ConfigFields& f, Tree& s) {
  f.path("own", s.own, {}, "A file");
  f.path("none", s.none, {}, "A file");
  f.number("number", s.number, {}, "A number");
  f.object("one", s.one, "A struct");
  f.map("named", s.named, "Structs by name");
  f.list("row", s.row, "Structs in a row");
}

}  // namespace paths

namespace {

kinds::Settings read(const std::string& text, const std::vector<std::string>& overrides = {}) {
  ConfigProblems problems;
  kinds::Settings settings;
  ConfigFields fields;
  describe(fields, settings);
  read_config(load_config_text(text, "a.json", "", overrides, problems), fields, problems);
  problems.throw_if_any();
  return settings;
}

std::string fault(const std::string& text, const std::vector<std::string>& overrides = {}) {
  try {
    read(text, overrides);
  } catch (const UserError& error) {
    return error.what();
  }
  return "";
}

std::string written(kinds::Settings settings) {
  ConfigFields fields;
  describe(fields, settings);
  return to_json(write_config(fields));
}

}  // namespace

TEST_CASE("paths that are set are listed, wherever they are") {
  paths::Tree tree{"/a", "", 2, {"/b"}, {{"x", {"/c"}}, {"y", {""}}, {"z", {"/d"}}}, {{""}, {"/e"}}};
  ConfigFields fields;
  describe(fields, tree);
  std::vector<std::pair<std::string, std::string>> found;
  for (const ConfigPath& path : list_paths(fields)) found.emplace_back(path.pointer, path.path.string());
  CHECK(found == std::vector<std::pair<std::string, std::string>>{{"/own", "/a"},
                                                                  {"/one/file", "/b"},
                                                                  {"/named/x/file", "/c"},
                                                                  {"/named/z/file", "/d"},
                                                                  {"/row/1/file", "/e"}});
}

TEST_CASE("absent keys keep the defaults of the struct") {
  const kinds::Settings settings = read("{}");
  CHECK(settings.share == 0.5);
  CHECK(settings.text == "hello");
  CHECK(settings.radii == std::vector<double>{0.5});
  CHECK_FALSE(settings.limit.has_value());
}

TEST_CASE("every kind of value is read") {
  const kinds::Settings s = read(R"({"share": 1, "scale": 0.1, "steps": 1.5e1, "small": 255, "on": true, "text": "",
    "colour": "blue", "point": [0, -1, 2.5], "radii": [1, 2], "names": ["a", "b"], "limit": 3, "second": "red",
    "inner": {"x": 4, "count": 5}, "free": {"p": {"count": 1}, "q-2": {"count": 2, "x": 7}},
    "known": {"two": {"count": 9}}, "list": [{"count": 1}, {"count": 2}]})");
  CHECK(s.share == 1);
  CHECK(s.scale == 0.1F);
  CHECK(s.steps == 15);
  CHECK(s.small == 255);
  CHECK(s.on);
  CHECK(s.text.empty());
  CHECK(s.colour == kinds::Colour::kBlue);
  CHECK(s.point == std::array<double, 3>{0, -1, 2.5});
  CHECK(s.names == std::vector<std::string>{"a", "b"});
  CHECK(s.limit == 3.0);
  CHECK(s.second == kinds::Colour::kRed);
  CHECK(s.inner.count == 5);
  REQUIRE(s.free.size() == 2);
  CHECK(s.free[1].first == "q-2");
  CHECK(find_entry(s.free, "q-2")->x == 7);
  CHECK(find_entry(s.free, "r") == nullptr);
  REQUIRE(s.known.size() == 1);
  CHECK(s.known[0].second.x == 2);  // the initial value of that key
  CHECK(s.known[0].second.count == 9);
  REQUIRE(s.list.size() == 2);
  CHECK(s.list[1].count == 2);
}

TEST_CASE("null empties an optional value and is refused elsewhere") {
  CHECK_FALSE(read(R"({"limit": 3})", {"limit=null"}).limit.has_value());
  CHECK_THAT(fault(R"({"share": null})"), Equals("a.json:1: /share: null is not a number; allowed: 0 to 1"));
  CHECK_THAT(
      fault(R"({"inner": null})"),
      Equals("a.json:1: /inner: null is not an object, and takes none out: the file that is extended has none here; "
             "write {...}, or leave the key out"));
}

TEST_CASE("a wrong value is named with what is allowed") {
  CHECK_THAT(fault(R"({"share": true})"), Equals("a.json:1: /share: true is a boolean, not a number; allowed: 0 to 1"));
  CHECK_THAT(fault(R"({"share": "0.5"})"),
             Equals("a.json:1: /share: \"0.5\" is a string, not a number; allowed: 0 to 1"));
  CHECK_THAT(fault(R"({"scale": 10})"), Equals("a.json:1: /scale: 10 is out of range; allowed: above 0 and below 10"));
  CHECK_THAT(fault(R"({"scale": 1e39})"), Equals("a.json:1: /scale: 1e39 is too large or too near to zero for a 32-bit "
                                                 "number; allowed: above 0 and below 10"));
  CHECK_THAT(fault(R"({"share": 1e-400})"),
             Equals("a.json:1: /share: 1e-400 is too large or too near to zero for a 64-bit number; allowed: 0 to 1"));
  CHECK_THAT(fault(R"({"steps": 2.7})"),
             Equals("a.json:1: /steps: 2.7 is not a whole number; allowed: 0 to 100, a multiple of 5"));
  CHECK_THAT(fault(R"({"steps": 7})"),
             Equals("a.json:1: /steps: 7 is out of range; allowed: 0 to 100, a multiple of 5"));
  CHECK_THAT(fault(R"({"steps": 99999999999999999999})"),
             Equals("a.json:1: /steps: 99999999999999999999 is out of range; allowed: 0 to 100, a multiple of 5"));
  CHECK_THAT(fault(R"({"steps": 1e300})"),
             Equals("a.json:1: /steps: 1e300 is out of range; allowed: 0 to 100, a multiple of 5"));
  CHECK_THAT(fault(R"({"small": 256})"), Equals("a.json:1: /small: 256 is out of range; allowed: 0 to 255"));
  CHECK_THAT(fault(R"({"on": 1})"), Equals("a.json:1: /on: 1 is a number, not a boolean; allowed: true or false"));
  CHECK_THAT(fault(R"({"text": 1})"), Equals("a.json:1: /text: 1 is a number, not a string"));
  CHECK_THAT(fault(R"({"text": "x\u0000y"})"),
             Equals(R"(a.json:1: /text: "x\u0000y" holds the character 0 (\u0000), which no text here can have)"));
  CHECK_THAT(fault(R"({"names": ["a", "\u0000"]})"),
             Equals(R"(a.json:1: /names/1: "\u0000" holds the character 0 (\u0000), which no text here can have)"));
  CHECK_THAT(
      fault(R"({"colour": "blu"})"),
      Equals(
          "a.json:1: /colour: \"blu\" is not one of the choices; allowed: \"red\", \"blue\"; did you mean \"blue\"?"));
  CHECK_THAT(fault(R"({"colour": 1})"),
             Equals("a.json:1: /colour: 1 is a number, not one of the choices; allowed: \"red\", \"blue\""));
  CHECK_THAT(fault(R"({"point": [1, 2]})"), Equals("a.json:1: /point: [1, 2] has 2 elements; allowed: 3"));
  CHECK_THAT(fault(R"({"point": [1, "2", 3]})"),
             Equals("a.json:1: /point/1: \"2\" is a string, not a number; allowed: any finite number"));
  CHECK_THAT(fault(R"({"radii": []})"), Equals("a.json:1: /radii: [] has 0 elements; allowed: 1 or more"));
  CHECK_THAT(fault(R"({"names": ["a", "b", "c"]})"),
             Equals("a.json:1: /names: [\"a\", \"b\", \"c\"] has 3 elements; allowed: 0 to 2"));
  CHECK_THAT(fault(R"({"list": {}})"), Equals("a.json:1: /list: {} is an object, not an array of objects"));
  CHECK_THAT(fault(R"({"inner": []})"), Equals("a.json:1: /inner: [] is an array, not an object"));
  CHECK_THAT(fault("[]"), Equals("a.json:1: [] is an array; a config is an object: {...}"));
}

TEST_CASE("a missing required key is told, where its object begins") {
  CHECK_THAT(fault("{\n\"inner\": {}}"), Equals("a.json:2: /inner: the key \"count\" is missing; allowed: 1 to 9"));
  CHECK_THAT(fault("{\"list\": [{\"count\": 1},\n{}]}"),
             Equals("a.json:2: /list/1: the key \"count\" is missing; allowed: 1 to 9"));
}

TEST_CASE("unknown keys are told with the nearest one, the section they belong in, or what is known") {
  CHECK_THAT(fault(R"({"shair": 1})"), Equals("a.json:1: /shair: unknown key; did you mean \"share\"?"));
  CHECK_THAT(fault(R"({"count": 1})"),
             Equals("a.json:1: /count: unknown key; it belongs in /inner, /free/NAME, /known/one, "
                    "/known/two or /list/0"));
  CHECK_THAT(fault(R"({"inner": {"count": 1, "colour": "red"}})"),
             Equals("a.json:1: /inner/colour: unknown key; it belongs at the top level"));
  CHECK_THAT(fault(R"({"inner": {"count": 1, "qqq": 1}})"),
             Equals("a.json:1: /inner/qqq: unknown key; known here: x, count"));
  CHECK_THAT(fault(R"({"known": {"tow": {"count": 1}}})"),
             Equals("a.json:1: /known/tow: unknown key; did you mean \"two\"?"));
  CHECK_THAT(fault(R"({"free": {"a b": {"count": 1}}})"),
             Equals("a.json:1: /free/a b: \"a b\" cannot be a name; allowed: letters, digits, '_' and '-'"));
}

TEST_CASE("what is written reads back to the same text") {
  const kinds::Settings settings =
      read(R"({"share": 0.1, "limit": 0.25, "colour": "blue", "list": [{"count": 3, "x": 0.3}],
    "free": {"z": {"count": 1}, "a": {"count": 2}}, "known": {"two": {"count": 2}, "one": {"count": 1}}})");
  const std::string text = written(settings);
  CHECK(written(read(text)) == text);
  CHECK(text.find("\"limit\": 0.25") != std::string::npos);
  CHECK(text.find("\"second\": null") != std::string::npos);
  CHECK(text.find("\"z\"") < text.find("\"a\""));  // the order of writing stays
}

TEST_CASE("steps run between fields, so that a preset loses against explicit keys") {
  struct Preset {
    bool big = false;
    double a = 1, b = 1;
  };
  Preset s;
  ConfigFields fields;
  fields.boolean("big", s.big, "");
  fields.then([&s] {
    if (s.big) s.a = s.b = 100;
  });
  fields.number("a", s.a, {}, "");
  fields.number("b", s.b, {}, "");
  ConfigProblems problems;
  read_config(load_config_text(R"({"a": 5, "big": true})", "a.json", "", {}, problems), fields, problems);
  CHECK(s.a == 5);
  CHECK(s.b == 100);
}

TEST_CASE("rules are checked when the fields themselves are right") {
  double low = 0, high = 1, other = 0;
  ConfigFields fields;
  fields.number("low", low, {}, "");
  fields.number("high", high, {}, "");
  fields.number("other", other, {}, "");
  fields.rule({"high", "low"}, [&]() -> std::string { return low < high ? "" : "high must be above low"; });
  const auto check = [&](const std::string& text) {
    ConfigProblems problems;
    read_config(load_config_text(text, "a.json", "", {}, problems), fields, problems);
    problems.throw_if_any();
  };
  CHECK_NOTHROW(check(R"({"low": 1, "high": 2})"));
  CHECK_THROWS_WITH(check("{\"low\": 3,\n\"high\": 2}"), "a.json:2: /high: high must be above low");
  CHECK_THROWS_WITH(check("{\"low\": \"3\",\n\"high\": 2}"),
                    "a.json:1: /low: \"3\" is a string, not a number; allowed: any finite number");
  // Other fields that are wrong do not hide it.
  CHECK_THROWS_WITH(
      check("{\"low\": 3, \"high\": 2,\n\"other\": \"x\", \"more\": 1}"),
      Catch::Matchers::Contains("3 problems in a.json") && Catch::Matchers::Contains("/high: high must be above low"));
  CHECK_THROWS_AS(fields.rule({"none"}, [] { return ""; }), InternalError);
}

TEST_CASE("describing one name twice is our bug") {
  double value = 0;
  ConfigFields fields;
  fields.number("a", value, {}, "");
  CHECK_THROWS_AS(fields.number("a", value, {}, ""), InternalError);
}

TEST_CASE("settings are listed with pointer, range, default and meaning") {
  kinds::Settings settings;
  ConfigFields fields;
  describe(fields, settings);
  const std::vector<ConfigSetting> all = list_settings(fields);
  const auto find = [&](const std::string& pointer) {
    for (const ConfigSetting& setting : all) {
      if (setting.pointer == pointer) return setting;
    }
    return ConfigSetting{};
  };
  CHECK(find("/share").allowed == "0 to 1");
  CHECK(find("/share").initial == "0.5");
  CHECK(find("/share").summary == "A share");
  CHECK(find("/free/NAME/count").initial == "required");
  CHECK(find("/known/two/x").initial == "2");
  CHECK(find("/list/0/x").allowed == "above 0");
  CHECK(find("/limit").allowed == "at least 0, or null");
}

}  // namespace config_test
