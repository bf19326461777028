// The schema that editors use against the reader: what one refuses, so does the other.
#include <cmath>
#include <filesystem>
#include <regex>

#include <catch2/catch.hpp>
#include <nlohmann/json.hpp>

#include "core/check.h"
#include "core/config_file.h"
#include "pipelines/config/run_config.h"
#include "pipelines/sweep/file.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/test_losses.h"

namespace config_schema_test {

using namespace hsi4d;
using namespace hsi4d::test;
using nlohmann::json;

namespace {

bool is_of_type(const json& value, const std::string& type) {
  if (type == "object") return value.is_object();
  if (type == "array") return value.is_array();
  if (type == "string") return value.is_string();
  if (type == "boolean") return value.is_boolean();
  if (type == "null") return value.is_null();
  if (type == "number") return value.is_number();
  if (type == "integer") return value.is_number() && value.get<double>() == std::floor(value.get<double>());
  throw std::runtime_error("a type that JSON Schema does not have: " + type);
}

bool type_fits(const json& value, const json& type) {
  if (type.is_string()) return is_of_type(value, type);
  for (const json& one : type) {
    if (is_of_type(value, one)) return true;
  }
  return false;
}

bool number_fits(const json& value, const json& schema) {
  if (!value.is_number()) return true;
  const double x = value;
  return !(schema.contains("minimum") && x < schema["minimum"].get<double>()) &&
         !(schema.contains("maximum") && x > schema["maximum"].get<double>()) &&
         !(schema.contains("exclusiveMinimum") && x <= schema["exclusiveMinimum"].get<double>()) &&
         !(schema.contains("exclusiveMaximum") && x >= schema["exclusiveMaximum"].get<double>()) &&
         !(schema.contains("multipleOf") && std::fmod(x, schema["multipleOf"].get<double>()) != 0);
}

// The part of JSON Schema that our schemas use; a keyword that it does not know is a failure, not a pass.
bool validates(const json& value, const json& schema) {
  if (schema.is_boolean()) return schema.get<bool>();
  static const std::vector<std::string> known = {
      "$schema",       "title",    "description", "default", "type",    "properties",       "additionalProperties",
      "propertyNames", "items",    "enum",        "minimum", "maximum", "exclusiveMinimum", "exclusiveMaximum",
      "multipleOf",    "minItems", "maxItems"};
  for (const auto& [keyword, content] : schema.items()) {
    if (keyword != "pattern" && keyword != "anyOf" && keyword != "required" &&
        std::find(known.begin(), known.end(), keyword) == known.end())
      throw std::runtime_error("a keyword that this test does not know: " + keyword);
  }
  if (schema.contains("type") && !type_fits(value, schema["type"])) return false;
  if (schema.contains("enum") && std::find(schema["enum"].begin(), schema["enum"].end(), value) == schema["enum"].end())
    return false;
  if (schema.contains("pattern") &&
      !std::regex_match(value.get<std::string>(), std::regex(schema["pattern"].get<std::string>())))
    return false;
  if (!number_fits(value, schema)) return false;
  const json any = schema.value("anyOf", json::array());
  if (!any.empty() && std::none_of(any.begin(), any.end(), [&](const json& one) { return validates(value, one); }))
    return false;
  for (const json& key : schema.value("required", json::array())) {
    if (!value.contains(key.get<std::string>())) return false;
  }
  if (value.is_array() && value.size() < schema.value("minItems", std::size_t{0})) return false;
  for (std::size_t i = 0; value.is_array() && schema.contains("items") && i < value.size(); ++i) {
    if (!validates(value[i], schema["items"])) return false;
  }
  if (!value.is_object()) return true;
  for (const auto& [key, content] : value.items()) {
    if (schema.contains("propertyNames") && !validates(key, schema["propertyNames"])) return false;
    const bool named = schema.contains("properties") && schema["properties"].contains(key);
    if (!validates(content, named ? schema["properties"][key] : schema.value("additionalProperties", json(true))))
      return false;
  }
  return true;
}

bool reader_accepts(const std::string& text) {
  const TemporaryFolder folder;
  try {
    load_run_config(folder.write("a.json", text), {}, test_losses());
    return true;
  } catch (const UserError&) {
    return false;
  }
}

// Every default in the schema must itself be valid.
void check_defaults(const json& schema, const std::string& where) {
  if (schema.is_object() && schema.contains("default")) {
    INFO(where);
    CHECK(validates(schema["default"], schema));
  }
  if (!schema.is_structured()) return;
  for (const auto& [key, child] : schema.items()) check_defaults(child, where + "/" + key);
}

}  // namespace

TEST_CASE("the schema accepts and refuses what the reader does") {
  const json schema = json::parse(run_config_schema(test_losses()));
  CHECK(schema["$schema"] == "https://json-schema.org/draft/2020-12/schema");
  const auto stage = [](const std::string& inside) {
    return R"({"stages": {"camera": {"iterations": 30, )" + inside + "}}}";
  };
  const std::vector<std::string> right = {"{}",
                                          R"({"$schema": "s.json", "seed": 3})",
                                          R"({"render": {"depth_key": null, "tile": 8}})",
                                          R"({"render": {"quality": "accurate", "alpha_min": 0}})",
                                          stage(R"("losses": {"photo": {"weight": 2}})"),
                                          stage(R"("optimize": {"root-1": {"lr": 0.1, "until": null}})"),
                                          R"({"seed": 3.0})"};
  const std::vector<std::string> wrong = {R"({"sede": 1})",
                                          R"({"seed": -1})",
                                          R"({"seed": 1.5})",
                                          R"({"seed": "1"})",
                                          R"({"render": {"alpha_cap": 0}})",
                                          R"({"render": {"tile": 12}})",
                                          R"({"render": {"tile": 24}})",
                                          R"({"render": {"quality": "best"}})",
                                          R"({"render": {"depth_key": 1}})",
                                          R"({"render": {"antialias": 1}})",
                                          R"({"render": 1})",
                                          stage(R"("losses": {"depth": {}})"),
                                          stage(R"("losses": {"centre": {"masked": true}})"),
                                          stage(R"("optimize": {"a b": {"lr": 1}})"),
                                          stage(R"("optimizer": {"beta2": 1})"),
                                          stage(R"("x": 1)"),
                                          "[]"};
  for (const std::string& text : right) {
    INFO(text);
    CHECK(validates(json::parse(text), schema));
    CHECK(reader_accepts(text));
  }
  for (const std::string& text : wrong) {
    INFO(text);
    CHECK_FALSE(validates(json::parse(text), schema));
    CHECK_FALSE(reader_accepts(text));
  }
  // Whether null takes something out only the file tells that is extended.
  for (const std::string text : {R"({"render": null})", R"({"stages": {"camera": null}})"}) {
    CHECK(validates(json::parse(text), schema));
    CHECK_FALSE(reader_accepts(text));
  }
}

TEST_CASE("the schema accepts resolved configs, and its own defaults") {
  const json schema = json::parse(run_config_schema(test_losses()));
  CHECK(validates(json::parse(resolved_config(RunConfig{}, test_losses())), schema));
  check_defaults(schema, "");
}

TEST_CASE("every setting in the schema is described") {
  const std::function<void(const json&, const std::string&)> check = [&](const json& node, const std::string& where) {
    if (!node.is_structured()) return;
    if (node.is_object() && node.contains("properties")) {
      for (const auto& [key, property] : node["properties"].items()) {
        INFO(where << "/" << key);
        CHECK(property.contains("description"));
      }
    }
    for (const auto& [key, child] : node.items()) check(child, where + "/" + key);
  };
  check(json::parse(run_config_schema(test_losses())), "");
}

TEST_CASE("the schema of sweeps accepts those that are shipped and refuses what their reader does") {
  const json schema = json::parse(sweep_schema());
  CHECK(schema["title"] == "hsi4d sweep");
  int count = 0;
  for (const auto& entry : std::filesystem::directory_iterator(HSI4D_SOURCE_DIR "/configs/sweeps")) {
    if (entry.path().extension() != ".json") continue;
    INFO(entry.path());
    CHECK(validates(json::parse(file_text(entry.path())), schema));
    ++count;
  }
  CHECK(count > 0);
  const TemporaryFolder here;
  here.write("base.json", "{}");
  const auto reads = [&here](const std::string& text) {
    try {
      ConfigProblems problems;
      const ConfigValue tree = load_config(here.write("sweep.json", text), {}, problems);
      read_sweep_file(tree, "sweep.json", problems);
      return true;
    } catch (const UserError&) {
      return false;
    }
  };
  const std::string base = R"({"base": "base.json", )";
  for (const std::string more :
       {R"("seeds": 3})", R"("seeds": [0, 7]})", R"("seeds": {"a": {"seed": 1}}})", R"("clips": ["base.json"]})",
        R"("clips": {"a": "base.json", "b": {"config": "base.json", "set": {"render.blur": 1}}}})",
        R"("zip": [{"a": [1]}, {"b": [null, {}]}]})", R"("slurm": {"time": "1:00:00", "options": ["--nice"]}})",
        R"("blocks": [{}, {"name": "x", "grid": {"a": [1]}}], "compare": {"a": 1}})",
        R"("ablations": {"whole": {}, "no": {"stages.camera": null}}, "skip": [{"ablation": "no"}]})",
        R"("hours": 0.5, "memory_retries": 2,
           "search": {"metric": "mpjpe_mm", "runs": 4, "over": {"a": {"from": 0, "to": 1}}}})",
        R"("search": {"metric": "ssim", "runs": 4, "over": {"a": [1, 2, 3, 4]}},
           "blocks": [{"name": "x", "search": {}}]})",
        R"("search": {"metric": "ssim", "method": "random", "seed": 3, "runs": 9, "over": {"a": ["x", null],
           "b": {"from": 1, "to": 9, "scale": "log", "integer": true}},
           "halving": {"rungs": {"last_frame": [3, 7]}, "factor": 3}}})"}) {
    INFO(more);
    CHECK(validates(json::parse(base + more), schema));
    CHECK(reads(base + more));
  }
  for (const std::string more :
       {R"("sedes": 3})",
        R"("seeds": 0})",
        R"("seeds": [-1]})",
        R"("seeds": true})",
        R"("clips": [{}]})",
        R"("clips": {"a b": "base.json"}})",
        R"("clips": {"a": {"set": {}}}})",
        R"("grid": {"a": 1}})",
        R"("grid": {"a": []}})",
        R"("zip": [[1]]})",
        R"("slurm": {"grace_s": 0}})",
        R"("blocks": [{"threads": 1}]})",
        R"("ablations": {"a": 1}})",
        R"("skip": {"seed": 1}})",
        R"("name": "a b"})",
        R"("memory_mb": -1})",
        R"("search": [1]})",
        R"("search": {"runs": 4, "over": {"a": [1, 2]}}})",
        R"("hours": -1})",
        R"("memory_retries": -1})",
        R"("search": {"metric": "ssim", "runs": 2, "method": "grid", "over": {"a": [1, 2]}}})",
        R"("search": {"metric": "ssim", "runs": 2, "over": {"a": [1]}}})",
        R"("search": {"metric": "ssim", "runs": 2, "over": {"a": {"from": 1}}}})",
        R"("search": {"metric": "ssim", "runs": 9, "over": {"a": [1, 2, 3, 4]}, "halving": {"factor": 2}}})"}) {
    INFO(more);
    CHECK_FALSE(validates(json::parse(base + more), schema));
    CHECK_FALSE(reads(base + more));
  }
}

}  // namespace config_schema_test
