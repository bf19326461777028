#include "pipelines/study/key.h"

#include <algorithm>
#include <set>

#include "core/config_value.h"
#include "core/file.h"
#include "core/json_text.h"
#include "optim/checkpoint.h"
#include "pipelines/study/json.h"

namespace hsi4d {

namespace {

constexpr const char* kFormat = "hsi4d study key";

ConfigValue tree_of(const StudyKey& key) {
  ConfigValue root = study_file(kFormat, key.study), pairs = ConfigValue::make_array();
  root.add("a", ConfigValue::make_string(key.a));
  root.add("b", ConfigValue::make_string(key.b));
  if (!key.salt.empty()) root.add("salt", ConfigValue::make_string(key.salt));
  root.add("pairs_per_person", ConfigValue::make_integer(key.pairs_per_person));
  for (const StudyPair& pair : key.pairs) {
    ConfigValue entry = ConfigValue::make_object();
    entry.add("id", ConfigValue::make_string(pair.id));
    entry.add("name", ConfigValue::make_string(pair.name));
    entry.add("text", ConfigValue::make_string(pair.text));
    entry.add("a", ConfigValue::make_string(pair.a));
    entry.add("b", ConfigValue::make_string(pair.b));
    pairs.items.push_back(std::move(entry));
  }
  root.add("pairs", std::move(pairs));
  return root;
}

}  // namespace

Index StudyKey::shown_pairs() const { return std::min(pairs_per_person, std::ssize(pairs)); }

std::string study_id(const StudyKey& key) {
  StudyKey content = key;
  content.study = "";
  return text_hash(to_json(tree_of(content)));
}

std::string study_key_json(const StudyKey& key) { return to_json(tree_of(key)); }

StudyKey read_study_key(const std::string& file) {
  const ConfigValue root = read_study_file(file, kFormat);
  StudyKey key;
  key.study = needed_text(root, "study", "");
  key.a = needed_text(root, "a", "");
  key.b = needed_text(root, "b", "");
  key.salt = string_member(root, "salt");
  key.pairs_per_person = whole_number_of(needed(root, "pairs_per_person", ""), "/pairs_per_person");
  const ConfigValue& pairs = needed_array(root, "pairs", "");
  std::set<std::string> seen;  // ids and videos
  for (std::size_t i = 0; i < pairs.items.size(); ++i) {
    const ConfigValue& entry = pairs.items[i];
    const std::string pointer = child_pointer("/pairs", std::to_string(i));
    check_kind(entry, ConfigValue::Kind::kObject, pointer);
    const auto text = [&](const char* name) { return needed_text(entry, name, pointer); };
    const StudyPair pair{text("id"), text("name"), text("text"), text("a"), text("b")};
    for (const char* const name : {"id", "a", "b"}) {
      const ConfigValue& value = *find_member(entry, name);
      if (!seen.insert(value.text).second)
        fail_at(value, child_pointer(pointer, name), json_string(value.text) + " is there twice");
    }
    key.pairs.push_back(pair);
  }
  const ConfigValue& id = *find_member(root, "study");
  if (study_id(key) != key.study)
    fail_at(id, "/study",
            json_string(key.study) + " is not that of this content, " + study_id(key) + ": the key has been changed");
  return key;
}

}  // namespace hsi4d
