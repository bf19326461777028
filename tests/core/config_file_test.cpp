#include "core/config_file.h"

#include <catch2/catch.hpp>

#include "core/check.h"
#include "core/config.h"
#include "tests/support/temporary_folder.h"

namespace config_file_test {

using namespace hsi4d;
using Catch::Matchers::Equals;
using hsi4d::test::TemporaryFolder;

namespace {

std::string loaded(const std::string& file, const std::vector<std::string>& overrides = {}) {
  ConfigProblems problems;
  try {
    const ConfigValue tree = load_config(file, overrides, problems);
    problems.throw_if_any();
    std::string text;
    for (const char c : to_json(tree)) text += c == '\n' || c == ' ' ? "" : std::string(1, c);
    return text;
  } catch (const UserError& error) {
    return error.what();
  }
}

}  // namespace

TEST_CASE("a text may extend another one that is in no file either") {
  const TemporaryFolder folder;
  folder.write("file.json", R"({"c": 3})");
  const std::map<std::string, std::string> beside = {
      {"base.json", R"({"extends": "file.json", "a": 1, "b": {"x": 2}})"}};
  ConfigProblems problems;
  const ConfigValue tree =
      load_config_text(R"({"extends": "base.json", "b": {"y": 4}})", "top.json", ".", {"a=5"}, problems, beside);
  CHECK_NOTHROW(problems.throw_if_any());
  CHECK(to_json_line(tree) == R"({"c": 3, "a": 5, "b": {"x": 2, "y": 4}})");
  ConfigProblems more;
  CHECK_THROWS_WITH(load_config_text(R"({"extends": "basis.json"})", "top.json", ".", {}, more, beside),
                    Catch::Matchers::Contains("\"basis.json\""));
  CHECK_THROWS_WITH(load_config_text(R"({"extends": "a"})", "top.json", ".", {}, more, {{"a", R"({"extends": "a"})"}}),
                    Catch::Matchers::Contains("\"a\" extends itself"));
}

TEST_CASE("a config is laid over what it extends, through several files and folders") {
  const TemporaryFolder folder;
  folder.write("base/root.json", R"({"a": {"x": 1, "y": 1}, "list": [1, 2, 3], "z": 0})");
  folder.write("base/middle.json", R"({"extends": "root.json", "a": {"y": 2}})");
  folder.write("top.json",
               R"({"$schema": "s.json", "list": [9], "extends": "base/middle.json", "a": {"w": 3}, "z": null})");
  CHECK_THAT(loaded("top.json"), Equals(R"({"a":{"x":1,"y":2,"w":3},"list":[9],"z":null})"));
}

TEST_CASE("missing files are told, with the nearest name") {
  const TemporaryFolder folder;
  folder.write("configs/default.json", "{}");
  folder.write("a.json", "{\n  \"extends\": \"configs/defualt.json\"}");
  folder.write("b.json", "{\"extends\": \"nothing/at/all.json\"}");
  CHECK_THAT(loaded("configs/defaults.json"),
             Equals("configs/defaults.json: there is no such file; did you mean \"configs/default.json\"?"));
  CHECK_THAT(loaded("nowhere/x.json"), Equals("nowhere/x.json: there is no such file"));
  CHECK_THAT(loaded("configs"), Equals("configs: this is a folder, not a config file"));
  CHECK_THAT(loaded("a.json"),
             Equals("a.json:2: /extends: \"configs/defualt.json\": there is no such file; did you mean "
                    "\"configs/default.json\"? (looked for configs/defualt.json)"));
  CHECK_THAT(
      loaded("b.json"),
      Equals("b.json:1: /extends: \"nothing/at/all.json\": there is no such file (looked for nothing/at/all.json)"));
}

TEST_CASE("extends must be a path, and not lead in a circle") {
  const TemporaryFolder folder;
  folder.write("number.json", R"({"extends": 3})");
  folder.write("empty.json", R"({"extends": ""})");
  folder.write("self.json", R"({"extends": "./self.json"})");
  folder.write("one.json", R"({"extends": "sub/two.json"})");
  folder.write("sub/two.json", "{\n\n\"extends\": \"../three.json\"}");
  folder.write("three.json", R"({"extends": "one.json"})");
  CHECK_THAT(
      loaded("number.json"),
      Equals(
          "number.json:1: /extends: 3 is a number, not a string; write the path of a config, relative to this file"));
  CHECK_THAT(loaded("empty.json"),
             Equals("empty.json:1: /extends: \"\" is empty; write the path of a config, relative to this file"));
  CHECK_THAT(loaded("self.json"),
             Equals("self.json:1: /extends: the files extend each other in a circle: self.json -> self.json"));
  CHECK_THAT(loaded("one.json"), Equals("three.json:1: /extends: the files extend each other in a circle: one.json -> "
                                        "sub/two.json -> three.json -> one.json"));
}

TEST_CASE("problems of a base are told beside those of the config itself") {
  const TemporaryFolder folder;
  folder.write("base.json", "{\"a\": 1,\n\"a\": 2}");
  folder.write("top.json", "{\"extends\": \"base.json\", \"b\": 1,\n\"b\": 2}");
  CHECK_THAT(loaded("top.json"),
             Equals("2 problems:\ntop.json:2: /b: written twice, first in line 1; keep one of them\n"
                    "base.json:2: /a: written twice, first in line 1; keep one of them"));
}

TEST_CASE("overrides are JSON, or else a string") {
  const TemporaryFolder folder;
  folder.write("a.json", R"({"a": {"b": 1, "list": [1, {"c": 2}]}, "s": ""})");
  CHECK_THAT(loaded("a.json", {"a.b=2.5", "s=hello there", "a.list.1.c=[true]"}),
             Equals(R"({"a":{"b":2.5,"list":[1,{"c":[true]}]},"s":"hellothere"})"));
  CHECK_THAT(loaded("a.json", {"a={\"z\": 1}", "s=\"2\"", "a.z=7"}), Equals(R"({"a":{"z":7},"s":"2"})"));
  CHECK_THAT(loaded("a.json", {"s=a=b", "a=null"}), Equals(R"({"s":"a=b"})"));  // an object is taken out
  CHECK_THAT(loaded("a.json", {"s=null"}), Equals(R"({"a":{"b":1,"list":[1,{"c":2}]},"s":null})"));
  CHECK_THAT(loaded("a.json", {"s="}), Equals(R"({"a":{"b":1,"list":[1,{"c":2}]},"s":""})"));
}

TEST_CASE("unusable overrides are told") {
  const TemporaryFolder folder;
  folder.write("a.json", R"({"a": {"b": 1, "list": [1]}})");
  const std::string form =
      ": write --set KEY=VALUE with dots between nested keys, for example --set render.blur=0.1 or --set "
      "/render/blur=0.1";
  CHECK_THAT(loaded("a.json", {"a.b"}), Equals("--set a.b" + form));
  CHECK_THAT(loaded("a.json", {"=1"}), Equals("--set =1" + form));
  CHECK_THAT(loaded("a.json", {"a..b=1"}), Equals("--set a..b=1" + form));
  CHECK_THAT(loaded("a.json", {"a.b.c=1"}), Equals("--set a.b.c=1: /a/b: 1 is a number and has no key \"c\""));
  CHECK_THAT(loaded("a.json", {"a.list.1=1"}),
             Equals("--set a.list.1=1: /a/list: 1 is not an index of this array; allowed: 0 to 0"));
  CHECK_THAT(loaded("a.json", {"a.b=\xFF"}), Equals("--set a.b=\xFF: the value is not UTF-8"));
}

TEST_CASE("a path is relative to the file that names it, on the command line to the current folder") {
  const TemporaryFolder folder;
  folder.write("data/x.txt", "");
  folder.write("data/base.json", R"({"file": "x.txt"})");
  folder.write("top.json", R"({"extends": "data/base.json"})");
  const auto read = [](const std::vector<std::string>& overrides) {
    std::filesystem::path file;
    ConfigFields fields;
    fields.path("file", file, {.must_exist = true}, "");
    ConfigProblems problems;
    read_config(load_config("top.json", overrides, problems), fields, problems);
    problems.throw_if_any();
    return file;
  };
  const std::filesystem::path expected = std::filesystem::current_path() / "data/x.txt";
  CHECK(read({}) == expected);
  CHECK(read({"file=data/x.txt"}) == expected);
  CHECK(read({"file=" + expected.string()}) == expected);
  CHECK(read({"file="}).empty());
  CHECK_THROWS_WITH(read({"file=x.txt"}), "--set file=x.txt: /file: \"x.txt\" does not exist (looked for x.txt)");
  folder.write("data/base.json", R"({"file": "y.txt"})");
  CHECK_THROWS_WITH(read({}), "data/base.json:1: /file: \"y.txt\" does not exist (looked for data/y.txt)");
}

TEST_CASE("a huge file is refused without being read") {
  const TemporaryFolder folder;
  folder.write("big.json", std::string(kLargestConfig + 1, ' '));
  CHECK_THAT(loaded("big.json"), Equals("big.json: has 8388609 bytes; at most 8388608 are read"));
}

}  // namespace config_file_test
