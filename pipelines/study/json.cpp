#include "pipelines/study/json.h"

#include "core/file.h"
#include "core/json_text.h"

namespace hsi4d {

namespace {

constexpr std::int64_t kVersion = 1;
constexpr std::int64_t kLargestFile = 64 << 20;  // bytes: some ten thousand pairs

}  // namespace

ConfigValue study_file(std::string_view format, const std::string& study) {
  ConfigValue root = ConfigValue::make_object();
  root.add("format", ConfigValue::make_string(format));
  root.add("version", ConfigValue::make_integer(kVersion));
  root.add("study", ConfigValue::make_string(study));
  return root;
}

ConfigValue read_study_file(const std::string& file, std::string_view format) {
  ConfigValue root = parse_json_text(read_text_file(file, kLargestFile), file);
  check_kind(root, ConfigValue::Kind::kObject, "");
  const std::string found = needed_text(root, "format", "");
  if (found != format)
    fail_at(*find_member(root, "format"), "/format",
            json_string(found) + " is something else; " + json_string(format) + " is read here");
  const std::int64_t version = whole_number_of(needed(root, "version", ""), "/version");
  if (version != kVersion)
    fail_at(*find_member(root, "version"), "/version",
            std::to_string(version) + " is not a version that is known; " + std::to_string(kVersion) + " is");
  return root;
}

const ConfigValue& needed(const ConfigValue& object, std::string_view name, const std::string& pointer) {
  const ConfigValue* const member = find_member(object, name);
  if (member == nullptr) fail_at(object, pointer, json_string(name) + " is missing");
  return *member;
}

std::string needed_text(const ConfigValue& object, std::string_view name, const std::string& pointer) {
  const ConfigValue& member = needed(object, name, pointer);
  check_kind(member, ConfigValue::Kind::kString, child_pointer(pointer, name));
  return member.text;
}

const ConfigValue& needed_array(const ConfigValue& object, std::string_view name, const std::string& pointer) {
  const ConfigValue& member = needed(object, name, pointer);
  check_kind(member, ConfigValue::Kind::kArray, child_pointer(pointer, name));
  return member;
}

}  // namespace hsi4d
