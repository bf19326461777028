#include "core/config_file.h"

#include <algorithm>
#include <iterator>
#include <optional>

#include "core/check.h"
#include "core/config_parse.h"
#include "core/config_place.h"
#include "core/file.h"
#include "core/file_kind.h"
#include "core/suggest.h"

namespace hsi4d {
namespace {

namespace fs = std::filesystem;
using Kind = ConfigValue::Kind;
using SourcePtr = std::shared_ptr<const ConfigSource>;

constexpr int kFirstOverride = 1 << 20;  // overrides are told after every file

SourcePtr make_source(std::string name, fs::path folder, int order, bool is_command_line) {
  auto source = std::make_shared<ConfigSource>();
  *source = {std::move(name), std::move(folder), order, is_command_line};
  return source;
}

/// "; did you mean "other.json"?" from the files beside a missing one.
std::string suggest_file(const fs::path& missing) {
  std::vector<std::string> names;
  std::error_code error;
  const fs::path folder = missing.has_parent_path() ? missing.parent_path() : fs::path(".");
  for (fs::directory_iterator it(folder, error), end; !error && it != end; it.increment(error))
    names.push_back(it->path().filename().string());
  std::sort(names.begin(), names.end());
  const std::string name = nearest_name(missing.filename().string(), names);
  return name.empty() ? "" : "; did you mean \"" + (missing.parent_path() / name).generic_string() + "\"?";
}

/// The bytes of a file, or why there are none.
struct FileText {
  std::string text, problem;
};

FileText read_file(const fs::path& file) {
  std::error_code error;
  const fs::file_status status = fs::status(file, error);
  if (!fs::exists(status)) return {"", "there is no such file" + suggest_file(file)};
  if (fs::is_directory(status)) return {"", "this is a folder, not a config file"};
  std::string text;
  try {
    text = read_text_file(file.string(), kLargestConfig);
  } catch (const UserError& problem) {
    return {"", std::string(problem.what()).substr(file.string().size() + 2)};  // without the path, which callers tell
  }
  const std::string kind = file_kind(std::span(reinterpret_cast<const std::uint8_t*>(text.data()), text.size()));
  if (!kind.empty() && kind != "JSON" && kind != "text") return {"", "looks like " + kind + ", not like JSON"};
  return {std::move(text), ""};
}

/// Removes a member of the top level and hands it out.
std::optional<ConfigMember> take_member(ConfigValue& tree, const std::string& key) {
  for (std::size_t i = 0; i < tree.members.size(); ++i) {
    if (tree.members[i].key != key) continue;
    ConfigMember taken = std::move(tree.members[i]);
    tree.members.erase(tree.members.begin() + static_cast<std::ptrdiff_t>(i));
    return taken;
  }
  return std::nullopt;
}

/// Reads a chain of files.
class Loader {
 public:
  Loader(ConfigProblems& problems, const std::map<std::string, std::string>& beside)
      : problems_(problems), beside_(beside) {}

  ConfigValue load(const std::string& text, const SourcePtr& source) {
    ConfigValue tree;
    if (!parse_config_text(text, source, problems_, tree)) {
      broken_ = true;
      return ConfigValue::make_object();
    }
    if (tree.kind != Kind::kObject) {
      problems_.add(tree.origin, "", shown(tree) + " is " + kind_name(tree) + "; a config is an object: {...}");
      broken_ = true;
      return ConfigValue::make_object();
    }
    const auto schema = take_member(tree, "$schema");
    if (schema && schema->value.kind != Kind::kString)
      problems_.add(
          schema->value.origin, "/$schema",
          shown(schema->value) + " is " + kind_name(schema->value) + ", not a string: the file or address of a schema");
    const auto extends = take_member(tree, "extends");
    return extends ? merged(load_base(extends->value, *source), std::move(tree)) : tree;
  }

  /// The files that are being read, outermost first, to find cycles.
  void enter(const fs::path& file) { chain_.push_back(file); }
  bool broken() const { return broken_; }

 private:
  ConfigValue load_base(const ConfigValue& extends, const ConfigSource& source) {
    ConfigValue nothing = ConfigValue::make_object();
    if (extends.kind != Kind::kString || extends.text.empty()) {
      fail(extends, shown(extends) +
                        (extends.kind == Kind::kString ? " is empty" : " is " + kind_name(extends) + ", not a string") +
                        "; write the path of a config, relative to this file");
      return nothing;
    }
    const fs::path file = (source.folder / extends.text).lexically_normal();
    if (extends.text.find('\0') != std::string::npos) {
      fail(extends, shown(extends) + " is not a path");
      return nothing;
    }
    for (const fs::path& open : chain_) {
      std::error_code error;
      if (!fs::equivalent(open, file, error)) continue;
      std::string names;
      for (const fs::path& link : chain_) names += link.generic_string() + " -> ";
      fail(extends, "the files extend each other in a circle: " + names + file.generic_string());
      return nothing;
    }
    if (const auto text = beside_.find(extends.text); text != beside_.end()) {
      if (std::find(chain_.begin(), chain_.end(), fs::path(text->first)) != chain_.end()) {
        fail(extends, shown(extends) + " extends itself");
        return nothing;
      }
      chain_.emplace_back(text->first);
      const int order = static_cast<int>(chain_.size());
      return load(text->second, make_source(text->first, source.folder, order, false));
    }
    FileText content = read_file(file);
    if (!content.problem.empty()) {
      fail(extends, shown(extends) + ": " + content.problem + " (looked for " + file.generic_string() + ")");
      return nothing;
    }
    chain_.push_back(file);
    const int order = static_cast<int>(chain_.size());
    return load(content.text, make_source(file.generic_string(), file.parent_path(), order, false));
  }

  // A base that is missing makes every later complaint about missing keys noise.
  void fail(const ConfigValue& extends, const std::string& message) {
    problems_.add(extends.origin, "/extends", message);
    broken_ = true;
  }

  ConfigProblems& problems_;
  const std::map<std::string, std::string>& beside_;
  std::vector<fs::path> chain_;
  bool broken_ = false;
};

/// The value of an override: JSON, or else the text itself.
std::optional<ConfigValue> override_value(const std::string& text, const SourcePtr& source) {
  ConfigValue value;
  if (parse_json_value(text, source, value)) return value;
  if (!parse_json_value(json_string(text), source, value)) return std::nullopt;  // not UTF-8
  return value;
}

void forget_lines(ConfigValue& value) {
  value.origin.line = 0;
  for (ConfigValue& item : value.items) forget_lines(item);
  for (ConfigMember& member : value.members) {
    member.key_origin.line = 0;
    forget_lines(member.value);
  }
}

void apply_override(ConfigValue& tree, const std::string& text, int order, ConfigProblems& problems) {
  const SourcePtr source = make_source("--set " + text, fs::path(), order, true);
  const ConfigOrigin origin{source, 0, 0, 0};
  const std::size_t equals = text.find('=');
  const std::vector<std::string> keys = config_keys(text.substr(0, equals));
  if (equals == std::string::npos || keys.empty()) {
    problems.add(origin, "",
                 "write --set KEY=VALUE with dots between nested keys, for example --set render.blur=0.1 or --set "
                 "/render/blur=0.1");
    return;
  }
  std::optional<ConfigValue> value = override_value(text.substr(equals + 1), source);
  if (!value) {
    problems.add(origin, "", "the value is not UTF-8");
    return;
  }
  forget_lines(*value);
  if (value->kind == Kind::kNull && take_out_object(tree, keys)) return;
  ConfigValue* const place = config_place(tree, keys, origin, problems);
  if (place == nullptr) return;
  *place = std::move(*value);
  place->origin = origin;
}

ConfigValue with_overrides(ConfigValue tree, const std::vector<std::string>& overrides, ConfigProblems& problems) {
  int order = kFirstOverride;
  for (const std::string& text : overrides) apply_override(tree, text, order++, problems);
  return tree;
}

}  // namespace

ConfigValue load_config(const fs::path& file, const std::vector<std::string>& overrides, ConfigProblems& problems) {
  FileText content = read_file(file);
  if (!content.problem.empty()) throw UserError(file.generic_string() + ": " + content.problem);
  const std::map<std::string, std::string> no_texts;
  Loader loader(problems, no_texts);
  loader.enter(file);
  ConfigValue tree = loader.load(content.text, make_source(file.generic_string(), file.parent_path(), 0, false));
  if (loader.broken()) problems.throw_if_any();
  return with_overrides(std::move(tree), overrides, problems);
}

ConfigValue config_from_overrides(const std::vector<std::string>& overrides, ConfigProblems& problems) {
  return with_overrides(ConfigValue::make_object(), overrides, problems);
}

ConfigValue load_config_text(const std::string& text, const std::string& name, const fs::path& folder,
                             const std::vector<std::string>& overrides, ConfigProblems& problems,
                             const std::map<std::string, std::string>& beside) {
  Loader loader(problems, beside);
  ConfigValue tree = loader.load(text, make_source(name, folder, 0, false));
  if (loader.broken()) problems.throw_if_any();
  return with_overrides(std::move(tree), overrides, problems);
}

}  // namespace hsi4d
