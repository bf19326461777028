#include "pipelines/evaluate/prompt.h"

#include "core/file.h"
#include "core/json_text.h"
#include "pipelines/evaluate/tracks.h"
#include "pipelines/record/folder.h"

namespace hsi4d {

namespace {

std::string prompt_in(const ConfigValue& tree, const char* section) {
  const ConfigValue* const found = find_member(tree, section);
  return found == nullptr ? "" : string_member(*found, "prompt");
}

/// Those of a chain's clips, one after the other; one that says nothing has that of `sources`.
std::string prompt_of_clips(const ConfigValue& tree) {
  const ConfigValue* const clips = find_member(tree, "chain");
  std::string text, before;
  for (std::size_t i = 0; clips != nullptr && i < clips->items.size(); ++i) {
    std::string prompt = string_member(clips->items[i], "prompt");
    if (prompt.empty()) prompt = prompt_in(tree, "sources");
    if (!prompt.empty() && prompt != before) text += (text.empty() ? "" : " ") + prompt;
    before = prompt;
  }
  return text;
}

}  // namespace

std::string run_prompt(const std::filesystem::path& run) {
  const std::string file = RunPaths{run}.config();
  if (!is_run_folder(run.string()) || !std::filesystem::exists(file)) return "";
  const ConfigValue tree = parse_json_text(read_text_file(file), file);
  const std::string of_clips = prompt_of_clips(tree);
  if (!of_clips.empty()) return of_clips;
  for (const char* const name : {"sources", "instance"}) {
    const std::string prompt = prompt_in(tree, name);
    if (!prompt.empty()) return prompt;
  }
  return "";
}

}  // namespace hsi4d
