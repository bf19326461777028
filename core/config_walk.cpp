// The four uses of a description: reading, writing, the JSON Schema, the list of settings.
#include <algorithm>

#include "core/check.h"
#include "core/config.h"
#include "core/suggest.h"
#include "core/text.h"

namespace hsi4d {
namespace {

using Kind = ConfigValue::Kind;
using FieldKind = ConfigField::Kind;

constexpr std::size_t kMostSuggested = 50;    // problems after which nobody reads suggestions any more
constexpr std::size_t kMostListed = 24;       // keys that a message lists
constexpr std::size_t kMostSectionsTold = 6;  // that have a key which is unknown where it stands

bool is_free_key(const std::string& key) {
  return !key.empty() && std::all_of(key.begin(), key.end(), [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' || c == '-';
  });
}

std::string listed(const std::vector<std::string>& names) {
  if (names.empty()) return "; there are none here";
  std::string text = "; known here: ";
  for (std::size_t i = 0; i < std::min(names.size(), kMostListed); ++i) text += (i > 0 ? ", " : "") + names[i];
  return names.size() > kMostListed ? text + ", ..." : text;
}

class Reader {
 public:
  Reader(const ConfigFields& root, ConfigProblems& problems) : root_(root), problems_(problems) {}

  void read_object(const ConfigValue& value, const ConfigFields& fields, const std::string& pointer) {
    if (!expect_object(value, pointer)) return;
    std::vector<std::string> wrong;  // fields with problems
    for (const ConfigMember& member : value.members) {
      if (!fields.find(member.key)) report_unknown(member, fields.names(), pointer);
    }
    for (const ConfigField& field : fields.fields()) {
      if (field.kind == FieldKind::kStep) field.step();
      if (field.kind == FieldKind::kStep || field.kind == FieldKind::kRule) continue;
      const std::size_t before = problems_.size();
      read_field(value, field, pointer);
      if (problems_.size() != before) wrong.push_back(field.name);
    }
    check_rules(value, fields, wrong, pointer);
  }

 private:
  bool expect_object(const ConfigValue& value, const std::string& pointer) {
    if (value.kind == Kind::kObject) return true;
    problems_.add(value.origin, pointer,
                  value.kind == Kind::kNull
                      ? "null is not an object, and takes none out: the file that is extended has none here; write "
                        "{...}, or leave the key out"
                      : shown(value) + " is " + kind_name(value) + ", not an object");
    return false;
  }

  void read_field(const ConfigValue& object, const ConfigField& field, const std::string& pointer) {
    const ConfigValue* value = find_member(object, field.name);
    if (!value) {
      if (field.is_required)
        problems_.add(
            object.origin, pointer,
            "the key \"" + field.name + "\" is missing" + (field.allowed.empty() ? "" : "; allowed: " + field.allowed));
      return;
    }
    const std::string here = child_pointer(pointer, field.name);
    switch (field.kind) {
      case FieldKind::kValue:
        field.read(*value, here, problems_);
        break;
      case FieldKind::kObject:
        read_object(*value, *field.children, here);
        break;
      case FieldKind::kMap:
        read_map(*value, field, here);
        break;
      case FieldKind::kList:
        read_list(*value, field, here);
        break;
      case FieldKind::kStep:
      case FieldKind::kRule:
        break;
    }
  }

  void read_map(const ConfigValue& value, const ConfigField& field, const std::string& pointer) {
    if (!expect_object(value, pointer)) return;
    const std::vector<std::string> known = field.has_known_keys ? field.children->names() : std::vector<std::string>();
    for (const ConfigMember& member : value.members) {
      if (field.has_known_keys && !field.children->find(member.key)) {
        report_unknown(member, known, pointer);
      } else if (!field.has_known_keys && !is_free_key(member.key)) {
        problems_.add(member.key_origin, child_pointer(pointer, member.key),
                      json_string(member.key) + " cannot be a name; allowed: letters, digits, '_' and '-'");
      } else if (member.made_by_set) {
        report_new_entry(member, value, pointer);
      } else {
        read_object(member.value, field.entry(member.key), child_pointer(pointer, member.key));
      }
    }
  }

  void read_list(const ConfigValue& value, const ConfigField& field, const std::string& pointer) {
    if (value.kind != Kind::kArray) {
      problems_.add(value.origin, pointer, shown(value) + " is " + kind_name(value) + ", not an array of objects");
      return;
    }
    field.clear();
    for (std::size_t i = 0; i < value.items.size(); ++i)
      read_object(value.items[i], field.entry(""), child_pointer(pointer, std::to_string(i)));
  }

  void report_unknown(const ConfigMember& member, const std::vector<std::string>& known, const std::string& pointer) {
    std::string hint;
    if (problems_.size() < kMostSuggested) {
      const std::string near = nearest_name(member.key, known);
      const bool is_slip = !near.empty() && edit_distance(member.key, near) <= 1;
      if (!is_slip) hint = elsewhere(member.key);
      if (hint.empty()) hint = did_you_mean(member.key, known);
      if (hint.empty()) hint = listed(known);
    }
    problems_.add(member.key_origin, child_pointer(pointer, member.key), "unknown key" + hint);
  }

  /// The hint that a key exists in other sections.
  std::string elsewhere(const std::string& key) {
    if (settings_.empty()) settings_ = list_settings(root_);
    std::vector<std::string> sections;
    for (const ConfigSetting& setting : settings_) {
      const std::size_t slash = setting.pointer.rfind('/');
      if (setting.pointer.substr(slash + 1) != key) continue;
      if (slash == 0) return "; it belongs at the top level";
      sections.push_back(setting.pointer.substr(0, slash));
    }
    if (sections.empty()) return {};
    const std::size_t told = std::min<std::size_t>(sections.size(), kMostSectionsTold);
    const bool are_all = told == sections.size();
    return "; it belongs in " + joined(std::span(sections).first(told), are_all ? " or " : ", ") +
           (are_all ? "" : " or others");
  }

  void report_new_entry(const ConfigMember& member, const ConfigValue& map, const std::string& pointer) {
    std::vector<std::string> present;
    for (const ConfigMember& other : map.members) {
      if (!other.made_by_set) present.push_back(other.key);
    }
    const std::string hint = did_you_mean(member.key, present);
    problems_.add(member.key_origin, child_pointer(pointer, member.key),
                  std::string(member.key_origin.source && member.key_origin.source->is_command_line
                                  ? "no such entry in the config, and --set adds none; a config that extends it can"
                                  : "no such entry in the config; an object in its place, {...}, adds one") +
                      (hint.empty() ? listed(present) : hint));
  }

  void check_rules(const ConfigValue& value, const ConfigFields& fields, const std::vector<std::string>& wrong,
                   const std::string& pointer) {
    for (const ConfigField& field : fields.fields()) {
      if (field.kind != FieldKind::kRule) continue;
      const auto& about = field.rule_fields;
      if (std::find_first_of(about.begin(), about.end(), wrong.begin(), wrong.end()) != about.end()) continue;
      const std::string message = field.rule();
      if (message.empty()) continue;
      const ConfigValue* at = find_member(value, field.name);
      problems_.add(at ? at->origin : value.origin, child_pointer(pointer, field.name), message);
    }
  }

  const ConfigFields& root_;
  ConfigProblems& problems_;
  std::vector<ConfigSetting> settings_;
};

ConfigValue write_field(const ConfigField& field) {
  switch (field.kind) {
    case FieldKind::kValue:
      return field.write();
    case FieldKind::kObject:
      return write_config(*field.children);
    case FieldKind::kMap: {
      ConfigValue object = ConfigValue::make_object();
      for (const auto& [name, fields] : field.entries()) object.add(name, write_config(fields));
      return object;
    }
    case FieldKind::kList: {
      ConfigValue array = ConfigValue::make_array();
      for (const auto& [name, fields] : field.entries()) array.items.push_back(write_config(fields));
      return array;
    }
    case FieldKind::kStep:
    case FieldKind::kRule:
      break;
  }
  throw InternalError("a step or rule of a config description cannot be written");
}

/// Of an object's schema: null takes one out that a config inherits.
void allow_null(ConfigValue& schema) {
  for (ConfigMember& member : schema.members) {
    if (member.key == "type")
      member.value = ConfigValue::make_array({ConfigValue::make_string("object"), ConfigValue::make_string("null")});
  }
}

ConfigValue object_schema(const ConfigFields& fields);

ConfigValue field_schema(const ConfigField& field) {
  ConfigValue schema = ConfigValue::make_object();
  std::string description = field.summary;
  if (field.is_required) description += " (required, here or in the config that this one extends)";
  if (!description.empty()) schema.add("description", ConfigValue::make_string(description));
  ConfigValue content = field.schema;
  if (field.kind == FieldKind::kObject || (field.kind == FieldKind::kMap && field.has_known_keys)) {
    content = object_schema(*field.children);
  } else if (field.kind == FieldKind::kMap) {
    content = ConfigValue::make_object();
    content.add("type", ConfigValue::make_string("object"));
    content.add("propertyNames", ConfigValue::make_object())
        .add("pattern", ConfigValue::make_string("^[A-Za-z0-9_-]+$"));
    allow_null(content.add("additionalProperties", object_schema(*field.children)));
  } else if (field.kind == FieldKind::kList) {
    content = ConfigValue::make_object();
    content.add("type", ConfigValue::make_string("array"));
    content.add("items", object_schema(*field.children));
  }
  for (ConfigMember& member : content.members) schema.add(member.key, std::move(member.value));
  if (field.kind == FieldKind::kObject || field.kind == FieldKind::kMap) allow_null(schema);
  if (field.kind == FieldKind::kValue && !field.is_required) schema.add("default", field.write());
  return schema;
}

ConfigValue object_schema(const ConfigFields& fields) {
  ConfigValue schema = ConfigValue::make_object();
  schema.add("type", ConfigValue::make_string("object"));
  ConfigValue properties = ConfigValue::make_object();
  for (const ConfigField& field : fields.fields()) {
    if (field.kind != FieldKind::kStep && field.kind != FieldKind::kRule)
      properties.add(field.name, field_schema(field));
  }
  schema.add("properties", std::move(properties));
  schema.add("additionalProperties", ConfigValue::make_boolean(false));
  return schema;
}

ConfigValue described_string(const char* description) {
  ConfigValue schema = ConfigValue::make_object();
  schema.add("description", ConfigValue::make_string(description));
  schema.add("type", ConfigValue::make_string("string"));
  return schema;
}

}  // namespace

void read_config(const ConfigValue& value, const ConfigFields& fields, ConfigProblems& problems,
                 const std::string& pointer) {
  Reader(fields, problems).read_object(value, fields, pointer);
}

ConfigValue write_config(const ConfigFields& fields) {
  ConfigValue object = ConfigValue::make_object();
  for (const ConfigField& field : fields.fields()) {
    if (field.kind != FieldKind::kStep && field.kind != FieldKind::kRule) object.add(field.name, write_field(field));
  }
  return object;
}

std::vector<ConfigPath> list_paths(const ConfigFields& fields, const std::string& pointer) {
  std::vector<ConfigPath> all;
  const auto add_inner = [&all](const ConfigFields& inner, const std::string& here) {
    for (ConfigPath& path : list_paths(inner, here)) all.push_back(std::move(path));
  };
  for (const ConfigField& field : fields.fields()) {
    const std::string here = child_pointer(pointer, field.name);
    if (field.kind == FieldKind::kObject) add_inner(*field.children, here);
    if (field.kind == FieldKind::kMap || field.kind == FieldKind::kList) {
      std::size_t index = 0;
      for (const auto& [name, inner] : field.entries()) {
        add_inner(inner, child_pointer(here, field.kind == FieldKind::kMap ? name : std::to_string(index)));
        ++index;
      }
    }
    if (!field.is_path) continue;
    std::string path = field.write().text;
    if (!path.empty()) all.push_back({here, std::move(path)});
  }
  return all;
}

ConfigValue config_schema(const ConfigFields& fields, std::string_view title) {
  ConfigValue schema = ConfigValue::make_object();
  schema.add("$schema", ConfigValue::make_string("https://json-schema.org/draft/2020-12/schema"));
  schema.add("title", ConfigValue::make_string(title));
  ConfigValue content = object_schema(fields);
  ConfigValue properties = ConfigValue::make_object();
  properties.add("$schema", described_string("The schema that an editor checks this file with; otherwise ignored"));
  properties.add("extends", described_string("A config, relative to this file, that this one is laid over"));
  for (ConfigMember& member : content.members) {
    if (member.key == "properties") {
      for (ConfigMember& property : member.value.members) properties.add(property.key, std::move(property.value));
      schema.add("properties", std::move(properties));
    } else {
      schema.add(member.key, std::move(member.value));
    }
  }
  return schema;
}

std::vector<ConfigSetting> list_settings(const ConfigFields& fields, const std::string& pointer) {
  std::vector<ConfigSetting> all;
  for (const ConfigField& field : fields.fields()) {
    if (field.kind == FieldKind::kStep || field.kind == FieldKind::kRule) continue;
    std::string here = child_pointer(pointer, field.name);
    if (field.kind == FieldKind::kValue) {
      all.push_back({here, field.allowed, field.is_required ? "required" : shown(field.write()), field.summary});
      continue;
    }
    if (field.kind == FieldKind::kMap && !field.has_known_keys) here += "/NAME";
    if (field.kind == FieldKind::kList) here += "/0";
    for (ConfigSetting& inner : list_settings(*field.children, here)) all.push_back(std::move(inner));
  }
  return all;
}

}  // namespace hsi4d
