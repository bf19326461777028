// docs/settings.md tells every setting, as it is, and examples that are right where defaults say little.
#include <filesystem>
#include <regex>
#include <sstream>

#include <catch2/catch.hpp>

#include "core/check.h"
#include "core/config_file.h"
#include "optim/loss_term.h"
#include "pipelines/config/run_config.h"
#include "tests/support/temporary_folder.h"

namespace settings_page_test {

using namespace hsi4d;

namespace {

std::vector<LossDescription> all_losses() { return descriptions_of(loss_terms()); }

std::string page() { return test::file_text(std::filesystem::path(HSI4D_SOURCE_DIR) / "docs" / "settings.md"); }

/// The setting whose row says what this one is: clips of a chain have the settings of `data`, programs for masks and
/// motion some of those for the video, and losses the weight of `photometric` where their default is the same.
std::string told_as(const ConfigSetting& setting) {
  static const std::regex of_clip("^/chain/0(/data/.*)"), of_program("^/sources/(masks|motion)(/(timeout_s|retr).*)"),
      of_loss("^/stages/NAME/losses/[a-z0-9_]+/weight$");
  if (setting.initial == "1" && std::regex_match(setting.pointer, of_loss))
    return "/stages/NAME/losses/photometric/weight";
  return std::regex_replace(std::regex_replace(setting.pointer, of_clip, "$1"), of_program, "/sources/video$2");
}

/// Where the row of a setting begins in the page; npos: nowhere. The row stands below its section's heading. Its name
/// leaves out the section and what follows it for a stage (NAME) or a clip (0).
std::size_t place_of_row(const std::string& text, const std::string& setting) {
  static const std::regex parts("^/(?:([^/]*)/)?(?:NAME/|0/)?(.*)$");
  std::smatch found;
  if (!std::regex_match(setting, found, parts)) return std::string::npos;
  const std::string heading = found[1].length() == 0 ? "The config" : "`" + found[1].str() + "`";
  const std::size_t section = text.find("\n## " + heading + "\n");
  if (section == std::string::npos) return section;
  const std::size_t at = text.find("\n| `" + found[2].str() + "` |", section);
  return at < text.find("\n## ", section + 1) ? at : std::string::npos;
}

/// The cells of the table's row of this setting; empty: there is none.
std::vector<std::string> row_of(const std::string& text, const std::string& setting) {
  const std::size_t at = place_of_row(text, setting);
  if (at == std::string::npos) return {};
  const std::size_t end = text.find('\n', at + 1);
  std::string line = text.substr(at + 1, end - at - 1);
  std::vector<std::string> cells;
  std::size_t from = 2;
  for (std::size_t to; (to = line.find(" | ", from)) != std::string::npos; from = to + 3)
    cells.push_back(line.substr(from, to - from));
  cells.push_back(line.substr(from, line.size() - from - 2));
  return cells;
}

/// The example below the table that has this setting; empty: there is none.
std::string example_of(const std::string& text, const std::string& setting) {
  const std::string begin = "\n```json\n";
  const std::size_t at = text.find(begin, place_of_row(text, setting));
  if (at == std::string::npos) return "";
  return text.substr(at + begin.size(), text.find("\n```\n", at + 1) - at - begin.size());
}

/// Whether a config says something at a JSON pointer.
bool has(const ConfigValue& tree, const std::string& pointer) {
  const ConfigValue* at = &tree;
  std::istringstream keys(pointer.substr(1));
  for (std::string key; at != nullptr && std::getline(keys, key, '/');) {
    const bool is_list = at->kind == ConfigValue::Kind::kArray;
    at = is_list ? &at->items.at(std::stoul(key)) : find_member(*at, key);
  }
  return at != nullptr;
}

/// Whether a default does not show what a value looks like.
bool is_silent(const std::string& initial) {
  return initial == "required" || initial == "\"\"" || initial == "[]" || initial == "null";
}

std::string escaped(std::string text) {
  for (std::size_t at = 0; (at = text.find('|', at)) != std::string::npos; at += 2) text.insert(at, "\\");
  return text;
}

}  // namespace

TEST_CASE("the page of settings tells every setting as it is") {
  const std::string text = page();
  for (const ConfigSetting& setting : run_config_settings(all_losses())) {
    INFO(setting.pointer << ": tools/settings_page writes the page again");
    const std::vector<std::string> cells = row_of(text, told_as(setting));
    REQUIRE(cells.size() == 4);
    CHECK(cells[1] == "`" + escaped(setting.initial) + "`");
    CHECK(cells[2] == escaped(setting.allowed));
    CHECK(cells[3] == escaped(setting.summary));
  }
}

TEST_CASE("every setting whose default does not show its values is in an example of the page, and right there") {
  const std::string text = page();
  for (const ConfigSetting& setting : run_config_settings(all_losses())) {
    if (!is_silent(setting.initial)) continue;
    const std::string pointer = told_as(setting);
    const std::string example = example_of(text, pointer);
    INFO(pointer << ": " << example);
    ConfigProblems problems;
    const ConfigValue tree = load_config_text(example, "example.json", "/", {}, problems);
    REQUIRE(problems.empty());
    CHECK(has(tree, pointer));
    std::string faults;
    try {
      read_run_config(tree, all_losses(), problems, ConfigUse::kStages);
    } catch (const UserError& error) {
      faults = error.what();
    }
    INFO(faults);
    // What else the config would need is not there, nor are the files.
    const bool is_path = setting.allowed.find("path") != std::string::npos;
    CHECK((is_path || faults.find(": " + pointer + ": ") == std::string::npos));
  }
}

}  // namespace settings_page_test
