#include "core/config_place.h"

#include <algorithm>
#include <charconv>
#include <utility>

#include "core/config_parse.h"

namespace hsi4d {
namespace {

using Kind = ConfigValue::Kind;

/// One step down: the place that `part` names in `node`, made if it is a new key of an object.
ConfigValue* step_down(ConfigValue& node, const std::string& part, const std::string& pointer,
                       const ConfigOrigin& origin, ConfigProblems& problems) {
  if (node.kind == Kind::kArray) {
    std::size_t index = 0;
    const auto end = std::from_chars(part.data(), part.data() + part.size(), index);
    if (end.ec == std::errc() && end.ptr == part.data() + part.size() && index < node.items.size())
      return &node.items[index];
    problems.add(origin, pointer,
                 part + " is not an index of this array; allowed: 0 to " +
                     std::to_string(static_cast<std::ptrdiff_t>(node.items.size()) - 1));
    return nullptr;
  }
  if (node.kind != Kind::kObject) {
    problems.add(origin, pointer, shown(node) + " is " + kind_name(node) + " and has no key \"" + part + "\"");
    return nullptr;
  }
  for (ConfigMember& member : node.members) {
    if (member.key == part) return &member.value;
  }
  ConfigValue made = ConfigValue::make_object();
  made.origin = origin;
  ConfigValue& placed = node.add(part, std::move(made));
  node.members.back().key_origin = origin;
  node.members.back().made_by_set = true;
  return &placed;
}

/// The object that holds what the last of the keys names, if everything on the way is there.
ConfigValue* find_holder(ConfigValue& tree, const std::vector<std::string>& keys) {
  ConfigValue* node = &tree;
  for (std::size_t i = 0; i + 1 < keys.size(); ++i) {
    const auto member = std::find_if(node->members.begin(), node->members.end(),
                                     [&](const ConfigMember& other) { return other.key == keys[i]; });
    if (member == node->members.end()) return nullptr;
    node = &member->value;
  }
  return node;
}

/// The objects on the way to `keys` are there by intent, and not by a mistaken key.
void unmark(ConfigValue& tree, const std::vector<std::string>& keys) {
  ConfigValue* node = &tree;
  for (const std::string& key : keys) {
    for (ConfigMember& member : node->members) {
      if (member.key != key) continue;
      member.made_by_set = false;
      node = &member.value;
      break;
    }
  }
}

}  // namespace

std::vector<std::string> config_keys(const std::string& path) {
  const bool is_pointer = path.starts_with('/');
  std::vector<std::string> keys(1);
  for (std::size_t i = is_pointer ? 1 : 0; i < path.size(); ++i) {
    const char c = path[i], next = i + 1 < path.size() ? path[i + 1] : '\0';
    if (is_pointer && c == '~' && (next == '0' || next == '1')) {
      keys.back() += next == '0' ? '~' : '/';
      ++i;
    } else if (c == (is_pointer ? '/' : '.')) {
      keys.emplace_back();
    } else {
      keys.back() += c;
    }
  }
  const bool has_empty = std::any_of(keys.begin(), keys.end(), [](const std::string& key) { return key.empty(); });
  if (has_empty || keys.size() > kDeepestConfig) keys.clear();
  return keys;
}

ConfigValue* config_place(ConfigValue& tree, const std::vector<std::string>& keys, const ConfigOrigin& origin,
                          ConfigProblems& problems) {
  ConfigValue* node = &tree;
  std::string pointer;
  for (const std::string& key : keys) {
    node = step_down(*node, key, pointer, origin, problems);
    if (node == nullptr) return nullptr;
    pointer = child_pointer(pointer, key);
  }
  return node;
}

bool take_out_object(ConfigValue& tree, const std::vector<std::string>& keys) {
  ConfigValue* const holder = find_holder(tree, keys);
  if (holder == nullptr) return false;
  return std::erase_if(holder->members, [&](const ConfigMember& member) {
           return member.key == keys.back() && member.value.kind == Kind::kObject;
         }) > 0;
}

void lay_into_config(ConfigValue& tree, const std::string& key, const ConfigValue& value, const ConfigOrigin& origin,
                     ConfigProblems& problems) {
  const std::vector<std::string> keys = config_keys(key);
  if (keys.empty()) {
    problems.add(origin, "", json_string(key) + " is no key; write stages.camera.iterations, with dots between keys");
    return;
  }
  if (value.kind == Kind::kNull && take_out_object(tree, keys)) return;
  ConfigValue* const place = config_place(tree, keys, origin, problems);
  if (place == nullptr) return;
  *place = merged(std::move(*place), value);
  if (value.kind == Kind::kObject) unmark(tree, keys);
}

}  // namespace hsi4d
