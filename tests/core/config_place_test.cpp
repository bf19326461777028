#include "core/config_place.h"

#include <catch2/catch.hpp>

#include "core/check.h"
#include "core/config_file.h"
#include "tests/support/temporary_folder.h"

namespace config_place_test {

using namespace hsi4d;
using namespace hsi4d::test;

namespace {

ConfigValue json(const std::string& text) {
  ConfigProblems problems;
  ConfigValue tree = load_config_text("{\"value\": " + text + "}", "value", "", {}, problems);
  problems.throw_if_any();
  return tree.members.front().value;
}

/// A tree with a value laid over one place, as JSON on a line; or what is wrong.
std::string laid(const std::string& tree_text, const std::string& key, const std::string& value) {
  ConfigValue tree = json(tree_text);
  ConfigProblems problems;
  lay_into_config(tree, key, json(value), {}, problems);
  try {
    problems.throw_if_any();
  } catch (const UserError& error) {
    return error.what();
  }
  return to_json_line(tree);
}

}  // namespace

TEST_CASE("keys are dotted paths or JSON pointers") {
  using Keys = std::vector<std::string>;
  CHECK(config_keys("a.b.c") == Keys{"a", "b", "c"});
  CHECK(config_keys("/a/b.c/d~1e~0f") == Keys{"a", "b.c", "d/e~f"});
  CHECK(config_keys("a..b").empty());
  CHECK(config_keys("").empty());
  CHECK(config_keys("/").empty());
}

TEST_CASE("values are laid over a config") {
  const std::string tree = R"({"a": {"b": 1, "c": [1, 2]}, "d": 4})";
  CHECK(laid(tree, "a.b", "2") == R"({"a": {"b": 2, "c": [1, 2]}, "d": 4})");
  CHECK(laid(tree, "/a/c/1", "7") == R"({"a": {"b": 1, "c": [1, 7]}, "d": 4})");
  CHECK(laid(tree, "a", R"({"x": {"y": 1}, "b": 3})") == R"({"a": {"b": 3, "c": [1, 2], "x": {"y": 1}}, "d": 4})");
  CHECK(laid(tree, "a", "null") == R"({"d": 4})");
  CHECK(laid(tree, "d", "null") == R"({"a": {"b": 1, "c": [1, 2]}, "d": null})");
  CHECK(laid(tree, "e.f", "true") == R"({"a": {"b": 1, "c": [1, 2]}, "d": 4, "e": {"f": true}})");
  CHECK(laid(tree, "d.e", "1") == "/d: 4 is a number and has no key \"e\"");
  CHECK(laid(tree, "a.c.9", "1") == "/a/c: 9 is not an index of this array; allowed: 0 to 1");
  CHECK(laid(tree, "a.", "1") == "\"a.\" is no key; write stages.camera.iterations, with dots between keys");
}

TEST_CASE("what one setting makes on its way is marked, what an object adds is not") {
  ConfigValue tree = json(R"({"stages": {}})");
  ConfigProblems problems;
  lay_into_config(tree, "stages.one.iterations", json("1"), {}, problems);
  lay_into_config(tree, "stages.two", json(R"({"iterations": 1})"), {}, problems);
  const ConfigValue& stages = tree.members.front().value;
  CHECK(stages.members[0].made_by_set);
  CHECK_FALSE(stages.members[1].made_by_set);
}

}  // namespace config_place_test
