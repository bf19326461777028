// The JSON Schema of sweeps' files. What a block has is described here, what is a plain setting by `describe`.
#include <algorithm>

#include "core/config.h"
#include "core/json_text.h"
#include "pipelines/sweep/file.h"

namespace hsi4d {
namespace {

/// Members of the file and of blocks alike.
constexpr const char* kBlockProperties = R"({
  "name": {"description": "Of the sweep or the block: letters, digits, '_' and '-'", "type": "string",
           "pattern": "^[A-Za-z0-9_-]+$"},
  "base": {"description": "The config that all runs begin with, relative to this file", "type": "string"},
  "set": {"description": "Settings of all runs, {KEY: value}: stages.camera.iterations", "type": "object"},
  "clips": {"description": "What is reconstructed: configs, or {NAME: config}, or {NAME: {config, set}}", "anyOf": [
    {"type": "array", "items": {"type": "string"}},
    {"type": "object", "propertyNames": {"pattern": "^[A-Za-z0-9_-]+$"}, "additionalProperties": {"anyOf": [
      {"type": "string"},
      {"type": "object", "properties": {"config": {"type": "string"}, "set": {"type": "object"}},
       "required": ["config"], "additionalProperties": false}]}}]},
  "seeds": {"description": "A number of seeds, a list of them, or {NAME: {KEY: value}}", "anyOf": [
    {"type": "integer", "minimum": 1, "maximum": 100000},
    {"type": "array", "items": {"type": "integer", "minimum": 0}, "minItems": 1},
    {"type": "object", "propertyNames": {"pattern": "^[A-Za-z0-9_-]+$"}, "additionalProperties": {"type": "object"}}]},
  "ablations": {"description": "{NAME: {KEY: value}}; null in place of a stage, loss or group takes it out",
    "type": "object", "propertyNames": {"pattern": "^[A-Za-z0-9_-]+$"}, "additionalProperties": {"type": "object"}},
  "grid": {"description": "{KEY: [values]}: every combination", "type": "object",
    "additionalProperties": {"type": "array", "minItems": 1}},
  "zip": {"description": "{KEY: [values]}: lists of one length, of which the first values go together; or a list of such",
    "anyOf": [
    {"type": "object", "additionalProperties": {"type": "array", "minItems": 1}},
    {"type": "array", "items": {"type": "object", "additionalProperties": {"type": "array", "minItems": 1}}}]},
  "search": {"description": "Points of a space: settings that are tried until the runs are used up", "anyOf": [
    {"type": "object", "additionalProperties": false},
    {"type": "object", "properties": {
    "metric": {"description": "What is searched for, by its name in summary.json: the best of it", "type": "string"},
    "method": {"description": "How points are chosen: evenly, or independently of each other",
               "enum": ["sobol", "random"], "default": "sobol"},
    "seed": {"description": "Of the points", "type": "integer", "minimum": 0, "default": 0},
    "runs": {"description": "The most runs, of all points, clips and seeds together", "type": "integer",
             "minimum": 1, "maximum": 100000},
    "over": {"description": "{KEY: [choices]} or {KEY: {from, to, scale, integer}}", "type": "object",
      "additionalProperties": {"anyOf": [
      {"type": "array", "minItems": 2},
      {"type": "object", "properties": {
        "from": {"description": "The least value", "type": "number", "minimum": -1e15, "maximum": 1e15},
        "to": {"description": "The largest value", "type": "number", "minimum": -1e15, "maximum": 1e15},
        "scale": {"description": "Of equal differences as many values, or of equal ratios", "enum": ["linear", "log"],
                  "default": "linear"},
        "integer": {"description": "Whole numbers alone, both ends among them", "type": "boolean", "default": false}},
       "required": ["from", "to"], "additionalProperties": false}]}},
    "halving": {"description": "Rungs of successive halving, the cheapest first", "type": "object", "properties": {
      "rungs": {"description": "{KEY: [values]}, a value a rung", "type": "object",
                "additionalProperties": {"type": "array", "minItems": 2}},
      "factor": {"description": "Of so many points of a rung the best goes on", "type": "integer", "minimum": 2,
                 "maximum": 1000, "default": 2}},
      "required": ["rungs"], "additionalProperties": false}},
    "required": ["metric", "runs", "over"], "additionalProperties": false}]},
  "skip": {"description": "[{KEY: value}]: combinations that are left out", "type": "array",
    "items": {"type": "object"}, "minItems": 1},
  "only": {"description": "[{KEY: value}]: the only combinations that stay", "type": "array",
    "items": {"type": "object"}, "minItems": 1}
})";

ConfigValue text_value(const char* text) { return ConfigValue::make_string(text); }

ConfigValue blocks_schema(const ConfigValue& properties) {
  ConfigValue block = ConfigValue::make_object();
  block.add("type", text_value("object"));
  block.add("properties", properties);
  block.add("additionalProperties", ConfigValue::make_boolean(false));
  ConfigValue blocks = ConfigValue::make_object();
  blocks.add("description", text_value("Parts of the sweep; what they do not have they take from the file"));
  blocks.add("type", text_value("array"));
  blocks.add("items", std::move(block));
  blocks.add("minItems", ConfigValue::make_integer(1));
  return blocks;
}

ConfigValue compare_schema() {
  ConfigValue compare = ConfigValue::make_object();
  compare.add("description", text_value("What the others are compared with, {\"ablation\": NAME} or {KEY: value}"));
  compare.add("type", text_value("object"));
  return compare;
}

}  // namespace

std::string sweep_schema() {
  SweepFile sweep;
  ConfigFields fields;
  describe(fields, sweep);
  ConfigValue schema = config_schema(fields, "hsi4d sweep");
  const ConfigValue block = parse_json_text(kBlockProperties, "the schema of sweeps");
  const auto properties = std::find_if(schema.members.begin(), schema.members.end(),
                                       [](const ConfigMember& member) { return member.key == "properties"; });
  for (const ConfigMember& member : block.members) properties->value.add(member.key, member.value);
  properties->value.add("blocks", blocks_schema(block));
  properties->value.add("compare", compare_schema());
  return to_json(schema);
}

}  // namespace hsi4d
